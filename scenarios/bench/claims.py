"""Claims of accuracy against the errors: coverage of intervals, and the normalised error."""

from collections.abc import Callable

import numpy as np
from scipy.stats import chi2, ks_2samp, kstest

from scenarios.bench.accuracy import (
    EFFICIENT,
    QUICK,
    TOGETHER,
    Acceptance,
    AccuracyMetric,
    RecordStatistic,
    by_problem,
    enough,
    error_against_bound,
    mean_parts,
    pooled_part,
)
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import NAN, Metric, Part
from scenarios.bench.statistics import (
    Statistic,
    bound_for,
    covered_share,
    free_parts,
    normalised_square,
    null_bandwidth_coverage,
    null_chi_square,
    null_distribution,
    null_parameter_coverage,
    real_and_imaginary,
    variance_ratio,
)
from scenarios.bench.theory import BIAS, BIAS_AND_SCATTER, Expectation, expectation, limitation
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

NEGLIGIBLE_BIAS = 0.1
"""Greatest share of a bias in the mean square error that explains no failure: it would make errors in claimed
deviations a ninth larger in the square, which is within the limits. Ten records cannot show it, a hundred can."""

INEFFICIENT = 1e-3
"""Probability that the mean square error of a perfect estimator is taken as larger than the bound."""

UNIT_SQUARE = Acceptance(expected=1.0, ratio=1.05)
"""Of squares in claimed variances."""

COVERAGE = 0.95
COVERED = Acceptance(expected=COVERAGE, points=0.01, shares=True)
KINDS = ("parameters", "bandwidth", "response")


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
    return float(np.mean(values)) <= EFFICIENT.limits([null], [len(values)], INEFFICIENT)[1]


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
        return NAN
    free = free_parts(response_covariance(bound)).any(axis=-1)
    errors = real_and_imaginary(np.stack(responses) - bound.response)[:, free]
    squares: FloatArray = np.mean(np.sum(errors**2, axis=-1), axis=0)
    of_mean = np.sum(np.mean(errors, axis=0) ** 2, axis=-1)
    scatter = (squares - of_mean) / (len(errors) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.max((of_mean - scatter) / squares))


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
