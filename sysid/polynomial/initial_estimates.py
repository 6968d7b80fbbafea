"""Where prediction-error minimisation of ARMAX and OE models begins.

None of these is a prediction-error estimate; each fails on some systems, and on different ones.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import hankel
from scipy.signal import lfilter

from sysid.models.polynomials import stabilised
from sysid.polynomial.arx import arx_solution
from sysid.polynomial.lagged_products import lagged_products, solution
from sysid.polynomial.least_squares import solve
from sysid.polynomial.long_arx import LongArx, long_arx_family, long_arx_order
from sysid.polynomial.orders import Orders
from sysid.polynomial.regressors import arx_regressors, input_lags, lagged, output_lags
from sysid.polynomial.search import Start
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

HANKEL_ROWS = 100
REFINEMENTS = 8  # rounds of Steiglitz-McBride at most
SETTLED = 1e-3  # change of the denominator, as a part of it, that ends them


def armax_starts(experiments: Sequence[IOData], orders: Orders) -> Iterator[Start]:
    """Hannan-Rissanen with two long ARX orders, long ARX models simulated and reduced, and ARX.

    Args:
        experiments: Single-output experiments.
        orders: ARMAX structure.
    """
    y = [e.y[:, 0] for e in experiments]
    u = [e.u for e in experiments]
    rows = [orders.first_row(e.window) for e in experiments]
    short, middle, long = (long_arx_order(experiments, orders, factor) for factor in (3, 5, 8))
    family = long_arx_family(experiments, orders, long)
    for n in (short, long):
        yield Start(f"Hannan-Rissanen ({n})", hannan_rissanen(experiments, orders, family.model(n)))
    model = family.model(middle)
    clean = [model.simulate(e) for e in experiments]
    path = arx_solution(clean, u, orders.na, orders.nb, orders.nk, rows)
    yield Start(f"simulated ARX ({middle})", _without_noise_model(orders, path))
    yield Start(f"reduced ARX ({middle})", _reduced_armax(experiments, orders, model))
    yield Start("arx", _without_noise_model(orders, arx_solution(y, u, orders.na, orders.nb, orders.nk, rows)))


def check_room_to_start(experiments: Sequence[IOData], orders: Orders) -> None:
    """Refuse orders for which no beginning can be found.

    Args:
        experiments: Single-output experiments.
        orders: The structure.

    Raises:
        SysidError: More dynamics than the longest pulse response that the data allow, or more coefficients than rows.
    """
    dynamics, rows = max(orders.na, *orders.nf), _hankel_rows(experiments, orders)
    if dynamics >= rows:
        raise SysidError(
            f"too many orders for the data: dynamics of order {dynamics} need an experiment of {3 * (dynamics + 1)} "
            f"samples to begin with, the longest has {max(len(e) for e in experiments)}"
        )
    skipped = long_arx_order(experiments, orders, 8) + max(orders.nk) + max(orders.nc, orders.nd)
    firsts = [max(e.window, orders.first_row(0), max(orders.nf)) for e in experiments]
    left = [len(e) - max(first, skipped) for e, first in zip(experiments, firsts, strict=True)]
    shared = sum(orders.nb) + orders.nc + max(orders.na, *orders.nf)
    if min(left) <= 0 or sum(left) <= max(shared, orders.nc + orders.nd):
        raise SysidError(
            f"too many orders for the data: {orders.count} parameters and {max(sum(left), 0)} samples in "
            f"{len(experiments)} experiment(s) behind the first {skipped}, which the search needs to begin with"
        )


def oe_starts(experiments: Sequence[IOData], orders: Orders) -> Iterator[Start]:
    """Steiglitz-McBride from the simulation of a long ARX model, that model reduced, and ARX in several ways.

    Args:
        experiments: Single-output experiments.
        orders: OE structure.
    """
    y = [e.y[:, 0] for e in experiments]
    n = long_arx_order(experiments, orders, 5)
    model = long_arx_family(experiments, orders, n).model(n)
    clean = [model.simulate(e) for e in experiments]
    simulated = steiglitz_mcbride(experiments, orders, clean, 0)
    refined = steiglitz_mcbride(experiments, orders, y, REFINEMENTS, simulated)
    yield Start(f"Steiglitz-McBride from simulated ARX ({n})", refined)
    yield Start(f"reduced ARX ({n})", reduced_path(experiments, orders, model))
    yield Start("Steiglitz-McBride from arx", steiglitz_mcbride(experiments, orders, y, REFINEMENTS))
    refined = steiglitz_mcbride(experiments, orders, clean, REFINEMENTS, simulated)
    yield Start(f"Steiglitz-McBride of simulated ARX ({n})", refined)
    yield Start(f"simulated ARX ({n})", simulated)
    yield Start("arx", steiglitz_mcbride(experiments, orders, y, 0))


def hannan_rissanen(experiments: Sequence[IOData], orders: Orders, model: LongArx) -> FloatArray:
    """ARMAX: residuals of a long ARX model stand in for e, then one least squares [HannanRissanen1982].

    Args:
        experiments: Single-output experiments.
        orders: ARMAX structure.
        model: The long ARX model.
    """
    lags = [output_lags(orders.na), *(input_lags(n, k) for n, k in zip(orders.nb, orders.nk, strict=True))]
    lags.append(output_lags(orders.nc))
    most = max(orders.first_row(0), orders.nc)
    table: FloatArray | float = 0.0
    for e in experiments:
        start = max(e.window, model.skip) + orders.nc
        table = table + lagged_products(np.column_stack((e.y[:, 0], e.u, model.errors(e))), most, max(start, most))
    theta = solution(np.asarray(table), lags, [1.0] + [0.0] * len(orders.nb) + [-1.0])
    if theta is not None:
        theta[: orders.na] *= -1.0
        return with_stable_noise(orders, theta)
    rows, targets = [], []
    for e in experiments:
        y, errors = e.y[:, 0], model.errors(e)
        start = max(max(e.window, model.skip) + orders.nc, most)
        past = lagged(errors, output_lags(orders.nc), start)
        rows.append(np.hstack((arx_regressors(y, e.u, orders.na, orders.nb, orders.nk, start), past)))
        targets.append((y - errors)[start:])
    return with_stable_noise(orders, solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0])


def with_stable_noise(orders: Orders, theta: FloatArray) -> FloatArray:
    """The same parameters with C and F brought inside the unit circle."""
    a, b, c, d, f = orders.split(theta)
    return orders.join(a, b, stabilised(c), d, [stabilised(fj) for fj in f])


def steiglitz_mcbride(
    experiments: Sequence[IOData],
    orders: Orders,
    y: Sequence[FloatArray],
    iterations: int,
    first: FloatArray | None = None,
) -> FloatArray:
    """Repeated least squares on data filtered by 1/F [SteiglitzMcBride1965]; several inputs share one F meanwhile.

    Args:
        experiments: Experiments, of which the inputs count.
        orders: OE structure.
        y: Output per experiment (N,).
        iterations: Rounds at most.
        first: Parameters whose F filters in the first round; None begins with ARX.
    """
    nf = max(orders.nf)
    u = [e.u for e in experiments]
    starts = [max(e.window, nf, orders.first_row(e.window)) for e in experiments]
    f = np.ones(1) if first is None else max((fj for fj in orders.split(first)[4]), key=len)
    theta = np.zeros(0)
    for k in range(iterations + 1):
        before = f
        if k or first is not None:
            filtered_y = [lfilter([1.0], f, yi) for yi in y]
            filtered_u = [lfilter([1.0], f, ui, axis=0) for ui in u]
        else:
            filtered_y, filtered_u = list(y), u
        theta = arx_solution(filtered_y, filtered_u, nf, orders.nb, orders.nk, starts)
        f = stabilised(np.concatenate(([1.0], theta[:nf])))
        if len(before) == len(f) and np.abs(f - before).max() <= SETTLED * np.abs(f).max():
            break
    b = [np.concatenate((np.zeros(k), part)) for k, part in _by_input(orders, theta[nf:])]
    return orders.join(np.ones(1), b, f=[f[: n + 1] if n == nf else stabilised(f[: n + 1]) for n in orders.nf])


def reduced_path(experiments: Sequence[IOData], orders: Orders, model: LongArx) -> FloatArray:
    """OE: the pulse response of a long ARX model, path by path, reduced to F; then B by least squares on the data.

    Args:
        experiments: Single-output experiments.
        orders: OE structure.
        model: The long ARX model.
    """
    rows = _hankel_rows(experiments, orders)
    responses = model.responses(2 * rows + max(orders.nk) + max(orders.nb))
    f = []
    for response, nb, nk, nf in zip(responses[:-1], orders.nb, orders.nk, orders.nf, strict=True):
        f.append(reduced_denominator([response[max(nk + nb - nf, 1) :]], nf, rows))
    blocks, targets = [], []
    for e in experiments:
        start = orders.first_row(e.window)
        columns = [
            lagged(lfilter([1.0], fj, e.u[:, j]), input_lags(nb, nk), start)
            for j, (fj, nb, nk) in enumerate(zip(f, orders.nb, orders.nk, strict=True))
        ]
        blocks.append(np.hstack(columns))
        targets.append(e.y[start:])
    theta = solve(np.vstack(blocks), np.concatenate(targets)).solution[:, 0]
    b = [np.concatenate((np.zeros(k), part)) for k, part in _by_input(orders, theta)]
    return orders.join(np.ones(1), b, f=f)


def reduced_denominator(responses: Sequence[FloatArray], order: int, rows: int) -> FloatArray:
    """Monic, stable polynomial of the dynamics that pulse responses share, from their Hankel matrices [JuangPappa1985].

    Args:
        responses: Pulse responses (2 rows,) or longer, each from where its recursion holds.
        order: Degree.
        rows: Rows and columns of each Hankel matrix.
    """
    if order == 0:
        return np.ones(1)
    blocks = [hankel(g[:rows], g[rows - 1 : 2 * rows - 1]) for g in responses]
    _, vectors = np.linalg.eigh(sum(block @ block.T for block in blocks))
    observability = vectors[:, -order:]
    dynamics, *_ = np.linalg.lstsq(observability[:-1], observability[1:], rcond=None)
    return stabilised(np.atleast_1d(np.poly(np.linalg.eigvals(dynamics)).real))


def _reduced_armax(experiments: Sequence[IOData], orders: Orders, model: LongArx) -> FloatArray:
    """ARMAX: A from all pulse responses of a long ARX model, then B and C by least squares with its residuals."""
    rows = _hankel_rows(experiments, orders)
    errors = [model.errors(e) for e in experiments]
    loudness = [float(np.std(np.concatenate([e.u[:, j] for e in experiments]))) for j in range(len(orders.nb))]
    loudness.append(float(np.std(np.concatenate([error[model.skip :] for error in errors]))))
    delays = [k + n - orders.na for k, n in zip(orders.nk, orders.nb, strict=True)] + [orders.nc - orders.na + 1]
    responses = model.responses(2 * rows + max(*delays, 1))
    lasting = [level * g[max(k, 1) :] for g, k, level in zip(responses, delays, loudness, strict=True)]
    a = reduced_denominator(lasting, orders.na, rows)
    blocks, targets = [], []
    for e, error in zip(experiments, errors, strict=True):
        start = max(max(e.window, model.skip) + orders.nc, orders.first_row(0))
        inputs = arx_regressors(e.y[:, 0], e.u, 0, orders.nb, orders.nk, start)
        blocks.append(np.hstack((inputs, lagged(error, output_lags(orders.nc), start))))
        targets.append((lfilter(a, [1.0], e.y[:, 0]) - error)[start:])
    theta = solve(np.vstack(blocks), np.concatenate(targets)[:, None]).solution[:, 0]
    return with_stable_noise(orders, np.concatenate((a[1:], theta)))


def _hankel_rows(experiments: Sequence[IOData], orders: Orders) -> int:
    wanted = max(HANKEL_ROWS, 2 * max(orders.na, *orders.nf))
    return min(wanted, max(len(e) for e in experiments) // 3)


def _without_noise_model(orders: Orders, arx_theta: FloatArray) -> FloatArray:
    return np.concatenate((arx_theta, np.zeros(orders.nc)))


def _by_input(orders: Orders, coefficients: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    return zip(orders.nk, np.split(coefficients, np.cumsum(orders.nb)[:-1]), strict=True)
