"""Other packages that identify polynomial models: pysib, SIPPY, SysIdentPy. None claims a covariance."""

import warnings
from functools import partial
from typing import Any

import numpy as np

from scenarios.estimators.outcome import Answer
from scenarios.estimators.task import Task, require
from sysid import IOData, Polynomials
from sysid.models import innovations_form
from sysid.polynomial.structures import STRUCTURES

ROUNDS = 60
"""Of SysIdentPy's extended least squares: after its default of 20 it has often not settled."""


def sippy_polynomials(structure: str, data: IOData, task: Task, *, mode: str = "OPT") -> Answer:
    """Answer of a polynomial method of SIPPY, whose orders are a list for each output.

    By default the optimiser IPOPT searches (OPT), which its authors call the most accurate.

    Args:
        structure: `arx`, `armax`, `oe` or `bj`.
        data: The record, one output.
        task: With the orders.
        mode: Of `armax` and `oe`: `OPT`, or one of its recursive and iterative ones.
    """
    no_choice = "its criteria fit every combination of orders and delays by the optimiser"
    require(task, structure, data, delayed=True, no_choice=no_choice)
    n, method = task.orders, structure.upper()
    if 0 in (n.get("nc", 1), n.get("nd", 1)):
        raise NotImplementedError("nc = 0 or nd = 0 asked for, its optimiser needs at least 1 of each")
    from sippy_unipi import system_identification

    counts: dict[str, list[Any]] = {name: [n[name]] for name in n}
    # Its delay `theta` counts samples beyond the first.
    counts |= {"nb": [[n["nb"]] * data.nu], "nk": [[n["nk"] - 1] * data.nu]}
    options: dict[str, Any] = {f"{method}_orders": [counts[name] for name in STRUCTURES[structure]]}
    if structure in ("armax", "oe"):
        options[f"{method}_mod"] = mode
    m = system_identification(data.y.copy(), data.u.copy(), method, tsample=data.dt, **options)
    # Numerators begin with q^-1 and, like denominators, have zeros behind.
    length = n["nk"] - 1 + n["nb"]
    numerators = np.array([[0.0, *row[:length]] for row in m.NUMERATOR[0]])
    below, several = np.asarray(m.DENOMINATOR[0][0]), data.nu > 1
    rows: dict[str, Any] = {}
    rows["B"] = numerators if several else numerators[0]
    if structure in ("arx", "armax"):
        rows["A"] = below[: n["na"] + 1]
    else:
        f = below[: n["nf"] + 1]
        rows["F"] = np.tile(f, (data.nu, 1)) if several else f
    if structure in ("armax", "bj"):
        rows["C"] = np.asarray(m.NUMERATOR_H[0][0])[: n["nc"] + 1]
    if structure == "bj":
        rows["D"] = np.asarray(m.DENOMINATOR_H[0][0])[: n["nd"] + 1]
    p = Polynomials(**rows)
    return Answer(innovations_form(p, data.dt), p)


def _pysib(structure: str, data: IOData, task: Task) -> Answer:
    """Least squares for ARX, prediction error from the ARX model otherwise."""
    require(task, structure, data, inputs=1, no_choice="it has no criterion of orders")
    import pysib

    orders = [task.orders[name] for name in STRUCTURES[structure]]
    u, y = data.u[:, 0].copy(), data.y[:, 0].copy()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        _, rows = getattr(pysib, structure)(u, y, *orders)
        # Its warning of a predictor that is not stable advises the variant with filtered data.
        if structure != "arx" and any("unit circle" in str(warning.message) for warning in caught):
            _, rows = getattr(pysib, f"{structure}_filtered")(u, y, *orders)
    polynomials = Polynomials(*(np.asarray(rows[name], dtype=float) for name in "ABCDF"))
    return Answer(innovations_form(polynomials, data.dt), polynomials)


def _sysidentpy(structure: str, data: IOData, task: Task) -> Answer:
    """A polynomial NARX model of degree one, which is linear; its noise model is not returned, so none is claimed.

    Where the orders are open, forward orthogonal regression chooses terms by BIC.
    """
    require(task, structure, data, delayed=True)
    nc = task.orders.get("nc", task.most_order) if structure == "armax" else None
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    n = task.orders
    of_y = of_u = list(range(1, task.most_order + 1))
    if n:
        of_y = list(range(1, n["na"] + 1))
        of_u = list(range(n["nk"], n["nk"] + n["nb"]))
    # A constant is among the terms: a mean that does not belong to the dynamics.
    terms = len(of_y) + data.nu * len(of_u) + 1
    lags_of_inputs = of_u if data.nu == 1 else [of_u] * data.nu
    fixed_terms = None if task.chooses else terms
    search = FROLS(
        ylag=of_y,
        xlag=lags_of_inputs,
        elag=list(range(1, (nc or 1) + 1)),
        order_selection=task.chooses,
        info_criteria="bic",
        n_terms=fixed_terms,
        n_info_values=terms,
        estimator=LeastSquares(unbiased=nc is not None, uiter=ROUNDS),
        basis_function=Polynomial(degree=1),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        search.fit(X=data.u, y=data.y)
    a, b = np.zeros(max(of_y) + 1), np.zeros((data.nu, max(of_u) + 1))
    a[0] = 1.0
    # A regressor's code is 1000 times its signal (0 the constant, 1 the output, 2 the first input) plus the lag.
    for (code,), value in zip(search.final_model, np.ravel(search.theta), strict=True):
        channel, lag = divmod(int(code), 1000)
        if channel == 1:
            a[lag] = -value
        elif channel:
            b[channel - 2, lag] = value
    rows = b if data.nu > 1 else b[0]
    polynomials = Polynomials(A=a, B=rows)
    model = innovations_form(polynomials, data.dt)
    return Answer(model, polynomials) if nc is None else Answer(model.input_path())


pysib_arx, pysib_armax, pysib_oe, pysib_bj = (partial(_pysib, name) for name in ("arx", "armax", "oe", "bj"))
sippy_arx, sippy_armax, sippy_oe, sippy_bj = (partial(sippy_polynomials, name) for name in ("arx", "armax", "oe", "bj"))
sysidentpy_arx, sysidentpy_armax = (partial(_sysidentpy, name) for name in ("arx", "armax"))
