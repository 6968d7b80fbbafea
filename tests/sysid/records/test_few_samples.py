"""Orders beyond what a record allows, and records that hold nothing: one clear refusal, or a warning, never a crash."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import InitialConditions, IOData, SysidWarning
from tests.sysid.refusals import refused


@pytest.fixture(scope="module")
def whole():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    noise = lfilter([1.0, -0.5], [1.0, -1.5, 0.7], 0.1 * rng.standard_normal(400))
    return IOData(u, lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + noise, 0.1)


@pytest.mark.parametrize(("samples", "orders"), [(20, (1, 7)), (30, (1, 12)), (400, (2, 150))])
def test_denominators_beyond_the_data(whole, samples, orders):
    refused("too many orders", lambda: sysid.oe(whole[:samples], *orders))


def test_noise_models_beyond_the_data(whole):
    refused("too many orders", lambda: sysid.armax(whole[:20], 1, 1, 8))


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_inputs_that_reach_back_beyond_the_long_model(whole):
    assert np.isfinite(sysid.armax(whole[:22], 4, 5, 1, 2, initial_conditions=InitialConditions.ZERO).parameters).all()


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(("samples", "orders"), [(30, (1, 2, 2, 1)), (57, (5, 0, 2, 5))])
def test_backcasting_at_the_edge_of_stability(whole, samples, orders):
    found = sysid.bj(whole[:samples], *orders, initial_conditions=InitialConditions.BACKCAST, max_iterations=4)
    assert np.isfinite(found.parameters).all()


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_outputs_that_are_zero(whole, first):
    y = np.zeros(100)
    y[0] = first
    record = IOData(whole.u[:100], y, 0.1)
    start = sysid.arx(whole, 2, 2)
    for fit in (lambda: sysid.n4sid(record, 2), lambda: sysid.pem_ss(record, start)):
        refused("zero", fit)


def test_n4sid_whose_gain_no_machine_can_use():
    rng = np.random.default_rng(2)
    u = rng.standard_normal(200)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + rng.standard_normal(200)
    with pytest.warns(SysidWarning, match="made stable"):
        found = sysid.n4sid(IOData(u, y, 1.0), 6, block_rows=7)
    assert np.isfinite(found.parameters).all()
    assert found.model.input_path().is_stable()


@pytest.mark.parametrize("given", ["now", None, 2])
def test_pasts_that_are_none(whole, given):
    for fit in (
        lambda: sysid.oe(whole, 2, 2, initial_conditions=given),
        lambda: sysid.armax(whole, 2, 2, 1, initial_conditions=given),
        lambda: sysid.bj(whole, 2, 1, 1, 2, initial_conditions=given),
    ):
        refused("initial_conditions must be one of", fit)


def test_past_by_name(whole):
    part = whole[:60]
    by_name, named = (
        sysid.armax(part, 2, 2, 1, initial_conditions="zero"),
        sysid.armax(part, 2, 2, 1, initial_conditions=InitialConditions.ZERO),
    )
    assert np.array_equal(by_name.parameters, named.parameters)


@pytest.mark.parametrize("given", [0, -5, 2.5, "2", None, np.nan, True])
def test_iterations_that_are_none(whole, given):
    start = sysid.arx(whole, 2, 2)
    for fit in (
        lambda: sysid.oe(whole, 2, 2, max_iterations=given),
        lambda: sysid.armax(whole, 2, 2, 1, max_iterations=given),
        lambda: sysid.bj(whole, 2, 1, 1, 2, max_iterations=given),
        lambda: sysid.pem_ss(whole, start, max_iterations=given),
    ):
        refused("max_iterations", fit)


@pytest.mark.parametrize(
    "call",
    [
        lambda d: sysid.cra(d),
        lambda d: sysid.n4sid(d, 2),
        lambda d: sysid.pem_ss(d, two_inputs()),
        lambda d: sysid.rarx(d, 2, 2),
        lambda d: sysid.rarmax(d, 2, 2, 1),
        lambda d: sysid.roe(d, 2, 2),
        lambda d: sysid.selstruc(d, 2, 2),
        lambda d: sysid.delayest(d),
        lambda d: sysid.spa(d),
        lambda d: sysid.welch(d),
        lambda d: sysid.arx(d, 2, 2),
    ],
)
def test_inputs_that_are_equal(whole, call):
    both = IOData(np.column_stack((whole.u, whole.u)), whole.y, 0.1)
    with pytest.warns(SysidWarning, match=r"have rank \d+ together and \d+ one by one"):
        call(both)


def two_inputs():
    return sysid.StateSpace([[0.5]], [[1.0, 0.5]], [[1.0]], [[0.0, 0.0]], None, 0.1)


def test_independent_inputs_are_not_suspected(whole):
    rng = np.random.default_rng(1)
    both = IOData(np.column_stack((whole.u, 0.9 * whole.u[:, 0] + 0.1 * rng.standard_normal(400))), whole.y, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sysid.arx(both, 2, 2)
        sysid.n4sid(both, 2)


def test_a_response_that_inputs_do_not_determine_has_no_interval(whole):
    both = IOData(np.column_stack((whole.u, whole.u)), whole.y, 0.1)
    with pytest.warns(SysidWarning):
        found = sysid.cra(both)
    assert np.isinf(found.deviation).all()
    sinusoid = IOData(np.sin(0.3 * np.arange(400.0)), whole.y, 0.1)
    with pytest.warns(SysidWarning, match="persistently exciting"):
        found = sysid.cra(sinusoid)
    assert not np.isnan(found.deviation).any()


def test_a_pulse_that_the_window_loses(whole):
    u = np.zeros(400)
    u[0] = 1.0
    with pytest.warns(SysidWarning, match="at all 25 frequencies"):
        sysid.welch(IOData(u, whole.y, 0.1))


def test_too_few_samples_say_so(whole):
    short = IOData([1.0], [1.0], 0.1)
    for call in (lambda: sysid.spa(short), lambda: sysid.welch(short), lambda: sysid.order_of_excitation([1.0])):
        refused(r"too few samples|constant", call)
    refused("too few samples for order 2", lambda: sysid.n4sid(whole[:12], 2))
    refused("too few Markov", lambda: sysid.era_dc(np.ones(30), 2, lags=10_000))


def test_folds_beyond_the_record(whole):
    refused("folds must be", lambda: sysid.selstruc(whole, 2, 2, folds=10**6))
