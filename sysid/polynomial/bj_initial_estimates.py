"""Where the minimisation of a Box-Jenkins model begins: the input path first, then its disturbance."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from sysid.models.polynomials import stabilised
from sysid.polynomial.initial_estimates import REFINEMENTS, oe_starts, reduced_path, steiglitz_mcbride
from sysid.polynomial.least_squares import solve
from sysid.polynomial.long_arx import LongArx, long_arx_family, long_arx_order
from sysid.polynomial.orders import Orders
from sysid.polynomial.regressors import lagged, output_lags
from sysid.polynomial.search import Start
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData


def bj_starts(experiments: Sequence[IOData], orders: Orders) -> Iterator[Start]:
    """Input paths, each with a disturbance model by the second step of Hannan and Rissanen.

    Steiglitz-McBride on data whitened by a long ARX model gives efficient input paths [ZhuHjalmarsson2016]; a reduced
    long model and output-error fits do not suffer where that fails.

    Args:
        experiments: Single-output experiments.
        orders: Box-Jenkins structure.
    """
    path_orders = replace(orders, nc=0, nd=0)
    short, long = (long_arx_order(experiments, orders, factor) for factor in (3, 8))
    family = long_arx_family(experiments, orders, long)
    model = family.model(short)
    for n in (short, long):
        path = _whitened_path(experiments, path_orders, family.model(n))
        yield Start(f"whitened ({n})", _with_disturbance(experiments, orders, path_orders, path, model))
    path = reduced_path(experiments, path_orders, family.model(long))
    yield Start(f"reduced ARX ({long})", _with_disturbance(experiments, orders, path_orders, path, model))
    for start in oe_starts(experiments, path_orders):
        theta = _with_disturbance(experiments, orders, path_orders, start.theta, model)
        yield Start(f"oe: {start.name}", theta)


def _whitened_path(experiments: Sequence[IOData], path_orders: Orders, model: LongArx) -> FloatArray:
    a = model.a
    clean = [model.simulate(e) for e in experiments]
    first = steiglitz_mcbride(experiments, path_orders, clean, REFINEMENTS)
    white = [replace(e, u=lfilter(a, [1.0], e.u, axis=0), y=lfilter(a, [1.0], e.y, axis=0)) for e in experiments]
    return steiglitz_mcbride(white, path_orders, [e.y[:, 0] for e in white], REFINEMENTS, first)


def _with_disturbance(
    experiments: Sequence[IOData], orders: Orders, path_orders: Orders, path: FloatArray, model: LongArx
) -> FloatArray:
    """Add C and D: regress v = y - B/F u on its own past and on that of estimated innovations."""
    one, b, _, _, f = path_orders.split(path)
    rows, targets = [], []
    for e in experiments:
        innovations = model.errors(e)
        v = e.y[:, 0] - sum(lfilter(bj, fj, e.u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True)))
        start = max(e.window, model.skip) + max(orders.nc, orders.nd)
        past = (lagged(innovations, output_lags(orders.nc), start), -lagged(v, output_lags(orders.nd), start))
        rows.append(np.hstack(past))
        targets.append((v - innovations)[start:])
    cd = solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0]
    c, d = (stabilised(np.concatenate(([1.0], part))) for part in np.split(cd, [orders.nc]))
    return orders.join(one, b, c, d, f)
