"""Bias of the response in closed loop, and where two inputs share their waveform."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import f as f_distribution
from scipy.stats import ncf

from scenarios.bench.accuracy import needed
from scenarios.bench.measurement import Measurements
from scenarios.bench.metric import DRAWS, UNLIMITED, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.statistics import bound_for, real_and_imaginary
from scenarios.bench.theory import expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

PROBLEMS = ("feedback", "feedback-arx", "shared")
RECORDS = 40
ALONE = "shared-alone"
"""One of two inputs that share their waveform: every estimate contains the other path; shown, not judged."""

RECORDS_ALONE = 20
DIRECTIONS = 4
"""In which the mean error is tested: those in which the record is least informative, by the bound."""

ALLOWED = 0.2
"""Bias that is no fault, in standard deviations of the estimator's own error.

Estimates that are unbiased in the limit have one of the order of 1/N, a fraction of a deviation on a short record.
"""


@dataclass(frozen=True)
class MeanError:
    """Size of a mean error in standard deviations of one record's error.

    Attributes:
        size: Estimate free of the part that scatter alone has, 0 where that part is larger.
        interval: 95 % interval of the size.
        limit: Value that `size` exceeds with the given probability where the mean is as large as allowed.
    """

    size: float
    interval: tuple[float, float]
    limit: float


def mean_error(errors: FloatArray, false_alarm: float, allowed: float = 0.0) -> MeanError:
    """Hotelling's test of the mean of repeated errors, with an allowance [Anderson2003, sec. 5.2].

    T^2 = K m' S^-1 m of the mean m and the sample covariance S of K records; (K - q) / (q (K - 1)) T^2 has the
    F distribution with q and K - q degrees of freedom and noncentrality K d^2, exactly for Gaussian errors, where d is
    the size of the true mean.

    Args:
        errors: One row per record, one column per direction (K, q), K of at least q + 3.
        false_alarm: Probability of a size beyond the limit.
        allowed: Size that is no fault.

    Returns:
        The size and its limit; both infinite where the errors are all equal and not zero.
    """
    records, q = errors.shape
    rest, noncentrality = records - q, records * allowed**2
    # the noncentral distribution loses digits where there is no noncentrality
    upper = ncf.isf(false_alarm, q, rest, noncentrality) if allowed else f_distribution.isf(false_alarm, q, rest)
    limit = _size(float(upper), records, q)
    statistic = f_statistic(errors)
    if not np.isfinite(statistic):
        return MeanError(np.inf, (np.inf, np.inf), limit)
    low, high = (_noncentrality(statistic, q, rest, share) for share in (0.025, 0.975))
    return MeanError(
        _size(statistic, records, q),
        (float(np.sqrt(low / records)), float(np.sqrt(high / records))),
        limit,
    )


def f_statistic(errors: FloatArray) -> float:
    """The F-distributed statistic; 0 where there are no errors, infinite where some direction does not scatter."""
    records, q = errors.shape
    mean = errors.mean(axis=0)
    length = np.sqrt(np.mean(errors**2, axis=0))
    used = length > 0.0
    if not used.any():
        return 0.0
    _, values, right = np.linalg.svd((errors - mean)[:, used] / length[used], full_matrices=False)
    if values[-1] <= 1e-12 * np.sqrt(records):
        # the same error in every record, in some direction: it has no scatter to be judged by
        return float("inf")
    whitened = (right @ (mean[used] / length[used])) / values
    return float(whitened @ whitened) * records * (records - q) / q


def _size(statistic: float, records: int, q: int) -> float:
    """E T^2 = (K - 1) (q + K d^2) / (K - q - 2), solved for d."""
    squared = statistic * q * (records - 1.0) / (records - q)
    return float(np.sqrt(max(squared * (records - q - 2.0) / (records - 1.0) - q, 0.0) / records))


def _noncentrality(statistic: float, q: int, rest: int, above: float) -> float:
    """Noncentrality with which a larger statistic has the given probability; 0 where even that is too much."""
    if float(f_distribution.sf(statistic, q, rest)) >= above:
        return 0.0

    def excess(value: float) -> float:
        return float(ncf.sf(statistic, q, rest, value)) - above

    high = 4.0 * (q * statistic + 10.0)
    while excess(high) < 0.0 and high < 1e12:
        high *= 4.0
    return float(brentq(excess, 0.0, high)) if excess(high) > 0.0 else high


class Bias(MetricDefinition):
    """Mean error of the response, in standard deviations of one record's error.

    The scatter is the estimator's own, so that one that is inefficient and unbiased passes. A mean over errors of many
    frequencies lives in as many directions as there are parameters; it is judged in the few in which the bound is
    largest, which are chosen without the data.
    """

    name = "bias"
    title = "Bias under feedback and under a shared waveform"
    unit = "deviations of one record"
    verdicts = len(PROBLEMS)

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records in closed loop, and with a shared waveform."""
        counts = {**dict.fromkeys(PROBLEMS, RECORDS), ALONE: RECORDS_ALONE}
        return tuple(Trial(name, draw) for name, count in counts.items() for draw in range(count * DRAWS[effort]))

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Test the mean error on each problem."""
        parts, curves = [], {}
        for name in PROBLEMS:
            own = [m for m in measurements if m.trial.problem == name and m.trial.ask == "fit"]
            part, curves[name] = _bias_on(name, own, estimator, false_alarm)
            parts.append(part)
        alone = [m for m in measurements if m.trial.problem == ALONE and m.trial.ask == "fit"]
        if alone:
            parts.append(_bias_alone(alone, estimator))
        percent = ", ".join(f"{curve['percent']:.2g} % on {name}" for name, curve in curves.items() if curve)
        return self.of_parts(
            parts,
            self.verdicts * false_alarm,
            f"mean error in {DIRECTIONS} directions against the estimator's own scatter, {ALLOWED:g} deviations allowed"
            + (f"; greatest mean error of the response {percent}" if percent else ""),
            curves,
        )


def _bias_on(name: str, own: Measurements, estimator: Estimator, false_alarm: float) -> tuple[Part, dict[str, Any]]:
    bound = bound_for(name, estimator.structure)
    if bound is None:
        return unjudged(name, "there is no Cramér-Rao bound, which gives the directions of the test"), {}
    responses = _responses(own, bound)
    axes = directions(bound)
    if too_few := _too_few(len(responses), max(fewest(axes), needed(len(own))), len(own)):
        return unjudged(name, too_few, len(responses)), {}
    errors = np.array(responses) - bound.response
    judged = mean_error(_flat(errors) @ axes, false_alarm, ALLOWED)
    theory = expectation(estimator, name, "bias")
    mean = errors.mean(axis=0)
    size = np.sqrt(np.mean(np.abs(bound.response) ** 2, axis=0))
    curve: dict[str, Any] = {
        "percent": float(np.max(100.0 * np.abs(mean) / size)),
        "frequencies": bound.frequencies.tolist(),
        "mean_error": np.abs(mean).reshape(len(mean), -1).T.tolist(),
        "deviation_of_mean": (errors.std(axis=0, ddof=1) / np.sqrt(len(errors))).reshape(len(mean), -1).T.tolist(),
    }
    limits = (0.0, judged.limit)
    return Part.judged(name, judged.size, 0.0, judged.interval, limits, theory, len(responses)), curve


def _bias_alone(own: Measurements, estimator: Estimator) -> Part:
    """Bias of an estimate that is not given the other input, beside the bias that theory predicts."""
    alone = problem(ALONE)
    if not isinstance(alone, SharedAlone):
        return unjudged(ALONE, "no bias is predicted")
    bound = alone.bound_without_other(estimator.structure) or alone.bound_without_other(None)
    if bound is None:
        return unjudged(ALONE, "no bias is predicted")
    axes = directions(bound)
    responses = _responses(own, bound)
    if too_few := _too_few(len(responses), fewest(axes), len(own)):
        return unjudged(ALONE, too_few, len(responses))
    errors = np.array(responses) - bound.response
    predicted = alone.expected_bias()
    judged = mean_error(_flat(errors) @ axes, 0.5)
    shifted = mean_error(_flat(errors - errors.mean(axis=0) + predicted) @ axes, 0.5)
    if not np.isfinite(shifted.size):
        return unjudged(
            ALONE, "the error is the same on all records: there is no scatter to judge it by", len(responses)
        )
    scale = float(np.sqrt(np.mean(np.abs(bound.response) ** 2)))
    size, expected = (100.0 * float(np.sqrt(np.mean(np.abs(b) ** 2))) / scale for b in (errors.mean(axis=0), predicted))
    return Part(
        label=ALONE,
        value=judged.size,
        expected=shifted.size,
        interval=judged.interval,
        limits=UNLIMITED,
        passed=None,
        theory=False,
        why=f"not judged: without the other input the response is {size:.3g} % off; output error without noise "
        f"is {expected:.3g} % off",
        draws=len(responses),
    )


def _responses(own: Measurements, bound: Bound) -> list[ComplexArray]:
    """Responses of the models that have the inputs and outputs of the bound."""
    responses = [m.response for m in own if m.kind == MODEL and m.response is not None]
    return [response for response in responses if response.shape == bound.response.shape]


def fewest(axes: FloatArray) -> int:
    """Records with a model that are needed to judge the mean error by its own scatter.

    Args:
        axes: Directions of the test, one per column.
    """
    return 2 * axes.shape[1] + 3


def _too_few(count: int, least: int, records: int) -> str:
    """Why there is no verdict; empty where there are enough records."""
    return f"{count} of {records} records gave a model: too few, at least {least} are needed" if count < least else ""


def _flat(errors: ComplexArray) -> FloatArray:
    """Real and imaginary parts side by side (records, nf ny nu 2)."""
    return real_and_imaginary(errors).reshape(len(errors), -1)


def directions(bound: Bound) -> FloatArray:
    """Combinations of real and imaginary parts of the response on which the record is least informative.

    Each response is scaled by its own deviation first, so that small ones count as large ones do.

    Returns:
        One column per direction (nf ny nu 2, q); a perfect estimate's errors have variance 1 along each.
    """
    flat = bound.response_directions.reshape(len(bound.response_directions), -1, 2)
    deviation = np.sqrt(np.sum(flat**2, axis=(0, 2)))
    weight = np.where(deviation > 0.0, 1.0 / np.where(deviation > 0.0, deviation, 1.0), 0.0)
    scaled = (flat * weight[:, None]).reshape(len(flat), -1)
    _, values, right = np.linalg.svd(scaled, full_matrices=False)
    q = min(DIRECTIONS, int(np.count_nonzero(values > 1e-6 * values[0])))
    return np.asarray((right[:q] / values[:q, None]).T * np.repeat(weight, 2)[:, None])
