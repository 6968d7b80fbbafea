import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, bj, oe


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the parameters are poorly determined", "ignore:F has a root")
@pytest.mark.parametrize("order", [9, 12])
def test_clustered_real_poles(p2, order):
    """Nine poles in three clusters, as a servo with hydraulics has them: the response is right all the same."""
    poles = np.exp(-0.02 * np.array([6.5, 7.0, 7.6, 28.0, 30.0, 33.0, 150.0, 160.0, 170.0]))
    a = np.poly(poles)
    b = np.concatenate(([0.0], np.linspace(1.0, 0.2, 9)))
    b *= a.sum() / b.sum()
    data = IOData(p2.reference, lfilter(b, a, p2.reference[:, 0]), 0.02)[300:]
    f = np.linspace(0.0, 10.0, 50)
    z = np.exp(-2j * np.pi * f * 0.02)
    expected = np.polyval(b[::-1], z) / np.polyval(a[::-1], z)
    response = oe(data, order, order, 1).model.frequency_response(f)[:, 0, 0]
    assert np.max(np.abs(response / expected - 1.0)) < 1e-3


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("poles", [[0.999, 0.9995, 0.9999], [0.999, 0.9995, 0.9999, 0.5]])
def test_slow_poles_are_fitted_to_the_noise(poles):
    """The criterion is a narrow valley at the edge of stability, where a search ends thousands of times higher."""
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 50)
    y = lfilter([0.0, *rng.standard_normal(len(poles))], np.poly(poles), u)
    noise = 1e-3 * y.std() * rng.standard_normal(5000)
    estimate = oe(IOData(u, y + noise, 1.0), len(poles), len(poles), 1)
    assert estimate.diagnostics["converged"]
    assert estimate.diagnostics["sum_of_squares"] < noise @ noise


@pytest.mark.filterwarnings("ignore:oe did not converge")
def test_pole_at_the_edge_is_reported():
    u = np.random.default_rng(1).standard_normal(800)
    y = np.cumsum(u)
    with pytest.warns(SysidWarning, match="edge of stability"):
        oe(IOData(u, y + 0.01 * np.random.default_rng(2).standard_normal(800), 0.1), 1, 1, 0)


@pytest.mark.filterwarnings("ignore:bj did not converge", "ignore:D has a root")
def test_a_drifting_disturbance_leaves_the_model_stable():
    rng = np.random.default_rng(3)
    u, e = rng.standard_normal((2, 800))
    estimate = bj(IOData(u, lfilter([0, 1.0], [1, -0.7], u) + np.cumsum(e), 0.1), 1, 1, 1, 1)
    assert estimate.model.is_stable()
    np.testing.assert_allclose(estimate.polynomials.D, [1, -1], atol=0.02)
