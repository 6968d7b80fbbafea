"""Claims of accuracy against the errors: coverage, normalised error, and frequency response in claimed deviations."""

from collections.abc import Callable, Mapping
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
    by_problem,
    enough,
    mean_parts,
    pooled_part,
)
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import Metric, Part, excess
from scenarios.bench.statistics import (
    Statistic,
    bound_for,
    covered_share,
    free_parts,
    limits_of_moments,
    normalised_square,
    null_bandwidth_coverage,
    null_chi_square,
    null_distribution,
    null_parameter_coverage,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)
from scenarios.bench.theory import Expectation, expected_of_claims
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import response_covariance
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from sysid.records.arrays import FloatArray

NO_COVARIANCE = "no verdict: the estimator claims no covariance"
NO_INTERVAL = "no verdict: the estimator claims no interval of the {}"
NO_TRUE_VALUES = "no verdict: no {} model is the truth: the parameters that it claims have no true values"
OTHER_ORDERS = "no verdict: the parameters that it claims are not those of the orders that were asked"

UNIT_SQUARE = Acceptance(expected=1.0, ratio=1.05)
"""Of squares in claimed variances."""

COVERAGE = 0.95
COVERED = Acceptance(expected=COVERAGE, points=0.01, shares=True)
KINDS = ("parameters", "bandwidth", "response")


def claims_covariance(m: Measurement) -> bool:
    """Whether a covariance of the response is claimed, without NaN: that of a fit at a bound may be unknown."""
    return m.response_covariance is not None and not bool(np.isnan(m.response_covariance).any())


def claimed_values(good: Measurements, name: str, structure: str | None, statistic: Statistic) -> FloatArray:
    """A statistic of each record by its claimed covariance (n,), of those that claim one."""
    return np.array([float(value[0]) for value in by_claim(good, name, structure, statistic)])


def by_claim(
    good: Measurements, name: str, structure: str | None, statistic: Callable[..., FloatArray]
) -> list[FloatArray]:
    """A function of errors, claimed covariance and free parts, evaluated for each record that claims a covariance."""
    bound = bound_for(name, structure)
    if bound is None:
        return []
    free = free_parts(response_covariance(bound))
    values = []
    for m in good:
        if m.response is None or m.response_covariance is None or not claims_covariance(m):
            continue
        if m.response_covariance.shape != (*bound.response.shape, 2, 2):
            raise ScenarioError(
                f"{m.trial.key}: covariance of the response {m.response_covariance.shape} given, "
                f"expected {(*bound.response.shape, 2, 2)}"
            )
        errors = real_and_imaginary(m.response - bound.response)[None]
        values.append(statistic(errors, m.response_covariance, free))
    return values


class Coverage(AccuracyMetric):
    """Share of claimed 95 % intervals that hold the truth: of parameters, of the bandwidth, of the response.

    Those of the response are intervals of its real and of its imaginary part, at each frequency. Intervals that hold
    the truth too often are wrong too.
    """

    name = "coverage"
    title = "Coverage of claimed 95 % intervals"
    unit = "share of intervals"
    verdicts = len(KINDS) * (len(QUICK) + 1)

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Count the intervals that hold the truth."""
        groups = by_problem(measurements)
        budget = false_alarm * self.verdicts
        share = budget / (len(KINDS) * (len(groups) + 1))
        theories = {name: expected_of_claims(estimator, name, good, self.name) for name, (good, _) in groups.items()}
        parts: list[Part] = []
        for kind in KINDS:
            statistics = [
                _covered(kind, good, run, name, estimator.structure, theories[name])
                for name, (good, run) in groups.items()
            ]
            parts += [statistic.part(COVERED, share) for statistic in statistics]
            parts += pooled_part(f"{TOGETHER} {kind}", statistics, COVERED, share)
        return self.of_parts(
            parts,
            budget,
            "share of 95 % intervals that hold the truth, within what chance allows a perfect estimator and one "
            "percentage point of it",
            {kind: {p.label.split()[0]: p.value for p in parts if p.label.endswith(kind)} for kind in KINDS},
        )


def _covered(
    kind: str, good: Measurements, run: int, name: str, structure: str | None, theory: Expectation
) -> RecordStatistic:
    null: FloatArray | None
    missing, models = NO_INTERVAL.format(kind), len(good)
    if kind == "parameters":
        known = [m for m in good if m.covered >= 0 and m.parameters > 0]
        values = np.array([m.covered / m.parameters for m in known])
        null = null_parameter_coverage(name, structure)
        if not known and any(m.parameters > 0 for m in good):
            held = structure is None or problem(name).bound(structure) is not None
            missing = OTHER_ORDERS if held else NO_TRUE_VALUES.format(structure)
    elif kind == "bandwidth":
        values = _covered_bandwidths(good, bound_for(name, structure))
        null = null_bandwidth_coverage()
        models = sum(m.bandwidth_hz is not None and bool(np.isfinite(m.bandwidth_hz).any()) for m in good)
    else:
        values = claimed_values(good, name, structure, covered_share)
        null = null_distribution(name, structure, covered_share, COVERAGE)
    return RecordStatistic(f"{name} {kind}", values, run, null, theory, missing, models)


def _covered_bandwidths(good: Measurements, bound: Bound | None) -> FloatArray:
    """Share of the true bandwidths within their intervals, of those that have one, record by record."""
    if bound is None:
        return np.empty(0)
    shares = []
    for m in good:
        if m.bandwidth_ci95 is None:
            continue
        low, high = m.bandwidth_ci95
        known = np.isfinite(bound.bandwidth_hz) & ~np.isnan(low) & ~np.isnan(high)
        if known.any():
            inside = (low[known] <= bound.bandwidth_hz[known]) & (bound.bandwidth_hz[known] <= high[known])
            shares.append(float(np.mean(inside)))
    return np.array(shares)


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

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Judge the mean; the fit of the whole distribution is shown beside it."""
        statistics: list[RecordStatistic] = []
        curves: dict[str, dict[str, object]] = {}
        for name, (good, run) in by_problem(measurements).items():
            values, null, freedom = _normalised_errors(good, name, estimator.structure)
            theory = expected_of_claims(estimator, name, good, self.name)
            statistics.append(RecordStatistic(name, values, run, null, theory, NO_COVARIANCE, len(good)))
            if enough(len(values), run) and np.isfinite(values).all():
                curves[name] = {
                    "of": "parameters" if freedom else "response",
                    "degrees_of_freedom": freedom or None,
                    "records": np.sort(values).tolist(),
                    "kolmogorov_smirnov_p": _distribution_p(values, freedom, null),
                }
        budget = false_alarm * self.verdicts
        return self.of_parts(
            mean_parts(statistics, UNIT_SQUARE, budget) if statistics else [],
            budget,
            "mean of the squared error in claimed standard deviations, within what chance allows a perfect estimator "
            "and 5 % of it; the whole distribution is shown, not judged",
            curves,
        )


def _normalised_errors(
    good: Measurements, name: str, structure: str | None
) -> tuple[FloatArray, FloatArray | None, int]:
    """Values of the records, those of perfect ones, and the degrees of freedom; 0 where they are of the response."""
    known = [m for m in good if m.parameters > 0 and not np.isnan(m.normalised_error)]
    if enough(len(known), len(good)) and len({m.parameters for m in known}) == 1:
        p = known[0].parameters
        return np.array([m.normalised_error / p for m in known]), null_chi_square(p), p
    return (
        claimed_values(good, name, structure, normalised_square),
        null_distribution(name, structure, normalised_square, 1.0),
        0,
    )


def _distribution_p(values: FloatArray, freedom: int, null: FloatArray | None) -> float | None:
    if freedom:
        return float(kstest(values * freedom, chi2(freedom).cdf).pvalue)
    return None if null is None else float(ks_2samp(values, null).pvalue)


class ResponseError(AccuracyMetric):
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
