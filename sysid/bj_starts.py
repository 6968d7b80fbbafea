"""Where the minimisation of a Box-Jenkins model begins: the input path first, then its disturbance."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from sysid.arrays import FloatArray
from sysid.data import IOData
from sysid.least_squares import solve
from sysid.orders import Orders
from sysid.polynomials import stabilised
from sysid.regressors import lagged, output_lags
from sysid.starts import Start, arx_errors, long_arx, long_arx_order, oe_starts, simulated_outputs, steiglitz_mcbride

ITERATIONS = 8


def bj_starts(experiments: Sequence[IOData], orders: Orders) -> list[Start]:
    """Input paths by Steiglitz-McBride, each with a disturbance model by the second step of Hannan and Rissanen.

    Data whitened by a long ARX model give efficient input paths [ZhuHjalmarsson2016]; those on the data as they are
    do not suffer where the long model is poor.

    Args:
        experiments: Single-output experiments.
        orders: Box-Jenkins structure.
    """
    path_orders = replace(orders, nc=0, nd=0)
    starts = []
    for factor in (3, 8):
        n = long_arx_order(experiments, orders, factor)
        a, b = long_arx(experiments, orders, n)
        errors = [arx_errors(e, a, b) for e in experiments]
        whitened = [replace(e, u=lfilter(a, [1.0], e.u, axis=0), y=lfilter(a, [1.0], e.y, axis=0)) for e in experiments]
        clean = simulated_outputs(experiments, a, b)
        first = steiglitz_mcbride(experiments, path_orders, clean, ITERATIONS)
        path = steiglitz_mcbride(whitened, path_orders, [e.y[:, 0] for e in whitened], ITERATIONS, first)
        paths = {f"whitened ({n})": path}
        if factor == 3:
            paths |= {s.name: s.theta for s in oe_starts(experiments, path_orders)[1::2]}
        skip = n + max(orders.nk)
        starts += [
            Start(name, _with_disturbance(experiments, orders, path_orders, path, errors, skip))
            for name, path in paths.items()
        ]
    return starts


def _with_disturbance(
    experiments: Sequence[IOData],
    orders: Orders,
    path_orders: Orders,
    path: FloatArray,
    errors: Sequence[FloatArray],
    skip: int,
) -> FloatArray:
    """Add C and D: regress v = y - B/F u on its own past and on that of estimated innovations."""
    one, b, _, _, f = path_orders.split(path)
    rows, targets = [], []
    for e, innovations in zip(experiments, errors, strict=True):
        v = e.y[:, 0] - sum(lfilter(bj, fj, e.u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True)))
        start = max(e.window, skip) + max(orders.nc, orders.nd)
        past = (lagged(innovations, output_lags(orders.nc), start), -lagged(v, output_lags(orders.nd), start))
        rows.append(np.hstack(past))
        targets.append((v - innovations)[start:])
    cd = solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0]
    c, d = (stabilised(np.concatenate(([1.0], part))) for part in np.split(cd, [orders.nc]))
    return orders.join(one, b, c, d, f)
