"""Values that a Python function may return, as named numbers. Runs in the function's own process.

docs/estimator-protocol.md says which, and what they mean.
"""

import sys
from typing import Any

import numpy as np

from scenarios.estimators.named_numbers import CLAIMS, MATRICES, POLYNOMIALS, Numbers, real, real_numbers
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

    Raises:
        NoModelError: It is nothing that the protocol knows.
    """
    if isinstance(value, Estimate):
        value = estimate_answer(value, task)
    if isinstance(value, Answer):
        claims = {name: getattr(value, name) for name in CLAIMS}
        return _of_model(value.model, data) | _of_polynomials(value.polynomials) | real_numbers(claims)
    if not isinstance(value, tuple):
        return _of_model(value, data)
    if len(value) not in (2, 3):
        raise NoModelError(f"a tuple of {len(value)} given, {EXPECTED}")
    model, covariance, ends = (*value, None)[:3]
    # The covariance of the parameters has two axes, that of the response five.
    of_response = covariance is not None and real("covariance", covariance).ndim == OF_RESPONSE
    name = "response_covariance" if of_response else "covariance"
    return _of_model(model, data) | real_numbers({name: covariance, "bandwidth_ci95": ends})


def estimate_answer(estimate: Estimate, task: Task) -> Answer:
    """An estimate of the toolbox as an answer.

    Response and bandwidth of a polynomial model follow from the covariance of its parameters; the parameters of a
    state-space model are coordinates of its own, so their covariance is propagated here.

    Args:
        estimate: From any method; a covariance that it does not know (NaN throughout) is not claimed.
        task: What was asked: the response is claimed at its frequencies.
    """
    # An estimate without parameters, or of a method that does not know its covariance, claims nothing.
    if np.isnan(estimate.covariance).all():
        return Answer(estimate.model, estimate.polynomials)
    # NaN among numbers is passed on, to be reported as not finite.
    if estimate.polynomials is not None or not np.isfinite(estimate.covariance).all():
        return Answer(estimate.model, estimate.polynomials, estimate.covariance)
    # Only here: the process that reads the answer does not know the coordinates.
    response, bandwidth = estimate.response_and_bandwidth(task.frequencies)
    return Answer(estimate.model, response_covariance=response.covariance, bandwidth_ci95=bandwidth.ci95)


def _of_model(model: object, data: IOData) -> dict[str, FloatArray]:
    """Named numbers of a model of any of the accepted types."""
    if isinstance(model, StateSpace):
        return real_numbers({name: getattr(model, name) for name in ("dt", *MATRICES, "innovation_covariance")})
    if isinstance(model, Polynomials):
        return {"dt": np.array(data.dt), **_of_polynomials(model)}
    # Whoever returns one of its systems has imported it: no need to import it for everyone.
    control = sys.modules.get("control")
    if control is None or not isinstance(model, control.TransferFunction | control.StateSpace):
        raise NoModelError(f"{type(model).__name__} given, {EXPECTED}")
    # The sampling time of its systems is 0 or True where there is none.
    if isinstance(model.dt, bool) or not isinstance(model.dt, int | float) or not model.dt > 0:
        raise NoModelError(f"a system with dt = {model.dt!r} given, expected one that is discrete in time, dt in s")
    if isinstance(model, control.TransferFunction):
        return {"dt": np.array(float(model.dt)), **_of_fractions(model)}
    return {name: real(name, getattr(model, name)) for name in ("dt", "A", "B", "C", "D")}


def _of_polynomials(polynomials: Polynomials | None) -> dict[str, FloatArray]:
    """Named numbers of polynomials; none where there are none."""
    return {} if polynomials is None else {name: getattr(polynomials, key) for name, key in POLYNOMIALS.items()}


def _of_fractions(system: Any) -> dict[str, FloatArray]:
    """Coefficients of falling powers of z, all (ny, nu, k) or (k,)."""
    ny, nu = system.noutputs, system.ninputs
    longest = max(len(denominator) for row in system.den for denominator in row)
    num, den = np.zeros((2, ny, nu, longest))
    for i, j in np.ndindex(ny, nu):
        numerator, denominator = real("num", system.num[i][j]), real("den", system.den[i][j])
        if len(numerator) > len(denominator):
            raise NoModelError("a transfer function given that is not causal, expected num no longer than den")
        # Zeros behind both are a power of z above and below: the denominator still begins with its highest power.
        num[i, j, len(denominator) - len(numerator) : len(denominator)] = numerator
        den[i, j, : len(denominator)] = denominator
    return {"num": num, "den": den}
