"""The estimators of this package on the test bench: what a user gets who asks for the orders of the task.

Where the task leaves the orders open they are chosen as the toolbox's page tells, by Schwarz's criterion.
"""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType

import numpy as np

import sysid
from scenarios.estimators.answer import Answer
from scenarios.estimators.estimates import answer_of
from scenarios.estimators.order_choice import arx_orders, scanned
from scenarios.estimators.refusals import only_given_orders, only_one_output, only_structure
from scenarios.estimators.task import STRUCTURES, Task
from sysid import Estimate, IOData

LEAST_P, P_PER_ORDER = 20, 2
"""Observer Markov parameters for OKID: so many, and so many more per state."""

SAMPLES_PER_UNKNOWN = 5
"""Equations that OKID has at least for each of its unknowns, as far as the order allows."""

SCAN_ITERATIONS = 20
"""Of each search while orders are chosen: only models that are too large need more, and they take very long."""

PULSES, MOST_INPUT_COLUMNS = 200, 0.2
"""Values of the pulse response that ERA realises, and the columns of inputs, as a part of the samples, at most."""


def arx(data: IOData, task: Task) -> Answer:
    """A y = B u + e by least squares."""
    return answer_of(_polynomial(sysid.arx, "arx", data, task, arx_orders), task)


def armax(data: IOData, task: Task) -> Answer:
    """A y = B u + C e by prediction error."""
    return answer_of(_polynomial(sysid.armax, "armax", data, task), task)


def oe(data: IOData, task: Task) -> Answer:
    """Output error: y = B/F u + e."""
    return answer_of(_polynomial(sysid.oe, "oe", data, task), task)


def bj(data: IOData, task: Task) -> Answer:
    """Box-Jenkins: y = B/F u + C/D e."""
    return answer_of(_polynomial(sysid.bj, "bj", data, task), task)


def iv4(data: IOData, task: Task) -> Answer:
    """A y = B u + disturbance of any colour by instrumental variables; no model of the disturbance is claimed."""
    chooses = partial(scanned, sysid.iv4, simulated=True)
    return answer_of(_polynomial(sysid.iv4, "arx", data, task, chooses), task, noise_model=False)


def n4sid(data: IOData, task: Task) -> Answer:
    """State space by subspace projection; it claims no covariance."""
    return answer_of(_state_space(_n4sid, data, task), task)


def pem_ss(data: IOData, task: Task) -> Answer:
    """State space by prediction error, from N4SID's model."""
    return answer_of(_state_space(_pem_ss, data, task), task)


def okid(data: IOData, task: Task) -> Answer:
    """Observer/Kalman filter identification with ERA."""
    return answer_of(_state_space(_okid, data, task), task)


def era(data: IOData, task: Task) -> Answer:
    """ERA on the pulse response by least squares on past inputs alone; no model of the noise, no covariance."""
    only_structure(task, "ss")
    only_given_orders(task, "ERA by itself has no criterion; okid has one")
    count = min(PULSES, int(MOST_INPUT_COLUMNS * len(data) / data.nu))
    past = np.lib.stride_tricks.sliding_window_view(data.u, count, axis=0)[:-1, :, ::-1]
    columns = past.transpose(0, 2, 1).reshape(len(past), count * data.nu)
    solution = np.linalg.lstsq(columns, data.y[count:], rcond=None)[0]
    pulses = solution.reshape(count, data.nu, data.ny).transpose(0, 2, 1)
    markov = np.concatenate((np.zeros((1, data.ny, data.nu)), pulses))
    return Answer(sysid.era(markov, task.orders["order"], dt=data.dt).model)


def pem(data: IOData, task: Task) -> Answer:
    """Whatever is asked, by prediction error; ARX by least squares, which is the same."""
    return answer_of(prediction_error(data, task), task)


def prediction_error(data: IOData, task: Task) -> Estimate:
    """The estimate behind `pem`."""
    if task.structure == "ss":
        return _state_space(_pem_ss, data, task)
    return _polynomial(
        POLYNOMIAL[task.structure], task.structure, data, task, arx_orders if task.structure == "arx" else None
    )


POLYNOMIAL: Mapping[str, Callable[..., Estimate]] = MappingProxyType(
    {"arx": sysid.arx, "armax": sysid.armax, "oe": sysid.oe, "bj": sysid.bj}
)
"""Prediction-error estimators of polynomials, by structure."""


def observer_parameters(data: IOData, order: int) -> int:
    """Number p of OKID's observer Markov parameters for a record and an order."""
    wanted = LEAST_P + P_PER_ORDER * order
    allowed = len(data) // (SAMPLES_PER_UNKNOWN * (data.nu + data.ny))
    return max(min(wanted, allowed), -(-order // data.ny))


def _n4sid(data: IOData, order: int) -> Estimate:
    return sysid.n4sid(data, order, direct=False)


def _pem_ss(data: IOData, order: int) -> Estimate:
    return sysid.pem_ss(data, sysid.n4sid(data, order, direct=False), direct=False)


def _okid(data: IOData, order: int) -> Estimate:
    return sysid.okid(data, order, p=observer_parameters(data, order), direct=False)


def _polynomial(
    estimator: Callable[..., Estimate],
    structure: str,
    data: IOData,
    task: Task,
    chooses: Callable[[IOData, Task], Mapping[str, int]] | None = None,
) -> Estimate:
    only_structure(task, structure)
    only_one_output(data)
    orders = task.orders or (chooses or partial(scanned, partial(estimator, max_iterations=SCAN_ITERATIONS)))(
        data, task
    )
    return estimator(data, *(orders[name] for name in STRUCTURES[structure]))


def _state_space(estimator: Callable[[IOData, int], Estimate], data: IOData, task: Task) -> Estimate:
    only_structure(task, "ss")
    orders = task.orders or scanned(estimator, data, task)
    return estimator(data, orders["order"])
