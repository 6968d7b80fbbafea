"""Consistency: the error shrinks as one over the root of the number of samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenarios.bench.accuracy_records import NO_RECORD, by_problem, enough, needed
from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS, Figure, Part
from scenarios.bench.perfect_mean import limits_of_mean
from scenarios.bench.perfect_records import CHUNK, SEED, SINGLES, bound_for, parts_of_perfect
from scenarios.bench.response_statistics import TWO_SIDED_95, free_parts, parts_of, power
from scenarios.bench.theory import expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.bound import response_covariance
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

QUICK = ("p2", "p3")
FULL = ("p2", "p3", "p4", "p5")
LENGTHS = (1000, 4000, 16_000)
RECORDS = 20
"""Of each length by the quick effort."""

SLACK = 0.02
"""What the slope may be flatter: a variance that lies some 10 % above the bound on the longest records only."""

SETS = 4000
"""Slopes that are simulated for the limit."""


@dataclass(frozen=True)
class Consistency:
    """Slope of the logarithm of the response's error over that of the number of samples [Ljung1999, ch. 9].

    -1/2 in the limit of an estimator whose error is chance, however much of it; 0 of one whose error is bias. What is
    expected is the slope of the bound at these lengths: the input does not tell exactly as much per sample at each.
    Only a flatter slope fails: short records may be worse than the theory of long ones says.
    """

    name: str = "consistency"
    title: str = "Consistency: slope of the error against the number of samples"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of three lengths."""
        names = QUICK if effort == "quick" else FULL
        return tuple(
            Trial(f"{name}@{samples}", draw)
            for name in names
            for samples in LENGTHS
            for draw in range(RECORDS * DRAWS[effort])
        )

    def verdicts(self) -> int:
        """One of each problem of the quick effort; with more problems each gets less."""
        return len(QUICK)

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Fit the slopes."""
        del referee
        groups = by_problem(measured)
        names = dict.fromkeys(name.partition("@")[0] for name in groups)
        budget = false_alarm * self.verdicts()
        parts: list[Part] = []
        curves: dict[str, dict[str, list[float]]] = {}
        for name in names:
            lengths = sorted(int(key.partition("@")[2]) for key in groups if key.partition("@")[0] == name)
            here = {samples: groups[f"{name}@{samples}"] for samples in lengths}
            part, curve = _slope_of(name, here, contestant, budget / len(names))
            parts.append(part)
            curves[name] = curve
        return figure_of_parts(
            self.name,
            self.title,
            "log error / log samples",
            parts or [unjudged("all", NO_RECORD)],
            budget,
            "slope of log root mean square error of the response over log number of samples, -0.5 in the limit; "
            f"flatter than chance allows a perfect estimator, and {SLACK} more, fails",
            curves,
        )


def _slope_of(
    name: str, here: dict[int, tuple[list[Measured], int]], contestant: Contestant, false_alarm: float
) -> tuple[Part, dict[str, list[float]]]:
    lengths = tuple(here)
    few = [
        f"{len(good)} of {run} at {samples} samples, at least {needed(run)} are needed"
        for samples, (good, run) in here.items()
        if not enough(len(good), run)
    ]
    longest = bound_for(f"{name}@{lengths[-1]}", contestant.structure)
    if few or longest is None or len(lengths) < 2:
        why = f"records with a model: {', '.join(few)}" if few else "there is no Cramér-Rao bound or a single length"
        return unjudged(name, f"no verdict: {why}"), {}
    # one weight for all lengths, so that the slope is that of the errors alone
    weight = response_covariance(longest)
    free = free_parts(weight)
    squares = [
        power(np.stack([parts_of(m.response - longest.response) for m in good if m.response is not None]), weight, free)
        for good, _ in here.values()
    ]
    counts = tuple(len(one) for one in squares)
    value = float(_slopes(lengths, np.array([[np.mean(one) for one in squares]]))[0])
    spreads = np.array([np.std(one, ddof=1) / np.sqrt(len(one)) / np.mean(one) for one in squares])
    half = TWO_SIDED_95 * float(np.linalg.norm(_weights(lengths) * spreads / 2.0))
    slopes = perfect_slopes(name, contestant.structure, lengths, counts)
    high = limits_of_mean(slopes, 1, false_alarm, low=False)[1] + SLACK
    theory = expectation(contestant, name, "consistency")
    part = Part(
        label=name,
        value=value,
        expected=float(np.mean(slopes)),
        interval=(value - half, value + half),
        limits=(-np.inf, high),
        passed=value <= high,
        theory=theory.passes,
        why=theory.why,
        draws=sum(counts),
    )
    return part, {
        "samples": [float(samples) for samples in lengths],
        "error": [float(np.sqrt(np.mean(one))) for one in squares],
        "bound": [float(np.sqrt(np.mean(s))) for s in _single_squares(name, contestant.structure, lengths)],
    }


@lru_cache(maxsize=64)
def perfect_slopes(
    name: str, structure: str | None, lengths: tuple[int, ...], counts: tuple[int, ...], *, seed: int = SEED
) -> FloatArray:
    """Slopes of perfect estimators (SETS,), each from as many records of each length."""
    rng = np.random.default_rng(seed)
    means = [
        single[rng.integers(len(single), size=(SETS, count))].mean(axis=1)
        for single, count in zip(_single_squares(name, structure, lengths), counts, strict=True)
    ]
    return _slopes(lengths, np.stack(means, axis=1))


@lru_cache(maxsize=64)
def _single_squares(name: str, structure: str | None, lengths: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Errors of single records of each length, in variances of the longest (M,) each."""
    bounds = [bound_for(f"{name}@{samples}", structure) for samples in lengths]
    known = [bound for bound in bounds if bound is not None]
    weight = response_covariance(known[-1])
    free = free_parts(weight)
    out = []
    for place, bound in enumerate(known):
        rng = np.random.default_rng((SEED, place))
        out.append(
            np.concatenate([power(parts_of_perfect(bound, CHUNK, rng), weight, free) for _ in range(0, SINGLES, CHUNK)])
        )
    return tuple(out)


def _weights(lengths: Sequence[int]) -> FloatArray:
    """The slope of values over the logarithm of lengths is their sum with these weights."""
    x = np.log(np.asarray(lengths, dtype=float))
    x = x - x.mean()
    return np.asarray(x / np.sum(x**2))


def _slopes(lengths: Sequence[int], squares: FloatArray) -> FloatArray:
    """Slopes of log root mean square errors, from mean squares (sets, lengths)."""
    return np.asarray(0.5 * np.log(np.maximum(squares, np.finfo(float).tiny)) @ _weights(lengths))
