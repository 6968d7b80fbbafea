import numpy as np
import pytest
import scipy

import sysid
from sysid import IOData, Polynomials, rarx, track
from sysid.models import innovations_form
from sysid.models.bandwidth import half_power_hz
from sysid.recursive import DirectionalForgetting, Forgetting, Tracker
from sysid.recursive.change_test import ChangeTest
from sysid.recursive.servo_quantities import ServoQuantities
from sysid.recursive.stretch_fit import fit_degrees, model_weights, preferred
from sysid.recursive.tracker import BLOCKS, STUDENT_95
from tests.refusals import refused

SERVOS = [np.poly([0.82, 0.86 + 0.1j, 0.86 - 0.1j]).real, np.poly([0.9, 0.9 + 0.12j, 0.9 - 0.12j]).real]
DELAY = 2


def numerator(F):
    return np.array([1.0, 0.2, 0.1]) / 1.3 * F.sum()


def switched(seed, change=3000, samples=6000, deviation=1e-4, rest=None):
    """A servo that becomes another one, in state space, its input at rest from a sample on; the true bandwidths."""
    rng = np.random.default_rng(seed)
    u = 0.02 * np.convolve(rng.standard_normal(samples + 20), np.hanning(8) / 2.0)[20 : samples + 20]
    u[samples if rest is None else rest :] = 0.0
    models = [innovations_form(Polynomials(B=np.append([0, 0], numerator(F)), F=F), dt=0.02) for F in SERVOS]
    x, y = np.zeros(models[0].order), np.empty(samples)
    for t in range(samples):
        m = models[t >= change]
        y[t] = (m.C @ x)[0] + 0.3
        x = m.A @ x + m.B[:, 0] * u[t]
    return IOData(u, y + deviation * rng.standard_normal(samples), 0.02), [half_power_hz(m) for m in models]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_without_forgetting_it_is_least_squares(seed):
    data = switched(seed)[0].detrend()
    rules = Forgetting(1.0), DirectionalForgetting(1.0)
    plain, directional = (rarx(data, 3, 3, 2, adaptation=rule, P0=1e6) for rule in rules)
    np.testing.assert_allclose(directional.final.parameters, plain.final.parameters, rtol=1e-6)


def test_directions_without_excitation_keep_their_information():
    rng, rule, exponential = np.random.default_rng(0), DirectionalForgetting(0.95), Forgetting(0.95)
    memory, root = rule.enter(np.eye(3)), exponential.enter(np.eye(3))
    for _ in range(400):
        psi = np.append(rng.standard_normal(2), 0.0)
        _, memory = rule.step(memory, psi, 0)
        _, root = exponential.step(root, psi, 0)
    P = rule.leave(memory)
    np.testing.assert_allclose(P @ memory[1], np.eye(3), atol=1e-9)
    assert P[2, 2] == pytest.approx(1.0) and exponential.leave(root)[2, 2] > 1e8
    # where there is excitation the memory is that of exponential forgetting, up to the direction of each sample
    assert 0.3 < np.trace(P[:2, :2]) / np.trace(exponential.leave(root)[:2, :2]) < 1.0


@pytest.mark.parametrize("begin", [0, 1234])
def test_a_stretch_in_the_middle_of_a_motion_is_fitted_exactly(begin):
    data, _ = switched(1, deviation=0.0)
    u, y = data.u[: begin + 400, 0], data.y[: begin + 400, 0]
    fits = fit_degrees(
        u[max(begin - 50, 0) :], y[max(begin - 50, 0) :], min(begin, 50), (2, 3), DELAY, np.array([1, -0.7])
    )
    fit = preferred(fits)
    assert fit is fits[1] and fit.order == 3
    np.testing.assert_allclose(fit.F, SERVOS[0], atol=1e-6)
    np.testing.assert_allclose(fit.B, numerator(SERVOS[0]), atol=1e-7)
    assert fit.nuisance[-1] == pytest.approx(0.3, abs=1e-7)


def test_no_degree_fits_worse_than_a_smaller_one():
    data, _ = switched(2)
    fits = fit_degrees(data.u[:800, 0], data.y[:800, 0], 0, range(3, 9), DELAY, np.ones(1))
    costs = [fit.errors @ fit.errors for fit in fits]
    assert (np.diff(costs) <= 1e-9 * costs[0]).all()
    weights, criteria = model_weights(fits), np.array([fit.criterion for fit in fits])
    assert weights.sum() == pytest.approx(1.0) and min(weights[:2]) > 0.3 and np.argmin(criteria) == 0
    assert weights[1] / weights[0] == pytest.approx(1.0 + np.exp(0.5 * (criteria[0] - criteria[1])))


def test_fits_go_on_where_the_singular_values_do_not_converge(monkeypatch):
    data, _ = switched(2)
    case = data.u[:400, 0], data.y[:400, 0], 0, (3,), DELAY, np.ones(1)
    (expected,) = fit_degrees(*case)

    def diverges(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge in Linear Least Squares")

    monkeypatch.setattr(np.linalg, "lstsq", diverges)
    (fit,) = fit_degrees(*case)
    np.testing.assert_allclose(fit.F, expected.F, rtol=1e-6)


@pytest.mark.parametrize("gain", [None, 1.0])
def test_quantities_and_their_gradients(gain):
    quantities, F = ServoQuantities(DELAY, 0.02, gain), SERVOS[0]
    B = numerator(F)
    value, moves = quantities(B, F)
    model = innovations_form(Polynomials(B=np.append([0, 0], B), F=F), dt=0.02)
    hz = model.bandwidth().item()
    assert np.exp(value[0]) == pytest.approx(hz, rel=1e-6)
    g = model.frequency_response([hz])[0, 0, 0]
    assert value[1] == pytest.approx(-np.angle(g) / (2 * np.pi * hz), rel=1e-6)
    for k, step in enumerate(1e-7 * np.eye(6)):
        ends = [quantities(B + s * step[:3], F + s * np.append(0.0, step[3:]))[0] for s in (1, -1)]
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-7, moves[:, k], rtol=1e-3, atol=1e-4)
    assert np.isnan(quantities(np.array([1.0]), np.array([1.0, 0.0]))[0]).all()


@pytest.mark.slow
def test_false_alarms_and_detection():
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(20):
        test = ChangeTest(rng.standard_normal(1500), 1.0, 50, 1 / 3600, 0.02)
        statistics = [test.update(e, 1.0) for e in rng.standard_normal(9000)]
        alarms += max(statistics) > test.threshold(1500, 10)
    # an hour in all
    assert alarms <= 2
    for e in 2.0 * rng.standard_normal(100):
        last = test.update(e, 1.0)
    assert last > test.threshold(1500, 10) and 80 <= test.age(1.0) < 100


def bursts(rng, size):
    """Errors of unit variance that come in bursts of half a second, as dry friction makes them."""
    loud = np.repeat(rng.random(size // 25) < 0.15, 25)
    return np.where(loud, 2.2, 0.57) * rng.standard_normal(size)


def test_the_threshold_follows_the_bursts_of_an_arm_behind_a_change():
    rng = np.random.default_rng(4)
    test = ChangeTest(rng.standard_normal(1500), 1.0, 50, 1 / 3600, 0.02)
    before = test.threshold(1500, 10)
    statistics = [test.update(e, 1.0) for e in bursts(rng, 30000)]
    assert max(statistics) > before
    # too few to tell, then a part of a calibration, which only raises the threshold
    test.learn(0.1 * rng.standard_normal(150), 0.01)
    assert test.threshold(1500, 10) == before
    test.learn(rng.standard_normal(750), 1.0)
    assert test.threshold(1500, 10) >= before
    test.learn(bursts(rng, 750), 1.0)
    assert test.threshold(1500, 10) > 1.5 * before
    test.learn(bursts(rng, 3000), 1.0)
    assert max(statistics) < test.threshold(3000, 10)
    # as long as the calibration: its own scatter alone
    test.learn(rng.standard_normal(1500), 1.0)
    assert test.threshold(1500, 10) == pytest.approx(before, rel=0.3)
    # an arm that stands still tells nothing
    known = test.threshold(1500, 10)
    test.learn(np.zeros(1500), 1.0)
    assert test.threshold(1500, 10) == known


@pytest.mark.thorough
def test_a_change_is_noticed_and_followed():
    hits = []
    for seed in range(4):
        data, truth = switched(seed)
        found = track(data, 4, DELAY, gain=1.0)
        (change,) = found.changes
        assert 59.0 < change.time <= change.detected < 62.0 and change.statistic > change.threshold
        assert np.isnan(found.bandwidth[:1500]).all() and not found.settled[:1500].any()
        for second, hz in ((59, truth[0]), (65, truth[1]), (90, truth[1])):
            low, high = found.bandwidth_ci95[50 * second]
            hits.append(low <= hz <= high)
            assert high / low < 1.1
            delay = ServoQuantities(DELAY, 0.02, 1.0)(numerator(SERVOS[second > 60]), SERVOS[second > 60])[0][1]
            low, high = found.delay_ci95[50 * second]
            hits.append(low <= delay <= high)
            assert high - low < 0.02
    assert sum(hits) >= 20  # of 24 at 95 %
    table = found.to_xarray()
    assert table.bandwidth.attrs["units"] == "Hz" and "detected at" in str(found)


@pytest.mark.slow
def test_live_is_the_same_and_a_constant_plant_raises_no_alarm():
    data, _ = switched(7, change=10**6, samples=3000)
    whole = track(data, 4, DELAY, gain=1.0)
    assert whole.changes == () and whole.settled[1500:].all()
    live = Tracker(data[:1500], 4, DELAY, gain=1.0)
    for u, y in zip(data.u[1500:1700, 0], data.y[1500:1700, 0], strict=True):
        sample = live.step(u, y)
    assert sample.time == pytest.approx(data.time[1699]) and sample.bandwidth == whole.bandwidth[1699]
    assert sample.bandwidth_ci95 == tuple(whole.bandwidth_ci95[1699])
    np.testing.assert_array_equal(live.parameters[:2], whole.parameters[1699, :2])


def repeated_play(seed, period=300, plays=9, cubic=0.2):
    """A random-phase multisine, again and again, through two lags with a cubic nonlinearity between them."""
    rng = np.random.default_rng(seed)
    lines = np.arange(1, 40)
    waves = np.cos(2.0 * np.pi * (np.outer(np.arange(period), lines) / period + rng.random(len(lines))))
    u = np.tile(waves.sum(axis=1) * np.sqrt(2.0 / len(lines)), plays + 1)
    x = scipy.signal.lfilter([0.0, 0.25], [1.0, -0.75], u)
    y = scipy.signal.lfilter([0.2], [1.0, -0.8], x + cubic * x**3) + 0.003 * rng.standard_normal(len(u))
    # for normal x the best linear gain of x + c x^3 is 1 + 3 c times the variance of x
    lags = 0.25 / (np.exp(2j * np.pi * lines / period) - 0.75)
    gain = 1.0 + 3.0 * cubic * np.mean(np.abs(lags) ** 2)
    bandwidth = half_power_hz(innovations_form(Polynomials(B=[0.0, 0.05], F=np.poly([0.75, 0.8])), dt=0.02))
    return IOData(u[period:], y[period:], 0.02), gain, bandwidth


def test_periods_of_one_sequence_count_once():
    hits = []
    for seed in range(12):
        data, gain, bandwidth = repeated_play(seed)
        low, high = track(data, 4, 1, gain=gain, calibration=20.0).bandwidth_ci95[-1]
        hits.append(low <= bandwidth <= high)
    # of independent blocks, 3 of the 12
    assert sum(hits) >= 9


def test_the_quantile_is_that_of_the_blocks():
    assert scipy.stats.t.ppf(0.975, BLOCKS - 1) == pytest.approx(STUDENT_95, rel=1e-10)


@pytest.mark.slow
def test_bandwidths_below_those_that_a_model_can_show_are_not_claimed():
    """Without excitation after a change the model is noise: the interval reaches from nothing to all, never [0, 0]."""
    found = track(switched(9, samples=9000, rest=3010)[0])
    low, high = found.bandwidth_ci95[found.settled & np.isfinite(found.bandwidth)].T
    assert (high - low > 0.0).all()
    assert found.bandwidth[np.isfinite(found.bandwidth)].min() >= 2e-4 / 0.02 * 0.999


def test_refusals():
    data, _ = switched(0, samples=2000)
    two = IOData(np.c_[data.u, data.u**2], data.y, 0.02)
    refused("2 inputs given", track, two)
    refused("calibration must lie between", track, data, calibration=99.0)
    refused("the record of 20 s is no longer than the calibration, 30 s unless given", track, data[:1000])
    refused("samples of calibration given", track, data, calibration=1.0)
    refused("drift must lie", track, data, drift=0.0)
    refused("drift must lie", track, data, drift=1e300)
    refused("false_alarms must lie", track, data, false_alarms=np.inf)
    refused("order must be", track, data, 2**70)
    refused("the forgetting factor must", DirectionalForgetting, 1.5)
    refused("got list", track, [data])
    tracker = Tracker(data[:1500], 3, DELAY)
    for u, y in ((np.nan, 0.0), (0.0, 1e61), ("a", 0.0), ([1.0], 0.0), (0.0, None), (1j, 0.0)):
        refused("must be finite", tracker.step, u, y)
    flat = IOData(data.u, data.u * 0.5 + np.random.default_rng(0).standard_normal((2000, 1)) * 1e-6, 0.02)
    refused("no bandwidth", sysid.track, flat[:1800], 2)
