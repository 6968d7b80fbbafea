"""Where prediction-error minimisation begins, and the search from several beginnings.

None of these is a prediction-error estimate; each fails on some systems, and on different ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from sysid.arrays import FloatArray
from sysid.arx import arx_solution
from sysid.data import IOData
from sysid.least_squares import solve
from sysid.orders import Orders
from sysid.polynomials import stabilised
from sysid.prediction_error import Minimum, admissible, minimise
from sysid.regressors import arx_regressors, lagged, output_lags

SCREENING_STEPS = 4


@dataclass(frozen=True)
class Start:
    """A named beginning.

    Attributes:
        name: Method that made it.
        theta: Parameters (p,).
    """

    name: str
    theta: FloatArray


@dataclass(frozen=True)
class Search:
    """Outcome of a search from several beginnings.

    Attributes:
        best: Minimum reached from the best one.
        costs: Sum of squares of each beginning after a few steps.
        chosen: Name of the one that was polished.
    """

    best: Minimum
    costs: dict[str, float]
    chosen: str


def search(
    experiments: Sequence[IOData], orders: Orders, starts: Sequence[Start], *, max_iterations: int = 100
) -> Search:
    """Screen all beginnings by a few steps, polish the best."""
    screened = {}
    for start in starts:
        if admissible(orders, start.theta):
            screened[start.name] = minimise(experiments, orders, start.theta, max_iterations=SCREENING_STEPS)
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    first = screened[chosen]
    best = first
    if not first.converged:
        best = minimise(experiments, orders, first.at.theta, max_iterations=max_iterations)
    return Search(best, {name: m.at.cost for name, m in screened.items()}, chosen)


def long_arx_order(experiments: Sequence[IOData], orders: Orders, factor: int) -> int:
    """Order of a long ARX model: `factor` times the largest order, as far as the data allow it."""
    largest = max(orders.na, orders.nc, orders.nd, *orders.nf, *orders.nb, 2)
    rows = min(len(e) - e.window for e in experiments)
    return max(1, min(factor * largest, 60, rows // (4 * (1 + len(orders.nb)))))


def long_arx(experiments: Sequence[IOData], orders: Orders, n: int) -> tuple[FloatArray, list[FloatArray]]:
    """A and B of an ARX model with n coefficients each: a stand-in for the infinite ARX form."""
    nu = len(orders.nb)
    theta = arx_solution(
        [e.y[:, 0] for e in experiments],
        [e.u for e in experiments],
        n,
        (n,) * nu,
        orders.nk,
        [max(e.window, n + max(orders.nk)) for e in experiments],
    )
    parts = np.split(theta, np.cumsum([n] * nu))
    return np.concatenate(([1.0], parts[0])), [
        np.concatenate((np.zeros(k), part)) for k, part in zip(orders.nk, parts[1:], strict=True)
    ]


def arx_errors(experiment: IOData, a: FloatArray, b: Sequence[FloatArray]) -> FloatArray:
    """Prediction errors of an ARX model from rest (N,)."""
    inputs = sum(lfilter(bj, [1.0], experiment.u[:, j]) for j, bj in enumerate(b))
    return np.asarray(lfilter(a, [1.0], experiment.y[:, 0]) - inputs)


def hannan_rissanen(experiments: Sequence[IOData], orders: Orders, n: int) -> FloatArray:
    """ARMAX: residuals of a long ARX model stand in for e, then one least squares [HannanRissanen1982].

    Args:
        experiments: Single-output experiments.
        orders: ARMAX structure.
        n: Order of the long ARX model.
    """
    a, b = long_arx(experiments, orders, n)
    rows, targets = [], []
    for e in experiments:
        y = e.y[:, 0]
        errors = arx_errors(e, a, b)
        start = max(e.window, n + max(orders.nk)) + orders.nc
        rows.append(
            np.hstack(
                (
                    arx_regressors(y, e.u, orders.na, orders.nb, orders.nk, start),
                    lagged(errors, output_lags(orders.nc), start),
                )
            )
        )
        targets.append((y - errors)[start:])
    theta = solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0]
    return with_stable_noise(orders, theta)


def with_stable_noise(orders: Orders, theta: FloatArray) -> FloatArray:
    """The same parameters with C and F brought inside the unit circle."""
    a, b, c, d, f = orders.split(theta)
    return orders.join(a, b, stabilised(c), d, [stabilised(fj) for fj in f])


def simulated_outputs(experiments: Sequence[IOData], a: FloatArray, b: Sequence[FloatArray]) -> list[FloatArray]:
    """Noise-free output of an ARX model, per experiment (N,)."""
    stable = stabilised(a)
    return [np.asarray(sum(lfilter(bj, stable, e.u[:, j]) for j, bj in enumerate(b))) for e in experiments]


def armax_starts(experiments: Sequence[IOData], orders: Orders) -> list[Start]:
    """ARX, Hannan-Rissanen with two long ARX orders, and the simulation of a long ARX model."""
    y = [e.y[:, 0] for e in experiments]
    u = [e.u for e in experiments]
    rows = [orders.first_row(e.window) for e in experiments]
    starts = [Start("arx", _armax(orders, arx_solution(y, u, orders.na, orders.nb, orders.nk, rows)))]
    for factor in (3, 8):
        n = long_arx_order(experiments, orders, factor)
        starts.append(Start(f"Hannan-Rissanen ({n})", hannan_rissanen(experiments, orders, n)))
    n = long_arx_order(experiments, orders, 5)
    clean = simulated_outputs(experiments, *long_arx(experiments, orders, n))
    path = arx_solution(clean, u, orders.na, orders.nb, orders.nk, rows)
    starts.append(Start(f"simulated ARX ({n})", _armax(orders, path)))
    return starts


def oe_starts(experiments: Sequence[IOData], orders: Orders) -> list[Start]:
    """Steiglitz-McBride from an ARX model and from the simulation of a long one, and those models themselves."""
    y = [e.y[:, 0] for e in experiments]
    n = long_arx_order(experiments, orders, 5)
    clean = simulated_outputs(experiments, *long_arx(experiments, orders, n))
    starts = []
    for name, target in (("arx", y), (f"simulated ARX ({n})", clean)):
        theta = steiglitz_mcbride(experiments, orders, target, 0)
        starts.append(Start(name, theta))
        starts.append(Start(f"Steiglitz-McBride from {name}", steiglitz_mcbride(experiments, orders, target, 8)))
    starts.append(
        Start(
            f"Steiglitz-McBride on data from simulated ARX ({n})",
            steiglitz_mcbride(experiments, orders, y, 8, starts[2].theta),
        )
    )
    return starts


def _armax(orders: Orders, arx_theta: FloatArray) -> FloatArray:
    return np.concatenate((arx_theta, np.zeros(orders.nc)))


def steiglitz_mcbride(
    experiments: Sequence[IOData],
    orders: Orders,
    y: Sequence[FloatArray],
    iterations: int,
    first: FloatArray | None = None,
) -> FloatArray:
    """Repeated least squares on data filtered by 1/F [SteiglitzMcBride1965]; several inputs share one F meanwhile."""
    nf = max(orders.nf)
    u = [e.u for e in experiments]
    starts = [max(e.window, nf, orders.first_row(e.window)) for e in experiments]
    f = np.ones(1) if first is None else max((fj for fj in orders.split(first)[4]), key=len)
    theta = np.zeros(0)
    for k in range(iterations + 1):
        if k or first is not None:
            filtered_y = [lfilter([1.0], f, yi) for yi in y]
            filtered_u = [lfilter([1.0], f, ui, axis=0) for ui in u]
        else:
            filtered_y, filtered_u = list(y), u
        theta = arx_solution(filtered_y, filtered_u, nf, orders.nb, orders.nk, starts)
        f = stabilised(np.concatenate(([1.0], theta[:nf])))
    parts = np.split(theta[nf:], np.cumsum(orders.nb)[:-1])
    b = [np.concatenate((np.zeros(k), part)) for k, part in zip(orders.nk, parts, strict=True)]
    return orders.join(np.ones(1), b, f=[f[: n + 1] if n == nf else stabilised(f[: n + 1]) for n in orders.nf])
