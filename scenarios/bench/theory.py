"""What theory expects of an estimator on the test bench: which metrics it passes, which not, and why.

The classical results: a prediction-error estimate in a structure that holds the truth, its disturbance included, is
consistent, reaches the Cramér-Rao bound and knows its own covariance, in open loop and under feedback [Ljung1999,
ch. 8, 9 and 13]. Everything else gives up some of this.
"""

from dataclasses import dataclass
from functools import lru_cache

from scenarios.estimators.estimator import Estimator
from scenarios.problems.registry import problem

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
            claimed covariance too; empty for another reason. See `scenarios.bench.claims.expected_of_claims`.
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
        method: One of `scenarios.estimators.contestant.METHODS`, or None.
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
