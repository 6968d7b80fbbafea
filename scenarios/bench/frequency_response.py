"""Error of the frequency response in the standard deviations that the estimator claims."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenarios.bench.accuracy import (
    QUICK,
    TOGETHER,
    AccuracyMetric,
    RecordStatistic,
    by_problem,
    enough,
    pooled_part,
)
from scenarios.bench.claims import NO_COVARIANCE, UNIT_SQUARE, by_claim, claims_covariance, expected_of_claims
from scenarios.bench.measurement import Measurements
from scenarios.bench.metric import Metric, Part, excess
from scenarios.bench.statistics import (
    bound_for,
    free_parts,
    limits_of_moments,
    null_distribution,
    variance_ratio,
    variance_ratio_by_frequency,
)
from scenarios.bench.theory import Expectation
from scenarios.estimators.estimator import Estimator
from scenarios.problems.bound import response_covariance
from scenarios.problems.registry import problem
from sysid.records.arrays import FloatArray


class FrequencyResponse(AccuracyMetric):
    """Root mean square error of the response in claimed standard deviations, over all frequencies and at the worst.

    The error relative to the response, in percent, is shown beside it, also where nothing is claimed.
    """

    name = "frequency_response"
    title = "Error of the frequency response against the claimed band"
    unit = "claimed standard deviations"
    verdicts = 2 * len(QUICK) + 1

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Compare the errors with the claimed covariance."""
        groups = by_problem(measurements)
        budget = false_alarm * self.verdicts
        share = budget / (2 * len(groups) + 1)
        structure = estimator.structure
        statistics: list[RecordStatistic] = []
        parts: list[Part] = []
        for name, (good, run) in groups.items():
            theory = expected_of_claims(estimator, name, good, self.name)
            ratios = by_claim(good, name, structure, variance_ratio_by_frequency)
            values = np.array([float(np.nanmean(ratio)) for ratio in ratios])
            null = null_distribution(name, structure, variance_ratio, 1.0)
            statistics.append(RecordStatistic(name, values, run, null, theory, NO_COVARIANCE, len(good)))
            parts.append(statistics[-1].part(UNIT_SQUARE, share))
            if enough(len(ratios), run):
                parts.append(_worst_frequency(np.concatenate(ratios), name, structure, theory, share))
        parts += pooled_part(TOGETHER, statistics, UNIT_SQUARE, share)
        curves = {name: _response_curves(good, name, structure) for name, (good, _) in groups.items() if good}
        percent = ", ".join(f"{curve['relative_error_percent']:.3g} % on {name}" for name, curve in curves.items())
        return self.of_parts(
            [_root(part) for part in parts],
            budget,
            "root mean square error of the response in claimed standard deviations, within what chance allows a "
            f"perfect estimator and 5 % of the variance; relative to the response it is {percent or 'not known'}",
            curves,
        )


def _worst_frequency(
    ratios: FloatArray, name: str, structure: str | None, theory: Expectation, false_alarm: float
) -> Part:
    """The frequency at which the mean of squares (n, nf, ny, nu) lies furthest from its limits."""
    bound = bound_for(name, structure)
    if bound is None:
        raise AssertionError(f"{name}: errors in claimed deviations without a bound")
    low, high = limits_by_frequency(name, structure, len(ratios), false_alarm)
    parts = []
    for k, i, j in np.argwhere(np.isfinite(low)):
        limits = UNIT_SQUARE.with_slack(float(low[k, i, j]), float(high[k, i, j]))
        values = ratios[:, k, i, j]
        interval, label = UNIT_SQUARE.interval(values), f"{name} at {bound.frequencies[k]:.3g} Hz"
        parts.append(Part.judged(label, float(np.mean(values)), 1.0, interval, limits, theory, len(values)))
    return max(parts, key=lambda part: (np.isinf(part.value), excess(part)))


@lru_cache(maxsize=256)
def limits_by_frequency(
    name: str, structure: str | None, draws: int, false_alarm: float
) -> tuple[FloatArray, FloatArray]:
    """Limits of the mean of |error|^2 over its variance at each frequency (nf, ny, nu), without slack.

    Args:
        name: Of a problem with a bound.
        structure: Of the estimator.
        draws: Records.
        false_alarm: Greatest probability that a perfect estimator's mean lies outside at any frequency.

    Returns:
        Lower and upper limits, NaN where the response cannot be wrong.
    """
    bound = bound_for(name, structure)
    if bound is None:
        raise AssertionError(f"{name}: limits without a bound")
    covariance = response_covariance(bound)
    free = free_parts(covariance)
    low, high = np.full(bound.response.shape, np.nan), np.full(bound.response.shape, np.nan)
    places = [tuple(place) for place in np.argwhere(free.any(axis=-1))]
    for place in places:
        kept = covariance[place] * np.outer(free[place], free[place])
        # |error|^2 is a sum of squares of independent Gaussian variables with these shares of its mean
        shares = np.linalg.eigvalsh(kept) / np.trace(kept)
        variance, third = 2.0 * float(np.sum(shares**2)), 8.0 * float(np.sum(shares**3))
        low[place], high[place] = limits_of_moments(1.0, variance / draws, third / draws**2, false_alarm / len(places))
    return low, high


def _root(part: Part) -> Part:
    """The part of mean squares as one of root mean squares."""

    def root(square: float) -> float:
        return float(np.sqrt(max(square, 0.0))) if not np.isnan(square) else square

    low, high = part.limits
    return replace(
        part,
        value=float(np.sqrt(part.value)),
        interval=(root(part.interval[0]), root(part.interval[1])),
        limits=(root(low) if np.isfinite(low) else -np.inf, root(high)),
    )


def _response_curves(good: Measurements, name: str, structure: str | None) -> Mapping[str, Any]:
    """Gains (nf, ny, nu) of truth, error, claimed band and bound."""
    bound = bound_for(name, structure)
    frequencies = problem(name).frequencies
    true = problem(name).truth.frequency_response(frequencies)
    square = np.mean([np.abs(m.response - true) ** 2 for m in good if m.response is not None], axis=0)
    claimed = [
        np.trace(m.response_covariance, axis1=-2, axis2=-1)
        for m in good
        if claims_covariance(m) and m.response_covariance is not None
    ]
    return {
        "frequencies_hz": frequencies.tolist(),
        "truth": np.abs(true).tolist(),
        "error": np.sqrt(square).tolist(),
        "claimed": np.sqrt(np.mean(claimed, axis=0)).tolist() if claimed else None,
        "bound": None if bound is None else np.sqrt(np.sum(bound.response_directions**2, axis=(0, -1))).tolist(),
        "relative_error_percent": 100.0 * float(np.sqrt(np.mean(square) / np.mean(np.abs(true) ** 2))),
    }
