"""Bias of the response in closed loop, and where two inputs share their waveform."""

from typing import Any

import numpy as np

from scenarios.bench.accuracy import needed
from scenarios.bench.measurement import Measurements
from scenarios.bench.metric import DRAWS, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.null_distributions import bound_for
from scenarios.bench.theory import expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation import CramerRaoBound
from sysid.validation.mean_error import mean_error
from sysid.validation.response_errors import real_and_imaginary

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


class Bias(MetricDefinition):
    """Mean error of the response, in standard deviations of one record's error.

    The scatter is the estimator's own, so that one that is inefficient and unbiased passes. A mean over errors of many
    frequencies lives in as many directions as there are parameters; it is judged in the few in which the bound is
    largest, which are chosen without the data.
    """

    name = "bias"
    title = "Bias in closed loop, and of two inputs that share their waveform"
    unit = "deviations of one record"
    verdicts = len(PROBLEMS)

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records in closed loop, and with a shared waveform."""
        trials = []
        for name, records in {**dict.fromkeys(PROBLEMS, RECORDS), ALONE: RECORDS_ALONE}.items():
            trials += [Trial(name, draw) for draw in range(records * DRAWS[effort])]
        return tuple(trials)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Test the mean error on each problem."""
        metric_parts, curves = [], {}
        for name in PROBLEMS:
            bias, curves[name] = _bias_on(name, evidence)
            metric_parts.append(bias)
        if alone := evidence.on(ALONE):
            metric_parts.append(_bias_alone(alone, evidence.estimator))
        why = (
            f"mean error in {DIRECTIONS} directions against the estimator's own scatter, {ALLOWED:g} deviations allowed"
        )
        percent = ", ".join(f"{curve['percent']:.2g} % on {name}" for name, curve in curves.items() if curve)
        if percent:
            why += f"; greatest mean error of the response {percent}"
        return self.of_parts(metric_parts, self.verdicts * evidence.false_alarm, why, curves)


def _bias_on(name: str, evidence: Evidence) -> tuple[Part, dict[str, Any]]:
    """The part of bias on one problem, and its curves for drawing."""
    measurements = evidence.on(name)
    bound = bound_for(name, evidence.estimator.structure)
    axes, errors, too_few = _errors(measurements, bound, needed(len(measurements)))
    if too_few:
        return unjudged(name, too_few, len(errors)), {}
    judged = mean_error(_flat(errors) @ axes, evidence.false_alarm, ALLOWED)
    theory = expectation(evidence.estimator, name, "bias")
    mean = errors.mean(axis=0)
    # Each channel relative to its own rms response.
    size = np.sqrt(np.mean(np.abs(bound.response) ** 2, axis=0))
    deviation_of_mean = errors.std(axis=0, ddof=1) / np.sqrt(len(errors))
    curve: dict[str, Any] = {
        "percent": float(np.max(100.0 * np.abs(mean) / size)),
        "frequencies": bound.frequencies.tolist(),
        "mean_error": np.abs(mean).reshape(len(mean), -1).T.tolist(),
        "deviation_of_mean": deviation_of_mean.reshape(len(mean), -1).T.tolist(),
    }
    limits = (0.0, judged.limit)
    return Part.judged(name, judged.size, 0.0, judged.interval, limits, theory, len(errors)), curve


def _bias_alone(measurements: Measurements, estimator: Estimator) -> Part:
    """Bias of an estimate that is not given the other input, beside the bias that theory predicts."""
    alone = problem(ALONE)
    if not isinstance(alone, SharedAlone):
        return unjudged(ALONE, "no bias is predicted")
    # A structure that cannot hold the truth is tested in the directions of the truth's own.
    bound = alone.bound_without_other(estimator.structure) or alone.bound_without_other(None)
    if bound is None:
        return unjudged(ALONE, "no bias is predicted")
    axes, errors, too_few = _errors(measurements, bound, 0)
    if too_few:
        return unjudged(ALONE, too_few, len(errors))
    mean, predicted = errors.mean(axis=0), alone.expected_bias()
    # Not judged, so that the probability of a false alarm does not matter.
    judged = mean_error(_flat(errors) @ axes, 0.5)
    # The bias that theory predicts, in the same unit: the estimator's own scatter about it.
    shifted = mean_error(_flat(errors - mean + predicted) @ axes, 0.5)
    # Without any scatter every shift is infinitely many deviations.
    if not np.isfinite(shifted.size):
        why = "the error is the same on all records: there is no scatter to judge it by"
        return unjudged(ALONE, why, len(errors))
    scale = float(np.sqrt(np.mean(np.abs(bound.response) ** 2)))
    size = 100.0 * float(np.sqrt(np.mean(np.abs(mean) ** 2))) / scale
    expected = 100.0 * float(np.sqrt(np.mean(np.abs(predicted) ** 2))) / scale
    why = (
        f"not judged: without the other input the response is {size:.3g} % off; output error without noise is "
        f"{expected:.3g} % off"
    )
    return unjudged(ALONE, why, len(errors), judged.size, shifted.size, judged.interval, theory=False)


def _errors(measurements: Measurements, bound: CramerRaoBound, minimum: int) -> tuple[FloatArray, ComplexArray, str]:
    """Directions of the test, errors of models with the inputs and outputs of the bound, and why they are too few.

    The mean error is judged by its own scatter, which needs a model of some records, and at least of so many.
    """
    axes = directions(bound)
    responses = [m.response for m in measurements if m.kind == MODEL and m.response is not None]
    responses = [response for response in responses if response.shape == bound.response.shape]
    errors = np.array([response - bound.response for response in responses])
    # With fewer records than these the scatter's own covariance in the directions is hardly known.
    minimum = max(2 * axes.shape[1] + 3, minimum)
    if len(errors) >= minimum:
        return axes, errors, ""
    run = len(measurements)
    return axes, errors, f"{len(errors)} of {run} records gave a model: too few, at least {minimum} are needed"


def _flat(errors: ComplexArray) -> FloatArray:
    """Real and imaginary parts side by side (records, nf ny nu 2)."""
    return real_and_imaginary(errors).reshape(len(errors), -1)


def directions(bound: CramerRaoBound) -> FloatArray:
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
    # Directions of singular values below 1e-6 of the largest are rounding: there are no more parameters.
    q = min(DIRECTIONS, int(np.count_nonzero(values > 1e-6 * values[0])))
    return np.asarray((right[:q] / values[:q, None]).T * np.repeat(weight, 2)[:, None])
