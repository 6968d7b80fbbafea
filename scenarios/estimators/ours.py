"""The toolbox's estimators on the test bench, called as a user calls them with the orders of the task.

Where the task leaves the orders open, Schwarz's criterion (BIC) chooses them, from one to the highest order.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

import sysid
from scenarios.estimators.outcome import Answer
from scenarios.estimators.returned import estimate_answer
from scenarios.estimators.task import STRUCTURES, Task, require
from sysid import Estimate, IOData, SysidError
from sysid.records.arrays import FloatArray
from sysid.validation.structure_scan import StructureTable

LEAST_P, P_PER_ORDER = 20, 2
"""Observer Markov parameters for OKID: so many, and so many more per state."""

SAMPLES_PER_UNKNOWN = 5
"""Equations that OKID has at least for each of its unknowns, as far as the order allows."""

LOOKS_AHEAD = 2
"""Degrees that are tried beyond the best so far."""

SCAN_ITERATIONS = 20
"""Of each search while orders are chosen: only models that are too large need more, and they take very long."""

PULSES, MOST_INPUT_COLUMNS = 200, 0.2
"""Values of the pulse response that ERA realises, and the most columns of inputs, as a share of the samples."""


def arx(data: IOData, task: Task) -> Answer:
    """A y = B u + e by least squares."""
    return estimate_answer(_polynomial(sysid.arx, "arx", data, task, arx_orders), task)


def iv4(data: IOData, task: Task) -> Answer:
    """A y = B u + disturbance of any colour by instrumental variables."""
    choose = partial(scanned_orders, sysid.iv4, simulated=True)
    answer = estimate_answer(_polynomial(sysid.iv4, "arx", data, task, choose), task)
    # Its white equation error is an auxiliary quantity: no model of the disturbance is claimed.
    return replace(answer, model=replace(answer.model, K=None, innovation_covariance=None))


def era(data: IOData, task: Task) -> Answer:
    """ERA on the pulse response by least squares on past inputs alone; no noise model, no covariance."""
    require(task, "ss", no_choice="ERA by itself has no criterion; okid has one")
    count = min(PULSES, int(MOST_INPUT_COLUMNS * len(data) / data.nu))
    past = np.lib.stride_tricks.sliding_window_view(data.u, count, axis=0)[:-1, :, ::-1]
    columns = past.transpose(0, 2, 1).reshape(len(past), count * data.nu)
    solution = np.linalg.lstsq(columns, data.y[count:], rcond=None)[0]
    pulses = solution.reshape(count, data.nu, data.ny).transpose(0, 2, 1)
    markov = np.concatenate((np.zeros((1, data.ny, data.nu)), pulses))
    return Answer(sysid.era(markov, task.orders["order"], dt=data.dt).model)


def pem(data: IOData, task: Task) -> Answer:
    """Any structure by prediction error; ARX by least squares, which is the same."""
    return estimate_answer(prediction_error(data, task), task)


def prediction_error(data: IOData, task: Task) -> Estimate:
    """The estimate behind `pem`."""
    if task.structure == "ss":
        return _state_space(_pem_ss, data, task)
    choose = arx_orders if task.structure == "arx" else None
    return _polynomial(POLYNOMIAL[task.structure], task.structure, data, task, choose)


POLYNOMIAL: Mapping[str, Callable[..., Estimate]] = MappingProxyType(
    {"arx": sysid.arx, "armax": sysid.armax, "oe": sysid.oe, "bj": sysid.bj}
)
"""Prediction-error estimators of polynomials, by structure."""


def observer_parameters(data: IOData, order: int) -> int:
    """Number p of OKID's observer Markov parameters for a record and an order."""
    wanted = LEAST_P + P_PER_ORDER * order
    allowed = len(data) // (SAMPLES_PER_UNKNOWN * (data.nu + data.ny))
    return max(min(wanted, allowed), -(-order // data.ny))


def arx_orders(data: IOData, task: Task) -> dict[str, int]:
    """Orders of the ARX structure with the least BIC among all up to the highest order [Ljung1999, sec. 16.4]."""
    upto = range(1, task.most_order + 1)
    best = sysid.selstruc(data, upto, upto, upto).best("bic")
    return {name: int(np.max(value)) for name, value in best.items()}


def scanned_orders(
    estimator: Callable[..., Estimate], data: IOData, task: Task, *, simulated: bool = False
) -> dict[str, int]:
    """Orders of any structure by the least BIC, all polynomials of one degree, the delay that of the best ARX model.

    One degree for all keeps the number of fits at the highest order; a delay that is too small costs a coefficient that
    is nearly zero, and no order. Degrees rise until two in a row are no better than the best before, because models
    that are far too large take the longest. Unstable models are skipped.

    Args:
        estimator: Called with data and orders in the sequence of the structure.
        data: The record.
        task: What is asked.
        simulated: Whether the error of the simulated output counts instead of that one step ahead: for methods without
            a meaningful noise model.

    Returns:
        Orders by their names in the structure.
    """
    delay = 0 if task.structure == "ss" else arx_orders(data, task)["nk"]
    fits: dict[tuple[int, ...], Estimate | SysidError] = {}

    def fit(record: IOData, *orders: int) -> Estimate:
        if orders not in fits:
            fits[orders] = _stable_fit(estimator, record, orders)
        estimate = fits[orders]
        if isinstance(estimate, SysidError):
            raise estimate
        return estimate

    best: dict[str, int] = {}
    candidates: list[dict[str, int]] = []
    for degree in range(1, task.most_order + 1):
        candidates.append(_of_degree(degree, delay, task.structure))
        if degree < LOOKS_AHEAD and degree < task.most_order:
            continue
        table = sysid.structure_scan(
            fit,
            data,
            tuple(candidates[0]),
            [tuple(candidate.values()) for candidate in candidates],
            validation=data if simulated else None,
            steps=None if simulated else 1,
        )
        criterion = simulated_bic(table) if simulated else "bic"
        best = {name: int(np.max(value)) for name, value in table.best(criterion).items()}
        if candidates.index(best) + LOOKS_AHEAD < degree:
            break
    return best


def simulated_bic(table: StructureTable) -> FloatArray:
    """Schwarz's criterion on the error of simulation, which the table has as that of validation (m,)."""
    return np.asarray(np.log(table.validation) + table.parameters * np.log(table.samples) / table.samples)


def _stable_fit(estimator: Callable[..., Estimate], data: IOData, orders: tuple[int, ...]) -> Estimate | SysidError:
    try:
        estimate = estimator(data, *orders)
    except SysidError as error:
        return error
    stable = estimate.model.input_path().is_stable()
    return estimate if stable else SysidError(f"orders {orders} give an unstable model")


def _of_degree(n: int, delay: int, structure: str) -> dict[str, int]:
    sizes = {"na": n, "nb": max(n + 1 - delay, 1), "nc": n, "nd": n, "nf": n, "nk": delay, "order": n}
    return {name: sizes[name] for name in STRUCTURES[structure]}


def _pem_ss(data: IOData, order: int) -> Estimate:
    return sysid.pem_ss(data, sysid.n4sid(data, order, direct=False), direct=False)


def _okid(data: IOData, order: int) -> Estimate:
    return sysid.okid(data, order, p=observer_parameters(data, order), direct=False)


def _polynomial(
    estimator: Callable[..., Estimate],
    structure: str,
    data: IOData,
    task: Task,
    choose: Callable[[IOData, Task], Mapping[str, int]] | None = None,
) -> Estimate:
    require(task, structure, data=data, outputs=1)
    choose = choose or partial(scanned_orders, partial(estimator, max_iterations=SCAN_ITERATIONS))
    orders = task.orders or choose(data, task)
    return estimator(data, *(orders[name] for name in STRUCTURES[structure]))


def _state_space(estimator: Callable[[IOData, int], Estimate], data: IOData, task: Task) -> Estimate:
    require(task, "ss")
    orders = task.orders or scanned_orders(estimator, data, task)
    return estimator(data, orders["order"])


def _state_space_answer(estimator: Callable[[IOData, int], Estimate], data: IOData, task: Task) -> Answer:
    return estimate_answer(_state_space(estimator, data, task), task)


def _polynomial_answer(structure: str, data: IOData, task: Task) -> Answer:
    return estimate_answer(_polynomial(POLYNOMIAL[structure], structure, data, task), task)


armax, oe, bj = (partial(_polynomial_answer, name) for name in ("armax", "oe", "bj"))
n4sid = partial(_state_space_answer, partial(sysid.n4sid, direct=False))
pem_ss, okid = (partial(_state_space_answer, estimator) for estimator in (_pem_ss, _okid))
