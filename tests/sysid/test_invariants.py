"""What no estimator may depend on: units, the clock, the sequence of channels, where a record is cut."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import sysid
from sysid import IOData

DT = 0.1
F = np.linspace(0.1, 4.9, 40)

# name: estimator, relative tolerance of its answer (iterations stop when a part of 1e-9 of the cost is left)
SINGLE = {
    "arx": (lambda d: sysid.arx(d, 2, 2), 1e-8),
    # its instruments are simulated from rest: what comes before the window has not quite died out behind it
    "iv4": (lambda d: sysid.iv4(d, 2, 2), 1e-5),
    "armax": (lambda d: sysid.armax(d, 2, 2, 2), 2e-3),
    "oe": (lambda d: sysid.oe(d, 2, 2), 2e-3),
    "bj": (lambda d: sysid.bj(d, 2, 1, 1, 2), 2e-3),
}
SEVERAL = {
    "okid": (lambda d: sysid.okid(d, 2, p=6), 1e-6),
    "n4sid": (lambda d: sysid.n4sid(d, 2), 1e-6),
    "pem_ss": (lambda d: sysid.pem_ss(d, sysid.n4sid(d, 2)), 2e-3),
}
EVERY = {**SINGLE, **SEVERAL}
each = pytest.mark.parametrize("name", EVERY)
quick = settings(max_examples=5, deadline=None, derandomize=True)
pytestmark = pytest.mark.filterwarnings("ignore::sysid.SysidWarning")


def record(seed, nu=1, ny=1, samples=500, noise=0.2):
    """Every channel has the poles 0.75 +- 0.37 i, so that the order stays two."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples + 100, nu))
    a = [1, -1.5, 0.7]
    numerators = rng.uniform(-1.0, 1.0, (ny, nu, 2)) if ny * nu > 1 else np.array([[[1.0, 0.5]]])
    if ny > 1:
        # a state space of order two: all channels share it
        A, B, C = np.array([[1.5, -0.7], [1.0, 0.0]]), rng.standard_normal((2, nu)), rng.standard_normal((ny, 2))
        y = sysid.simulate(sysid.StateSpace(A, B, C, np.zeros((ny, nu)), None, DT), u)
    else:
        y = sum(lfilter([0, *numerators[0, j]], a, u[:, j]) for j in range(nu))[:, None]
    y = y + noise * rng.standard_normal(y.shape)
    return IOData(u, y, DT)[100:]


@cache
def identified(name, seed, window=0):
    """The estimate of a record, once for all examples of a test."""
    return EVERY[name][0](replace(record(seed), window=window))


def response(estimate):
    return estimate.model.frequency_response(F)


def assert_same(actual, expected, tolerance):
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_array_less(np.abs(actual - expected) / scale, tolerance)


@pytest.mark.slow
@each
@quick
@given(u=st.floats(-9.0, 9.0), y=st.floats(-9.0, 9.0), signs=st.sampled_from([(1, 1), (1, -1), (-1, 1)]))
def test_scaled_channels_scale_the_model(name, u, y, signs):
    identify, tolerance = EVERY[name]
    data = record(1)
    a, b = signs[0] * 10.0**u, signs[1] * 10.0**y
    plain, scaled = identified(name, 1), identify(replace(data, u=a * data.u, y=b * data.y))
    assert_same(response(scaled) * a / b, response(plain), tolerance)
    np.testing.assert_allclose(scaled.noise_variance / b**2, plain.noise_variance, rtol=tolerance)
    np.testing.assert_allclose(scaled.model.noise_response(F), plain.model.noise_response(F), rtol=20 * tolerance)
    np.testing.assert_allclose(scaled.model.poles(), plain.model.poles(), atol=tolerance)


@pytest.mark.slow
@each
@quick
@given(cut=st.integers(0, 30))
def test_the_clock_does_not_matter(name, cut):
    """Samples at the head of the initialisation window that nothing needs may stay or go, whatever they are."""
    identify, tolerance = EVERY[name]
    # The instruments of iv4, simulated from rest, need 30 samples of the window for themselves.
    data = replace(record(2), window=60 if name == "iv4" else 40)
    expected = response(identified(name, 2, data.window))
    assert_same(response(identify(data[cut:])), expected, tolerance)
    y = data.y.copy()
    y[:cut] += 100.0
    assert_same(response(identify(replace(data, y=y))), expected, tolerance)


@pytest.mark.slow
@each
@quick
@given(where=st.integers(150, 350))
def test_a_record_in_two_parts_is_one_record(name, where):
    """The equations lost at the cut move the model by a small part of its uncertainty; the order is arbitrary."""
    identify, tolerance = EVERY[name]
    data = record(3)
    whole = identified(name, 3)
    parts = identify([data[:where], data[where:]])
    assert_same(response(identify([data[where:], data[:where]])), response(parts), tolerance)
    uncertain = np.sqrt(np.einsum("f...ii->f...", sysid.arx(data, 2, 2).frequency_response(F).covariance))
    assert np.mean(np.abs(response(parts) - response(whole)) / uncertain) < (0.5 if name != "n4sid" else 1.0)


@pytest.mark.slow
@each
@quick
@given(where=st.integers(100, 400))
def test_without_noise_the_cut_costs_nothing(name, where):
    identify, _ = EVERY[name]
    data = record(4, noise=0.0)
    parts = identify([data[:where], data[where:]])
    z = np.exp(-2j * np.pi * DT * F)
    truth = np.polyval([0.5, 1, 0], z) / np.polyval([0.7, -1.5, 1], z)
    assert_same(response(parts)[:, 0, 0], truth, 1e-7)


@pytest.mark.parametrize("name", ["arx", "okid"])
@quick
@given(where=st.integers(100, 400))
def test_parts_that_overlap_by_their_windows_are_exactly_one_record(name, where):
    identify, tolerance = EVERY[name]
    data = record(5)
    first, second = data[:where], replace(data[where - 10 :], window=10)
    assert_same(response(identify([first, second])), response(identify(data)), tolerance)


@pytest.mark.slow
@each
def test_two_inputs_in_either_sequence(name):
    identify, tolerance = EVERY[name]
    data = record(6, nu=2)
    turned = data.select(inputs=[1, 0])
    assert_same(response(identify(turned))[:, :, ::-1], response(identify(data)), tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("name", SEVERAL)
@quick
@given(st.permutations(range(3)), st.permutations(range(2)))
def test_channels_in_any_sequence(name, outputs, inputs):
    identify, tolerance = SEVERAL[name]
    data = record(7, nu=2, ny=3)
    moved, plain = identify(data.select(inputs=inputs, outputs=outputs)), identify(data)
    assert_same(response(moved), response(plain)[:, outputs][:, :, inputs], tolerance)
    variance = plain.noise_variance[np.ix_(outputs, outputs)]
    np.testing.assert_allclose(moved.noise_variance, variance, rtol=tolerance, atol=1e-12)
    assert moved.model.output_names == tuple(plain.model.output_names[i] for i in outputs)


@quick
@given(u=st.floats(-9.0, 9.0), y=st.floats(-9.0, 9.0))
def test_scaled_channels_scale_what_has_no_model(u, y):
    data = record(8)
    a, b = 10.0**u, 10.0**y
    scaled = replace(data, u=a * data.u, y=b * data.y)
    for estimate in (sysid.spa, sysid.welch, lambda d: sysid.etfe(d, smoothing=5)):
        plain, other = estimate(data), estimate(scaled)
        np.testing.assert_allclose(other.response * a / b, plain.response, rtol=1e-9)
        np.testing.assert_allclose(other.covariance * (a / b) ** 2, plain.covariance, rtol=1e-7)
        np.testing.assert_allclose(other.coherence, plain.coherence, rtol=1e-9)
    np.testing.assert_allclose(sysid.cra(scaled).response * a / b, sysid.cra(data).response, rtol=1e-7, atol=1e-12)
    assert sysid.delayest(scaled).arx == sysid.delayest(data).arx
    grid = (range(1, 4), range(1, 4), range(3))
    assert sysid.selstruc(scaled, *grid).orders == sysid.selstruc(data, *grid).orders
    tested, plain_test = sysid.resid(sysid.arx(scaled, 1, 1), scaled), sysid.resid(sysid.arx(data, 1, 1), data)
    np.testing.assert_allclose(tested.whiteness_p, plain_test.whiteness_p, rtol=1e-6)
    np.testing.assert_allclose(tested.independence_p, plain_test.independence_p, rtol=1e-6, atol=1e-300)
