from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, Polynomials, StateSpace, arx, compare, covf, predict, residuals, spa
from sysid.models import innovations_form
from sysid.models.predict import initial_state
from tests.refusals import refused
from tests.sysid.systems import A, B, covered, joint_normal, losing, second_order

C = [1.0, -0.6, 0.2]
MODEL = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1, 1.0)
record = partial(second_order, c=C, settle=100, lost=0.1)


def test_contract_of_the_record():
    y = np.array([1.0, np.nan, 3.0, 4.0, np.nan, np.nan, 7.0, 8.0])
    refused(r"3 sample.* channel 0 at index 1; missing=True", lambda: IOData(np.ones(8), y, 1.0))
    refused("u: 3 sample", lambda: IOData(y, np.ones(8), 1.0, missing=True))
    refused("no known sample", lambda: IOData(np.ones(8), np.full(8, np.nan), 1.0, missing=True))
    refused("infinite", lambda: IOData(np.ones(3), [1.0, np.inf, 2.0], 1.0, missing=True))
    data = IOData(np.arange(8.0), y, 1.0, missing=True, window=3, name="run")
    assert not data.complete
    np.testing.assert_array_equal(data.known[:, 0], ~np.isnan(y))
    parts = data.complete_parts()
    assert [part.y[:, 0].tolist() for part in parts] == [[3.0, 4.0], [7.0, 8.0]]
    assert [(part.window, part.name, part.missing) for part in parts] == [(1, "run", False), (0, "run", False)]
    assert len(data.complete_parts(shortest=2)) == 1
    refused("has 9 samples; the longest has 2", lambda: data.complete_parts(shortest=9))
    for shortest in ("a", np.nan, 2.5):
        refused("shortest must be", partial(data.complete_parts, shortest=shortest))
    assert data[6:].complete
    np.testing.assert_allclose(np.nanmean(data.detrend().y[3:]), 0.0, atol=1e-14)
    np.testing.assert_array_equal(np.isnan(data.detrend(1).y), np.isnan(data.y))
    np.testing.assert_allclose(data.subtract(y=1.0).y, data.y - 1.0)


@pytest.mark.parametrize("steps", [1, 3])
def test_prediction_is_the_conditional_mean(steps):
    """E[y(t) | known y up to t - steps] by the joint normal distribution of all outputs."""
    data, x0 = record(0, 60, lost=0.3), np.array([0.7, -0.2])
    mean, covariance = joint_normal(MODEL, data, x0)
    expected = mean.copy()
    for t in range(steps, 60):
        seen = np.flatnonzero(data.known[: t - steps + 1, 0])
        gain = np.linalg.solve(covariance[np.ix_(seen, seen)], covariance[seen, t])
        expected[t] += gain @ (data.y[seen, 0] - mean[seen])
    np.testing.assert_allclose(predict(MODEL, data, steps=steps, x0=x0)[:, 0], expected, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(residuals(MODEL, data)), np.isnan(data.y))


def test_two_outputs_one_of_which_is_lost():
    """What is known of one output at an instant tells about the innovation of the other."""
    rng = np.random.default_rng(3)
    model = StateSpace([[0.8]], [[1.0]], [[1.0], [0.5]], [[0.0], [0.0]], [[0.5, 0.2]], 0.1, [[1.0, 0.9], [0.9, 1.0]])
    u = rng.standard_normal((300, 1))
    y = sysid.simulate(model, u, rng=rng)
    lost = y.copy()
    lost[rng.random(300) < 0.5, 1] = np.nan
    best = predict(model, IOData(u, y, 0.1), x0=[0.0])
    filtered = predict(model, IOData(u, lost, 0.1, missing=True), x0=[0.0])
    x, deaf = np.zeros(1), np.empty((300, 2))
    for t in range(300):
        deaf[t] = model.C @ x
        known = np.where(np.isnan(lost[t]), 0.0, lost[t] - deaf[t])
        x = model.A @ x + model.B @ u[t] + model.gain @ known
    assert np.mean((filtered - best) ** 2) < 0.5 * np.mean((deaf - best) ** 2)


def test_initial_state_and_fits_look_at_what_is_known():
    x0 = np.array([3.0, -1.0])
    still = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, None, 0.1)
    u = np.random.default_rng(1).standard_normal((80, 1))
    y = predict(still, IOData(u, np.ones(80), 0.1), steps=None, x0=x0)
    data = losing(IOData(u, y, 0.1), slice(None, None, 3))
    np.testing.assert_allclose(initial_state(still, data), x0, atol=1e-9)
    np.testing.assert_allclose(compare(still, data)[0].simulation, 100.0, atol=1e-9)
    noisy = record(2, 400)
    (fit,) = compare(MODEL, noisy)
    keep = noisy.known[:, 0]
    error, scale = (noisy.y - fit.predicted)[keep], noisy.y[keep] - np.nanmean(noisy.y)
    assert fit.one_step[0] == pytest.approx(100 * (1 - np.linalg.norm(error) / np.linalg.norm(scale)))


def test_arx_leaves_out_what_touches_a_gap():
    truth = [-1.5, 0.7, 1.0, 0.5]
    np.testing.assert_allclose(arx(record(0, 200, noise=0.0), 2, 2).parameters, truth, atol=1e-9)
    fits = [arx(record(seed, 300, c=[1.0]), 2, 2) for seed in range(80)]
    scaled = [(fit.parameters - truth) ** 2 / np.diag(fit.covariance) for fit in fits]
    # 320 chi-squares with one degree of freedom
    assert np.mean(scaled) == pytest.approx(1.0, abs=0.2)
    refused("too many missing samples", lambda: arx(record(0, 30, lost=0.7), 2, 2))


def test_spectra_with_gaps_hold_within_their_intervals():
    f = np.linspace(0.3, 4.7, 12)
    z = np.exp(-2j * np.pi * f * 0.1)
    truth, density = np.abs(0.5 * z / (1 - 0.5 * z)), 0.1 * 0.25 / np.abs(1 - 0.5 * z) ** 2
    hits, noise = [], []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        u, e = rng.standard_normal((2, 2000))
        y = lfilter([0, 0.5], [1, -0.5], u) + lfilter([0.5], [1, -0.5], e)
        estimate = spa(losing(IOData(u, y, 0.1), rng.random(2000) < 0.2), lag=60, frequencies=f)
        hits.append(covered(estimate.magnitude_ci95(), truth[:, None, None]))
        noise.append(estimate.noise_spectrum[:, 0, 0].real)
    assert 0.93 <= np.mean(hits) <= 0.97
    # short of the part sum(w^2) / N that the response has fitted, here 2.4 % and more with gaps
    np.testing.assert_allclose(np.mean(noise, axis=0) / density, 1.0, atol=0.12)


def test_covariances_average_known_products():
    data = record(0, 50)
    y, known = np.nan_to_num(data.y[:, 0]), data.known[:, 0]
    products = [(y[t + 3] * y[t], known[t + 3] and known[t]) for t in range(47)]
    expected = np.mean([p for p, both in products if both]) * 47 / 50
    assert covf(data, lags=4).output[7, 0, 0] == pytest.approx(expected, rel=1e-9)
    whole, opened = (IOData(data.u, y, 0.1, missing=missing) for missing in (False, True))
    np.testing.assert_allclose(covf(opened).values, covf(whole).values, rtol=1e-12)


@pytest.mark.parametrize("lost", [0.02, 0.3])
def test_scattered_losses_leave_a_subspace_start(lost):
    """Parts without gaps have a few samples; the start is about as good as that of the whole record."""
    f = np.linspace(0.05, 4.5, 30)
    truth = MODEL.frequency_response(f)

    def error(estimate):
        return np.linalg.norm(estimate.model.frequency_response(f) - truth) / np.linalg.norm(truth)

    data = record(1, 1000, lost=lost)
    start, whole = sysid.n4sid(data, 2), sysid.n4sid(record(1, 1000, lost=0.0), 2)
    assert error(start) < error(whole) + 0.02
    assert start.noise_variance[0, 0] == pytest.approx(1.0, abs=0.15)
    np.testing.assert_array_equal(np.isnan(start.residuals), np.isnan(data.y))
    assert sysid.pem_ss(data, start).diagnostics["converged"]
    without = sysid.n4sid(data, 2, gain=False)
    assert not without.model.gain.any()
    assert error(without) < 0.15


@pytest.mark.parametrize(
    "identify",
    [
        lambda d: sysid.armax(d, 2, 2, 2, coloured=True),
        lambda d: sysid.pem_ss(d, MODEL, gain=False, coloured=True),
        lambda d: sysid.etfe(d),
        lambda d: sysid.welch(d, segment=20),
        lambda d: sysid.cra(d, lags=4),
        lambda d: sysid.delayest(d, largest=2, na=2, nb=2),
        lambda d: sysid.selstruc(d, 2, 2),
        lambda d: sysid.bla(d, 20),
        lambda d: sysid.rarx(d, 2, 2),
    ],
)
def test_everything_else_refuses_gaps(identify):
    data = record(0, 600, lost=0.01)
    lacking = rf"lacks {int((~data.known).sum())} of 600 output samples.*complete_parts"
    refused(lacking, identify, data)
