"""Answers to which one thing is done on purpose, everything else left as it is."""

from dataclasses import replace

import numpy as np

from scenarios.estimators.answer import Answer
from scenarios.estimators.delayed_model import delayed
from scenarios.files.errors import ScenarioError
from sysid import Estimate, Polynomials
from sysid.models import innovations_form
from sysid.models.delta_method import standard_directions
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray

ATTEMPTS = 100
"""Errors that are drawn at most until one leaves a stable model."""


def delayed_input(answer: Answer) -> Answer:
    """The same model and claims, the input one sample late."""
    if answer.polynomials is None:
        return replace(answer, model=delayed(answer.model, 1))
    b = np.atleast_2d(answer.polynomials.B)
    late = np.hstack((np.zeros((len(b), 1)), b)).reshape((*answer.polynomials.B.shape[:-1], -1))
    return _with_polynomials(answer, replace(answer.polynomials, B=late))


def scaled_gain(answer: Answer, factor: float) -> Answer:
    """The response from input to output times a factor."""
    if answer.polynomials is None:
        return replace(answer, model=replace(answer.model, B=factor * answer.model.B, D=factor * answer.model.D))
    return _with_polynomials(answer, replace(answer.polynomials, B=factor * answer.polynomials.B))


def changed_claim(answer: Answer, factor: float) -> Answer:
    """All claimed covariances times a factor, intervals with them; the model is left alone."""
    interval = answer.bandwidth_ci95
    if interval is not None:
        hz = answer.model.bandwidth()
        low, high = (_stretched(end, hz, np.sqrt(factor)) for end in interval)
        interval = (low, high)
    return replace(
        answer,
        covariance=None if answer.covariance is None else factor * answer.covariance,
        response_covariance=None if answer.response_covariance is None else factor * answer.response_covariance,
        bandwidth_ci95=interval,
    )


def wandering(estimate: Estimate, share: float, rng: np.random.Generator) -> Estimate:
    """The parameters with a normal error of so large a part of the claimed covariance; the claim is left alone.

    Args:
        estimate: With a covariance.
        share: Covariance of the error, as a multiple of the claimed one.
        rng: For the error.

    Raises:
        ScenarioError: No error leaves a stable model.
    """
    directions, realise = standard_directions(share * estimate.covariance), estimate.realise
    for _ in range(ATTEMPTS):
        theta = estimate.parameters + directions @ rng.standard_normal(len(estimate.parameters))
        model = realise(theta)
        if model.input_path().is_stable():
            polynomials = realise.orders.polynomials(theta) if isinstance(realise, Realise) else None
            return replace(estimate, parameters=theta, model=model, polynomials=polynomials)
    raise ScenarioError(f"{ATTEMPTS} errors drawn, none leaves a stable model")


def _with_polynomials(answer: Answer, polynomials: Polynomials) -> Answer:
    model = innovations_form(polynomials, answer.model.dt, answer.model.innovation_covariance)
    return replace(answer, model=model, polynomials=polynomials)


def _stretched(end: FloatArray, hz: FloatArray, factor: float) -> FloatArray:
    """An end of an interval that is symmetric on a logarithmic scale; NaN where there is no bandwidth."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(hz * (end / hz) ** factor)
