"""The toolbox's methods on the test bench, called as a user calls them with the orders of the task.

`ours.NAME` is the method of that name in `scenarios/identification/methods.toml`; only what differs there from a call
with given orders stands here. Where the task leaves the orders open, Schwarz's criterion (BIC) chooses them, from one
to the highest order.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

import sysid
from scenarios.estimators.outcome import Answer
from scenarios.estimators.returned import estimate_answer
from scenarios.estimators.task import Task, require
from scenarios.identification.methods import BENCH_ENTRIES, METHODS
from sysid import Estimate, IOData
from sysid.polynomial.structures import STRUCTURES
from sysid.validation import choose_orders

LEAST_P, P_PER_ORDER = 20, 2
"""Observer Markov parameters for OKID: so many, and so many more per state."""

SAMPLES_PER_UNKNOWN = 5
"""Equations that OKID has at least for each of its unknowns, as far as the order allows."""

PULSES, MOST_INPUT_COLUMNS = 200, 0.2
"""Values of the pulse response that ERA realises, and the most columns of inputs, as a share of the samples."""


def __getattr__(name: str) -> Callable[[IOData, Task], Answer]:
    if name not in BENCH_ENTRIES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(answer, name)


def answer(name: str, data: IOData, task: Task) -> Answer:
    """Estimate by a method of the table, and claim what the estimate knows.

    Args:
        name: The method.
        data: The record.
        task: What is asked.

    Raises:
        NotImplementedError: The method does not do this.
    """
    result = estimate_answer(estimate(name, data, task), task)
    if BENCH_ENTRIES[name].noise_model:
        return result
    return replace(result, model=replace(result.model, K=None, innovation_covariance=None))


def era(data: IOData, task: Task) -> Answer:
    """ERA on the pulse response by least squares on past inputs alone; no noise model, no covariance."""
    require(task, "ss", no_choice="ERA by itself has no criterion; okid has one")
    count = min(PULSES, int(MOST_INPUT_COLUMNS * len(data) / data.nu))
    return Answer(METHODS["era"].function(data, task.orders["order"], count))


def pem(data: IOData, task: Task) -> Answer:
    """Any structure by prediction error; ARX by least squares, which is the same."""
    return estimate_answer(prediction_error(data, task), task)


def prediction_error(data: IOData, task: Task) -> Estimate:
    """The estimate behind `pem`."""
    return estimate("pem_ss" if task.structure == "ss" else task.structure, data, task)


def estimate(name: str, data: IOData, task: Task) -> Estimate:
    """Estimate by a method of the table, with the orders of the task, or those that the criterion chooses.

    Raises:
        NotImplementedError: The method does not do this.
    """
    bench = BENCH_ENTRIES[name]
    of_one_output = None if METHODS[name].outputs else data
    require(task, bench.structure, of_one_output)
    estimator: Callable[..., Estimate] = _okid if name == "okid" else METHODS[name].function
    fit = partial(estimator, **bench.options)
    orders = task.orders
    if task.chooses:
        orders = _chosen_orders(name, partial(fit, **bench.search), data, task)
    return fit(data, *(orders[order] for order in STRUCTURES[bench.structure]))


def _chosen_orders(name: str, estimator: Callable[..., Estimate], data: IOData, task: Task) -> dict[str, int]:
    # Linear least squares is quick enough to try every combination of orders.
    if name == "arx":
        return arx_orders(data, task)
    return scanned_orders(estimator, data, task, simulated=not BENCH_ENTRIES[name].noise_model)


def _okid(data: IOData, order: int, *, direct: bool) -> Estimate:
    return sysid.okid(data, order, p=observer_parameters(data, order), direct=direct)


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
