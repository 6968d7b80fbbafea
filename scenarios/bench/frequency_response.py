"""Error of the frequency response, against the band that the estimator claims around it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenarios.bench.accuracy_records import NO_RECORD, QUICK, accuracy_trials, by_problem, enough
from scenarios.bench.claimed_errors import NOT_CLAIMED, by_claim, claims
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, Part
from scenarios.bench.part_of_mean import TOGETHER, Judgement, Values, part_of_mean, parts_together
from scenarios.bench.perfect_mean import limits_of_moments
from scenarios.bench.perfect_records import bound_for, single_records
from scenarios.bench.response_statistics import free_parts, power, power_by_frequency
from scenarios.bench.theory import Expectation
from scenarios.bench.theory_of_claims import ClaimsTheory
from scenarios.bench.worst_part import excess, figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.bound import response_covariance
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

JUDGED = Judgement(expected=1.0, ratio=1.05)
"""Of squares; the figure tells their roots."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Root mean square error of the response in claimed standard deviations, over all frequencies and at the worst.

    The error relative to the response, in percent, is told beside it, also where nothing is claimed.
    """

    name: str = "frequency_response"
    title: str = "Error of the frequency response against the claimed band"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The records of accuracy."""
        return accuracy_trials(effort)

    def verdicts(self) -> int:
        """Two of each problem of the quick effort and one of all; with more problems each gets less."""
        return 2 * len(QUICK) + 1

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Compare the errors with what is claimed of them."""
        del referee
        groups = by_problem(measured)
        budget = false_alarm * self.verdicts()
        share = budget / (2 * len(groups) + 1)
        structure = contestant.structure
        given: list[Values] = []
        parts: list[Part] = []
        for name, (good, run) in groups.items():
            theory = ClaimsTheory(contestant, name, good).expectation(self.name)
            ratios = by_claim(good, name, structure, power_by_frequency)
            values = np.array([float(np.nanmean(one)) for one in ratios])
            given.append(
                Values(name, values, run, single_records(name, structure, power, 1.0), theory, NOT_CLAIMED, len(good))
            )
            parts.append(_root(part_of_mean(given[-1], JUDGED, share)))
            if enough(len(ratios), run):
                parts.append(_root(_worst_frequency(np.concatenate(ratios), name, structure, theory, share)))
        parts += [_root(part) for part in parts_together(TOGETHER, given, JUDGED, share)]
        curves = {name: _curves(good, name, structure) for name, (good, _) in groups.items() if good}
        told = ", ".join(f"{curve['relative_error_percent']:.3g} % on {name}" for name, curve in curves.items())
        return figure_of_parts(
            self.name,
            self.title,
            "claimed standard deviations",
            parts or [unjudged("all", NO_RECORD)],
            budget,
            "root mean square error of the response in claimed standard deviations, within what chance allows a "
            f"perfect estimator and 5 % of the variance; relative to the response it is {told or 'not known'}",
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
        limits = JUDGED.widened(float(low[k, i, j]), float(high[k, i, j]))
        values = ratios[:, k, i, j]
        parts.append(
            Part(
                label=f"{name} at {bound.frequencies[k]:.3g} Hz",
                value=float(np.mean(values)),
                expected=1.0,
                interval=JUDGED.interval(values),
                limits=limits,
                passed=bool(limits[0] <= np.mean(values) <= limits[1]),
                theory=theory.passes,
                why=theory.why,
                draws=len(values),
            )
        )
    return max(parts, key=lambda part: (np.isinf(part.value), excess(part)))


@lru_cache(maxsize=256)
def limits_by_frequency(
    name: str, structure: str | None, draws: int, false_alarm: float
) -> tuple[FloatArray, FloatArray]:
    """Limits of the mean of |error|^2 over its variance at each frequency (nf, ny, nu), without slack.

    Args:
        name: Of a problem with a bound.
        structure: Of the contestant.
        draws: Records.
        false_alarm: Probability that a perfect estimator's mean lies outside at any frequency, at most.

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
    """The same of roots of mean squares."""
    return replace(
        part,
        value=float(np.sqrt(part.value)),
        interval=(_above_zero(part.interval[0]), _above_zero(part.interval[1])),
        limits=(_above_zero(part.limits[0]) if np.isfinite(part.limits[0]) else -np.inf, _above_zero(part.limits[1])),
    )


def _above_zero(square: float) -> float:
    return float(np.sqrt(max(square, 0.0))) if not np.isnan(square) else square


def _curves(good: Sequence[Measured], name: str, structure: str | None) -> Mapping[str, Any]:
    """For drawing: gains (nf, ny, nu) of truth, error, claimed band and bound."""
    bound = bound_for(name, structure)
    frequencies = problem(name).frequencies
    true = problem(name).truth.frequency_response(frequencies)
    square = np.mean([np.abs(m.response - true) ** 2 for m in good if m.response is not None], axis=0)
    claimed = [
        np.trace(m.response_covariance, axis1=-2, axis2=-1)
        for m in good
        if claims(m) and m.response_covariance is not None
    ]
    return {
        "frequencies_hz": frequencies.tolist(),
        "truth": np.abs(true).tolist(),
        "error": np.sqrt(square).tolist(),
        "claimed": np.sqrt(np.mean(claimed, axis=0)).tolist() if claimed else None,
        "bound": None if bound is None else np.sqrt(np.sum(bound.response_directions**2, axis=(0, -1))).tolist(),
        "relative_error_percent": 100.0 * float(np.sqrt(np.mean(square) / np.mean(np.abs(true) ** 2))),
    }
