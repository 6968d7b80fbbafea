"""Verdicts of the test bench in four words, and a guide to each metric: what it measures, and what it cannot see."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result


class Verdict(Enum):
    """A verdict: its word, and the sign that tells it apart without colour; from good to bad."""

    PASSES = ("passes", "✓")
    FAILS_AS_THEORY_SAYS = ("fails as theory says", "△")
    NONE = ("no verdict", "–")
    FAILS = ("fails", "✗")

    @property
    def word(self) -> str:
        """In words."""
        return self.value[0]

    @property
    def sign(self) -> str:
        """As one character."""
        return self.value[1]


def verdict(metric: Metric | None) -> Verdict:
    """The verdict of a metric: a part that fails where theory expects it to pass outweighs all others.

    Args:
        metric: The metric; None where the run has none of it.
    """
    if metric is None:
        return Verdict.NONE
    if metric.passed is False or any(part.surprises for part in metric.parts):
        return Verdict.FAILS
    if any(part.passed is False for part in metric.parts):
        return Verdict.FAILS_AS_THEORY_SAYS
    return Verdict.NONE if metric.passed is None else Verdict.PASSES


def part_verdict(part: Part) -> Verdict:
    """The verdict of a part of a metric."""
    if part.passed is None:
        return Verdict.NONE
    if part.passed:
        return Verdict.PASSES
    return Verdict.FAILS if part.theory else Verdict.FAILS_AS_THEORY_SAYS


def count(metrics: Iterable[Metric | None]) -> dict[Verdict, int]:
    """The number of metrics with each verdict."""
    counts = dict.fromkeys(Verdict, 0)
    for metric in metrics:
        counts[verdict(metric)] += 1
    return counts


@dataclass(frozen=True)
class MetricGuide:
    """How to read a metric.

    Attributes:
        short: Heading of its column.
        measures: What it measures and when it passes.
        blind: What it cannot see.
    """

    short: str
    measures: str
    blind: str


GUIDE: Mapping[str, MetricGuide] = MappingProxyType(
    {
        "noise_free_recovery": MetricGuide(
            "Digits without noise",
            "Correct digits of the frequency response on records without noise, −log10 of its relative rms error, by "
            "order and delay: quiet-3-2 is a system of order 3 with a delay of 2 samples. A method whose structure "
            "holds the system finds it up to rounding; fewer than 6 digits have another reason: often the state before "
            "the first sample, which is not zero and must be estimated or left out of the fit. More is better.",
            "whatever noise does.",
        ),
        "consistency": MetricGuide(
            "Consistency",
            "Slope of log rms error of the response over log number of samples: −1/2 where the error is chance, "
            "however much of it; 0 where it is bias and stays however long the record. Expected is the slope of the "
            "Cramér-Rao bound at these lengths; only a flatter one fails.",
            "how large the error is, and a bias that is small beside the scatter at the longest record.",
        ),
        "efficiency": MetricGuide(
            "Efficiency",
            "Mean of |error|² over the variance of the Cramér-Rao bound, over frequencies and records. 1 is what the "
            "best unbiased estimator reaches; one at 2 needs a record twice as long. The bound is that of the "
            "structure that the estimator declares: one that must also find the noise’s model is allowed more.",
            "whether an error is scatter or bias, and what the estimator says of its own accuracy.",
        ),
        "coverage": MetricGuide(
            "Coverage",
            "Share of claimed 95 % intervals that hold the truth: of parameters, of the bandwidth, of the response. "
            "Fewer than 95 %: it claims more than it knows; more: it knows more than it claims. Both fail.",
            "how wide intervals are: wide ones about a poor estimate hold the truth too.",
        ),
        "normalised_error": MetricGuide(
            "Normalised error",
            "Mean of error′ covariance⁻¹ error over its degrees of freedom, by the claimed covariance: 1 where the "
            "claim is right, ½ where the covariance is claimed twice too large. It sees correlations, which single "
            "intervals hide.",
            "estimators that claim no covariance.",
        ),
        "frequency_response": MetricGuide(
            "Response and band",
            "Rms error of the response in claimed standard deviations, over all frequencies and at the worst of them;"
            " 1 where the claim is right.",
            "frequencies that the problem does not ask for, and how large the error is: the drawing shows that.",
        ),
        "amplitude_split": MetricGuide(
            "Split over amplitude",
            "On the arm, which has friction and limits: the difference between estimate and best linear truth split "
            "into systematic error, noise and nonlinear distortion, against the amplitude of the command. The "
            "systematic error is judged: 5 % of the linear part are allowed at 5 and 10 mrad, 3 % at 20, 2 % from 40 "
            "on, and beyond that what the estimator’s own scatter from waveform to waveform explains by chance. Where "
            "that makes the limit more than four times as wide, to lie within says nothing: no verdict.",
            "distortion that looks like a linear system at the amplitude at hand, and a systematic error that hides in "
            "large scatter.",
        ),
        "bias": MetricGuide(
            "Bias",
            "Mean error of the response under feedback, and where two inputs share their waveform, in standard "
            "deviations of one record’s error, in the directions of which the records say least. 0.2 are allowed.",
            "errors in other directions, and those that cancel in the mean.",
        ),
        "tests_and_orders": MetricGuide(
            "Tests and orders",
            "How often residual tests at 1 % reject models of right order, how often they reject models of an order "
            "too low by one, and how often the estimator’s own choice of order is right, in percent.",
            "choices of estimators that refuse to choose: all are asked, and a refusal is no failure.",
        ),
        "agreement": MetricGuide(
            "Agreement",
            "Mean of |difference|² from a second implementation on the same records, in variances of the bound. Two "
            "efficient estimators differ by at most 4, of one record by hardly anything.",
            "errors that both have.",
        ),
        "reliability": MetricGuide(
            "Failures",
            "Share of requests that ended in no stable model, by kind. A single one fails. Failed requests are left "
            "out of all other figures, so that each fault shows where it belongs.",
            "a model that is stable and wrong.",
        ),
        "speed": MetricGuide(
            "Time",
            "Median processor time of an answer in rulers: a ruler is the time of a fixed least-squares problem on "
            "the same record in the same run, so that machines and lengths of records matter little. Beyond 1200 it "
            "fails.",
            "the time that starting a program takes.",
        ),
        "bandwidth": MetricGuide(
            "Bandwidth",
            "Half-power bandwidth that the estimator finds for each joint of the arm, beside the truth and the 1 Hz "
            "of the thesis. It is shown, not judged.",
            "why a bandwidth differs: friction lowers it for every linear estimator.",
        ),
    }
)
"""Guides by name of the metric, in the order of the page."""

INFORMATIVE = ("bandwidth",)
"""Metrics that never give a verdict."""


def judged_metrics(results: Iterable[Result]) -> tuple[str, ...]:
    """Names of the metrics by which rows are compared: all that give verdicts, whether a row has them or not.

    Args:
        results: Of all rows; metrics that they judge and this version does not know count too.
    """
    others = {name for result in results for name, m in result.figures.items() if verdict(m) is not Verdict.NONE}
    return (*(name for name in GUIDE if name not in INFORMATIVE), *sorted(others - set(GUIDE)))
