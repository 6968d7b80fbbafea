import contextlib
import copy
import pickle
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import InitialConditions, IOData, StateSpace, SysidError, SysidWarning
from sysid.models.zero_pole_gain import ZeroPoleGain
from sysid.records.arguments import real_number, whole_number
from tests.refusals import refused
from tests.sysid.systems import second_order

DATA = second_order(0, 300, noise=0.1, c=[1.0, -0.5])
MODEL = StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.1)
TWO_INPUTS = StateSpace([[0.5]], [[1.0, 0.5]], [[1.0]], [[0.0, 0.0]], None, 0.1)
EQUAL = IOData(np.column_stack((DATA.u, DATA.u)), DATA.y, 0.1)
COPIES = {"itself": lambda e: e, "deep copy": copy.deepcopy, "pickle": lambda e: pickle.loads(pickle.dumps(e))}
SEARCHES = [
    lambda **options: sysid.oe(DATA, 2, 2, **options),
    lambda **options: sysid.armax(DATA, 2, 2, 1, **options),
    lambda **options: sysid.bj(DATA, 2, 1, 1, 2, **options),
    lambda **options: sysid.pem_ss(DATA, MODEL, **options),
]


@pytest.fixture(scope="module")
def estimate():
    return sysid.arx(DATA, 2, 2)


@pytest.mark.parametrize("value", [2.5, "2", None, True, np.nan, [2], -1, 10**400, np.array([2])])
def test_what_is_no_whole_number(value):
    refused("n must be a whole number from 0 to 9", whole_number, "n", value, 0, 9)


@pytest.mark.parametrize("value", ["2", None, True, np.nan, [0.5], 10**400, 1j, b"1"])
def test_what_is_no_number(value):
    refused("x must be positive", real_number, "x", value, "be positive", lambda x: 0.0 < x < np.inf)


def test_numbers_of_any_kind():
    assert whole_number("n", np.array(2), 0) == whole_number("n", np.int8(2), 0) == 2
    assert real_number("x", np.float32(0.5), "be positive", lambda x: x > 0.0) == 0.5
    assert DATA.select(inputs=np.int64(0)).nu == 1
    refused("no input", lambda: DATA.select(inputs=np.int64(1)))


@pytest.mark.parametrize(
    "call",
    [
        lambda d, e: sysid.residuals(e, [d]),
        lambda d, e: sysid.resample([d], 2),
        lambda d, e: sysid.keep_band([d], 0.0, 2.0),
        lambda d, e: sysid.prefilter([d], [1.0]),
        lambda d, e: sysid.identifiability(MODEL),
        lambda d, e: sysid.models.sampled_band(MODEL, StateSpace.dc_gain, np.random.default_rng(0)),
        lambda d, e: sysid.models.sampled_band(e, StateSpace.dc_gain, 3),
        lambda d, e: sysid.models.poles_band(MODEL),
        lambda d, e: sysid.models.innovations_form(e.polynomials, 0.02, -1.0),
        lambda d, e: sysid.okid(d, 2, p=10, block_rows=2.5),
        lambda d, e: sysid.selstruc(d, 2.5, 2),
        lambda d, e: sysid.era(np.ones(30), 1, block_rows=2.0),
        lambda d, e: sysid.order_of_excitation(d.u, tolerance="small"),
        lambda d, e: sysid.order_of_excitation(d),
        lambda d, e: sysid.resid(e, d, level="2"),
        lambda d, e: sysid.cra(d, level=None),
        lambda d, e: sysid.delayest(d, level="2"),
        lambda d, e: sysid.welch(d, overlap="2"),
        lambda d, e: sysid.spa(d, window="hann"),
        lambda d, e: sysid.bla(d, 50, audible=None),
        lambda d, e: sysid.keep_band(d, low_hz="2"),
        lambda d, e: sysid.recursive.Forgetting("2"),
        lambda d, e: sysid.recursive.DirectionalForgetting("2"),
        lambda d, e: sysid.recursive.Gradient(None),
        lambda d, e: sysid.recursive.Kalman(1.0, "2"),
        lambda d, e: sysid.recursive.Kalman([[1.0, 2.0], [2.0, 1.0]]),
        lambda d, e: sysid.rarx(d, 2, 2, adaptation=sysid.recursive.Forgetting),
        lambda d, e: MODEL.minimal("2"),
        lambda d, e: MODEL.frequency_response(np.ones((2, 2))),
        lambda d, e: sysid.read_csv(3),
        lambda d, e: IOData([[1.0, 2.0], [3.0]], d.y, 0.02),
        lambda d, e: IOData(d.u, d.y, 10**400),
        lambda d, e: IOData(d.u, d.y, 0.02, missing="no"),
        lambda d, e: IOData(d.u, d.y, 0.02, input_names=5),
        lambda d, e: d.detrend(1.0),
        lambda d, e: d[1.5:3],
        lambda d, e: sysid.oe(d, 2, 2, coloured="2"),
        lambda d, e: sysid.spa(d, frequencies=[]),
        lambda d, e: ZeroPoleGain([], [0.5], np.nan, 0.1),
        lambda d, e: ZeroPoleGain([], [0.5], 1.0, "now"),
        lambda d, e: ZeroPoleGain([np.nan], [0.5], 1.0, 0.1),
        lambda d, e: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.02, [[-1.0]]),
        lambda d, e: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, None),
        lambda d, e: StateSpace.from_control(3),
    ],
)
def test_wrong_kinds(estimate, call):
    refused(".", call, DATA, estimate)


@pytest.mark.parametrize("estimator", [sysid.arx, sysid.oe])
@pytest.mark.parametrize("orders", [(2.5, 1), (1, None), ("2", 1), (1, 1, 1.0), (1, 1, 300), (-1, 1)])
def test_wrong_orders(estimator, orders):
    refused(".", estimator, DATA, *orders)


def test_wrong_data(estimate):
    for wrong in (None, 3, "data", np.zeros((10, 2))):
        refused("IOData", sysid.oe, wrong, 1, 1)
    for scale in (1e160, 1e-200):
        refused("change the unit", IOData, scale * DATA.u, DATA.y, DATA.dt)
    refused("masked", IOData, np.ma.masked_greater(DATA.u, 1.0), DATA.y, DATA.dt)
    refused("constant", sysid.compare, estimate, IOData(DATA.u, np.full(300, 0.3), DATA.dt))


@pytest.mark.parametrize("fit", SEARCHES)
def test_iterations_that_are_none(fit):
    for iterations in (0, -5, 2.5, "2", None, np.nan, True):
        refused("max_iterations", partial(fit, max_iterations=iterations))


@pytest.mark.parametrize("fit", SEARCHES[:3])
def test_pasts_that_are_none_and_pasts_by_name(fit):
    for past in ("now", None, 2):
        refused("initial_conditions must be one of", partial(fit, initial_conditions=past))
    by_name, named = fit(initial_conditions="zero"), fit(initial_conditions=InitialConditions.ZERO)
    assert np.array_equal(by_name.parameters, named.parameters)


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("too many orders", lambda: sysid.oe(DATA[:20], 1, 7)),
        ("too many orders", lambda: sysid.oe(DATA, 2, 110)),
        ("too many orders", lambda: sysid.armax(DATA[:20], 1, 1, 8)),
        ("too many orders for the data", lambda: sysid.bj(DATA[:20], 4, 4, 4, 4)),
        ("too many orders for the data", lambda: sysid.iv4(DATA[:20], 8, 8)),
        ("too few samples for order 2", lambda: sysid.n4sid(DATA[:12], 2)),
        ("too few Markov", lambda: sysid.era_dc(np.ones(30), 2, lags=10_000)),
        (r"too few samples|constant", lambda: sysid.spa(IOData([1.0], [1.0], 0.1))),
        (r"too few samples|constant", lambda: sysid.welch(IOData([1.0], [1.0], 0.1))),
        (r"too few samples|constant", lambda: sysid.order_of_excitation([1.0])),
        ("folds must be", lambda: sysid.selstruc(DATA, 2, 2, folds=10**6)),
        ("zero", lambda: sysid.n4sid(IOData(DATA.u, np.zeros(300), 0.1), 2)),
        ("zero", lambda: sysid.n4sid(IOData(DATA.u, np.eye(300)[0], 0.1), 2)),
        ("zero", lambda: sysid.pem_ss(IOData(DATA.u, np.zeros(300), 0.1), sysid.arx(DATA, 2, 2))),
        ("zero", lambda: sysid.pem_ss(IOData(DATA.u, np.eye(300)[0], 0.1), sysid.arx(DATA, 2, 2))),
    ],
)
def test_records_that_hold_too_little(message, call):
    refused(message, call)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(
    "fit",
    [
        # inputs that reach back beyond the long model, and backcasting at the edge of stability
        lambda: sysid.armax(DATA[:22], 4, 5, 1, 2, initial_conditions="zero"),
        lambda: sysid.bj(DATA[:30], 1, 2, 2, 1, initial_conditions="backcast", max_iterations=4),
        lambda: sysid.bj(DATA[:57], 5, 0, 2, 5, initial_conditions="backcast", max_iterations=4),
    ],
)
def test_fits_of_short_records_stay_finite(fit):
    assert np.isfinite(fit().parameters).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("samples", [20, 40, 80])
def test_long_delays_of_short_records(samples):
    u, y = np.random.default_rng(samples).standard_normal((2, samples))
    for nk in range(0, samples, 3):
        for fit in (lambda r, k: sysid.oe(r, 1, 1, k, max_iterations=5), lambda r, k: sysid.armax(r, 1, 1, 1, k)):
            with contextlib.suppress(SysidError):
                assert np.isfinite(fit(IOData(u, y, 1.0), nk).parameters).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        sysid.cra,
        sysid.delayest,
        sysid.spa,
        sysid.welch,
        lambda d: sysid.n4sid(d, 2),
        lambda d: sysid.pem_ss(d, TWO_INPUTS),
        lambda d: sysid.rarx(d, 2, 2),
        lambda d: sysid.rarmax(d, 2, 2, 1),
        lambda d: sysid.roe(d, 2, 2),
        lambda d: sysid.selstruc(d, 2, 2),
        lambda d: sysid.arx(d, 2, 2),
    ],
)
def test_inputs_that_are_equal(call):
    with pytest.warns(SysidWarning, match=r"have rank \d+ together and \d+ one by one"):
        call(EQUAL)


def test_independent_inputs_are_not_suspected():
    second = 0.9 * DATA.u[:, 0] + 0.1 * np.random.default_rng(1).standard_normal(300)
    both = IOData(np.column_stack((DATA.u, second)), DATA.y, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sysid.arx(both, 2, 2)
        sysid.n4sid(both, 2)


def test_a_response_that_inputs_do_not_determine_has_no_interval():
    with pytest.warns(SysidWarning):
        assert np.isinf(sysid.cra(EQUAL).deviation).all()
    with pytest.warns(SysidWarning, match="persistently exciting"):
        analysis = sysid.cra(IOData(np.sin(0.3 * np.arange(300.0)), DATA.y, 0.1))
    assert not np.isnan(analysis.deviation).any()
    with pytest.warns(SysidWarning, match=r"at all \d+ frequencies"):
        sysid.welch(IOData(np.eye(300)[0], DATA.y, 0.1))  # the window loses the pulse


def test_n4sid_whose_gain_no_machine_can_use():
    with pytest.warns(SysidWarning, match="made stable"):
        estimate = sysid.n4sid(second_order(2, 200, d=[1.0]), 6, block_rows=7)
    assert np.isfinite(estimate.parameters).all()
    assert estimate.model.input_path().is_stable()


def test_unstable_models_are_reported():
    y = lfilter([0.0, 1.0], [1.0, -1.3], DATA.u[:60, 0])
    with pytest.warns(SysidWarning, match="not stable"):
        estimate = sysid.arx(IOData(DATA.u[:60], y, 0.1), 1, 1)
    assert any("not stable" in text for text in estimate.diagnostics["warnings"])


@pytest.mark.parametrize("carry", COPIES.values(), ids=COPIES)
def test_diagnostics_stay_locked(carry):
    estimate = carry(sysid.okid(DATA, 2, p=5))
    for mapping in (estimate.diagnostics, estimate.orders):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["p"] = 3
    with pytest.raises(ValueError, match="read-only"):
        estimate.diagnostics["system_markov"][...] = 0.0


@pytest.mark.parametrize("carry", COPIES.values(), ids=COPIES)
def test_every_record_stays_locked(estimate, carry):
    band = sysid.band(estimate, StateSpace.dc_gain)
    pairs = [
        (DATA, "u"),
        (estimate.model, "A"),
        (estimate, "parameters"),
        (estimate.polynomials, "B"),
        (band, "value"),
        (sysid.models.poles_band(estimate), "roots"),
        (sysid.cra(DATA), "response"),
        (sysid.covf(DATA), "values"),
        (sysid.delayest(DATA), "bound"),
        (sysid.selstruc(DATA, 2, 2), "loss"),
        (sysid.identifiability(estimate), "weakest"),
        (sysid.zero_pole_gain(estimate), "poles"),
        (sysid.recursive.Kalman([1.0, 2.0]), "R1"),
        (sysid.cross_validate(lambda parts: sysid.arx(parts, 2, 2), DATA), "simulation"),
        (sysid.rarx(DATA, 2, 2), "P"),
    ]
    arrays = [getattr(carry(record), name) for record, name in pairs]
    arrays += [carry(record).ci95[0] for record in (band, estimate.bandwidth())]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_habits_of_matlab_are_met_with_the_expected_call(tmp_path):
    data = second_order()
    model = sysid.pem_ss(data, 2)
    assert model.model.order == 2
    refused(r"expected oe\(data, nb, nf, nk\), got \[2, 2, 4\]", sysid.oe, data, [2, 2, 4])
    refused(r"expected armax\(data, na, nb, nc, nk\)", sysid.armax, data, np.array([2, 2, 2, 1]))
    for function in (sysid.arx, sysid.iv4):
        refused(r"expected \w+\(data, na, nb, nk\), got \[2, 2, 1\]", function, data, [2, 2, 1])
    refused(r"expected bj\(data, nb, nc, nd, nf, nk\)", sysid.bj, data, [2, 1, 1, 2, 1])
    refused(r"expected arma\(data, na, nc\)", sysid.arma, data, [2, 1])
    refused(r"IOData\(u, y\) given without dt, expected .* in s", sysid.IOData, data.u, data.y)
    for function in (sysid.resid, sysid.compare):
        refused("got IOData: the model comes first", function, data, model)
    refused("there is no folder", sysid.write_model, model, tmp_path / "none" / "model.json")
    refused("input and output names: names must differ", replace, data, input_names=("x",), output_names=("x",))
    with pytest.warns(sysid.SysidWarning, match=r"900 Hz, above Nyquist \(5 Hz\)"):
        model.frequency_response([900.0])


def test_an_output_that_is_constant_or_one_sample_long_is_refused():
    data = second_order()
    for fit in (lambda d: sysid.arx(d, 1, 1), lambda d: sysid.oe(d, 1, 1), sysid.delayest, lambda d: sysid.n4sid(d, 1)):
        refused("output y1 is constant", fit, IOData(data.u, np.full(400, 3.7), 0.1))
    refused("of 1 sample, at least 2", sysid.oe, data[:1], 1, 1)
