"""Metrics of claimed accuracy: coverage, normalised error, and frequency response in claimed deviations."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.stats import chi2, ks_2samp, kstest

from scenarios.bench.accuracy import (
    QUICK,
    TOGETHER,
    Acceptance,
    AccuracyMetric,
    RecordStatistic,
    mean_parts,
    needed,
    pooled_part,
)
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import Evidence, Metric, Part, excess
from scenarios.bench.null_distributions import (
    NULL_BANDWIDTH_COVERAGE,
    SLACK,
    Statistic,
    bound_for,
    null_chi_square,
    null_distribution,
    null_parameter_coverage,
)
from scenarios.bench.theory import Expectation, expected_of_claims
from scenarios.files.errors import ScenarioError
from scenarios.problems.registry import problem
from sysid.records.arrays import FloatArray
from sysid.validation.monte_carlo import limits_of_response_squares
from sysid.validation.response_errors import (
    covered_share,
    free_parts,
    normalised_square,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)

NO_COVARIANCE = "no verdict: the estimator claims no covariance"
UNIT_SQUARE = Acceptance(expected=1.0, ratio=SLACK)
"""Of squares in claimed variances."""

COVERAGE = 0.95
COVERED = Acceptance(expected=COVERAGE, points=0.01, shares=True)
INTERVALS_OF = ("parameters", "bandwidth", "response")
"""Quantities whose claimed intervals are counted."""


def claimed_covariance(m: Measurement) -> FloatArray | None:
    """The claimed covariance of the response; None with NaN in it: that of a fit at a bound may be unknown."""
    claimed = m.response_covariance
    return None if claimed is None or np.isnan(claimed).any() else claimed


def claimed_values(good: Measurements, name: str, structure: str | None, statistic: Statistic) -> FloatArray:
    """A statistic of each record by its claimed covariance (n, ...), of those that claim one.

    Raises:
        ScenarioError: A covariance has another shape than the response.
    """
    bound = bound_for(name, structure)
    expected = (*bound.response.shape, 2, 2)
    free = free_parts(bound.response_covariance)
    values = []
    for m in good:
        covariance = claimed_covariance(m)
        if m.response is None or covariance is None:
            continue
        if covariance.shape != expected:
            raise ScenarioError(
                f"{m.trial.key}: covariance of the response {covariance.shape} given, expected {expected}"
            )
        values.append(statistic(real_and_imaginary(m.response - bound.response)[None], covariance, free))
    return np.concatenate(values) if values else np.empty(0)


class Coverage(AccuracyMetric):
    """Share of claimed 95 % intervals that hold the truth: of parameters, of the bandwidth, of the response.

    Those of the response are intervals of its real and of its imaginary part, at each frequency. Intervals that hold
    the truth too often are wrong too.
    """

    name = "coverage"
    title = "Coverage of claimed 95 % intervals"
    unit = "share of intervals"
    verdicts = len(INTERVALS_OF) * (len(QUICK) + 1)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Compute the share of claimed intervals that hold the truth: by kind of interval and problem, and together."""
        estimator, groups = evidence.estimator, evidence.by_problem()
        budget = evidence.false_alarm * self.verdicts
        share = budget / (len(INTERVALS_OF) * (len(groups) + 1))
        theories = {}
        for name, (good, _) in groups.items():
            theories[name] = expected_of_claims(estimator, name, good, self.name)
        metric_parts: list[Part] = []
        curves = {}
        counters = (_covered_parameters, _covered_bandwidths, _covered_responses)
        for quantity, covered in zip(INTERVALS_OF, counters, strict=True):
            statistics = []
            for name, (good, run) in groups.items():
                values, null, missing, models = covered(good, name, estimator.structure)
                missing = missing or f"no verdict: the estimator claims no interval of the {quantity}"
                label = f"{name} {quantity}"
                statistics.append(RecordStatistic(label, values, run, null, theories[name], missing, models))
            of_quantity = [statistic.part(COVERED, share) for statistic in statistics]
            of_quantity += pooled_part(f"{TOGETHER} {quantity}", statistics, COVERED, share)
            curves[quantity] = {p.label.split()[0]: p.value for p in of_quantity}
            metric_parts += of_quantity
        return self.of_parts(
            metric_parts,
            budget,
            "share of 95 % intervals that hold the truth, within what chance allows a perfect estimator and one "
            "percentage point of it",
            curves,
        )


Covered = tuple[FloatArray, FloatArray, str, int]
"""Shares by record, those of perfect records, why there are none, and number of records that should have some."""


def _covered_parameters(good: Measurements, name: str, structure: str | None) -> Covered:
    """Share of the true parameters within their claimed intervals, by record."""
    comparable = [m for m in good if m.covered >= 0 and m.parameters > 0]
    missing = ""
    if not comparable and any(m.parameters > 0 for m in good):
        missing = "no verdict: the parameters that it claims are not those of the orders that were asked"
        if structure is not None and problem(name).bound(structure) is None:
            missing = (
                f"no verdict: no {structure} model is the truth: the parameters that it claims have no true values"
            )
    values = np.array([m.covered / m.parameters for m in comparable])
    return values, null_parameter_coverage(name, structure), missing, len(good)


def _covered_bandwidths(good: Measurements, name: str, structure: str | None) -> Covered:
    """Share of the true bandwidths within their claimed intervals, by record."""
    bound = bound_for(name, structure)
    shares = []
    for m in good:
        if m.bandwidth_ci95 is None:
            continue
        low, high = m.bandwidth_ci95
        # Channels without a bandwidth, and those of which no interval is claimed, do not count.
        counted = np.isfinite(bound.bandwidth_hz) & ~np.isnan(low) & ~np.isnan(high)
        if counted.any():
            truth = bound.bandwidth_hz[counted]
            inside = (low[counted] <= truth) & (truth <= high[counted])
            shares.append(float(np.mean(inside)))
    with_bandwidth = [m for m in good if m.bandwidth_hz is not None and np.isfinite(m.bandwidth_hz).any()]
    return np.array(shares), NULL_BANDWIDTH_COVERAGE, "", len(with_bandwidth)


def _covered_responses(good: Measurements, name: str, structure: str | None) -> Covered:
    """Share of real and imaginary parts of the true response within their claimed intervals, by record."""
    values = claimed_values(good, name, structure, covered_share)
    return values, null_distribution(name, structure, covered_share, COVERAGE), "", len(good)


class NormalisedError(AccuracyMetric):
    """Mean of error' covariance^-1 error over its degrees of freedom, by the claimed covariance.

    Of the parameters it is chi-square with as many degrees of freedom as there are parameters [Ljung1999, ch. 9].
    Where the parameters are not those of the truth's structure it is that of the response, two degrees of freedom per
    frequency, averaged: frequencies depend on each other as those of the Cramér-Rao bound do.
    """

    name = "normalised_error"
    title = "Normalised error against chi-square"
    unit = "error' covariance^-1 error / degrees of freedom"
    verdicts = len(QUICK) + 1

    def evaluate(self, evidence: Evidence) -> Metric:
        """Judge the mean; the fit of the whole distribution is shown beside it."""
        estimator, budget = evidence.estimator, evidence.false_alarm * self.verdicts
        statistics: list[RecordStatistic] = []
        curves: dict[str, dict[str, object]] = {}
        for name, (good, run) in evidence.by_problem().items():
            freedom, values, null = _normalised_errors(good, name, estimator.structure)
            theory = expected_of_claims(estimator, name, good, self.name)
            statistics.append(RecordStatistic(name, values, run, null, theory, NO_COVARIANCE, len(good)))
            # A test of the whole distribution needs as many records as a verdict on its mean.
            if len(values) < needed(run) or not np.isfinite(values).all():
                continue
            # The distribution of the response's errors is known by its null records alone.
            test = kstest(values * freedom, chi2(freedom).cdf) if freedom else ks_2samp(values, null)
            quantity = "parameters" if freedom else "response"
            curves[name] = {
                "of": quantity,
                "degrees_of_freedom": freedom or None,
                "records": np.sort(values).tolist(),
                "kolmogorov_smirnov_p": float(test.pvalue),
            }
        return self.of_parts(
            mean_parts(statistics, UNIT_SQUARE, budget),
            budget,
            "mean of the squared error in claimed standard deviations, within what chance allows a perfect estimator "
            "and 5 % of it; the whole distribution is shown, not judged",
            curves,
        )


def _normalised_errors(good: Measurements, name: str, structure: str | None) -> tuple[int, FloatArray, FloatArray]:
    """Degrees of freedom, values by record and those of perfect records; 0 degrees where they are of the response."""
    of_parameters = [m for m in good if m.parameters > 0 and not np.isnan(m.normalised_error)]
    counts = {m.parameters for m in of_parameters}
    if len(of_parameters) >= needed(len(good)) and len(counts) == 1:
        freedom = counts.pop()
        values = np.array([m.normalised_error / freedom for m in of_parameters])
        return freedom, values, null_chi_square(freedom)
    values = claimed_values(good, name, structure, normalised_square)
    return 0, values, null_distribution(name, structure, normalised_square, 1.0)


class ResponseError(AccuracyMetric):
    """Root mean square error of the response in claimed standard deviations, over all frequencies and at the worst.

    The error relative to the response, in percent, is shown beside it, also where nothing is claimed.
    """

    name = "frequency_response"
    title = "Error of the frequency response against the claimed band"
    unit = "claimed standard deviations"
    verdicts = 2 * len(QUICK) + 1

    def evaluate(self, evidence: Evidence) -> Metric:
        """Compare the errors with the claimed covariance."""
        structure, groups = evidence.estimator.structure, evidence.by_problem()
        budget = evidence.false_alarm * self.verdicts
        # A problem has two parts, its mean and its worst frequency; one more is of all together.
        share = budget / (2 * len(groups) + 1)
        statistics: list[RecordStatistic] = []
        metric_parts: list[Part] = []
        for name, (good, run) in groups.items():
            theory = expected_of_claims(evidence.estimator, name, good, self.name)
            ratios = claimed_values(good, name, structure, variance_ratio_by_frequency)
            values = np.array([float(np.nanmean(ratio)) for ratio in ratios])
            null = null_distribution(name, structure, variance_ratio, 1.0)
            statistics.append(RecordStatistic(name, values, run, null, theory, NO_COVARIANCE, len(good)))
            metric_parts.append(statistics[-1].part(UNIT_SQUARE, share))
            if len(ratios) >= needed(run):
                metric_parts.append(_worst_frequency(ratios, name, structure, theory, share))
        metric_parts += pooled_part(TOGETHER, statistics, UNIT_SQUARE, share)
        curves = {name: _response_curves(good, name, structure) for name, (good, _) in groups.items() if good}
        percent = ", ".join(f"{curve['relative_error_percent']:.3g} % on {name}" for name, curve in curves.items())
        return self.of_parts(
            [_root_mean_squares(part) for part in metric_parts],
            budget,
            "root mean square error of the response in claimed standard deviations, within what chance allows a "
            f"perfect estimator and 5 % of the variance; relative to the response it is {percent or 'not known'}",
            curves,
        )


def _worst_frequency(
    ratios: FloatArray, name: str, structure: str | None, theory: Expectation, false_alarm: float
) -> Part:
    """The frequency at which the mean of squares (n, nf, ny, nu) lies furthest from its limits."""
    low, high = limits_by_frequency(name, structure, len(ratios), false_alarm)
    by_frequency = []
    for index in map(tuple, np.argwhere(np.isfinite(low))):
        limits = UNIT_SQUARE.with_slack(float(low[index]), float(high[index]))
        label = f"{name} at {problem(name).frequencies[index[0]]:.3g} Hz"
        by_frequency.append(UNIT_SQUARE.mean(label, ratios[(slice(None), *index)], theory, limits))
    return max(by_frequency, key=lambda p: (np.isinf(p.value), excess(p)))


@lru_cache(maxsize=256)
def limits_by_frequency(
    name: str, structure: str | None, draws: int, false_alarm: float
) -> tuple[FloatArray, FloatArray]:
    """`limits_of_response_squares` of a perfect estimator of a structure on a problem."""
    return limits_of_response_squares(bound_for(name, structure).response_covariance, draws, false_alarm)


def _root_mean_squares(part: Part) -> Part:
    """A part whose value, interval and limits are mean squares, with their square roots."""
    low, high = np.sqrt(np.maximum(part.interval, 0.0)).tolist()
    lower_limit, upper_limit = np.sqrt(np.maximum(part.limits, 0.0)).tolist()
    if not np.isfinite(part.limits[0]):
        lower_limit = -np.inf
    return replace(part, value=float(np.sqrt(part.value)), interval=(low, high), limits=(lower_limit, upper_limit))


def _response_curves(good: Measurements, name: str, structure: str | None) -> Mapping[str, Any]:
    """Gains (nf, ny, nu) of truth, error, claimed band and bound."""
    bound = bound_for(name, structure)
    frequencies = problem(name).frequencies
    true = problem(name).truth.frequency_response(frequencies)
    square = np.mean([np.abs(m.response - true) ** 2 for m in good if m.response is not None], axis=0)
    claimed = []
    for m in good:
        covariance = claimed_covariance(m)
        if covariance is not None:
            # The variance of a complex number: that of its real and that of its imaginary part.
            claimed.append(np.trace(covariance, axis1=-2, axis2=-1))
    mean_claim = np.sqrt(np.mean(claimed, axis=0)).tolist() if claimed else None
    deviation = np.sqrt(np.sum(bound.response_directions**2, axis=(0, -1)))
    relative_error = float(np.sqrt(np.mean(square) / np.mean(np.abs(true) ** 2)))
    return {
        "frequencies_hz": frequencies.tolist(),
        "truth": np.abs(true).tolist(),
        "error": np.sqrt(square).tolist(),
        "claimed": mean_claim,
        "bound": deviation.tolist(),
        "relative_error_percent": 100.0 * relative_error,
    }
