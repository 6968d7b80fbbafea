"""What theory expects of an estimator on the test bench: which metrics it passes, which not, and why.

The classical results: a prediction-error estimate in a structure that holds the truth, its disturbance included, is
consistent, reaches the Cramér-Rao bound and knows its own covariance, in open loop and under feedback [Ljung1999,
ch. 8, 9 and 13]. Everything else gives up some of this.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenarios.bench.measurement import Measurements
from scenarios.bench.statistics import (
    SLACK,
    bound_for,
    error_against_bound,
    free_parts,
    limits_of_mean,
    null_distribution,
    real_and_imaginary,
    variance_ratio,
)
from scenarios.estimators.estimator import Estimator
from scenarios.problems.bound import response_covariance
from scenarios.problems.registry import problem
from sysid.records.arrays import FloatArray

CONSISTENT = ("consistency", "bias")
"""Metrics of the mean error."""

CLAIMS = ("coverage", "normalised_error", "frequency_response")
"""Metrics of the accuracy that an estimator claims."""

ACCURACY = (*CONSISTENT, "efficiency", *CLAIMS)
TESTS = "tests_and_orders"
INDEPENDENCE = "independence"
"""The part of `TESTS` that looks at residuals and past inputs; both are whitened first, whatever the disturbance."""

BIAS, BIAS_AND_SCATTER = "bias", "bias and scatter"


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
        claims: Why claims fail: `BIAS` alone; `BIAS_AND_SCATTER`, where a wrong model of the disturbance spoils the
            claimed covariance too; empty for another reason. See `expected_of_claims`.
    """

    fails: tuple[str, ...]
    why: str
    claims: str = ""


FEEDBACK_INPUT = Limitation(
    ACCURACY,
    "its method takes the input as independent of the disturbance; feedback makes it depend on it, and the estimate "
    "biased [Ljung1999, ch. 13; Soderstrom1989, ch. 10]",
    BIAS,
)
INSTRUMENTS_FEEDBACK = Limitation(
    ACCURACY,
    "instruments built of an input that feedback makes depend on the disturbance are biased; a whitener before the "
    "last stage leaves them only as much of that as it does not whiten, since what is white does not depend on past "
    "inputs: on short records it may pass [Ljung1999, ch. 13; Soderstrom1989, ch. 8]",
)
FEEDBACK_NOISE = Limitation(
    ACCURACY,
    "under feedback the model of the disturbance must be right, or the estimate of the dynamics is biased "
    "[Ljung1999, ch. 13]",
)
EQUATION_ERROR = Limitation(
    (*ACCURACY, TESTS, INDEPENDENCE),
    "least squares are biased unless the disturbance is white equation error: past outputs carry it "
    "[Ljung1999, sec. 7.3]",
    BIAS_AND_SCATTER,
)
OUTPUT_ERROR = Limitation(
    ("efficiency", *CLAIMS, TESTS),
    "under a coloured disturbance output error is consistent in open loop, but not efficient, and intervals that take "
    "it as white are wrong; residuals are not white, though independent of past inputs [Ljung1999, ch. 8 and 9]",
)
WRONG_DISTURBANCE = Limitation(
    (*ACCURACY, TESTS, INDEPENDENCE),
    "the structure has poles in common between input and disturbance and cannot hold this disturbance: what is "
    "estimated is a compromise of both [Ljung1999, ch. 8]",
    BIAS_AND_SCATTER,
)
INSTRUMENTS = Limitation(
    ("efficiency",),
    "instruments built of the input leave out what past outputs tell through the disturbance: consistent, not "
    "efficient [Soderstrom1989, ch. 8]",
)
INSTRUMENTS_COLOURED = Limitation(
    ("efficiency", *CLAIMS, TESTS),
    "instruments built of the input are consistent whatever the disturbance; they are efficient, and their covariance "
    "is right, only where the autoregression that filters the data is that of A y - B u, which then is not white "
    "[Soderstrom1989, ch. 8; Ljung1999, sec. 15.3]",
)
SUBSPACE = Limitation(
    ("efficiency",),
    "subspace projections minimise no likelihood: consistent, above the Cramér-Rao bound [VanOverschee1996, ch. 3]",
)
OBSERVER = Limitation(
    (*ACCURACY, TESTS, INDEPENDENCE),
    "p observer Markov parameters truncate what the disturbance would need, and a realisation of low order weighs them "
    "without regard to how well each is known: above the Cramér-Rao bound, biased where p or the order is low, and the "
    "claimed covariance knows nothing of the bias [Juang1993]",
    BIAS,
)

NEGLIGIBLE_BIAS = 0.1
"""Greatest share of a bias in the mean square error that explains no failure: it would make errors in claimed
deviations a ninth larger in the square, which is within the limits. Ten records cannot show it, a hundred can."""

INEFFICIENT = 1e-3
"""Probability that the mean square error of a perfect estimator is taken as larger than the bound."""

UNSTABLE_MODELS = {
    "subspace": "a subspace estimate of A may have poles outside the unit circle, also where the truth is stable "
    "[Maciejowski1995]",
    "instrumental": "instrumental variables minimise no error of the model; nothing keeps its poles within the unit "
    "circle where noise and distortion are large [Soderstrom1989, ch. 8]",
}
"""Methods that may give unstable models, and why."""


def expectation(estimator: Estimator, name: str, metric: str) -> Expectation:
    """Theory's expectation of an estimator on a problem.

    Args:
        estimator: The estimator; without a stated method it is expected to pass.
        name: Name of the problem.
        metric: Key of the metric, or `INDEPENDENCE`.
    """
    limit = limitation(estimator.method, estimator.structure, name)
    if limit is not None and metric in limit.fails:
        return Expectation(False, limit.why)
    return Expectation(True)


@lru_cache(maxsize=1024)
def limitation(method: str | None, structure: str | None, name: str) -> Limitation | None:
    """The limitation of a method in a structure on a problem; None: there is none.

    Args:
        method: One of `scenarios.estimators.estimator.METHODS`, or None.
        structure: One of `scenarios.estimators.task.STRUCTURES`; None: that of the truth.
        name: Name of the problem.
    """
    family = name.split("@")[0].split("-")[0]
    if method is None or family in ("quiet", "twin"):
        return None
    if method == "observer":
        return FEEDBACK_INPUT if family == "feedback" else OBSERVER
    if method == "subspace":
        return FEEDBACK_INPUT if family == "feedback" else SUBSPACE
    held = structure is None or problem(name).bound(structure) is not None
    if method == "instrumental":
        if family == "feedback" and not held:
            return INSTRUMENTS_FEEDBACK
        return INSTRUMENTS if held else INSTRUMENTS_COLOURED
    if held:
        return None
    if family == "feedback":
        return FEEDBACK_INPUT if structure == "oe" else FEEDBACK_NOISE
    if structure == "oe":
        return OUTPUT_ERROR
    return EQUATION_ERROR if structure == "arx" else WRONG_DISTURBANCE


def expected_of_claims(estimator: Estimator, name: str, good: Measurements, metric: str) -> Expectation:
    """Theory of an estimator's claims on one problem; an excuse by bias is withdrawn where there is no bias.

    A method with a known bias may claim too little, since its claims do not include the bias. Where the mean error is
    no more than `NEGLIGIBLE_BIAS` of the mean square error at any frequency, it may not. Where a wrong model of the
    disturbance would spoil the claims too, the mean square error must also be that of the bound.

    Args:
        estimator: The estimator.
        name: Name of the problem.
        good: Records of the problem that have a model.
        metric: Key of the metric.
    """
    expected = expectation(estimator, name, metric)
    limit = limitation(estimator.method, estimator.structure, name)
    if expected.passes or limit is None or limit.claims not in (BIAS, BIAS_AND_SCATTER):
        return expected
    share = greatest_bias(good, name, estimator.structure)
    if not share <= NEGLIGIBLE_BIAS or (
        limit.claims == BIAS_AND_SCATTER and not _efficient(good, name, estimator.structure)
    ):
        return expected
    return Expectation(
        True,
        f"its mean error is at most {100.0 * max(share, 0.0):.2g} % of its mean square error at any frequency: "
        "there is no bias that would excuse its claims",
    )


def _efficient(good: Measurements, name: str, structure: str | None) -> bool:
    values = error_against_bound(good, name, structure)
    null = null_distribution(name, structure, variance_ratio, 1.0)
    if null is None or not len(values):
        return False
    return float(np.mean(values)) <= SLACK * limits_of_mean(null, len(values), INEFFICIENT, low=False)[1]


def greatest_bias(good: Measurements, name: str, structure: str | None) -> float:
    """Square of the mean error of the response over the mean square error, at the frequency where it is largest.

    Free of what scatter leaves in a mean. NaN where there is no bound or fewer than two records.

    Args:
        good: Records of the problem that have a model.
        name: Of the problem.
        structure: Of the estimator.
    """
    bound = bound_for(name, structure)
    responses = [m.response for m in good if m.response is not None]
    if bound is None or len(responses) < 2:
        return float("nan")
    free = free_parts(response_covariance(bound)).any(axis=-1)
    errors = real_and_imaginary(np.stack(responses) - bound.response)[:, free]
    squares: FloatArray = np.mean(np.sum(errors**2, axis=-1), axis=0)
    of_mean = np.sum(np.mean(errors, axis=0) ** 2, axis=-1)
    scatter = (squares - of_mean) / (len(errors) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.max((of_mean - scatter) / squares))
