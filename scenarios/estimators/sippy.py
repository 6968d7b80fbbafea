"""Estimators of SIPPY; they claim no covariance.

Its orders: a list for each output, and the delay `theta` counts samples beyond the first. Polynomial methods search by
the optimiser IPOPT (its option OPT), which its authors name the most accurate; its recursive options are not.
"""

from typing import Any

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.refusals import only_delayed, only_given_orders, only_one_output, only_structure
from scenarios.estimators.task import STRUCTURES, Task
from sysid import IOData, Polynomials, StateSpace
from sysid.models import innovations_form

LEAST_ROWS, ROWS_PER_ORDER = 20, 2
"""Block rows of the subspace methods: 20 as is its default, more for high orders."""


def arx(data: IOData, task: Task) -> Answer:
    """Least squares."""
    return polynomials("arx", data, task)


def armax(data: IOData, task: Task) -> Answer:
    """Prediction error by IPOPT."""
    return polynomials("armax", data, task)


def oe(data: IOData, task: Task) -> Answer:
    """Prediction error by IPOPT, one denominator for all inputs."""
    return polynomials("oe", data, task)


def bj(data: IOData, task: Task) -> Answer:
    """Prediction error by IPOPT, one denominator for all inputs."""
    return polynomials("bj", data, task)


def n4sid(data: IOData, task: Task) -> Answer:
    """Subspace projection with a Kalman gain."""
    only_structure(task, "ss")
    return Answer(subspace(data, task, "N4SID"))


def subspace(data: IOData, task: Task, weighting: str, *, direct: bool = False) -> StateSpace:
    """Model by a subspace method.

    Args:
        data: The record.
        task: Order, or the highest of those among which BIC chooses.
        weighting: `N4SID`, `MOESP`, `CVA` or `PARSIM-K`.
        direct: Whether D is estimated.
    """
    from sippy_unipi import system_identification

    rows = max(LEAST_ROWS, ROWS_PER_ORDER * task.orders.get("order", task.most_order))
    orders: dict[str, Any] = {"SS_fixed_order": task.orders.get("order")}
    if task.chooses:
        orders = {"SS_orders": [1, task.most_order], "IC": "BIC"}
    found = system_identification(
        data.y.copy(), data.u.copy(), weighting, tsample=data.dt, SS_f=rows, SS_p=rows, SS_D_required=direct, **orders
    )
    # Where it finds no gain it says so and gives an empty one.
    K = found.K if np.size(found.K) else None
    return StateSpace(found.A, found.B, found.C, found.D, K, data.dt)


def polynomials(structure: str, data: IOData, task: Task, *, mode: str = "OPT") -> Answer:
    """Answer of a polynomial method.

    Args:
        structure: `arx`, `armax`, `oe` or `bj`.
        data: The record, one output.
        task: With the orders.
        mode: Of `armax` and `oe`: `OPT`, or one of its recursive and iterative ones.
    """
    only_structure(task, structure)
    only_one_output(data)
    only_delayed(task)
    only_given_orders(task, "its criteria fit every combination of orders and delays by the optimiser")
    n, method = task.orders, structure.upper()
    if 0 in (n.get("nc", 1), n.get("nd", 1)):
        raise NotImplementedError("nc = 0 or nd = 0 asked for, its optimiser needs at least 1 of each")
    from sippy_unipi import system_identification

    counts: dict[str, list[Any]] = {name: [n[name]] for name in n}
    counts |= {"nb": [[n["nb"]] * data.nu], "nk": [[n["nk"] - 1] * data.nu]}
    options: dict[str, Any] = {f"{method}_orders": [counts[name] for name in STRUCTURES[structure]]}
    if structure in ("armax", "oe"):
        options[f"{method}_mod"] = mode
    m = system_identification(data.y.copy(), data.u.copy(), method, tsample=data.dt, **options)
    # Numerators begin with q^-1 and, like denominators, have zeros behind.
    above = np.array([[0.0, *row[: n["nk"] - 1 + n["nb"]]] for row in m.NUMERATOR[0]])
    below, several = np.asarray(m.DENOMINATOR[0][0]), data.nu > 1
    found: dict[str, Any] = {"B": above if several else above[0]}
    if structure in ("arx", "armax"):
        found["A"] = below[: n["na"] + 1]
    else:
        f = below[: n["nf"] + 1]
        found["F"] = np.tile(f, (data.nu, 1)) if several else f
    if structure in ("armax", "bj"):
        found["C"] = np.asarray(m.NUMERATOR_H[0][0])[: n["nc"] + 1]
    if structure == "bj":
        found["D"] = np.asarray(m.DENOMINATOR_H[0][0])[: n["nd"] + 1]
    p = Polynomials(**found)
    return Answer(innovations_form(p, data.dt), p)
