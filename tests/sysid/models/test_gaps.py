"""Missing output samples: what takes them, and what refuses them."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import (
    IOData,
    Polynomials,
    StateSpace,
    armax,
    arx,
    bla,
    compare,
    covf,
    cra,
    delayest,
    etfe,
    n4sid,
    oe,
    okid,
    pem_ss,
    predict,
    resid,
    residuals,
    selstruc,
    spa,
    welch,
)
from sysid.models import innovations_form
from sysid.models.predict import initial_state
from tests.sysid.refusals import refused

A, B, C = [1, -1.5, 0.7], [0, 1, 0.5], [1, -0.6, 0.2]
MODEL = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1, 1.0)


def record(seed: int, samples: int = 400, lost: float = 0.1, noise: float = 1.0, c: list[float] = C) -> IOData:
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, samples + 100))
    y = (lfilter(B, A, u) + noise * lfilter(c, A, e))[100:]
    y[rng.random(samples) < lost] = np.nan
    return IOData(u[100:], y, 0.1, missing=True)


def test_contract_of_the_record() -> None:
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
    assert data[6:].complete
    np.testing.assert_allclose(np.nanmean(data.detrend().y[3:]), 0.0, atol=1e-14)
    np.testing.assert_array_equal(np.isnan(data.detrend(1).y), np.isnan(data.y))
    np.testing.assert_allclose(data.subtract(y=1.0).y, data.y - 1.0)


def conditional_mean(model: StateSpace, data: IOData, x0: np.ndarray, t: int, latest: int) -> np.ndarray:
    """E[y(t) | known y up to `latest`] by the joint normal distribution of all outputs."""
    n, order = len(data), model.order
    to_output = np.zeros((n, n))
    pulse = model.noise_response([0.0])  # only for the shape
    assert pulse.shape == (1, 1, 1)
    h = [1.0]
    power = np.eye(order)
    for _ in range(n - 1):
        h.append((model.C @ power @ model.gain)[0, 0])
        power = power @ model.A
    for lag, value in enumerate(h):
        to_output += value * np.eye(n, k=-lag)
    mean = np.empty(n)
    x = x0
    for k in range(n):
        mean[k] = (model.C @ x + model.D @ data.u[k])[0]
        x = model.A @ x + model.B @ data.u[k]
    covariance = to_output @ to_output.T
    seen = np.flatnonzero(data.known[:, 0] & (np.arange(n) <= latest))
    if not len(seen):
        return mean[t]
    gain = np.linalg.solve(covariance[np.ix_(seen, seen)], covariance[seen, t])
    return mean[t] + gain @ (data.y[seen, 0] - mean[seen])


@pytest.mark.parametrize("steps", [1, 3])
def test_prediction_is_the_conditional_mean(steps: int) -> None:
    data = record(0, 60, lost=0.3)
    x0 = np.array([0.7, -0.2])
    found = predict(MODEL, data, steps=steps, x0=x0)[:, 0]
    expected = [conditional_mean(MODEL, data, x0, t, t - steps) for t in range(60)]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(residuals(MODEL, data)), np.isnan(data.y))


def test_without_gaps_and_far_from_them_it_is_the_stationary_predictor() -> None:
    whole = record(1, 1500, lost=0.0)
    y = whole.y.copy()
    y[700:705] = np.nan
    gapped = IOData(whole.u, y, 0.1, missing=True)
    x0 = np.zeros(2)
    a, b = predict(MODEL, whole, x0=x0), predict(MODEL, gapped, x0=x0)
    np.testing.assert_allclose(b[:701], a[:701], atol=1e-11)
    np.testing.assert_allclose(b[760:], a[760:], atol=1e-8)
    assert np.abs(b[702:706] - a[702:706]).max() > 0.1


def test_two_outputs_one_of_which_is_lost() -> None:
    """What is known of one output at an instant tells about the innovation of the other."""
    rng = np.random.default_rng(3)
    model = StateSpace([[0.8]], [[1.0]], [[1.0], [0.5]], [[0.0], [0.0]], [[0.5, 0.2]], 0.1, [[1.0, 0.9], [0.9, 1.0]])
    e = rng.multivariate_normal([0, 0], model.innovation_covariance, 300)
    u, x, y = rng.standard_normal((300, 1)), np.zeros(1), np.empty((300, 2))
    for t in range(300):
        y[t] = model.C @ x + e[t]
        x = model.A @ x + model.B @ u[t] + model.gain @ e[t]
    lost = y.copy()
    lost[rng.random(300) < 0.5, 1] = np.nan
    data = IOData(u, lost, 0.1, missing=True)
    best = predict(model, IOData(u, y, 0.1), x0=[0.0])
    filtered = predict(model, data, x0=[0.0])
    x, deaf = np.zeros(1), np.empty((300, 2))
    for t in range(300):
        deaf[t] = model.C @ x
        known = np.where(np.isnan(lost[t]), 0.0, lost[t] - deaf[t])
        x = model.A @ x + model.B @ u[t] + model.gain @ known
    assert np.mean((filtered - best) ** 2) < 0.5 * np.mean((deaf - best) ** 2)


def test_initial_state_and_fits_look_at_what_is_known() -> None:
    x0 = np.array([3.0, -1.0])
    still = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, None, 0.1)
    u = np.random.default_rng(1).standard_normal((80, 1))
    y = predict(still, IOData(u, np.ones(80), 0.1), steps=None, x0=x0)
    y[::3] = np.nan
    data = IOData(u, y, 0.1, missing=True)
    np.testing.assert_allclose(initial_state(still, data), x0, atol=1e-9)
    np.testing.assert_allclose(compare(still, data)[0].simulation, 100.0, atol=1e-9)
    noisy = record(2, 400)
    (fit,) = compare(MODEL, noisy)
    keep = noisy.known[:, 0]
    expected = 100 * (
        1 - np.linalg.norm((noisy.y - fit.predicted)[keep]) / np.linalg.norm(noisy.y[keep] - np.nanmean(noisy.y))
    )
    assert fit.one_step[0] == pytest.approx(expected)


def test_arx_leaves_out_what_touches_a_gap() -> None:
    exact = record(0, 200, noise=0.0)
    np.testing.assert_allclose(arx(exact, 2, 2).parameters, [-1.5, 0.7, 1.0, 0.5], atol=1e-9)
    scaled = []
    for seed in range(80):
        fit = arx(record(seed, 300, c=[1.0]), 2, 2)
        scaled.append((fit.parameters - [-1.5, 0.7, 1.0, 0.5]) ** 2 / np.diag(fit.covariance))
    # 320 chi-squares with one degree of freedom
    assert np.mean(scaled) == pytest.approx(1.0, abs=0.2)
    refused("too many missing samples", lambda: arx(record(0, 30, lost=0.7), 2, 2))


def test_spectra_with_gaps_hold_within_their_intervals() -> None:
    f = np.linspace(0.3, 4.7, 12)
    z = np.exp(-2j * np.pi * f * 0.1)
    truth, density = 0.5 * z / (1 - 0.5 * z), 0.1 * 0.25 / np.abs(1 - 0.5 * z) ** 2
    covered, noise = [], []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        u, e = rng.standard_normal((2, 2000))
        y = lfilter([0, 0.5], [1, -0.5], u) + lfilter([0.5], [1, -0.5], e)
        y[rng.random(2000) < 0.2] = np.nan
        found = spa(IOData(u, y, 0.1, missing=True), lag=60, frequencies=f)
        low, high = (edge[:, 0, 0] for edge in found.magnitude_ci95())
        covered.append((low <= np.abs(truth)) & (np.abs(truth) <= high))
        noise.append(found.noise_spectrum[:, 0, 0].real)
    assert 0.93 <= np.mean(covered) <= 0.97
    # short of the part sum(w^2) / N that the response has fitted, here 2.4 % and more with gaps
    np.testing.assert_allclose(np.mean(noise, axis=0) / density, 1.0, atol=0.12)


def test_covariances_average_known_products() -> None:
    data = record(0, 50)
    y, known = np.nan_to_num(data.y[:, 0]), data.known[:, 0]
    products = [(y[t + 3] * y[t], known[t + 3] and known[t]) for t in range(47)]
    expected = np.mean([p for p, both in products if both]) * 47 / 50
    assert covf(data, lags=4).output[7, 0, 0] == pytest.approx(expected, rel=1e-9)
    whole = IOData(data.u, y, 0.1)
    opened = IOData(data.u, y, 0.1, missing=True)
    np.testing.assert_allclose(covf(opened).values, covf(whole).values, rtol=1e-12)


def test_everything_else_refuses_and_takes_the_parts() -> None:
    data = record(0, 600, lost=0.01)
    refusing = [
        lambda d: armax(d, 2, 2, 2, coloured=True),
        lambda d: oe(d, 2, 2, coloured=True),
        lambda d: pem_ss(d, MODEL, gain=False, coloured=True),
        lambda d: n4sid(d, 2),
        lambda d: etfe(d),
        lambda d: welch(d, segment=20),
        lambda d: cra(d, lags=4),
        lambda d: delayest(d, largest=2, na=2, nb=2),
        lambda d: selstruc(d, 2, 2),
        lambda d: bla(d, 20),
        lambda d: resid(MODEL, d, lags=5),
    ]
    count = int((~data.known).sum())
    for identify in refusing:
        refused(rf"experiment 0 lacks {count} of 600 output samples.*complete_parts", identify, data)
    parts = data.complete_parts(shortest=30)
    np.testing.assert_allclose(armax(parts, 2, 2, 2).parameters, [-1.5, 0.7, 1.0, 0.5, -0.6, 0.2], atol=0.25)
    assert okid(parts, 2, p=4).model.order == 2
