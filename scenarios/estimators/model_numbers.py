"""From numbers to a model: the one check that every answer passes, wherever it comes from."""

from collections.abc import Mapping

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.claims import (
    check_covariance,
    covariance_of_response,
    interval_of,
    known_parameters,
    response_and_interval,
)
from scenarios.estimators.model_names import FRACTION, MATRICES, NAMES, POLYNOMIALS
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.polynomial_numbers import of_fractions, polynomials_of
from scenarios.estimators.shapes import shaped
from scenarios.estimators.task import Task
from sysid import IOData, StateSpace, SysidError
from sysid.models import innovations_form
from sysid.records.arrays import FloatArray

Numbers = Mapping[str, FloatArray]
"""Real numbers by name."""

MOST_ORDER = 100
"""No model has more states: what is done with an answer has no other limit, and takes less than half a second then."""

LARGEST = 1e60
"""No number of a model is larger."""

SAME_DT = 1e-6
"""So far, relative to it, the sampling time may be from that of the record."""


def answer_of(numbers: Numbers, data: IOData, task: Task) -> Answer:
    """Check numbers and make a model of them.

    Args:
        numbers: By names of `NAMES`: `dt`, and A, B, C (D zero, K none where left out) or `num` and `den` or `poly_a`
            ... `poly_f`, or matrices and polynomials together; and what is claimed.
        data: The record that was asked about.
        task: What was asked.

    Raises:
        NoModelError: They are none, `malformed` or `not_finite`.
    """
    _check_names(numbers)
    _check_finite(numbers)
    _check_dt(numbers, data)
    _check_lengths(numbers)
    polynomials = polynomials_of(numbers, data)
    innovation = numbers.get("innovation_covariance")
    if innovation is not None:
        innovation = shaped("innovation_covariance", innovation, (data.ny, data.ny))
        check_covariance("innovation_covariance", innovation)
    try:
        if "A" in numbers:
            model = _state_space(numbers, data, innovation)
        elif polynomials is not None:
            model = innovations_form(polynomials, data.dt, innovation)
        else:
            model = of_fractions(numbers, data)
    except SysidError as error:
        raise NoModelError("malformed", str(error)) from error
    if model.order > MOST_ORDER:
        raise NoModelError("malformed", f"a model of {model.order} states given, expected at most {MOST_ORDER}")
    _check_response(model, task)
    covariance = numbers.get("covariance")
    spread = numbers.get("response_covariance")
    response_covariance = None if spread is None else covariance_of_response(spread, data, task)
    ends = numbers.get("bandwidth_ci95")
    ci95 = None if ends is None else interval_of(ends, data)
    if covariance is not None:
        estimate = known_parameters(covariance, polynomials, model, data, task)
        covariance = estimate.covariance
        if (response_covariance is None or ci95 is None) and not unstable(model):
            follows = response_and_interval(estimate, task)
            response_covariance = follows[0] if response_covariance is None else response_covariance
            ci95 = follows[1] if ci95 is None else ci95
    return Answer(model, polynomials, covariance, response_covariance, ci95)


def unstable(model: StateSpace) -> str:
    """Why a model counts as unstable; empty where it does not.

    The poles from input to output count: a model of the noise may have any, and states that stand apart none.
    """
    poles = model.input_path().poles()
    outside = poles[np.abs(poles) >= 1.0]
    if not len(outside):
        return ""
    return (
        f"{len(outside)} of {len(poles)} poles on or outside the unit circle, the largest at {np.abs(outside[0]):.6g}"
    )


def _check_names(numbers: Numbers) -> None:
    unknown = sorted(numbers.keys() - set(NAMES))
    if unknown:
        raise NoModelError("malformed", f"unknown {unknown[0]!r} given, expected some of {', '.join(NAMES)}")
    given = numbers.keys()
    kinds = [
        (name, given & set(some), given >= set(needed))
        for name, some, needed in (
            ("matrices", MATRICES, ("A", "B", "C")),
            ("fraction", FRACTION, FRACTION),
            ("polynomials", POLYNOMIALS, ("poly_b",)),
        )
    ]
    there = [name for name, some, _ in kinds if some]
    whole = all(enough for _, some, enough in kinds if some)
    if not whole or there not in (["matrices"], ["fraction"], ["polynomials"], ["matrices", "polynomials"]):
        raise NoModelError(
            "malformed",
            f"{', '.join(sorted(given)) or 'nothing'} given, expected dt and either A, B, C (D, K), or num and den, or "
            "poly_b (with others of poly_a to poly_f; A, B, C may stand beside them)",
        )


def _check_finite(numbers: Numbers) -> None:
    for name, values in numbers.items():
        # An interval that is NaN says that there is none.
        bad = np.isinf(values) if name == "bandwidth_ci95" else ~np.isfinite(values)
        if bad.any():
            raise NoModelError(
                "not_finite", f"{name} has {int(bad.sum())} of {values.size} numbers that are not finite"
            )
        if (np.abs(values) > LARGEST).any():
            raise NoModelError("malformed", f"{name} has numbers above {LARGEST:g}")


def _check_response(model: StateSpace, task: Task) -> None:
    """Refuse a model whose response leaves the range of numbers though none of its own does."""
    if unstable(model):
        return
    with np.errstate(all="ignore"):
        size = np.abs(model.frequency_response(task.frequencies)).max(initial=0.0)
    if not size <= LARGEST:
        raise NoModelError("not_finite", f"a model whose response is {size:g} at some frequency of the task")


def _check_dt(numbers: Numbers, data: IOData) -> None:
    dt = numbers.get("dt")
    if dt is None or dt.size != 1:
        raise NoModelError("malformed", f"no sampling time given, expected dt = {data.dt:g}, s")
    if not abs(float(dt.ravel()[0]) - data.dt) <= SAME_DT * data.dt:
        raise NoModelError(
            "malformed",
            f"dt = {float(dt.ravel()[0]):g} given, expected a discrete-time model with that of the record, {data.dt:g}",
        )


def _check_lengths(numbers: Numbers) -> None:
    """Refuse what would be a model of too many states before it is made."""
    for name in (*POLYNOMIALS, *FRACTION):
        length = max(numbers[name].shape, default=0) if name in numbers else 0
        if length > MOST_ORDER + 1:
            raise NoModelError(
                "malformed", f"{name} of shape {numbers[name].shape} given, expected at most {MOST_ORDER + 1} in a row"
            )


def _state_space(numbers: Numbers, data: IOData, innovation: FloatArray | None) -> StateSpace:
    a = numbers["A"]
    n = 0 if a.size == 0 else (a.shape[0] if a.ndim else 1)
    if n > MOST_ORDER:
        raise NoModelError("malformed", f"A of shape {a.shape} given, expected at most {MOST_ORDER} states")
    shapes = {"A": (n, n), "B": (n, data.nu), "C": (data.ny, n), "D": (data.ny, data.nu), "K": (n, data.ny)}
    found = {name: shaped(name, numbers[name], shape) for name, shape in shapes.items() if name in numbers}
    direct = found.get("D", np.zeros(shapes["D"]))
    return StateSpace(found["A"], found["B"], found["C"], direct, found.get("K"), data.dt, innovation)
