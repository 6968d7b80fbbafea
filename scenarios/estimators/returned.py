"""What a Python function may return, as named numbers. Runs in the function's own process.

It may return

- `Answer`: a model and all claims about it;
- `sysid.Estimate`: the accuracy that it knows of its response and bandwidth is claimed too;
- `sysid.StateSpace` or `sysid.Polynomials`;
- python-control's `StateSpace` or `TransferFunction`, discrete in time with the sampling time of the record;
- a tuple (model, covariance) or (model, covariance, bandwidth_ci95): a model of the two lines before. The covariance is
  that of the parameters of polynomials or of a transfer function (p, p), in the sequence A, B, C, D, F (numerator
  before denominator), or that of the response (nf, ny, nu, 2, 2); either of the two may be None.
"""

import sys
from typing import Any

import numpy as np

from scenarios.estimators.claims import response_and_interval
from scenarios.estimators.named_numbers import POLYNOMIALS, Numbers, real
from scenarios.estimators.outcome import Answer, NoModelError
from scenarios.estimators.task import Task
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.records.arrays import FloatArray

EXPECTED = (
    "expected Answer, sysid.Estimate, sysid.StateSpace, sysid.Polynomials, python-control's StateSpace or "
    "TransferFunction, or a tuple (model, covariance) or (model, covariance, bandwidth_ci95)"
)

OF_RESPONSE = 5
"""Axes of the covariance of a response."""


def numbers_of(value: object, data: IOData, task: Task) -> Numbers:
    """Named numbers of what a function returned.

    Args:
        value: What it returned.
        data: The record of the request.
        task: The task of the request.

    Raises:
        NoModelError: It is nothing of the list above.
    """
    if isinstance(value, Estimate):
        return _of_estimate(value, task)
    if isinstance(value, Answer):
        polynomials = {} if value.polynomials is None else _of_polynomials(value.polynomials)
        claims = _claims(value.covariance, value.response_covariance, value.bandwidth_ci95)
        return _of_model(value.model, data) | polynomials | claims
    if not isinstance(value, tuple):
        return _of_model(value, data)
    if len(value) not in (2, 3):
        raise NoModelError("malformed", f"a tuple of {len(value)} given, {EXPECTED}")
    covariance = None if value[1] is None else real("covariance", value[1])
    of_response = covariance is not None and covariance.ndim == OF_RESPONSE
    ends = value[2] if len(value) > 2 else None
    return _of_model(value[0], data) | (
        _claims(None, covariance, ends) if of_response else _claims(covariance, None, ends)
    )


def estimate_answer(estimate: Estimate, task: Task) -> Answer:
    """An estimate of the toolbox as an answer.

    Response and bandwidth of a polynomial model follow from the covariance of its parameters; the parameters of a
    state-space model are coordinates of its own, so their covariance is propagated here.

    Args:
        estimate: From any method; a covariance that it does not know (NaN) is not claimed.
        task: What was asked: the response is claimed at its frequencies.
    """
    if not np.isfinite(estimate.covariance).all():
        return Answer(estimate.model, estimate.polynomials)
    if estimate.polynomials is not None:
        return Answer(estimate.model, estimate.polynomials, estimate.covariance)
    response, bandwidth = estimate.response_and_bandwidth(task.frequencies)
    return Answer(estimate.model, response_covariance=response.covariance, bandwidth_ci95=bandwidth.ci95)


def _of_estimate(estimate: Estimate, task: Task) -> dict[str, FloatArray]:
    numbers = _of_state_space(estimate.model)
    if estimate.polynomials is not None:
        numbers |= _of_polynomials(estimate.polynomials)
    covariance = real("covariance", estimate.covariance)
    if not covariance.size or np.isnan(covariance).all():
        # A method that does not know its covariance says so by NaN: none is claimed.
        return numbers
    response, ends = None, None
    if np.isfinite(covariance).all() and estimate.model.input_path().is_stable():
        response, ends = response_and_interval(estimate, task)
    return numbers | _claims(covariance if estimate.polynomials is not None else None, response, ends)


def _claims(covariance: Any, response_covariance: Any, ends: Any) -> dict[str, FloatArray]:
    claims = {"covariance": covariance, "response_covariance": response_covariance, "bandwidth_ci95": ends}
    return {name: real(name, value) for name, value in claims.items() if value is not None}


def _of_model(model: object, data: IOData) -> dict[str, FloatArray]:
    if isinstance(model, StateSpace):
        return _of_state_space(model)
    if isinstance(model, Polynomials):
        return {"dt": np.array(data.dt), **_of_polynomials(model)}
    # Whoever returns one of its systems has imported it: no need to import it for everyone.
    control = sys.modules.get("control")
    if control is not None and isinstance(model, control.TransferFunction):
        return {"dt": _discrete(model.dt), **_of_fractions(model)}
    if control is not None and isinstance(model, control.StateSpace):
        return {"dt": _discrete(model.dt), **{name: real(name, getattr(model, name)) for name in "ABCD"}}
    raise NoModelError("malformed", f"{type(model).__name__} given, {EXPECTED}")


def _of_state_space(model: StateSpace) -> dict[str, FloatArray]:
    values = {name: getattr(model, name) for name in ("dt", "A", "B", "C", "D", "K", "innovation_covariance")}
    return {name: real(name, value) for name, value in values.items() if value is not None}


def _of_polynomials(polynomials: Polynomials) -> dict[str, FloatArray]:
    return {name: real(name, getattr(polynomials, letter)) for name, letter in POLYNOMIALS.items()}


def _of_fractions(system: Any) -> dict[str, FloatArray]:
    """Coefficients of falling powers of z, all (ny, nu, k) or (k,)."""
    ny, nu = system.noutputs, system.ninputs
    pairs = {(i, j): (real("num", system.num[i][j]), real("den", system.den[i][j])) for i, j in np.ndindex(ny, nu)}
    k = max(len(part) for pair in pairs.values() for part in pair)
    num, den = np.zeros((2, ny, nu, k))
    for (i, j), (above, below) in pairs.items():
        if len(above) > len(below):
            raise NoModelError(
                "malformed", "a transfer function given that is not causal, expected num no longer than den"
            )
        # Zeros behind both are a power of z above and below: the denominator still begins with its highest power.
        num[i, j, len(below) - len(above) : len(below)] = above
        den[i, j, : len(below)] = below
    return {"num": num[0, 0], "den": den[0, 0]} if (ny, nu) == (1, 1) else {"num": num, "den": den}


def _discrete(dt: object) -> FloatArray:
    """Sampling time of a system of python-control, which is 0 or True where there is none."""
    if isinstance(dt, bool) or not isinstance(dt, int | float) or not dt > 0:
        raise NoModelError(
            "malformed", f"a system with dt = {dt!r} given, expected one that is discrete in time, dt in s"
        )
    return np.array(float(dt))
