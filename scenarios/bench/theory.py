"""Expectations of theory for an estimator on the test bench: which metrics it passes, which not, and why.

The classical results: a prediction-error estimate in a structure that holds the truth, its disturbance included, is
consistent, reaches the Cramér-Rao bound and knows its own covariance, in open loop and under feedback [Ljung1999,
ch. 8, 9 and 13]. Everything else gives up some of this.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from scenarios.bench.measurement import Measurements
from scenarios.bench.null_distributions import SLACK, bound_for, error_against_bound, null_distribution, responses
from scenarios.estimators.estimator import Estimator
from scenarios.files.codec import structure
from scenarios.files.toml_file import read_toml
from scenarios.problems.registry import problem
from sysid.records.arrays import FloatArray
from sysid.validation.monte_carlo import limits_of_mean
from sysid.validation.response_errors import free_parts, real_and_imaginary, variance_ratio

INDEPENDENCE = "independence"
"""The part of `tests_and_orders` that looks at residuals and past inputs; both are whitened first, whatever the
disturbance."""


@dataclass(frozen=True)
class Expectation:
    """Theory's expectation of a metric.

    Attributes:
        passes: Whether the metric is expected to pass; if not, it fails in the limit of long records, and may fail on
            those of the bench.
        why: Reason and reference.
    """

    passes: bool
    why: str = ""


@dataclass(frozen=True)
class Limitation:
    """A reason why a kind of estimator fails some metrics.

    Attributes:
        fails: Names of the metrics.
        why: Reason and reference.
        claims: Why claims fail: `bias` alone; `bias and scatter`, where a wrong model of the disturbance spoils the
            claimed covariance too; empty for another reason. See `expected_of_claims`.
    """

    fails: tuple[str, ...]
    why: str
    claims: str = ""


_TABLES = Path(__file__).with_name("limitations.toml")
LIMITATIONS = structure(dict[str, Limitation], read_toml(_TABLES.read_text(encoding="utf-8"), _TABLES.name))
"""Limitations by name."""

NEGLIGIBLE_BIAS = 0.1
"""Greatest share of a bias in the mean square error that explains no failure: it would make errors in claimed
deviations a ninth larger in the square, which is within the limits. Ten records cannot show it, a hundred can."""


def expectation(estimator: Estimator, name: str, metric: str) -> Expectation:
    """Theory's expectation of an estimator on a problem.

    Args:
        estimator: The estimator; without a stated method it is expected to pass.
        name: Name of the problem, or its family.
        metric: Key of the metric, or `INDEPENDENCE`.
    """
    limit = limitation(estimator.method, estimator.structure, name)
    if limit is None or metric not in limit.fails:
        return Expectation(True)
    return Expectation(False, limit.why)


@lru_cache(maxsize=1024)
def limitation(method: str | None, structure: str | None, name: str) -> Limitation | None:
    """Known limitation of a method with models of a structure on a problem, or None.

    Args:
        method: One of `scenarios.estimators.estimator.METHODS`, or None.
        structure: One of `sysid.polynomial.structures.STRUCTURES`; None: that of the truth.
        name: Name of the problem.
    """
    # A name is FAMILY-MORE@SAMPLES.
    family = name.split("@")[0].split("-")[0]
    feedback = family == "feedback"
    # Without noise every method is exact; of an estimator without a stated method theory says nothing.
    if method is None or family == "quiet":
        return None
    if family == "twin":
        return LIMITATIONS.get(f"arm_{method}")
    if method in ("observer", "subspace"):
        return _in_loop("feedback_input", method, feedback)
    # A structure has a bound where it holds the truth, its disturbance included.
    holds_truth = structure is None or problem(name).bound(structure) is not None
    if method == "instrumental":
        if holds_truth:
            return LIMITATIONS["instruments"]
        return _in_loop("instruments_feedback", "instruments_coloured", feedback)
    if holds_truth:
        return None
    if structure == "oe":
        return _in_loop("feedback_input", "output_error", feedback)
    if structure == "arx":
        return _in_loop("feedback_noise", "equation_error", feedback)
    return _in_loop("feedback_noise", "wrong_disturbance", feedback)


def _in_loop(closed: str, opened: str, feedback: bool) -> Limitation:
    """One of two limitations, of closed and of open loop."""
    name = closed if feedback else opened
    return LIMITATIONS[name]


def expected_of_claims(estimator: Estimator, name: str, good: Measurements, metric: str) -> Expectation:
    """Theory of an estimator's claims on one problem; an excuse by bias is withdrawn where there is no bias.

    A method with a known bias may claim too little, since its claims do not include the bias. Where the mean error is
    no more than `NEGLIGIBLE_BIAS` of the mean square error at any frequency, it may not. Where a wrong model of the
    disturbance would spoil the claims too, the mean square error must also be that of the bound.
    """
    expected = expectation(estimator, name, metric)
    limit = limitation(estimator.method, estimator.structure, name)
    if expected.passes or limit is None or not limit.claims:
        return expected
    share = greatest_bias(good, name, estimator.structure)
    # NaN, of fewer than two models, withdraws no excuse.
    if not share <= NEGLIGIBLE_BIAS:
        return expected
    if limit.claims == "bias and scatter":
        values = error_against_bound(good, name, estimator.structure)
        null = null_distribution(name, estimator.structure, variance_ratio, 1.0)
        # With a probability of 1e-3 the mean square error of a perfect estimator is taken as larger than the bound
        if np.mean(values) > SLACK * limits_of_mean([null], [len(values)], 1e-3, low=False)[1]:
            return expected
    return Expectation(
        True,
        f"its mean error is at most {100.0 * max(share, 0.0):.2g} % of its mean square error at any frequency: "
        "there is no bias that would excuse its claims",
    )


def greatest_bias(good: Measurements, name: str, structure: str | None) -> float:
    """Square of the mean error of the response over the mean square error, at the frequency where it is largest.

    Free of what scatter leaves in a mean. NaN for fewer than two records with a model.
    """
    if len(good) < 2:
        return float("nan")
    bound = bound_for(name, structure)
    free = free_parts(bound.response_covariance).any(axis=-1)
    errors = real_and_imaginary(responses(good) - bound.response)[:, free]
    squares: FloatArray = np.mean(np.sum(errors**2, axis=-1), axis=0)
    of_mean = np.sum(np.mean(errors, axis=0) ** 2, axis=-1)
    # The square of a mean over n records holds 1/n of their variance, which is (squares - of_mean) n / (n - 1).
    scatter = (squares - of_mean) / (len(errors) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.max((of_mean - scatter) / squares))
