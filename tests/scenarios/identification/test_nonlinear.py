"""Nonlinear models: exact recovery where the class holds the truth, exact sensitivities, equal bits, clear refusals."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.identification.hammerstein_loop import hammerstein_loop, simulate_loop
from scenarios.identification.methods import METHODS
from scenarios.identification.narx import forward_regression, narx
from scenarios.identification.neural_state_space import neural_ss, simulate_neural
from sysid import IOData
from tests.refusals import refused

DT, WINDOW = 0.02, 50


def excitation(seed, samples=600, width=1.0):
    """Filtered noise: a command that moves slowly, as those of the arm do."""
    noise = np.random.default_rng(seed).standard_normal(samples + 5)
    return width * np.convolve(noise, np.ones(5) / 5.0, mode="valid")[:samples]


def record(u, y, window=0):
    return IOData(u, y, DT, window=window)


def polynomial_record(seed, window=0):
    """y(t) = 0.7 u(t-1) - 0.4 y(t-2) + 0.3 u(t-1) y(t-1) + 0.2 u(t-2)^2, without noise."""
    # White: where regressors resemble each other, forward regression may choose the wrong one first.
    u = np.random.default_rng(seed).uniform(-1.0, 1.0, 600)
    y = np.zeros(len(u))
    for t in range(2, len(u)):
        y[t] = 0.7 * u[t - 1] - 0.4 * y[t - 2] + 0.3 * u[t - 1] * y[t - 1] + 0.2 * u[t - 2] ** 2
    return record(u, y, window)


def loop_record(seed, zone, delay=0):
    u = excitation(seed, width=0.1)
    z, _ = simulate_loop(np.array([0.05, 0.02]), np.array([-1.7, 0.7]), zone, u, 0.0)
    return record(u + 0.3, np.concatenate([np.zeros(delay), z])[: len(z)] + 0.5)


def wave_record(seed, strength, window=0):
    """A second-order system whose input passes u + strength tanh(3 u)."""
    u = excitation(seed)
    x, y = np.zeros(2), np.zeros(len(u))
    for t, value in enumerate(u):
        y[t] = x[0]
        x = np.array([1.5 * x[0] + x[1], -0.6 * x[0] + 0.1 * value + strength * np.tanh(3.0 * value)])
    return record(u, y, window)


def error(model, data):
    """Root mean square simulation error over the spread of the output, behind the window."""
    w = data.window
    difference = (model.predicted(data, 0) - data.y)[w:]
    return float(np.sqrt(np.mean(difference**2)) / data.y[w:].std())


def slopes_by_differences(output, values, step=1e-6):
    columns = []
    for i in range(len(values)):
        up, down = values.copy(), values.copy()
        up[i] += step
        down[i] -= step
        columns.append((output(up) - output(down)) / (2.0 * step))
    return np.stack(columns, axis=1)


def test_narx_finds_the_terms_and_coefficients_of_a_polynomial_difference_equation():
    model = narx([polynomial_record(1), polynomial_record(2)], 3, 3, 1, 2)
    # In scaled signals about their means the terms are those of the equation and, by shifting, lower ones.
    assert error(model, polynomial_record(3, WINDOW)) < 1e-7
    # Without a shift they are the equation's alone: of the table of monomials the four are chosen.
    data = polynomial_record(1)
    y, u = data.y[:, 0], data.u[:, 0]
    lags = np.stack([y[1:-1], y[:-2], u[1:-1], u[:-2]], axis=1)
    pairs = [(i, j) for i in range(4) for j in range(i, 4)]
    table = np.column_stack([np.ones(len(lags)), lags, *(lags[:, i] * lags[:, j] for i, j in pairs), y[2:]])
    terms, ratios = forward_regression(table, len(table))
    expected = {2: -0.4, 3: 0.7, 5 + pairs.index((0, 2)): 0.3, 5 + pairs.index((3, 3)): 0.2}
    assert set(terms[ratios > 1e-12]) == set(expected)
    assert ratios.sum() == pytest.approx(1.0, abs=1e-9)
    solution = np.linalg.lstsq(table[:, sorted(expected)], table[:, -1], rcond=None)[0]
    assert solution == pytest.approx([expected[term] for term in sorted(expected)], abs=1e-9)


def test_narx_predicts_steps_ahead_from_what_is_known_then():
    model = narx([polynomial_record(1)], 2, 2, 1, 2)
    data = polynomial_record(4, WINDOW)
    disturbed = replace(data, y=np.where(np.arange(len(data)) < 300, data.y[:, 0], data.y[:, 0] + 1.0))
    one, five, simulated = (model.predicted(disturbed, steps)[:, 0] for steps in (1, 5, 0))
    # Behind the step of the outputs a prediction follows once the horizon reaches there, a simulation never.
    assert np.abs(one - simulated)[:301].max() < 1e-6
    assert abs(one - simulated)[301] > 1e-3
    assert np.abs(five - simulated)[:305].max() < 1e-6
    assert abs(five - simulated)[305] > 1e-3
    assert np.abs(model.predicted(data, 10**6) - model.predicted(data, 0)).max() == 0.0


def test_narx_that_diverges_says_so():
    model = narx([polynomial_record(1)], 2, 2, 1, 2)
    wild = replace(model, coefficients=30.0 * model.coefficients)
    refused("narx:2/2/1/2 diverges on the record: from sample", wild.predicted, polynomial_record(4, WINDOW), 0)


def test_narx_refuses_orders_that_make_too_many_terms():
    refused("candidate terms of 1 input", narx, [polynomial_record(1)], 20, 20, 1, 3)
    refused("no sample behind 700 lags", narx, [polynomial_record(1)], 1, 1, 700, 1)


@pytest.mark.parametrize(
    "delay", [pytest.param(0, marks=pytest.mark.thorough), pytest.param(2, marks=pytest.mark.slow)]
)
def test_the_loop_with_its_dead_zone_is_recovered(delay):
    zone = 0.01
    parts = [loop_record(seed, zone, delay) for seed in (1, 2)]
    model = hammerstein_loop(parts, 2, 2, 1 + delay, widths=(zone, zone), width=zone)
    assert model.theta == pytest.approx([0.05, 0.02, -1.7, 0.7], abs=1e-6)
    test = replace(loop_record(3, zone, delay), window=WINDOW)
    assert error(model, test) < 1e-6
    # A wrong dead zone, and none, do not describe it.
    for wrong in (0.0, 2.0 * zone):
        assert error(hammerstein_loop(parts, 2, 2, 1 + delay, widths=(wrong, wrong), width=wrong), test) > 1e-2


def test_records_of_arms_with_other_dead_zones_share_a_loop():
    model = hammerstein_loop([loop_record(1, 0.01), loop_record(2, 0.02)], 2, 2, 1, widths=(0.01, 0.02), width=0.005)
    assert error(model, replace(loop_record(3, 0.005), window=WINDOW)) < 1e-6


def test_sensitivities_of_the_loop_are_those_of_finite_differences():
    u = excitation(5, 60, 0.1)
    theta = np.array([0.05, 0.02, -1.7, 0.7, 0.01])

    def angle(values):
        return simulate_loop(values[:2], values[2:4], 0.01, u, values[4])[0]

    exact = simulate_loop(theta[:2], theta[2:4], 0.01, u, theta[4])[1]
    assert exact == pytest.approx(slopes_by_differences(angle, theta), abs=1e-6)


@pytest.mark.slow
def test_sensitivities_of_the_neural_model_are_those_of_finite_differences():
    rng = np.random.default_rng(0)
    shapes = ((2, 2), (2, 3), (2,), (1,), (2, 4), (4, 5), (4,), (2,))
    blocks = [0.4 * rng.standard_normal(shape) for shape in shapes]
    cuts = np.cumsum([block.size for block in blocks])[:-1]
    inputs = rng.standard_normal((40, 3))

    def run(values):
        A, B, C, level, W, V, b, x0 = (a.reshape(s) for a, s in zip(np.split(values, cuts), shapes, strict=True))
        return simulate_neural(A, B, C, float(level[0]), W, V, b, x0, inputs)

    values = np.concatenate([block.ravel() for block in blocks])
    assert run(values)[1] == pytest.approx(slopes_by_differences(lambda v: run(v)[0], values), abs=1e-7)


@pytest.mark.thorough
def test_a_neural_model_beats_its_linear_start_where_there_is_a_tanh():
    parts, test = [wave_record(seed, 0.2) for seed in (1, 2)], wave_record(3, 0.2, WINDOW)
    start = neural_ss(parts, 2, 2, seed=1, iterations=0)
    assert start.theta[start.states * (start.states + 2) + 1 :][: 2 * 2] == pytest.approx(0.0)
    fitted = neural_ss(parts, 2, 2, seed=1)
    assert error(fitted, test) < 0.05 * error(start, test)


@pytest.mark.slow
def test_a_neural_model_of_a_linear_system_stays_with_the_linear_start():
    parts, test = [wave_record(seed, 0.0) for seed in (1, 2)], wave_record(3, 0.0, WINDOW)
    start, fitted = neural_ss(parts, 2, 2, seed=1, iterations=0), neural_ss(parts, 2, 2, seed=1)
    # The start is fitted about the mean of each record, which is not quite where the system rests.
    assert error(start, test) < 1e-2
    assert error(fitted, test) < 1e-6


def test_equal_seeds_give_equal_bits_and_others_do_not():
    parts = [wave_record(1, 0.2)]
    first, again, other = (neural_ss(parts, 2, 2, seed=seed, iterations=5).theta for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes() != other.tobytes()


def test_a_neural_model_that_diverges_says_so():
    model = neural_ss([wave_record(1, 0.2)], 2, 1, seed=1, iterations=0)
    wild = replace(model, theta=np.concatenate([3.0 * model.theta[:4], model.theta[4:]]))
    refused("diverges", wild.predicted, wave_record(3, 0.2, WINDOW), 0)


def test_records_and_orders_that_do_not_fit_are_refused():
    one = loop_record(1, 0.01)
    two = IOData(np.hstack([one.u, one.u[::-1]]), one.y, DT)
    refused("takes one joint; records of 2 inputs", hammerstein_loop, [two], 1, 2, 1, widths=(0.0,), width=0.0)
    refused("1 <= nb <= nf", hammerstein_loop, [one], 3, 2, 1, widths=(0.0,), width=0.0)
    refused("2 widths of the dead zone given for 1", hammerstein_loop, [one], 1, 2, 1, widths=(0.0, 0.0), width=0.0)
    refused("parameters, expected 400 or less", neural_ss, [one], 3, 200, seed=1)
    still = record(one.u, np.zeros(len(one)))
    refused("does not move", narx, [still], 1, 1, 1, 1)
    for name, orders, match in (
        ("narx", (2, 2, 1), "narx takes the orders na nb nk degree; given 2 2 1"),
        ("narx", (2, 2, 1, 0), "degree = 0 given, expected 1 or more"),
        ("neural_ss", (2, 0), "neurons = 0 given"),
        ("hammerstein", (1, 2, 0), "nk = 0 given"),
    ):
        with pytest.raises(ScenarioError, match=match):
            METHODS[name].complete(orders)
    assert METHODS["hammerstein"].complete((2, 2)) == {"nb": 2, "nf": 2, "nk": 1}
