"""Convergence to the truth: exact recovery without noise, and errors that shrink with the number of samples."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from scenarios.bench.accuracy import needed
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import DRAWS, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.null_distributions import SEED, bound_for, responses, statistic_of_perfect
from scenarios.bench.theory import Expectation, expectation
from scenarios.estimators.estimator import Estimator
from scenarios.problems.noise_free import DELAYS, ORDERS
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation.monte_carlo import limits_of_mean
from sysid.validation.response_errors import free_parts, real_and_imaginary, variance_ratio

DEMANDED = 6.0
"""Digits. Double precision has 15.7; normal equations may lose half of them, and a search that stops when the sum of
squares no longer changes in its 12th digit knows its minimum to half as many. Fewer digits have another cause than
rounding: a delay, a transient that is not allowed for, a term that is left out."""

MOST_DIGITS = 16.0
"""Most digits of agreement that are counted: errors of double precision mean no more."""

WHERE_IT_FAILS = "where it fails, "
"""Beginning of the fault that all failing parts have in common."""

QUICK = ("p2", "p3")
FULL = ("p2", "p3", "p4", "p5")
LENGTHS = (1000, 4000, 16_000)
RECORDS = 20
"""Of each length by the quick effort."""

SLACK = 0.02
"""Allowed flattening of the slope: a variance some 10 % above the bound on the longest records only."""

SLOPES = 4000
"""Slopes that are simulated for the limit."""


class NoiseFreeRecovery(MetricDefinition):
    """Digits of the response, -log10 of the relative root mean square error, by order and delay."""

    name = "noise_free_recovery"
    title = "Recovery without noise"
    unit = "digits"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """One record of a system of each order and delay, or several."""
        trials = []
        for order, delay in product(ORDERS, DELAYS):
            trials += [Trial(f"quiet-{order}-{delay}", draw) for draw in range(DRAWS[effort])]
        return tuple(trials)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Count the digits; without noise no verdict depends on chance."""
        metric_parts = [_digits(name, good, run) for name, (good, run) in evidence.by_problem().items()]
        digits = {p.label: p.value for p in metric_parts}
        table = []
        for order in ORDERS:
            table.append([digits.get(f"quiet-{order}-{delay}") for delay in DELAYS])
        why = (
            f"digits of the response that are right without noise where order and delay are given, the fewest of all "
            f"orders and delays; {DEMANDED:g} are demanded"
        )
        judged = [p for p in metric_parts if p.passed is not None]
        faults = {p.why for p in judged if not p.passed}
        if len(faults) == 1 and (fault := faults.pop()):
            why += f"; {WHERE_IT_FAILS}{fault}"
        curves = {"orders": list(ORDERS), "delays": list(DELAYS), "digits": table}
        # `excess` is 0 for all that pass: the worst is the one with the fewest digits
        worst = min(judged, key=lambda p: p.value, default=None)
        metric = self.of_parts(metric_parts, 0.0, why, curves, shown=worst)
        if metric.passed and 2 * len(judged) < len(metric_parts):
            missing = f"; no verdict: {len(judged)} of {len(metric_parts)} systems have a model"
            return replace(metric, passed=None, why=metric.why + missing)
        return metric


def _digits(name: str, good: Sequence[Measurement], run: int) -> Part:
    """Digits of the response that are right on one noise-free system, the fewest of its records."""
    if 2 * len(good) < run or not good:
        return unjudged(name, f"no verdict: {len(good)} of {run} records have a model", len(good))
    truth, frequencies = problem(name).truth, problem(name).frequencies
    true = truth.frequency_response(frequencies)
    size = np.sqrt(np.mean(np.abs(true) ** 2))
    # The worst record counts: without noise nothing but the estimator makes them differ.
    estimates = responses(good)
    errors = []
    for response in estimates:
        errors.append(np.sqrt(np.mean(np.abs(response - true) ** 2)) / size)
    digits = float(np.min(-np.log10(np.maximum(errors, 10.0**-MOST_DIGITS)))) + 0.0  # no -0
    fault = ""
    if not digits >= DEMANDED:
        fault = recognised_fault(estimates, true, frequencies, truth.dt, 10.0**-DEMANDED)
    theory = Expectation(True, fault and f"the response is {fault}")
    return Part.judged(name, digits, DEMANDED, (digits, digits), (DEMANDED, np.inf), theory, len(good))


def recognised_fault(
    estimates: ComplexArray, true: ComplexArray, frequencies: FloatArray, dt: float, tolerance: float
) -> str:
    """A delay, sign or gain that explains the error of all responses, in words; empty where none does.

    Args:
        estimates: Estimated responses (n, nf, ny, nu).
        true: The true one (nf, ny, nu).
        frequencies: (nf,), Hz.
        dt: Sampling interval, s.
        tolerance: Relative root mean square error up to which responses count as equal.
    """
    # The response of a delay by one sample.
    turn = np.exp(-2j * np.pi * frequencies * dt)[:, None, None]
    faults = {
        "1 sample late": true * turn,
        "2 samples late": true * turn**2,
        "1 sample early": true * turn**-1,
        "2 samples early": true * turn**-2,
        "of the wrong sign": -true,
    }
    # The real gain that brings the truth nearest to the estimates.
    gain = float(np.mean([np.vdot(true, response).real for response in estimates]) / np.vdot(true, true).real)
    faults[f"{gain:.8g} times the truth"] = gain * true
    for fault, expected in faults.items():
        size = np.linalg.norm(expected)
        if all(np.linalg.norm(response - expected) <= tolerance * size for response in estimates):
            return fault
    return ""


class Consistency(MetricDefinition):
    """Slope of the logarithm of the response's error over that of the number of samples [Ljung1999, ch. 9].

    -1/2 in the limit of an estimator whose error is chance, however much of it; 0 of one whose error is bias. Expected
    is the slope of the bound at these lengths: the input does not carry exactly the same information per sample at
    each. Only a flatter slope fails: short records may be worse than the theory of long ones says.
    """

    name = "consistency"
    title = "Consistency: slope of the error against the number of samples"
    unit = "log error / log samples"
    verdicts = len(QUICK)  # with more problems each gets less

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of three lengths."""
        problems = QUICK if effort == "quick" else FULL
        trials = []
        for name, samples in product(problems, LENGTHS):
            trials += [Trial(f"{name}@{samples}", draw) for draw in range(RECORDS * DRAWS[effort])]
        return tuple(trials)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Fit the slopes."""
        problems: dict[str, Records] = {}
        # A problem of another length is `NAME@SAMPLES`.
        for key, records in evidence.by_problem().items():
            name, _, samples = key.partition("@")
            problems.setdefault(name, {})[int(samples)] = records
        budget = evidence.false_alarm * self.verdicts
        metric_parts, curves = [], {}
        for name, lengths in problems.items():
            by_length = dict(sorted(lengths.items()))
            slope, curves[name] = _slope_part(name, by_length, evidence.estimator, budget / len(problems))
            metric_parts.append(slope)
        return self.of_parts(
            metric_parts,
            budget,
            "slope of log root mean square error of the response over log number of samples, -0.5 in the limit; "
            f"flatter than chance allows a perfect estimator, and {SLACK} more, fails",
            curves,
        )


Records = dict[int, tuple[list[Measurement], int]]
"""Measurements with a model and the number of records that were run, by number of samples."""


def _slope_part(
    name: str, records: Records, estimator: Estimator, false_alarm: float
) -> tuple[Part, dict[str, list[float]]]:
    """The slope on a problem, and its points for drawing."""
    lengths = tuple(records)
    obstacle = _why_no_slope(records)
    if obstacle:
        return unjudged(name, f"no verdict: {obstacle}"), {}
    longest = bound_for(f"{name}@{lengths[-1]}", estimator.structure)
    # The weight of the longest records for all lengths, so that the slope is that of the errors alone
    weight = longest.response_covariance
    # Parts of the response that the bound takes as exactly known have no variance to divide by.
    free = free_parts(weight)
    squares = []
    for good, _ in records.values():
        squares.append(variance_ratio(real_and_imaginary(responses(good) - longest.response), weight, free))
    counts = tuple(len(values) for values in squares)
    means = [np.mean(values) for values in squares]
    slope = float(_slopes(lengths, np.array([means]))[0])
    half = _half_width_of_slope(lengths, squares)
    interval = (slope - half, slope + half)
    null = perfect_slopes(name, estimator.structure, lengths, counts)
    limits = (-np.inf, limits_of_mean([null], [1], false_alarm, low=False)[1] + SLACK)
    theory = expectation(estimator, name, "consistency")
    judged = Part.judged(name, slope, float(np.mean(null)), interval, limits, theory, sum(counts))
    perfect = [np.mean(values) for values in _null_squares(name, estimator.structure, lengths)]
    return judged, {
        "samples": [float(samples) for samples in lengths],
        "error": np.sqrt(means).tolist(),
        "bound": np.sqrt(perfect).tolist(),
    }


def _why_no_slope(records: Records) -> str:
    """Why no slope can be judged; empty where it can."""
    too_few = []
    for samples, (good, run) in records.items():
        if len(good) < needed(run):
            too_few.append(f"{len(good)} of {run} at {samples} samples, at least {needed(run)} are needed")
    if too_few:
        return f"records with a model: {', '.join(too_few)}"
    return "there is only one length" if len(records) < 2 else ""


def _half_width_of_slope(lengths: Sequence[int], squares: Sequence[FloatArray]) -> float:
    """Half of the 95 % interval of a slope, by the scatter of the squares at each length."""
    spreads = []
    for values in squares:
        spreads.append(np.std(values, ddof=1) / np.sqrt(len(values)) / np.mean(values))
    # The logarithm of a root mean square has half of the relative deviation of the mean square.
    return NORMAL_95 * float(np.linalg.norm(_slope_weights(lengths) * np.array(spreads) / 2.0))


@lru_cache(maxsize=64)
def perfect_slopes(
    name: str, structure: str | None, lengths: tuple[int, ...], counts: tuple[int, ...], *, seed: int = SEED
) -> FloatArray:
    """Slopes of perfect estimators (SLOPES,), each from as many records of each length."""
    rng = np.random.default_rng(seed)
    means = []
    for null, count in zip(_null_squares(name, structure, lengths), counts, strict=True):
        drawn = null[rng.integers(len(null), size=(SLOPES, count))]
        means.append(drawn.mean(axis=1))
    return _slopes(lengths, np.stack(means, axis=1))


@lru_cache(maxsize=64)
def _null_squares(name: str, structure: str | None, lengths: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Squared errors of a perfect estimator at each length, in variances of the longest (M,) each."""
    bounds = [bound_for(f"{name}@{samples}", structure) for samples in lengths]
    weight = bounds[-1].response_covariance
    nulls = []
    for index, bound in enumerate(bounds):
        # Records of different lengths are independent, so each has a seed of its own.
        nulls.append(statistic_of_perfect(bound, variance_ratio, covariance=weight, seed=(SEED, index)))
    return tuple(nulls)


def _slope_weights(lengths: Sequence[int]) -> FloatArray:
    """The slope of values over the logarithm of lengths is their sum with these weights."""
    x = np.log(np.asarray(lengths, dtype=float))
    x = x - x.mean()
    return np.asarray(x / np.sum(x**2))


def _slopes(lengths: Sequence[int], squares: FloatArray) -> FloatArray:
    """Slopes of log root mean square errors, from mean squares (sets, lengths)."""
    # Of an estimator without any error the logarithm would be infinite.
    return np.asarray(0.5 * np.log(np.maximum(squares, np.finfo(float).tiny)) @ _slope_weights(lengths))
