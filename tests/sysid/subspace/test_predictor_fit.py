"""Normal equations of state-space predictors against differences, sample by sample."""

import numpy as np
import pytest

from sysid import IOData, StateSpace
from sysid.models.estimate import DataSummary
from sysid.models.recursion import free_response
from sysid.polynomial.gram_matrices import hankel_moments, hankel_triangle
from sysid.subspace.predictor import (
    PRIOR,
    Predictor,
    Record,
    Scales,
    initial_spread,
    input_coordinates,
    local_coordinates,
)
from sysid.subspace.predictor_errors import Point
from sysid.subspace.predictor_fit import constrained_step, least_squares_fit, linearise


def a_predictor(gain: bool, states: int = 4) -> Predictor:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((states, states))
    A *= 0.95 / np.abs(np.linalg.eigvals(A)).max()
    M = rng.standard_normal((states, 5 if gain else 2))
    return Predictor(A, M, rng.standard_normal((3, states)), rng.standard_normal((3, 2)))


def a_record(gain: bool, samples: int, seed: int = 1) -> Record:
    rng = np.random.default_rng(seed)
    data = IOData(rng.standard_normal((samples, 2)), rng.standard_normal((samples, 3)), 0.1)
    return Record.of(data, Scales(np.ones(2), np.ones(3)), gain)


def a_point(records: list[Record], p: Predictor, states: list[np.ndarray]) -> Point:
    """Anywhere, not only where the initial states are optimal."""
    errors = [r.y - p.predict(r.w, r.u, x) for r, x in zip(records, states, strict=True)]
    covariance = sum(e.T @ e for e in errors) / sum(map(len, errors))
    spreads = tuple(initial_spread(free_response(p.A, p.C, len(e))) for e in errors)
    return Point(p, states, errors, np.asarray(covariance), 0.0, spreads=spreads)


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("samples", [15, 200])
def test_normal_equations_are_those_of_the_samples(gain: bool, samples: int) -> None:
    """Also where the record is so short that its ends are most of it."""
    p, n, h = a_predictor(gain), 4, 1e-5
    records = [a_record(gain, samples, 1), a_record(gain, samples + 5, 2)]
    states = [np.arange(4.0), np.ones(4)]
    point = a_point(records, p, states)
    basis = local_coordinates(p)
    normal = linearise(records, point, basis)
    root = np.linalg.cholesky(point.weight)
    rows, targets = [], []
    for k, (record, x0) in enumerate(zip(records, states, strict=True)):

        def output(step: np.ndarray, x: np.ndarray, record: Record = record) -> np.ndarray:
            return (p.moved(basis @ step).predict(record.w, record.u, x) @ root).ravel()

        unit, still = np.eye(basis.shape[1]), np.zeros(basis.shape[1])
        columns = [(output(h * d, x0) - output(-h * d, x0)) / (2 * h) for d in unit]
        initial = np.zeros((len(record.y) * 3, 2 * n))
        for i, d in enumerate(np.eye(n)):
            initial[:, k * n + i] = output(still, x0 + d) - output(still, x0)
        rows.append(np.column_stack((*columns, initial)))
        targets.append((point.errors[k] @ root).ravel())
    q = basis.shape[1]
    # initial states are held, weakly, to the size that they have in balanced coordinates
    free = np.array([p.C @ np.linalg.matrix_power(p.A, t) for t in range(samples + 5)])
    power = [np.sum(free[: len(r.y)] ** 2, axis=(0, 1)) for r in records]
    prior = np.diag(1.0 / (PRIOR * np.sqrt(np.concatenate(power))))
    rows.append(np.hstack((np.zeros((2 * n, q)), prior)))
    targets.append(-prior @ np.concatenate(states))
    J, e = np.vstack(rows), np.concatenate(targets)
    transients = np.linalg.qr(J[:, q:])[0]
    projected = J[:, :q] - transients @ (transients.T @ J[:, :q])
    size = np.abs(projected.T @ projected).max()
    np.testing.assert_allclose(normal.information, projected.T @ projected, atol=1e-7 * size)
    np.testing.assert_allclose(normal.gradient, projected.T @ e, atol=1e-7 * np.sqrt(size) * np.linalg.norm(e))


def test_local_coordinates_leave_out_what_changes_nothing() -> None:
    p = a_predictor(True)
    basis = local_coordinates(p)
    assert basis.shape == (len(p.vector()), len(p.vector()) - 16)
    change = np.random.default_rng(3).standard_normal((4, 4))
    tangent = Predictor(change @ p.A - p.A @ change, change @ p.M, -p.C @ change, np.zeros((3, 2))).vector()
    np.testing.assert_allclose(basis.T @ tangent, 0.0, atol=1e-12)
    assert local_coordinates(p, direct=False).shape[1] == basis.shape[1] - 6


def test_balancing_changes_no_prediction() -> None:
    p, record = a_predictor(True), a_record(True, 50)
    still = np.zeros(4)
    expected = p.predict(record.w, record.u, still)
    np.testing.assert_allclose(p.balanced().predict(record.w, record.u, still), expected, atol=1e-9)


@pytest.mark.parametrize("gain", [False, True])
def test_input_matrices_in_one_step(gain: bool) -> None:
    truth, record = a_predictor(gain), a_record(gain, 400)
    y = truth.predict(record.w, record.u, np.ones(4))
    record = Record(record.u, y, record.w)
    M = truth.M.copy()
    M[:, :2] = 1.0
    found = least_squares_fit([record], Predictor(truth.A, M, truth.C, 0 * truth.D), input_coordinates)
    np.testing.assert_allclose(found.vector(), truth.vector(), atol=1e-10)


def test_scales_go_and_come_back() -> None:
    rng = np.random.default_rng(0)
    model = StateSpace(
        0.5 * np.eye(2), rng.standard_normal((2, 1)), rng.standard_normal((1, 2)), [[0.3]], [[0.1], [0.2]], 0.1
    )
    scales = Scales(np.array([100.0]), np.array([0.01]))
    p = scales.predictor(model, gain=True)
    back = Scales(np.ones(1), np.ones(1)).predictor(model, gain=True)
    np.testing.assert_allclose(p.A, back.A)
    again = model_of(scales, p)
    for name in "ABCDK":
        np.testing.assert_allclose(getattr(again, name), getattr(model, name), rtol=1e-12)


def model_of(scales: Scales, predictor: Predictor) -> StateSpace:
    return scales.model(predictor, DataSummary.of([IOData(np.ones(2), np.ones(2), 0.1)]), None)


def test_moments_of_the_hankel_matrix() -> None:
    rng = np.random.default_rng(0)
    signals = [rng.standard_normal((n, 3)) for n in (30, 17)]
    columns = [np.array([z[t : t + 6].ravel() for t in range(len(z) - 5)]) for z in signals]
    whole = np.vstack(columns)
    moments = hankel_moments(signals, 6)
    np.testing.assert_allclose(moments, whole.T @ whole / len(whole), atol=1e-13)
    sequence = rng.permutation(18)[:9]
    expected = moments[np.ix_(sequence, sequence)]
    triangle = hankel_triangle(signals, 6, moments, sequence)
    np.testing.assert_allclose(triangle @ triangle.T, expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(np.triu(triangle, 1), 0.0)


def test_singular_moments_send_the_triangle_to_the_data() -> None:
    """z2 = z1 shifted by one sample: rows repeat."""
    x = np.random.default_rng(0).standard_normal(40)
    signals = [np.column_stack((x[1:], x[:-1]))]
    moments = hankel_moments(signals, 4)
    triangle = hankel_triangle(signals, 4, moments, np.arange(8))
    np.testing.assert_allclose(triangle @ triangle.T, moments, atol=1e-12)
    # of eight rows five differ; the Cholesky factor would keep but half of the digits of zero
    assert np.sort(np.abs(np.diag(triangle)))[2] < 1e-13


@pytest.mark.parametrize("seed", range(30))
def test_constrained_steps_are_the_best_there_are(seed):
    rng = np.random.default_rng(seed)
    q, m = 6, int(rng.integers(1, 12))
    values, g, rows = rng.uniform(0.1, 10.0, q), rng.standard_normal(q), rng.standard_normal((m, q))
    if seed % 3 == 0:
        rows = np.vstack((rows, rows[:1], np.zeros((1, q))))
    step = constrained_step(values, g, rows)
    assert (rows @ step <= 1e-9).all()
    # a cone and a parabola: the gradient left over is normal to the step, and no feasible direction is downhill
    left = g - values * step
    assert left @ step == pytest.approx(0.0, abs=1e-9)
    for direction in rng.standard_normal((200, q)):
        if (rows @ direction <= 0.0).all():
            assert left @ direction <= 1e-9


def test_a_step_that_no_constraint_bars_is_the_free_one():
    values, g = np.array([1.0, 2.0]), np.array([1.0, 1.0])
    np.testing.assert_array_equal(constrained_step(values, g, np.array([[-1.0, 0.0]])), [1.0, 0.5])
