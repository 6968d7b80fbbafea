"""ARX models of high order, as approximations of the infinite ARX form of every polynomial model.

All orders up to the largest share one table of products, which costs about one pass over the data. For nearly
dependent columns, least squares on the columns takes over.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.polynomials import stabilised
from sysid.polynomial.gram_matrices import lagged_products, lagged_solution
from sysid.polynomial.least_squares import solve, tall_least_squares
from sysid.polynomial.orders import Orders, with_delays
from sysid.polynomial.regressors import arx_equations, arx_regressors, first_row, input_lags, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LARGEST = 60  # order: more coefficients cost time and variance, and the search refines the result anyway
ROWS_PER_COEFFICIENT = 4  # least number of samples per coefficient
DIED = 1e-17  # a free response has died out where it is below this part of its largest value
UNSTABLE = 1e60  # a larger response is that of an unstable model; it cannot be fitted


@dataclass(frozen=True, eq=False)
class LongArx:
    """A y = B u + e with many coefficients.

    Attributes:
        a: 1, a1, ..., (n + 1,).
        b: nk zeros and n coefficients, per input.
        skip: First sample whose error needs no sample from before the record.
    """

    a: FloatArray
    b: tuple[FloatArray, ...]
    skip: int

    def errors(self, experiment: IOData) -> FloatArray:
        """Prediction errors from rest (N,): estimates of the innovations from `skip` on."""
        return arx_errors(experiment, self.a, self.b)

    def simulate(self, experiment: IOData) -> FloatArray:
        """Noise-free output from rest (N,), the model stabilised."""
        stable = stabilised(self.a)
        output = np.zeros(len(experiment))
        for j, bj in enumerate(self.b):
            output = output + scipy.signal.lfilter(bj, stable, experiment.u[:, j])
        return output

    def responses(self, length: int, radius: float = 0.995) -> list[FloatArray]:
        """Pulse responses B/A per input and 1/A, all poles moved within `radius` (length,) each."""
        stable = stabilised(self.a, radius)
        pulse = np.zeros(length)
        pulse[0] = 1.0
        numerators = (*self.b, np.ones(1))
        return [scipy.signal.lfilter(numerator, stable, pulse) for numerator in numerators]


def long_arx_models(experiments: Sequence[IOData], orders: Orders, largest: int) -> Callable[[int], LongArx]:
    """Function from n up to the largest to the model with n coefficients of A and of each B, by least squares."""
    nk, nu = orders.nk, len(orders.nk)
    longest_lag = largest + max((*orders.nk, 1))
    gram = np.zeros((nu + 1, longest_lag + 1) * 2)
    for e in experiments:
        gram += lagged_products(np.column_stack((e.y[:, 0], e.u)), longest_lag, max(e.window, longest_lag))

    def model(n: int) -> LongArx:
        u_lags = [input_lags(n, k) for k in nk]
        theta = lagged_solution(gram, [output_lags(n), *u_lags], [1.0] + [0.0] * nu)
        skip = n + max(nk, default=0)
        if theta is None:
            y, u = [e.y[:, 0] for e in experiments], [e.u for e in experiments]
            theta = arx_solution(y, u, n, (n,) * nu, nk, [max(e.window, skip) for e in experiments])
        a, *b = np.split(theta, np.cumsum([n] * nu))
        return LongArx(np.concatenate(([1.0], a)), tuple(with_delays(b, nk)), skip)

    return model


def long_arx_order(experiments: Sequence[IOData], orders: Orders, factor: int) -> int:
    """Order of a long ARX model: `factor` times the largest order of the structure, limited by the data."""
    largest = max(orders.na, orders.nc, orders.nd, *orders.nf, *orders.nb, 2)
    rows = min(len(e) - e.window for e in experiments)
    signals = 1 + len(orders.nb)
    return max(1, min(factor * largest, LARGEST, rows // (ROWS_PER_COEFFICIENT * signals)))


def arx_errors(experiment: IOData, a: FloatArray, b: Sequence[FloatArray]) -> FloatArray:
    """A y - B u from rest (N,)."""
    effect = np.zeros(len(experiment))
    for j, bj in enumerate(b):
        effect = effect + scipy.signal.lfilter(bj, [1.0], experiment.u[:, j])
    return np.asarray(scipy.signal.lfilter(a, [1.0], experiment.y[:, 0]) - effect)


def arx_solution(
    y: Sequence[FloatArray],
    u: Sequence[FloatArray],
    na: int,
    nb: Sequence[int],
    nk: Sequence[int],
    starts: Sequence[int],
) -> FloatArray:
    """ARX parameters (na + sum(nb),) by least squares, outputs and inputs per experiment, `starts` the first rows."""
    longest_lag = first_row(na, nb, nk)
    if longest_lag <= min(starts):
        products: FloatArray | float = 0.0
        for yi, ui, start in zip(y, u, starts, strict=True):
            products = products + lagged_products(np.column_stack((yi, ui)), longest_lag, start)
        u_lags = [input_lags(n, k) for n, k in zip(nb, nk, strict=True)]
        theta = lagged_solution(np.asarray(products), [output_lags(na), *u_lags], [1.0] + [0.0] * len(nb))
        if theta is not None:
            return theta
    phi, target = arx_equations(y, u, na, nb, nk, starts)
    return solve(phi, target[:, None]).solution[:, 0]


def long_arx_simulation(u: FloatArray, y: FloatArray, order: int) -> FloatArray | None:
    """Fit A(q) y = B(q) u by least squares, then simulate it with the initial conditions that fit best, (N,).

    The same as `predict(arx(data, order, order), data, steps=None)`, without state-space matrices of that size: the
    influence of the initial conditions on A(q) y ends after `order` samples. For orders of some hundreds; N must exceed
    twice the number of coefficients. None where the model grows beyond what can be fitted.
    """
    nu = u.shape[1]
    regressors = arx_regressors(y, u, order, (order,) * nu, (1,) * nu, order)
    theta = tall_least_squares(regressors, y[order:], cond=1e-15)
    a, *b = np.split(theta, 1 + nu)
    a = np.concatenate([[1.0], a])
    pulse = np.zeros(len(y))
    pulse[0] = 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        forced = np.zeros(len(y))
        for bj, signal in zip(with_delays(b, (1,) * nu), u.T, strict=True):
            forced = forced + scipy.signal.lfilter(bj, a, signal)
        free = scipy.signal.lfilter([1.0], a, pulse)
    # the comparison is also false of what has overflowed to NaN
    if not (np.abs(free) < UNSTABLE).all() or not (np.abs(forced) < UNSTABLE).all():
        return None
    alive = int(np.flatnonzero(np.abs(free) > DIED * np.abs(free).max())[-1]) + 1
    rows = min(len(y), alive + order)
    columns = scipy.linalg.toeplitz(free[:rows], np.zeros(order))
    weights = tall_least_squares(columns, (y - forced)[:rows], cond=1e-15)
    return np.asarray(forced + np.convolve(free, weights)[: len(y)])
