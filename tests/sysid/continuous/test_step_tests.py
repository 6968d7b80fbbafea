"""Step tests: steps soon after the record begins, constant inputs from rest, models that contain one another."""

import itertools

import numpy as np
import pytest

from sysid import IOData, SysidWarning, armax, bj, oe, polyest, procest, tfest
from sysid.continuous.output_error_criterion import OutputError
from sysid.continuous.output_error_search import lowest_minimum
from sysid.continuous.structures import ProcessPath, RationalPath, enlarged
from tests.refusals import refused

GAIN, LAG, DELAY = 2.0, 9.4912, 10.0


def first_order(time):
    """Step response of GAIN exp(-DELAY s)/(1 + LAG s)."""
    return GAIN * (1.0 - np.exp(-np.clip(time - DELAY, 0.0, None) / LAG))


def step_test(step_at, *, input_before=0.0, level=0.0, noise=0.0, samples=300):
    """A step by one at a sample, in steady state before."""
    time = np.arange(samples, dtype=float)
    u = input_before + (time >= step_at)
    y = level + GAIN * input_before + first_order(time - step_at)
    return IOData(u, y + noise * np.random.default_rng(step_at).standard_normal(samples), 1.0)


@pytest.mark.parametrize("step_at", [1, 12, 40])
@pytest.mark.parametrize("offset", [False, True])
def test_a_step_before_the_longest_delay_shows_gain_lag_and_delay(step_at, offset):
    data = step_test(step_at, input_before=1.5, level=7.0 * offset)
    estimate = procest(data, "P1D", offset=offset)
    np.testing.assert_allclose(estimate.parameters, [GAIN, LAG, DELAY], rtol=1e-5)
    assert estimate.loss < 1e-12
    if step_at < 30:
        assert estimate.diagnostics["input_before"] == ("held",)
    transfer = tfest(data, 1, 0, delay=None, offset=offset)
    np.testing.assert_allclose(transfer.parameters, [GAIN / LAG, 1.0 / LAG, DELAY], rtol=1e-5)


@pytest.mark.slow
def test_delays_of_noisy_step_tests_are_within_their_intervals():
    distances = []
    for step_at in range(2, 26):
        estimate = procest(step_test(step_at, noise=0.05), "P1D", max_delay=40.0)
        deviations = np.sqrt(np.diag(estimate.covariance))
        distances.append(np.abs(estimate.parameters - [GAIN, LAG, DELAY]) / deviations)
    # a binomial(72, 0.95) number is below 61 with probability 0.002
    assert np.sum(np.array(distances) < 1.96) >= 61


def test_an_input_that_was_not_held_before_the_record_is_not_taken_as_held():
    long = step_test(40, samples=330)
    # the record begins between the step and its response: the input was not what it is at the first sample
    late = IOData(long.u[45:], long.y[45:], 1.0)
    moved = IOData(np.where(np.arange(285) > 6, 0.0, late.u[:, 0]), late.y, 1.0)
    with pytest.warns(SysidWarning):
        estimate = procest(moved, "P1D", max_delay=30.0)
    assert estimate.diagnostics["input_before"] == ("unknown",)


@pytest.mark.parametrize("rows", [0, 1, 50])
def test_a_constant_input_from_rest_is_a_step_at_the_first_sample(rows):
    time = np.arange(800.0)
    noise = 0.2 * np.random.default_rng(0).standard_normal(800 + rows)
    y = np.r_[np.zeros(rows), 50.0 * 0.62 * (1.0 - np.exp(-np.clip(time - 20.0, 0.0, None) / 168.0))] + noise
    data = IOData(np.r_[np.zeros(rows), np.full(800, 50.0)], y, 1.0)
    if rows:
        estimate = procest(data, "P1D", initial_conditions="zero")
    else:
        with pytest.warns(SysidWarning, match="is an assumption that this record cannot check"):
            estimate = procest(data, "P1D", initial_conditions="zero")
    deviations = np.sqrt(np.diag(estimate.covariance))
    assert (np.abs(estimate.parameters - [0.62, 168.0, 20.0]) < 4.0 * deviations).all()
    np.testing.assert_allclose(estimate.parameters, [0.62, 168.0, 20.0], rtol=0.05)


@pytest.mark.filterwarnings("ignore:input u1 is constant")
def test_polynomial_models_of_a_constant_input_from_rest():
    u = np.full(400, 3.0)
    # 0.2/(q^2 - 1.5 q + 0.56), by its step response
    y = np.zeros(400)
    for t in range(2, 400):
        y[t] = 1.5 * y[t - 1] - 0.56 * y[t - 2] + 0.6
    y[1] = 0.0
    data = IOData(u, y, 1.0)
    for estimate in (
        oe(data, 1, 2, 2, initial_conditions="zero"),
        armax(data, 2, 1, 1, 2, initial_conditions="zero"),
        bj(data, 1, 1, 1, 2, 2, initial_conditions="zero"),
        polyest(data, 0, 1, 0, 0, 2, 2, initial_conditions="zero"),
    ):
        assert estimate.dc_gain() == pytest.approx(0.2 / 0.06, rel=1e-6)
        np.testing.assert_allclose(np.sort(estimate.poles()), [0.7, 0.8], rtol=1e-5)
    refused("constant .3., which identifies nothing.*initial_conditions='zero'", oe, data, 1, 2, 2)
    refused("constant .0., which identifies nothing; expected a varying input$", oe, IOData(0 * u, y, 1.0), 1, 2)


def test_smaller_models_are_part_of_larger_ones():
    for structure in (ProcessPath("P3DZ"), ProcessPath("P2DZIU"), ProcessPath("P2DU"), RationalPath(3, 2, None)):
        smaller = structure.smaller()
        theta = np.linspace(2.0, 1.2, len(smaller.names))
        path = smaller.transfer(theta)
        larger = structure.transfer(enlarged(structure, path, 1e-3))
        s = 2j * np.pi * np.array([0.01, 0.1, 0.5])

        def response(path, s=s):
            return np.polyval(path.b[::-1], s) / np.polyval(path.a[::-1], s) * np.exp(-s * path.delay)

        np.testing.assert_allclose(response(larger), response(path), rtol=1e-3)
    assert ProcessPath("P0D").smaller() is None
    assert RationalPath(1, 0).smaller() is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_larger_model_is_never_worse(seed):
    data = step_test(5 + seed, noise=0.2)
    costs = []
    for kind in ("P1D", "P2D", "P2DZ"):
        criterion = OutputError([data], [ProcessPath(kind)], 15.0, True, offset=True, held=True)
        costs.append(lowest_minimum(criterion, 100).minimum.at.cost)
    # a pole of 0.03 samples stands for none
    assert all(larger <= smaller * (1.0 + 1e-4) for smaller, larger in itertools.pairwise(costs))
