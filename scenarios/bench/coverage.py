"""Coverage: how often claimed 95 % intervals hold the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.accuracy_records import NO_RECORD, QUICK, accuracy_trials, by_problem
from scenarios.bench.claimed_errors import claimed_records
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, Part
from scenarios.bench.part_of_mean import TOGETHER, Judgement, Values, part_of_mean, parts_together
from scenarios.bench.perfect_records import (
    bandwidth_covered,
    bound_for,
    parameters_covered,
    single_records,
)
from scenarios.bench.response_statistics import covered
from scenarios.bench.theory import Expectation
from scenarios.bench.theory_of_claims import ClaimsTheory
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

SHARE = 0.95
JUDGED = Judgement(expected=SHARE, points=0.01, shares=True)
KINDS = ("parameters", "bandwidth", "response")
NOT_CLAIMED = "no verdict: the estimator claims no interval of the {}"
NOT_HELD = "no verdict: no {} model is the truth: the parameters that it claims have no true values"
NOT_ASKED = "no verdict: the parameters that it claims are not those of the orders that were asked"


@dataclass(frozen=True)
class Coverage:
    """Share of claimed 95 % intervals that hold the truth: of parameters, of the bandwidth, of the response.

    Those of the response are intervals of its real and of its imaginary part, at each frequency. Intervals that hold
    the truth too often are wrong too.
    """

    name: str = "coverage"
    title: str = "Coverage of claimed 95 % intervals"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The records of accuracy."""
        return accuracy_trials(effort)

    def verdicts(self) -> int:
        """Three of each problem of the quick effort and three of all; with more problems each gets less."""
        return len(KINDS) * (len(QUICK) + 1)

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Count the intervals that hold."""
        del referee
        groups = by_problem(measured)
        budget = false_alarm * self.verdicts()
        share = budget / (len(KINDS) * (len(groups) + 1))
        theories = {
            name: ClaimsTheory(contestant, name, good).expectation(self.name) for name, (good, _) in groups.items()
        }
        parts: list[Part] = []
        for kind in KINDS:
            given = [
                _values(kind, good, run, name, contestant.structure, theories[name])
                for name, (good, run) in groups.items()
            ]
            parts += [part_of_mean(values, JUDGED, share) for values in given]
            parts += parts_together(f"{TOGETHER} {kind}", given, JUDGED, share)
        return figure_of_parts(
            self.name,
            self.title,
            "share of intervals",
            parts or [unjudged("all", NO_RECORD)],
            budget,
            "share of 95 % intervals that hold the truth, within what chance allows a perfect estimator and one "
            "percentage point of it",
            {kind: {p.label.split()[0]: p.value for p in parts if p.label.endswith(kind)} for kind in KINDS},
        )


def _values(
    kind: str, good: Sequence[Measured], run: int, name: str, structure: str | None, theory: Expectation
) -> Values:
    single: FloatArray | None
    why_not, models = NOT_CLAIMED.format(kind), len(good)
    if kind == "parameters":
        known = [m for m in good if m.covered >= 0 and m.parameters > 0]
        values = np.array([m.covered / m.parameters for m in known])
        single = parameters_covered(name, structure)
        if not known and any(m.parameters > 0 for m in good):
            held = structure is None or problem(name).bound(structure) is not None
            why_not = NOT_ASKED if held else NOT_HELD.format(structure)
    elif kind == "bandwidth":
        values = _bandwidths(good, name, structure)
        single = bandwidth_covered()
        models = sum(m.bandwidth_hz is not None and bool(np.isfinite(m.bandwidth_hz).any()) for m in good)
    else:
        values = claimed_records(good, name, structure, covered)
        single = single_records(name, structure, covered, SHARE)
    return Values(f"{name} {kind}", values, run, single, theory, why_not, models)


def _bandwidths(good: Sequence[Measured], name: str, structure: str | None) -> FloatArray:
    """Share of the bandwidths that lie within their intervals, of those that exist and have one, record by record."""
    bound = bound_for(name, structure)
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
