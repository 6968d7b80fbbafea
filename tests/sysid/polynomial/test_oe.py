"""Output error: exact recovery, efficiency, coverage, initial conditions."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, oe

GRID = np.linspace(0.1, 24.0, 40)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the parameters are poorly determined", "ignore:F has a root")
@pytest.mark.parametrize("order", [9, 12])
def test_clustered_real_poles(p2: Any, order: int) -> None:
    """Nine poles in three clusters, as a servo with hydraulics has them: the response is right all the same."""
    poles = np.exp(-0.02 * np.array([6.5, 7.0, 7.6, 28.0, 30.0, 33.0, 150.0, 160.0, 170.0]))
    a = np.poly(poles)
    b = np.concatenate(([0.0], np.linspace(1.0, 0.2, 9)))
    b *= a.sum() / b.sum()
    data = IOData(p2.input, lfilter(b, a, p2.input), 0.02)[300:]
    f = np.linspace(0.0, 10.0, 50)
    z = np.exp(-2j * np.pi * f * 0.02)
    expected = np.polyval(b[::-1], z) / np.polyval(a[::-1], z)
    found = oe(data, order, order, 1).model.frequency_response(f)[:, 0, 0]
    assert np.max(np.abs(found / expected - 1.0)) < 1e-3


def test_record_from_the_middle_is_as_good_as_from_rest(p2: Any) -> None:
    """Without noise a non-zero initial state leaves no trace."""
    data = IOData(p2.input, p2.noise_free, 0.02)[777:1777]
    estimate = oe(data, 2, 2, 1)
    np.testing.assert_allclose(estimate.parameters, p2.parameters, rtol=1e-9)


def test_two_inputs() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((2000, 2))
    y = lfilter([0, 1.0], [1, -0.9], u[:, 0]) + lfilter([0, 0, 0.5, 0.2], [1, -0.5, 0.3], u[:, 1])
    data = IOData(u, y + 0.1 * rng.standard_normal(2000), 0.1)
    estimate = oe(data, [1, 2], [1, 2], [1, 2])
    truth = np.array([1.0, 0.5, 0.2, -0.9, -0.5, 0.3])
    assert np.all(np.abs(estimate.parameters - truth) < 4 * np.sqrt(np.diag(estimate.covariance)))
    assert estimate.noise_variance[0, 0] == pytest.approx(0.01, rel=0.15)


def test_experiments_with_different_pasts(p2: Any) -> None:
    whole = IOData(p2.input, p2.noise_free, 0.02)
    estimate = oe([whole[100:400], whole[2000:2600]], 2, 2, 1)
    np.testing.assert_allclose(estimate.parameters, p2.parameters, rtol=1e-9)
    assert estimate.data.samples == (300, 600)


@pytest.mark.filterwarnings("ignore:oe did not converge")
def test_pole_at_the_edge_is_reported() -> None:
    u = np.random.default_rng(1).standard_normal(800)
    y = np.cumsum(u)
    with pytest.warns(SysidWarning, match="edge of stability"):
        oe(IOData(u, y + 0.01 * np.random.default_rng(2).standard_normal(800), 0.1), 1, 1, 0)


@pytest.mark.slow
def test_coloured_disturbances_need_the_coloured_covariance() -> None:
    a, b = [1, -1.5, 0.7], [0, 1.0, 0.5]
    truth = np.array([1.0, 0.5, -1.5, 0.7])
    plain, coloured = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 120), 10)
        y = lfilter(b, a, u) + lfilter([1.0], [1, -0.9], rng.standard_normal(1200))
        data = IOData(u, y, 0.1)[200:]
        for hits, option in ((plain, False), (coloured, True)):
            estimate = oe(data, 2, 2, coloured=option)
            deviation = np.sqrt(np.diag(estimate.covariance))
            hits.append(np.abs(estimate.parameters - truth) <= 1.96 * deviation)
    # nominally 95 % of 400 correlated trials
    assert np.mean(plain) < 0.85
    assert 0.90 < np.mean(coloured) < 0.98


def test_white_disturbances_hardly_notice_the_coloured_covariance(p2: Any) -> None:
    data = p2.draw(0)
    plain, coloured = oe(data, 2, 2), oe(data, 2, 2, coloured=True)
    np.testing.assert_array_equal(plain.parameters, coloured.parameters)
    ratio = np.sqrt(np.diag(coloured.covariance) / np.diag(plain.covariance))
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)
