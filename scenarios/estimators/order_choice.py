"""Orders for a task that leaves them to the estimator: Schwarz's criterion over orders from one to the highest."""

from collections.abc import Callable

import numpy as np

import sysid
from scenarios.estimators.task import STRUCTURES, Task
from sysid import Estimate, IOData, SysidError
from sysid.records.arrays import FloatArray
from sysid.validation.structure_scan import StructureTable

LOOKS_AHEAD = 2
"""Degrees that are tried beyond the best so far."""


def arx_orders(data: IOData, task: Task) -> dict[str, int]:
    """Orders of the ARX structure with the least BIC among all of up to the highest order [Ljung1999, sec. 16.4]."""
    upto = range(1, task.most_order + 1)
    chosen = sysid.selstruc(data, upto, upto, upto).best("bic")
    return {name: int(np.max(value)) for name, value in chosen.items()}


def scanned(estimator: Callable[..., Estimate], data: IOData, task: Task, *, simulated: bool = False) -> dict[str, int]:
    """Orders of any structure by the least BIC, all polynomials of one degree, the delay that of the best ARX model.

    One degree for all is what keeps the number of fits to the highest order; a delay that is too small costs a
    coefficient that is nearly zero, and no order. Degrees rise until two in a row are no better than the best before:
    models that are far too large take the longest. Unstable models are passed over.

    Args:
        estimator: Called with data and orders in the sequence of the structure.
        data: The record.
        task: What was asked.
        simulated: Whether the error of the simulated output counts instead of that one step ahead: for methods whose
            model of the noise means nothing.

    Returns:
        Orders by their names in the structure.
    """
    delay = 0 if task.structure == "ss" else arx_orders(data, task)["nk"]
    fitted: dict[tuple[int, ...], Estimate | SysidError] = {}

    def remembered(record: IOData, *orders: int) -> Estimate:
        if orders not in fitted:
            fitted[orders] = _stable(estimator, record, orders)
        found = fitted[orders]
        if isinstance(found, SysidError):
            raise found
        return found

    best: dict[str, int] = {}
    candidates: list[dict[str, int]] = []
    for degree in range(1, task.most_order + 1):
        candidates.append(_of_degree(degree, delay, task.structure))
        if degree < LOOKS_AHEAD and degree < task.most_order:
            continue
        table = sysid.structure_scan(
            remembered,
            data,
            tuple(candidates[0]),
            [tuple(candidate.values()) for candidate in candidates],
            validation=data if simulated else None,
            steps=None if simulated else 1,
        )
        best = {
            name: int(np.max(value)) for name, value in table.best(simulated_bic(table) if simulated else "bic").items()
        }
        if candidates.index(best) + LOOKS_AHEAD < degree:
            break
    return best


def simulated_bic(table: StructureTable) -> FloatArray:
    """Schwarz's criterion of the error of simulation that stands in the table as that of validation (m,)."""
    return np.asarray(np.log(table.validation) + table.parameters * np.log(table.samples) / table.samples)


def _stable(estimator: Callable[..., Estimate], data: IOData, orders: tuple[int, ...]) -> Estimate | SysidError:
    """The estimate, or why there is none that is stable."""
    try:
        estimate = estimator(data, *orders)
    except SysidError as error:
        return error
    stable = estimate.model.input_path().is_stable()
    return estimate if stable else SysidError(f"orders {orders} give an unstable model")


def _of_degree(n: int, delay: int, structure: str) -> dict[str, int]:
    if structure == "ss":
        return {"order": n}
    sizes = {"na": n, "nb": max(n + 1 - delay, 1), "nc": n, "nd": n, "nf": n, "nk": delay}
    return {name: sizes[name] for name in STRUCTURES[structure]}
