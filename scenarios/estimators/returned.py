"""What a Python function may return, as numbers by name. Runs in the function's own process.

It may return

- `Answer`: model and all that is claimed of it;
- `sysid.Estimate`: what it knows of its response at the frequencies of the task and of its bandwidth goes along;
- `sysid.StateSpace` or `sysid.Polynomials`;
- python-control's `StateSpace` or `TransferFunction`, discrete in time with the sampling time of the record;
- a tuple (model, covariance) or (model, covariance, bandwidth_ci95): a model of the two lines before, or `Answer`'s
  fields in its sequence. The covariance is that of the parameters of polynomials or of a transfer function (p, p), in
  the sequence A, B, C, D, F (numerator before denominator), or that of the response (nf, ny, nu, 2, 2); either of the
  two may be None.
"""

import sys
from typing import Any

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.claims import response_and_interval
from scenarios.estimators.model_names import POLYNOMIALS
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.shapes import real
from scenarios.estimators.task import Task
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.records.arrays import FloatArray

EXPECTED = (
    "expected Answer, sysid.Estimate, sysid.StateSpace, sysid.Polynomials, python-control's StateSpace or "
    "TransferFunction, or a tuple (model, covariance) or (model, covariance, bandwidth_ci95)"
)

OF_RESPONSE = 5
"""Axes of the covariance of a response."""


def numbers_of(value: object, data: IOData, task: Task) -> dict[str, FloatArray]:
    """The numbers of what a function returned; see `scenarios.estimators.model_names.NAMES`.

    Args:
        value: What it returned.
        data: The record that it was given.
        task: What it was asked.

    Raises:
        NoModelError: It is nothing of the list.
    """
    if isinstance(value, Estimate):
        return _of_estimate(value, task)
    if isinstance(value, Answer):
        found = _of_model(value.model, data)
        if value.polynomials is not None:
            found |= _of_polynomials(value.polynomials)
        found |= _claims(value.covariance, value.response_covariance, value.bandwidth_ci95)
        return found
    if isinstance(value, tuple):
        if len(value) not in (2, 3):
            raise NoModelError("malformed", f"a tuple of {len(value)} given, {EXPECTED}")
        found = _of_model(value[0], data)
        covariance = None if value[1] is None else real("covariance", value[1])
        response = covariance is not None and covariance.ndim == OF_RESPONSE
        ends = value[2] if len(value) > 2 else None
        return found | _claims(None if response else covariance, covariance if response else None, ends)
    return _of_model(value, data)


def _of_estimate(estimate: Estimate, task: Task) -> dict[str, FloatArray]:
    found = _of_state_space(estimate.model)
    if estimate.polynomials is not None:
        found |= _of_polynomials(estimate.polynomials)
    covariance = real("covariance", estimate.covariance)
    if not covariance.size or np.isnan(covariance).all():
        # A method that does not know it says so.
        return found
    response, ends = None, None
    if np.isfinite(covariance).all() and estimate.model.input_path().is_stable():
        response, ends = response_and_interval(estimate, task)
    return found | _claims(covariance if estimate.polynomials is not None else None, response, ends)


def _claims(covariance: Any, response_covariance: Any, ends: Any) -> dict[str, FloatArray]:
    given = {"covariance": covariance, "response_covariance": response_covariance, "bandwidth_ci95": ends}
    return {name: real(name, value) for name, value in given.items() if value is not None}


def _of_model(model: object, data: IOData) -> dict[str, FloatArray]:
    if isinstance(model, StateSpace):
        return _of_state_space(model)
    if isinstance(model, Polynomials):
        return {"dt": np.array(data.dt), **_of_polynomials(model)}
    # Whoever returns one of its systems has loaded it.
    control = sys.modules.get("control")
    if control is not None and isinstance(model, control.TransferFunction):
        return {"dt": _discrete(model.dt), **_of_fractions(model)}
    if control is not None and isinstance(model, control.StateSpace):
        return {"dt": _discrete(model.dt), **{name: real(name, getattr(model, name)) for name in "ABCD"}}
    raise NoModelError("malformed", f"{type(model).__name__} given, {EXPECTED}")


def _of_state_space(model: StateSpace) -> dict[str, FloatArray]:
    names = ("dt", "A", "B", "C", "D", "K", "innovation_covariance")
    found = {name: getattr(model, name) for name in names}
    return {name: real(name, value) for name, value in found.items() if value is not None}


def _of_polynomials(polynomials: Polynomials) -> dict[str, FloatArray]:
    return {name: real(name, getattr(polynomials, letter)) for name, letter in POLYNOMIALS.items()}


def _of_fractions(system: Any) -> dict[str, FloatArray]:
    """Coefficients of falling powers of z, all (ny, nu, k) or (k,): what is shorter is filled up in front."""
    pairs = [
        [(real("num", system.num[i][j]), real("den", system.den[i][j])) for j in range(system.ninputs)]
        for i in range(system.noutputs)
    ]
    k = max(len(part) for line in pairs for pair in line for part in pair)
    num = np.zeros((system.noutputs, system.ninputs, k))
    den = np.zeros_like(num)
    for i, line in enumerate(pairs):
        for j, (above, below) in enumerate(line):
            behind = k - len(below)
            if len(above) > len(below):
                raise NoModelError(
                    "malformed", "a transfer function given that is not causal, expected num no longer than den"
                )
            # Times a power of z above and below: the denominator begins with its highest power.
            num[i, j, len(below) - len(above) : len(below)] = above
            den[i, j, : k - behind] = below
    return {"num": num[0, 0], "den": den[0, 0]} if num.shape[:2] == (1, 1) else {"num": num, "den": den}


def _discrete(dt: object) -> FloatArray:
    """The sampling time of a system of python-control.

    Raises:
        NoModelError: It is continuous in time, or has none.
    """
    if isinstance(dt, bool) or not isinstance(dt, int | float) or not dt > 0:
        raise NoModelError(
            "malformed", f"a system with dt = {dt!r} given, expected one that is discrete in time, dt in s"
        )
    return np.array(float(dt))
