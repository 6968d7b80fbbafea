"""Fits of records with missing outputs: exact likelihood, efficient and honest about it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from sysid import (
    Estimate,
    InitialConditions,
    IOData,
    Polynomials,
    StateSpace,
    SysidError,
    armax,
    arx,
    bj,
    iv4,
    oe,
    okid,
    pem_ss,
)
from sysid.models import innovations_form
from sysid.polynomial.initial_estimates import completed
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.prediction_error import linearise
from tests.sysid.refusals import refused

Array = NDArray[np.float64]
A, B, C, D = [1.0, -1.5, 0.7], [0.0, 1.0, 0.5], [1.0, -0.6, 0.2], [1.0, -0.9]


def holes(rng: np.random.Generator, samples: int, bursts: bool = False) -> NDArray[np.bool_]:
    """A quarter of all samples, one by one or in bursts of 20 on average."""
    if not bursts:
        return rng.random(samples) < 0.25
    out, t = np.zeros(samples, dtype=bool), 0
    while t < samples:
        t += rng.geometric(1 / 60)
        length = rng.geometric(1 / 20)
        out[t : t + length] = True
        t += length
    return out


def record(
    seed: int,
    samples: int = 600,
    c: Sequence[float] = C,
    d: Sequence[float] = (1.0,),
    shared: bool = True,
    bursts: bool = False,
) -> IOData:
    """Input and disturbance share the denominator A, or the disturbance has D alone."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, samples + 100))
    y = (lfilter(B, A, u) + lfilter(c, np.convolve(A if shared else [1.0], d), e))[100:]
    y[holes(rng, samples, bursts)] = np.nan
    return IOData(u[100:], y, 0.1, missing=True)


@pytest.mark.parametrize(("ny", "samples", "lags", "lost"), [(1, 60, 9, 0.3), (2, 80, 30, 0.3), (1, 300, 12, 0.05)])
def test_elimination_is_that_of_the_dense_matrix(ny: int, samples: int, lags: int, lost: float) -> None:
    rng = np.random.default_rng(0)
    response = 0.3 * rng.standard_normal((lags, ny, ny)) * (0.8 ** np.arange(lags))[:, None, None]
    response[0] = np.eye(ny)
    known = rng.random((samples, ny)) > lost
    known[-2:] = False

    def dense(h: Array) -> Array:
        columns = []
        for t, channel in zip(*np.nonzero(~known), strict=True):
            column = np.zeros((samples, ny))
            column[t : t + lags] = h[: samples - t, :, channel]
            columns.append(column.ravel())
        return np.array(columns).T

    g, found = dense(response), MissingOutputs.of(known, response)
    errors = rng.standard_normal((samples, ny, 3))
    flat = errors.reshape(-1, 3)
    expected = flat - g @ np.linalg.lstsq(g, flat, rcond=None)[0]
    np.testing.assert_allclose(found.eliminated(errors).reshape(-1, 3), expected, atol=1e-12)
    inverse = np.linalg.inv(g.T @ g)
    for d, diagonal in enumerate(found.covariance()):
        np.testing.assert_allclose(diagonal[: len(inverse) - d], np.diag(inverse, -d), atol=1e-12)
    moves = rng.standard_normal((2, lags, ny, ny))
    ends = [
        [np.linalg.slogdet(dense(h).T @ dense(h))[1] for h in (response + s * m for s in (1e-6, -1e-6))] for m in moves
    ]
    np.testing.assert_allclose(found.slope(moves), [(up - down) / 2e-6 for up, down in ends], rtol=1e-5)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(g.T @ g)[1])


def likelihood(orders: Orders, theta: Array, data: IOData) -> tuple[float, float]:
    """Weighted sum of squares and log determinant of the known outputs' joint normal distribution, begun at rest."""
    model = innovations_form(orders.polynomials(theta), data.dt, 1.0)
    steps, known = len(data), data.known[:, 0]
    spread, power, mean, x = np.eye(steps), model.gain, np.empty(steps), np.zeros(model.order)
    for lag in range(1, steps):
        spread += float((model.C @ power)[0, 0]) * np.eye(steps, k=-lag)
        power = model.A @ power
    for t in range(steps):
        mean[t] = (model.C @ x + model.D @ data.u[t])[0]
        x = model.A @ x + model.B @ data.u[t]
    root = np.linalg.cholesky((spread @ spread.T)[np.ix_(known, known)])
    white = np.linalg.solve(root, (data.y[:, 0] - mean)[known])
    return float(white @ white), 2.0 * float(np.log(np.diag(root)).sum())


CASES = [
    (make_orders(1, na=2, nb=2, nc=2, nk=1), [-1.45, 0.65, 1.0, 0.4, -0.5, 0.1]),
    (make_orders(1, nb=2, nf=2, nk=1), [1.0, 0.4, -1.45, 0.65]),
    (make_orders(1, nb=2, nc=1, nd=2, nf=2, nk=1), [1.0, 0.4, -0.5, -1.4, 0.6, -1.45, 0.65]),
    (make_orders(1, na=3, nb=2, nc=1, nk=1), [-1.45, 0.65, 0.1, 1.0, 0.4, -0.5]),
]


@pytest.mark.parametrize(("orders", "theta"), CASES)
def test_criterion_is_the_likelihood_of_what_is_known(orders: Orders, theta: list[float]) -> None:
    data = record(1, 150)
    at = linearise([data], orders, np.array(theta), InitialConditions.ZERO)
    squares, determinant = likelihood(orders, np.array(theta), data)
    assert at.errors == data.known.sum()
    assert at.sum_of_squares == pytest.approx(squares, rel=1e-9)
    assert np.log(at.inflation) * at.errors == pytest.approx(determinant, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("initial_conditions", [InitialConditions.ESTIMATED, InitialConditions.ZERO])
@pytest.mark.parametrize(("orders", "theta"), CASES)
@pytest.mark.parametrize("lead", [0, 1, 5])
def test_gradient_is_exact(
    orders: Orders, theta: list[float], initial_conditions: InitialConditions, lead: int
) -> None:
    y = record(2, 150).y.copy()
    y[:lead] = np.nan
    data = [IOData(record(2, 150).u, y, 0.1, missing=True, window=3 if lead == 1 else 0), record(3, 90)]
    at = linearise(data, orders, np.array(theta), initial_conditions)
    found = 2.0 * at.scale * (at.triangle.T @ at.target)
    steps = 1e-5 * np.eye(len(theta))
    ends = [[linearise(data, orders, theta + s * step, initial_conditions).cost for s in (1, -1)] for step in steps]
    expected = np.array([(up - down) / 2e-5 for up, down in ends])
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


FITS: list[tuple[Callable[[IOData], Estimate], dict[str, Any], list[float]]] = [
    (lambda data: armax(data, 2, 2, 2), {}, [*A[1:], *B[1:], *C[1:]]),
    (lambda data: oe(data, 2, 2), {"c": [1.0], "shared": False}, [*B[1:], *A[1:]]),
    (lambda data: bj(data, 2, 1, 1, 2), {"c": [1.0, 0.5], "d": D, "shared": False}, [*B[1:], 0.5, *D[1:], *A[1:]]),
]


@pytest.mark.slow
@pytest.mark.parametrize("bursts", [False, True])
@pytest.mark.parametrize("case", range(3))
def test_errors_are_as_large_as_their_covariance(case: int, bursts: bool) -> None:
    fit, options, truth = FITS[case]
    squares, variances = [], []
    for seed in range(20):
        found = fit(record(seed, bursts=bursts, **options))
        error = found.parameters - truth
        squares.append(error @ np.linalg.solve(found.covariance, error) / len(truth))
        variances.append(found.noise_variance[0, 0])
    # 20 times at least four chi-squares: a standard error of at most 0.16
    assert np.mean(squares) == pytest.approx(1.0, abs=0.45)
    assert np.mean(variances) == pytest.approx(1.0, abs=0.06)


@pytest.mark.slow
def test_it_beats_the_complete_parts_of_a_record_full_of_gaps() -> None:
    truth = np.array([*A[1:], *B[1:], *C[1:]])
    whole, parts = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u, e = rng.standard_normal((2, 1000))
        y = lfilter(B, A, u) + lfilter(C, A, e)
        y[rng.random(1000) < 0.06] = np.nan
        data = IOData(u, y, 0.1, missing=True)
        found = armax(data, 2, 2, 2)
        weight = np.linalg.inv(found.covariance)
        cut = armax(data.complete_parts(shortest=14), 2, 2, 2)
        for errors, estimate in ((whole, found), (parts, cut)):
            error = estimate.parameters - truth
            errors.append(error @ weight @ error / len(error))
    assert np.mean(whole) < 0.8 * np.mean(parts)


def test_nothing_missing_is_the_complete_record() -> None:
    data = record(4)
    y = np.nan_to_num(data.y)
    for fit, _, _ in FITS:
        np.testing.assert_array_equal(
            fit(IOData(data.u, y, 0.1, missing=True)).parameters, fit(IOData(data.u, y, 0.1)).parameters
        )


def test_several_records_a_window_and_residuals() -> None:
    first, second = record(5), record(6)
    windowed = IOData(first.u, first.y, 0.1, missing=True, window=50)
    found = armax([windowed, second], 2, 2, 2)
    np.testing.assert_allclose(found.parameters, [*A[1:], *B[1:], *C[1:]], atol=0.2)
    np.testing.assert_array_equal(np.isnan(found.residuals), np.isnan(np.vstack((first.y, second.y))))
    assert found.diagnostics["rows"] == int(first.known[50:].sum() + second.known.sum())
    exact = IOData(first.u, np.where(first.known[:, 0], lfilter(B, A, first.u[:, 0]), np.nan), 0.1, missing=True)
    np.testing.assert_allclose(armax(exact, 2, 2, 0).parameters, [*A[1:], *B[1:]], atol=1e-8)
    np.testing.assert_allclose(oe(exact, 2, 2).parameters, [*B[1:], *A[1:]], atol=1e-8)


def test_backcasting_over_gaps_is_refused() -> None:
    with pytest.raises(SysidError, match=r"BACKCAST needs complete outputs.*complete_parts"):
        armax(record(0), 2, 2, 2, initial_conditions=InitialConditions.BACKCAST)


def test_completed_records_keep_what_is_known() -> None:
    data = record(7)
    (filled,) = completed([data], make_orders(1, na=2, nb=2, nc=2, nk=1))
    np.testing.assert_array_equal(filled.y[data.known], data.y[data.known])
    rng = np.random.default_rng(7)
    u, e = rng.standard_normal((2, 700))
    true = (lfilter(B, A, u) + lfilter(C, A, e))[100:]
    lost = ~data.known[:, 0]
    assert np.mean((filled.y[lost, 0] - true[lost]) ** 2) < 1.2


def test_arx_of_a_long_gap_agrees_with_the_exact_likelihood() -> None:
    """ARX leaves equations out; ARMAX without C uses them all, and must be no worse."""
    data = record(8, 1500, c=[1.0])
    left_out, all_used = arx(data, 2, 2), armax(data, 2, 2, 0)
    np.testing.assert_allclose(all_used.parameters, left_out.parameters, atol=0.1)
    assert (np.diag(all_used.covariance) < np.diag(left_out.covariance)).all()


def multivariable(seed: int, samples: int = 500) -> tuple[StateSpace, IOData]:
    model = StateSpace(
        [[0.9, 0.2], [-0.2, 0.7]],
        [[1.0], [0.3]],
        [[1.0, 0.0], [0.3, 1.0]],
        [[0.0], [0.2]],
        [[0.6, 0.1], [-0.2, 0.3]],
        0.1,
        [[1.0, 0.5], [0.5, 1.0]],
    )
    rng = np.random.default_rng(seed)
    e = rng.multivariate_normal([0.0, 0.0], model.innovation_covariance, samples)
    u, x, y = rng.standard_normal((samples, 1)), np.zeros(2), np.empty((samples, 2))
    for t in range(samples):
        y[t] = model.C @ x + model.D @ u[t] + e[t]
        x = model.A @ x + model.B @ u[t] + model.gain @ e[t]
    y[rng.random((samples, 2)) < 0.25] = np.nan
    return model, IOData(u, y, 0.1, missing=True)


def test_state_space_agrees_with_armax_and_its_covariance() -> None:
    data = record(9, 1000)
    polynomials = armax(data, 2, 2, 2)
    found = pem_ss(data, polynomials, direct=False)
    f = np.array([0.1, 0.5, 1.0, 3.0])
    a, b = (estimate.frequency_response(f) for estimate in (polynomials, found))
    np.testing.assert_allclose(b.response, a.response, rtol=0.01)
    assert a.covariance is not None and b.covariance is not None
    np.testing.assert_allclose(b.covariance, a.covariance, rtol=0.1, atol=1e-3 * np.abs(a.covariance).max())
    np.testing.assert_allclose(found.noise_variance, polynomials.noise_variance, rtol=0.01)


@pytest.mark.slow
def test_two_outputs_that_miss_different_samples() -> None:
    f = np.array([0.1, 0.5, 1.0, 2.0, 4.0])
    covered, variances = [], []
    for seed in range(5):
        model, data = multivariable(seed)
        found = pem_ss(data, model)
        low, high = found.frequency_response(f).magnitude_ci95()
        truth = np.abs(model.frequency_response(f))
        covered.append((low <= truth) & (truth <= high))
        variances.append(found.noise_variance)
    assert np.mean(covered) > 0.8
    np.testing.assert_allclose(np.mean(variances, axis=0), [[1.0, 0.5], [0.5, 1.0]], atol=0.1)
    assert found.residuals.shape == (500, 2)
    np.testing.assert_array_equal(np.isnan(found.residuals), np.isnan(data.y))


def test_regressions_leave_out_what_touches_a_gap() -> None:
    data = record(10, 3000)
    found = iv4(data, 2, 2)
    deviations = np.abs(found.parameters - [*A[1:], *B[1:]]) / np.sqrt(np.diag(found.covariance))
    assert (deviations < 3.5).all()
    f = np.array([0.1, 0.5, 1.0, 3.0])
    truth = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1).frequency_response(f)
    np.testing.assert_allclose(okid(data, 2, p=5).model.frequency_response(f), truth, rtol=0.4)
    refused(r"too many missing samples.*pem_ss", lambda: okid(data, 2, p=60))
    refused("too many missing samples", lambda: iv4(record(0, 40), 4, 4))
