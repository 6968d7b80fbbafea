"""Convergence to the truth: exact recovery without noise, and errors that shrink with the number of samples."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from scenarios.bench.accuracy import by_problem, enough, needed
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import DRAWS, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.statistics import (
    CHUNK,
    NULL_RECORDS,
    SEED,
    TWO_SIDED_95,
    bound_for,
    errors_of_perfect,
    free_parts,
    limits_of_mean,
    real_and_imaginary,
    variance_ratio,
)
from scenarios.bench.theory import expectation
from scenarios.estimators.estimator import Estimator
from scenarios.problems.bound import response_covariance
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

ORDERS = (1, 2, 3, 4, 5, 6)
DELAYS = (1, 2, 3)
DEMANDED = 6.0
"""Digits. Double precision has 15.7; normal equations may lose half of them, and a search that stops when the sum of
squares no longer changes in its 12th digit knows its minimum to half as many. Fewer digits have another cause than
rounding: a delay, a transient that is not allowed for, a term that is left out."""

MOST_DIGITS = 16.0
"""Digits that are shown at most."""

FAULT = "the response is "
"""Beginning of the description of a recognised fault."""

WHERE_IT_FAILS = "where it fails, "
"""Beginning of the fault that all failing parts have in common."""

SHIFTS = (1, 2, -1, -2)
"""Delays that are tried, samples."""

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
        return tuple(
            Trial(f"quiet-{order}-{delay}", draw)
            for order in ORDERS
            for delay in DELAYS
            for draw in range(DRAWS[effort])
        )

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Count the digits; without noise no verdict depends on chance."""
        parts = [
            _digits(name, good, run, estimator, self.name) for name, (good, run) in by_problem(measurements).items()
        ]
        values = {part.label: part.value for part in parts}
        table = [[values.get(f"quiet-{order}-{delay}") for delay in DELAYS] for order in ORDERS]
        metric = self.of_parts(
            parts,
            0.0,
            f"digits of the response that are right without noise, the fewest of all orders and delays; {DEMANDED:g} "
            "are demanded",
            {"orders": list(ORDERS), "delays": list(DELAYS), "digits": table},
        )
        judged = [part for part in parts if part.passed is not None]
        if not judged:
            return metric
        faults = {part.why for part in judged if not part.passed}
        if len(faults) == 1 and FAULT in (common := next(iter(faults))):
            metric = replace(metric, why=f"{metric.why}; {WHERE_IT_FAILS}{common}")
        # `excess` is 0 for all that pass: the worst is the one with the fewest digits
        worst = min(judged, key=lambda part: part.value)
        metric = replace(metric, value=worst.value, expected=worst.expected, interval=worst.interval)
        if 2 * len(judged) < len(parts) and metric.passed:
            missing = f"; no verdict: {len(judged)} of {len(parts)} systems have a model"
            return replace(metric, passed=None, why=metric.why + missing)
        return metric


def _digits(name: str, good: Measurements, run: int, estimator: Estimator, metric: str) -> Part:
    if 2 * len(good) < run or not good:
        return unjudged(name, f"no verdict: {len(good)} of {run} records have a model", len(good))
    truth, frequencies = problem(name).truth, problem(name).frequencies
    true = truth.frequency_response(frequencies)
    size = np.sqrt(np.mean(np.abs(true) ** 2))
    responses = [m.response for m in good if m.response is not None]
    errors = [np.sqrt(np.mean(np.abs(response - true) ** 2)) / size for response in responses]
    digits = float(np.min(-np.log10(np.maximum(errors, 10.0**-MOST_DIGITS)))) + 0.0  # no -0
    theory = expectation(estimator, name, metric)
    fault = ""
    if digits < DEMANDED:
        fault = recognised_fault(responses, true, frequencies, truth.dt, 10.0**-DEMANDED)
    theory = replace(theory, why="; ".join(filter(None, (theory.why, fault and f"{FAULT}{fault}"))))
    return Part.judged(name, digits, DEMANDED, (digits, digits), (DEMANDED, np.inf), theory, len(good))


def recognised_fault(
    responses: Sequence[ComplexArray], true: ComplexArray, frequencies: FloatArray, dt: float, tolerance: float
) -> str:
    """A delay, sign or gain that explains the error of all responses, in words; empty where none does.

    Args:
        responses: As estimated (nf, ny, nu), each.
        true: The true one, of the same shape.
        frequencies: (nf,), Hz.
        dt: Sampling interval, s.
        tolerance: Relative root mean square error up to which responses count as equal.
    """

    def all_equal(expected: ComplexArray) -> bool:
        size = np.linalg.norm(expected)
        return all(np.linalg.norm(response - expected) <= tolerance * size for response in responses)

    turn = np.exp(-2j * np.pi * frequencies * dt)[:, None, None]
    faults = {f"{abs(n)} sample{'s' * (abs(n) > 1)} {'late' if n > 0 else 'early'}": true * turn**n for n in SHIFTS}
    faults["of the wrong sign"] = -true
    for fault, response in faults.items():
        if all_equal(response):
            return fault
    gain = float(np.mean([np.vdot(true, response).real for response in responses]) / np.vdot(true, true).real)
    return f"{gain:.8g} times the truth" if all_equal(gain * true) else ""


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
        names = QUICK if effort == "quick" else FULL
        return tuple(
            Trial(f"{name}@{samples}", draw)
            for name in names
            for samples in LENGTHS
            for draw in range(RECORDS * DRAWS[effort])
        )

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Fit the slopes."""
        groups = by_problem(measurements)
        names = dict.fromkeys(name.partition("@")[0] for name in groups)
        budget = false_alarm * self.verdicts
        parts: list[Part] = []
        curves: dict[str, dict[str, list[float]]] = {}
        for name in names:
            lengths = sorted(int(key.partition("@")[2]) for key in groups if key.partition("@")[0] == name)
            records = {samples: groups[f"{name}@{samples}"] for samples in lengths}
            part, curves[name] = _slope_part(name, records, estimator, budget / len(names))
            parts.append(part)
        return self.of_parts(
            parts,
            budget,
            "slope of log root mean square error of the response over log number of samples, -0.5 in the limit; "
            f"flatter than chance allows a perfect estimator, and {SLACK} more, fails",
            curves,
        )


def _slope_part(
    name: str, records: dict[int, tuple[list[Measurement], int]], estimator: Estimator, false_alarm: float
) -> tuple[Part, dict[str, list[float]]]:
    lengths = tuple(records)
    too_few = [
        f"{len(good)} of {run} at {samples} samples, at least {needed(run)} are needed"
        for samples, (good, run) in records.items()
        if not enough(len(good), run)
    ]
    longest = bound_for(f"{name}@{lengths[-1]}", estimator.structure)
    if too_few or longest is None or len(lengths) < 2:
        why = (
            f"records with a model: {', '.join(too_few)}"
            if too_few
            else "there is no Cramér-Rao bound or only one length"
        )
        return unjudged(name, f"no verdict: {why}"), {}
    # the weight of the longest records for all lengths, so that the slope is that of the errors alone
    weight = response_covariance(longest)
    free = free_parts(weight)
    squares = [
        variance_ratio(
            np.stack([real_and_imaginary(m.response - longest.response) for m in good if m.response is not None]),
            weight,
            free,
        )
        for good, _ in records.values()
    ]
    counts = tuple(len(values) for values in squares)
    slope = float(_slopes(lengths, np.array([[np.mean(values) for values in squares]]))[0])
    spreads = np.array([np.std(values, ddof=1) / np.sqrt(len(values)) / np.mean(values) for values in squares])
    half = TWO_SIDED_95 * float(np.linalg.norm(_slope_weights(lengths) * spreads / 2.0))
    null = perfect_slopes(name, estimator.structure, lengths, counts)
    high = limits_of_mean(null, 1, false_alarm, low=False)[1] + SLACK
    theory = expectation(estimator, name, "consistency")
    interval = (slope - half, slope + half)
    part = Part.judged(name, slope, float(np.mean(null)), interval, (-np.inf, high), theory, sum(counts))
    return part, {
        "samples": [float(samples) for samples in lengths],
        "error": [float(np.sqrt(np.mean(values))) for values in squares],
        "bound": [float(np.sqrt(np.mean(s))) for s in _null_squares(name, estimator.structure, lengths)],
    }


@lru_cache(maxsize=64)
def perfect_slopes(
    name: str, structure: str | None, lengths: tuple[int, ...], counts: tuple[int, ...], *, seed: int = SEED
) -> FloatArray:
    """Slopes of perfect estimators (SLOPES,), each from as many records of each length."""
    rng = np.random.default_rng(seed)
    means = [
        null[rng.integers(len(null), size=(SLOPES, count))].mean(axis=1)
        for null, count in zip(_null_squares(name, structure, lengths), counts, strict=True)
    ]
    return _slopes(lengths, np.stack(means, axis=1))


@lru_cache(maxsize=64)
def _null_squares(name: str, structure: str | None, lengths: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Squared errors of a perfect estimator at each length, in variances of the longest (M,) each."""
    bounds = [bound for samples in lengths if (bound := bound_for(f"{name}@{samples}", structure)) is not None]
    weight = response_covariance(bounds[-1])
    free = free_parts(weight)
    squares = []
    for place, bound in enumerate(bounds):
        rng = np.random.default_rng((SEED, place))
        chunks = [
            variance_ratio(errors_of_perfect(bound, CHUNK, rng), weight, free) for _ in range(0, NULL_RECORDS, CHUNK)
        ]
        squares.append(np.concatenate(chunks))
    return tuple(squares)


def _slope_weights(lengths: Sequence[int]) -> FloatArray:
    """The slope of values over the logarithm of lengths is their sum with these weights."""
    x = np.log(np.asarray(lengths, dtype=float))
    x = x - x.mean()
    return np.asarray(x / np.sum(x**2))


def _slopes(lengths: Sequence[int], squares: FloatArray) -> FloatArray:
    """Slopes of log root mean square errors, from mean squares (sets, lengths)."""
    return np.asarray(0.5 * np.log(np.maximum(squares, np.finfo(float).tiny)) @ _slope_weights(lengths))
