"""Arguments and data of the wrong kind are refused with one clear error; records stay locked."""

import contextlib
import copy
import pickle

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, StateSpace, SysidError
from sysid.records.arguments import real_number, whole_number
from tests.sysid.refusals import refused


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    return IOData(u, np.convolve(u, [0.0, 0.5, 0.3])[:300] + 0.01 * rng.standard_normal(300), 0.02)


@pytest.fixture(scope="module")
def estimate(data):
    return sysid.arx(data, 2, 2)


MODEL = StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.02)


@pytest.mark.parametrize("value", [2.5, "2", None, True, np.nan, [2], -1, 10**400, np.array([2])])
def test_what_is_no_whole_number(value):
    refused("n must be a whole number from 0 to 9", lambda: whole_number("n", value, 0, 9))


@pytest.mark.parametrize("value", ["2", None, True, np.nan, [0.5], 10**400, 1j, b"1"])
def test_what_is_no_number(value):
    refused("x must be positive", lambda: real_number("x", value, "be positive", lambda x: 0.0 < x < np.inf))


def test_numbers_of_any_kind():
    assert whole_number("n", np.array(2), 0) == whole_number("n", np.int8(2), 0) == 2
    assert real_number("x", np.float32(0.5), "be positive", lambda x: x > 0.0) == 0.5


@pytest.mark.parametrize(
    "call",
    [
        lambda d, e: sysid.residuals(e, [d]),
        lambda d, e: sysid.resample([d], 2),
        lambda d, e: sysid.resample(MODEL, 2),
        lambda d, e: sysid.keep_band([d], 0.0, 2.0),
        lambda d, e: sysid.prefilter([d], [1.0]),
        lambda d, e: sysid.identifiability(MODEL),
        lambda d, e: sysid.band(MODEL, StateSpace.dc_gain),
        lambda d, e: sysid.models.sampled_band(MODEL, StateSpace.dc_gain, np.random.default_rng(0)),
        lambda d, e: sysid.models.sampled_band(e, StateSpace.dc_gain, 3),
        lambda d, e: sysid.models.poles_band(MODEL),
        lambda d, e: sysid.models.zeros_band(MODEL),
        lambda d, e: sysid.models.innovations_form(MODEL, 0.02),
        lambda d, e: sysid.models.innovations_form(e.polynomials, 0.02, -1.0),
        lambda d, e: sysid.okid(d, 2, p=10, block_rows=2.5),
        lambda d, e: sysid.okid(d, 2, p=10, block_rows=10**6),
        lambda d, e: sysid.selstruc(d, 2.5, 2),
        lambda d, e: sysid.selstruc(d, 2, None),
        lambda d, e: sysid.era(np.ones(30), 1, block_rows=2.0),
        lambda d, e: sysid.order_of_excitation(d.u, max_order=2.0),
        lambda d, e: sysid.order_of_excitation(d.u, tolerance="small"),
        lambda d, e: sysid.order_of_excitation(d.u, tolerance=np.nan),
        lambda d, e: sysid.order_of_excitation(d),
        lambda d, e: sysid.resid(e, d, level="2"),
        lambda d, e: sysid.cra(d, level=None),
        lambda d, e: sysid.delayest(d, level="2"),
        lambda d, e: sysid.welch(d, overlap="2"),
        lambda d, e: sysid.welch(d, window="hann"),
        lambda d, e: sysid.spa(d, window="hann"),
        lambda d, e: sysid.bla(d, 50, audible=None),
        lambda d, e: sysid.keep_band(d, low_hz="2"),
        lambda d, e: sysid.recursive.Forgetting("2"),
        lambda d, e: sysid.recursive.Gradient(None),
        lambda d, e: sysid.recursive.Kalman(1.0, "2"),
        lambda d, e: sysid.recursive.Kalman([[1.0, 2.0], [0.0, 1.0]]),
        lambda d, e: sysid.recursive.Kalman([[1.0, 2.0], [2.0, 1.0]]),
        lambda d, e: sysid.rarx(d, 2, 2, adaptation=3),
        lambda d, e: sysid.rarx(d, 2, 2, adaptation=0.99),
        lambda d, e: sysid.rarx(d, 2, 2, adaptation=sysid.recursive.Forgetting),
        lambda d, e: MODEL.minimal("2"),
        lambda d, e: MODEL.markov(True),
        lambda d, e: sysid.read_csv(3),
        lambda d, e: sysid.simulate(MODEL, d),
        lambda d, e: IOData([[1.0, 2.0], [3.0]], d.y, 0.02),
        lambda d, e: IOData(d.u, d.y, 10**400),
        lambda d, e: IOData(d.u, d.y, 0.02, missing="no"),
        lambda d, e: d.detrend(1.0),
        lambda d, e: sysid.oe(d, 2, 2, coloured="2"),
        lambda d, e: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.02, [[-1.0]]),
        lambda d, e: sysid.models.zero_pole_gain.ZeroPoleGain([], [0.5], np.nan, 0.1),
        lambda d, e: sysid.models.zero_pole_gain.ZeroPoleGain([], [0.5], 1.0, "now"),
        lambda d, e: sysid.models.zero_pole_gain.ZeroPoleGain(["a"], [0.5], 1.0, 0.1),
        lambda d, e: sysid.models.zero_pole_gain.ZeroPoleGain([np.nan], [0.5], 1.0, 0.1),
        lambda d, e: IOData(d.u, d.y, 0.02, input_names=5),
        lambda d, e: d[1.5:3],
        lambda d, e: sysid.spa(d, frequencies=[]),
        lambda d, e: MODEL.frequency_response(np.ones((2, 2))),
        lambda d, e: MODEL.markov(1.5),
        lambda d, e: StateSpace.from_control(3),
        lambda d, e: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, None),
    ],
)
def test_wrong_kinds(data, estimate, call):
    with pytest.raises(SysidError):
        call(data, estimate)


@pytest.mark.parametrize("shortest", ["a", np.nan, 2.5])
def test_shortest_parts(data, shortest):
    y = data.y.copy()
    y[20] = np.nan
    refused("shortest must be", lambda: IOData(data.u, y, 0.02, missing=True).complete_parts(shortest=shortest))


def test_channels_by_numpy_numbers(data):
    assert data.select(inputs=np.int64(0)).nu == 1
    refused("no input", lambda: data.select(inputs=np.int64(1)))


def test_the_variance_of_an_estimate_makes_its_model(estimate):
    found = sysid.models.innovations_form(estimate.polynomials, 0.02, estimate.noise_variance)
    assert np.array_equal(found.innovation_covariance, estimate.model.innovation_covariance)


@pytest.mark.parametrize("carry", [lambda e: e, copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
def test_what_an_estimate_says_of_itself_stays(data, carry):
    found = carry(sysid.okid(data, 2, p=5))
    for mapping in (found.diagnostics, found.orders):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["p"] = 3
    with pytest.raises(ValueError, match="read-only"):
        found.diagnostics["system_markov"][...] = 0.0


@pytest.mark.parametrize("carry", [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
def test_every_record_stays_locked(data, estimate, carry):
    band = sysid.band(estimate, StateSpace.dc_gain)
    pairs = [
        (data, "u"),
        (estimate.model, "A"),
        (estimate, "parameters"),
        (estimate.polynomials, "B"),
        (band, "value"),
        (sysid.models.poles_band(estimate), "roots"),
        (sysid.cra(data), "response"),
        (sysid.covf(data), "values"),
        (sysid.delayest(data), "bound"),
        (sysid.selstruc(data, 2, 2), "loss"),
        (sysid.identifiability(estimate), "weakest"),
        (sysid.zero_pole_gain(estimate), "poles"),
        (sysid.recursive.Kalman([1.0, 2.0]), "R1"),
        (sysid.cross_validate(lambda parts: sysid.arx(parts, 2, 2), data), "simulation"),
        (sysid.rarx(data, 2, 2), "P"),
    ]
    for record, name in pairs:
        with pytest.raises(ValueError, match="read-only"):
            getattr(carry(record), name)[...] = 0.0
    for record in (band, estimate.bandwidth()):
        with pytest.raises(ValueError, match="read-only"):
            carry(record).ci95[0][...] = 0.0


@pytest.mark.parametrize("estimator", [sysid.arx, sysid.oe])
@pytest.mark.parametrize("orders", [(2.5, 1), (1, None), ("2", 1), (1, 1, 1.0), (1, 1, 300), (-1, 1)])
def test_wrong_orders(data, estimator, orders):
    with pytest.raises(SysidError):
        estimator(data, *orders)


def test_wrong_data(data, estimate):
    for wrong in (None, 3, "data", np.zeros((10, 2))):
        refused("IOData", sysid.oe, wrong, 1, 1)
    for scale in (1e160, 1e-200):
        refused("change the unit", IOData, scale * data.u, data.y, data.dt)
    refused("masked", IOData, np.ma.masked_greater(data.u, 1.0), data.y, data.dt)
    refused("constant", sysid.compare, estimate, IOData(data.u, np.full(300, 0.3), data.dt))


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("samples", [20, 40, 80])
def test_long_delays_of_short_records(samples):
    u, y = np.random.default_rng(samples).standard_normal((2, samples))
    for nk in range(0, samples, 3):
        for fit in (lambda r, k: sysid.oe(r, 1, 1, k, max_iterations=5), lambda r, k: sysid.armax(r, 1, 1, 1, k)):
            with contextlib.suppress(SysidError):
                assert np.isfinite(fit(IOData(u, y, 1.0), nk).parameters).all()


def test_unstable_models_are_reported(data):
    y = lfilter([0.0, 1.0], [1.0, -1.3], data.u[:60, 0])
    with pytest.warns(sysid.SysidWarning, match="not stable"):
        estimate = sysid.arx(IOData(data.u[:60], y, 0.02), 1, 1)
    assert any("not stable" in text for text in estimate.diagnostics["warnings"])
