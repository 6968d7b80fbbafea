"""The toolbox's estimators on the test bench, called as a user calls them with the orders of the task.

Where the task leaves the orders open, Schwarz's criterion (BIC) chooses them, from one to the highest order.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

import sysid
from scenarios.estimators.outcome import Answer
from scenarios.estimators.returned import estimate_answer
from scenarios.estimators.task import Task, require
from sysid import Estimate, IOData
from sysid.polynomial.structures import STRUCTURES
from sysid.subspace import markov_parameters
from sysid.validation import choose_orders

LEAST_P, P_PER_ORDER = 20, 2
"""Observer Markov parameters for OKID: so many, and so many more per state."""

SAMPLES_PER_UNKNOWN = 5
"""Equations that OKID has at least for each of its unknowns, as far as the order allows."""

SCAN_ITERATIONS = 20
"""Of each search while orders are chosen: only models that are too large need more, and they take very long."""

POLYNOMIAL: dict[str, Callable[..., Estimate]] = {name: getattr(sysid, name) for name in ("arx", "armax", "oe", "bj")}
"""Prediction-error estimators of polynomials, by structure."""

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
    markov = markov_parameters(data, count)
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


def observer_parameters(data: IOData, order: int) -> int:
    """Number p of OKID's observer Markov parameters for a record and an order."""
    wanted = LEAST_P + P_PER_ORDER * order
    # Fewer equations than unknowns would fit the noise.
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
    is nearly zero, and no order.

    Args:
        estimator: Called with data and orders in the sequence of the structure.
        data: The record.
        task: What is asked.
        simulated: See `sysid.validation.choose_orders`.

    Returns:
        Orders by their names in the structure.
    """
    delay = 0 if task.structure == "ss" else arx_orders(data, task)["nk"]
    names, candidates = STRUCTURES[task.structure], []
    for n in range(1, task.most_order + 1):
        sizes = {"na": n, "nb": max(n + 1 - delay, 1), "nc": n, "nd": n, "nf": n, "nk": delay, "order": n}
        candidates.append(tuple(sizes[name] for name in names))
    best = choose_orders(estimator, data, names, candidates, simulated=simulated)
    return {name: int(np.max(value)) for name, value in best.items()}


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
    require(task, structure, data)
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
