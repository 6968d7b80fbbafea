import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, Polynomials, StateSpace, arx, compare, resid
from sysid.models import innovations_form
from sysid.validation.resid import independence_p, whiteness_p
from tests.refusals import refused

ONE = np.ones(1)


@pytest.mark.thorough
def test_true_model_is_rejected_at_the_nominal_rate(p3):
    model = p3.truth
    tests = [resid(model, p3.draw(seed), level=0.9) for seed in range(200)]
    # 10 % of 200 is 20, standard deviation 4.2
    assert 8 <= sum(not t.white[0] for t in tests) <= 33
    assert 8 <= sum(not t.independent[0, 0] for t in tests) <= 33
    assert np.mean([t.outside_whiteness[0] / 25 for t in tests]) == pytest.approx(0.1, abs=0.015)
    assert np.mean([t.outside_independence[0, 0] / 25 for t in tests]) == pytest.approx(0.1, abs=0.02)


@pytest.mark.slow
def test_independence_keeps_its_size_with_coloured_residuals():
    """An output-error model of data with coloured noise: not white, but independent of the input."""
    model = innovations_form(Polynomials(ONE, [0, 1.0], ONE, ONE, [1, -0.8]), 0.1)
    white, independent = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 400), 5)
        y = lfilter([0, 1.0], [1, -0.8], u) + lfilter([1.0], [1, -0.9], rng.standard_normal(2000))
        test = resid(model, IOData(u, y, 0.1), level=0.9)
        white.append(bool(test.white[0]))
        independent.append(bool(test.independent[0, 0]))
    assert not any(white)
    # 10 % of 100, with room for the sample correlations in the bound
    assert 3 <= 100 - sum(independent) <= 22


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "lags"), [(100, 10), (150, 25), (400, 25)])
def test_whiteness_keeps_its_size_on_short_records(samples, lags):
    e = np.random.default_rng(0).standard_normal((8000, samples))
    e -= e.mean(axis=1, keepdims=True)
    power = np.sum(e**2, axis=1)
    r = np.array([np.sum(e[:, k:] * e[:, : samples - k], axis=1) / power for k in range(1, lags + 1)])
    p = whiteness_p(r, samples - np.arange(lags + 1))
    # standard errors 0.0011 and 0.0024; the chi-square distribution gives 0.019 to 0.025 at 1 %
    assert np.mean(p < 0.01) == pytest.approx(0.01, abs=0.0045)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.006)


@pytest.mark.slow
def test_independence_keeps_its_size_on_short_records():
    p = []
    for seed in range(600):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 40), 3)
        p.append(independence_p([rng.standard_normal(120)], [u - u.mean()], 12))
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.025)
    assert np.mean(p) == pytest.approx(0.5, abs=0.04)


def test_experiments_are_tested_together(p3):
    data = p3.draw(0)
    parts = [data[:700], data[700:]]
    both, whole = resid(p3.truth, parts), resid(p3.truth, data)
    assert len(both.residuals) == 2000
    np.testing.assert_allclose(both.autocorrelation, whole.autocorrelation, atol=0.03)
    assert both.whiteness_p[0] == pytest.approx(whole.whiteness_p[0], abs=0.2)
    too_small = resid(arx(parts, 1, 1), parts)
    assert not too_small.white[0]
    assert not too_small.independent[0, 0]
    assert too_small.outside_whiteness[0] > 3


def test_bounds():
    rng = np.random.default_rng(0)
    data = IOData(rng.standard_normal(2500), rng.standard_normal(2500), 0.1)
    silent = innovations_form(Polynomials(ONE, [0, 0.0], ONE, ONE, ONE), 0.1)
    test = resid(silent, data)
    assert test.whiteness_bound == pytest.approx(2.5758 / 50, rel=1e-4)
    assert test.independence_bound[0, 0] == pytest.approx(2.58 / 50, rel=0.15)
    assert test.autocorrelation[0, 0, 0] == pytest.approx(1.0)
    assert test.cross_correlation.shape == (51, 1, 1)
    np.testing.assert_array_equal(test.cross_lags, np.arange(-25, 26))
    assert test.passed
    # A delay that the model misses shows at its lag.
    late = IOData(data.u, np.roll(data.u[:, 0], 7) + 0.1 * data.y[:, 0], 0.1)
    test = resid(silent, late)
    assert test.cross_lags[np.argmax(np.abs(test.cross_correlation[:, 0, 0]))] == 7


def test_refusals(p3):
    data = p3.draw(0)
    refused("level", lambda: resid(p3.truth, data, level=99.0))
    refused("lags", lambda: resid(p3.truth, data, lags=5000))
    refused(
        "25 lags need 52 residuals, the shortest record has 50; expected lags from 1 to 24",
        lambda: resid(p3.truth, data[:50]),
    )
    refused("3 residuals in the shortest record; expected 4 or more", lambda: resid(p3.truth, data[:3]))
    perfect = IOData(data.u, lfilter([0, 1, 0.5], [1, -1.5, 0.7], data.u[:, 0]), data.dt)
    refused("residuals are zero", lambda: resid(p3.truth, perfect))


@pytest.mark.filterwarnings("ignore:the predictor is unstable")
def test_exploding_residuals_fail_the_tests_without_breaking_them():
    rng = np.random.default_rng(0)
    data = IOData(*rng.standard_normal((2, 1500)), 0.1)
    unstable = StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], [[-1.0]], 0.1)
    test = resid(unstable, data)
    assert not test.white[0]
    assert test.whiteness_p[0] < 1e-100
    (scored,) = compare(unstable, data)
    assert scored.one_step[0] < -1e10
    assert -200 < scored.simulation[0] < 100
