"""The loss of an estimate is the mean square of its prediction errors, and warnings of intervals from few of them."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData


def _record(rng, samples):
    """Random stable system of order 1 to 4 beside coloured noise, from rest."""
    order = int(rng.integers(1, 5))
    pairs = rng.uniform(0.3, 0.98, 2) * np.exp(1j * rng.uniform(0.0, 3.0, 2))
    denominator = (
        np.poly(np.concatenate((pairs, pairs.conj()))).real if order == 4 else np.poly(rng.uniform(0, 0.98, order))
    )
    u = rng.choice([-1.0, 1.0], samples)
    y = lfilter(np.append(0.0, rng.standard_normal(order)), denominator, u)
    noise = lfilter([1.0, 0.5], [1.0, -0.7], rng.standard_normal(samples))
    return IOData(u, y + 0.1 * np.std(y) * noise, 0.1), order


def _estimate(name, data, n):
    calls = {
        "oe": lambda: sysid.oe(data, n, n, 1, initial_conditions="zero"),
        "armax": lambda: sysid.armax(data, n, n, 1, 1, initial_conditions="zero"),
        "bj": lambda: sysid.bj(data, n, 1, 1, n, 1, initial_conditions="zero"),
        "polyest": lambda: sysid.polyest(data, 1, n, 1, 0, n, 1, initial_conditions="zero"),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        return calls[name]()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "systems"), [("oe", 60), ("armax", 60), ("bj", 60), ("polyest", 20)])
def test_the_loss_is_that_of_the_prediction_errors(name, systems):
    """Prediction errors D/C (A y - B/F u) from rest by SciPy's filters, for 200 random systems."""
    for seed in range(systems):
        data, order = _record(np.random.default_rng(seed), 400)
        estimate = _estimate(name, data, order)
        model = estimate.polynomials
        path = lfilter(np.ravel(model.B), np.ravel(model.F), data.u[:, 0])
        errors = lfilter(model.D, model.C, lfilter(model.A, [1.0], data.y[:, 0]) - path)
        assert estimate.loss == pytest.approx(float(np.mean(errors**2)), rel=1e-9)
        minimised = estimate.diagnostics["sum_of_squares"] / estimate.diagnostics["rows"]
        assert estimate.loss == pytest.approx(minimised, rel=1e-6)


@pytest.mark.parametrize(
    ("samples", "method", "warned"), [(80, "armax", True), (300, "armax", False), (80, "oe", False)]
)
def test_intervals_of_noise_models_from_short_records(samples, method, warned):
    """Of armax with 6 parameters and 80 samples the intervals of C hold the truth in 83 %."""
    rng = np.random.default_rng(3)
    u = rng.choice([-1.0, 1.0], samples)
    a = [1.0, -1.5, 0.7]
    y = lfilter([0.0, 1.0, 0.5], a, u) + lfilter([1.0, -0.6, 0.2], a, rng.standard_normal(samples))
    data = IOData(u, y, 1.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        estimate = sysid.armax(data, 2, 2, 2, 1) if method == "armax" else sysid.oe(data, 2, 2, 1)
    assert any("are too narrow" in str(warning.message) for warning in caught) == warned
    assert any("are too narrow" in message for message in estimate.diagnostics["warnings"]) == warned
