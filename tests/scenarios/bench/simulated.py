"""Measurements of a perfect estimator and of faulty ones, with errors drawn from the Cramér-Rao bound."""

from dataclasses import dataclass

import numpy as np

from scenarios.bench.measurement import Measurement
from scenarios.bench.null_distributions import bound_for
from scenarios.estimators.outcome import MODEL
from scenarios.problems.registry import problem
from sysid.models.delta_method import standard_directions
from sysid.models.frequency_response import NORMAL_95


@dataclass(frozen=True)
class Fault:
    """What is wrong with an estimator that is perfect otherwise.

    `variance` is a factor that the estimator knows and claims, `claimed` one on the claimed covariance alone; `failing`
    is the share of requests that give no model, `claimed_share` that of the records of which it claims anything.
    """

    gain: float = 1.0
    delay: int = 0
    variance: float = 1.0
    claimed: float = 1.0
    failing: float = 0.0
    claimed_share: float = 1.0


ACCURATE = frozenset({"noise_free_recovery", "consistency", "efficiency"})
HONEST = frozenset({"coverage", "normalised_error", "frequency_response"})
NONE = frozenset[str]()

FAULTS = {
    "perfect": (Fault(), NONE),
    "claimed covariance twice too large": (Fault(claimed=2.0), HONEST),
    "claimed covariance half as large": (Fault(claimed=0.5), HONEST),
    "gain 2 % too high": (Fault(gain=1.02), ACCURATE | HONEST),
    "one sample too late": (Fault(delay=1), ACCURATE | HONEST),
    "variance 1.5 times the bound": (Fault(variance=1.5), frozenset({"efficiency"})),
    "variance 1.05 times the bound": (Fault(variance=1.05), NONE),
    "no model for 1 of 50": (Fault(failing=0.02), NONE),
    "claims nothing": (Fault(claimed_share=0.0), NONE),
    "claims 70 of 100": (Fault(claimed_share=0.7), HONEST),
    "claims 99 of 100": (Fault(claimed_share=0.99), NONE),
    "claimed covariance 1e12 times too large": (Fault(claimed=1e12), HONEST),
    "claimed covariance infinite": (Fault(claimed=np.inf), HONEST),
}
"""Faults by name, and the figures of accuracy that each fails, and no others: a test holds them to it."""


def simulated(trials, fault, rng):
    """Measurements of an estimator that is perfect but for a fault, on problems with a bound or without noise."""
    return [_one(trial, fault, rng) for trial in trials]


def _one(trial, fault, rng):
    if fault.failing > 0.0 and rng.random() < fault.failing:
        return Measurement(trial, "unstable", "a pole outside the unit circle")
    here = problem(trial.problem)
    if trial.problem.startswith("quiet-"):
        true = here.truth.frequency_response(here.frequencies)
        return Measurement(trial, MODEL, response=_wrong(true, here.frequencies, here.truth.dt, fault))
    bound = bound_for(trial.problem, None)
    steps = rng.standard_normal(len(bound.response_directions)) * np.sqrt(fault.variance)
    parts = np.tensordot(steps, bound.response_directions, axes=1)
    response = _wrong(bound.response + parts[..., 0] + 1j * parts[..., 1], bound.frequencies, here.truth.dt, fault)
    if fault.claimed_share < 1.0 and rng.random() >= fault.claimed_share:
        return Measurement(trial, MODEL, response=response)
    scale = fault.variance * fault.claimed
    deviation = bound.bandwidth_deviation * np.sqrt(scale) * NORMAL_95
    bandwidth = bound.bandwidth_hz * np.exp(
        bound.bandwidth_deviation * rng.standard_normal(bound.bandwidth_hz.shape) * np.sqrt(fault.variance)
    )
    normalised, covered, count = _parameters(bound, fault, scale, rng)
    with np.errstate(over="ignore"):
        ends = np.stack((bandwidth * np.exp(-deviation), bandwidth * np.exp(deviation)))
    covariance = bound.response_covariance
    return Measurement(
        trial,
        MODEL,
        response=response,
        # infinity times zero is zero here
        response_covariance=scale * covariance if scale < np.inf else np.where(covariance == 0.0, 0.0, scale),
        normalised_error=normalised,
        parameters=count,
        covered=covered,
        bandwidth_hz=bandwidth,
        bandwidth_ci95=ends,
    )


def _wrong(response, frequencies, dt, fault):
    late = np.exp(-2j * np.pi * frequencies * dt * fault.delay)
    return np.asarray(fault.gain * late[:, None, None] * response)


def _parameters(bound, fault, scale, rng):
    """Normalised error, covered and number of the parameters; none of a state space, nor of a model with a delay."""
    p = len(bound.parameters)
    if fault.delay or bound.polynomials is None:
        return (float("nan"), -1, p)
    directions = standard_directions(bound.covariance)
    errors = directions @ rng.standard_normal(p) * np.sqrt(fault.variance)
    # a gain is one of B, which comes after A
    first = len(np.atleast_1d(bound.polynomials.A)) - 1
    lags = np.atleast_2d(bound.polynomials.B)
    count = int(np.count_nonzero(lags))
    errors[first : first + count] += (fault.gain - 1.0) * bound.parameters[first : first + count]
    whitened = np.linalg.lstsq(directions, errors, rcond=None)[0]
    within = np.abs(errors) <= NORMAL_95 * np.sqrt(scale * np.diag(bound.covariance))
    return (float(whitened @ whitened) / scale, int(np.count_nonzero(within)), p)
