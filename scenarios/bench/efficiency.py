"""Efficiency: the variance of the estimated response against the Cramér-Rao bound."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.accuracy_records import NO_RECORD, QUICK, accuracy_trials, by_problem
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure
from scenarios.bench.part_of_mean import Judgement, Values, parts_of_means
from scenarios.bench.perfect_records import bound_for, single_records
from scenarios.bench.response_statistics import free_parts, parts_of, power
from scenarios.bench.theory import expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.bound import response_covariance
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

JUDGED = Judgement(expected=1.0, ratio=1.05, low=False)
"""Better than the bound is no fault: an estimator that knows more, or one that is biased, which other figures show."""


@dataclass(frozen=True)
class Efficiency:
    """Mean over records and frequencies of |error|^2 over the variance of the bound [Ljung1999, sec. 7.4 and ch. 9]."""

    name: str = "efficiency"
    title: str = "Efficiency: variance against the Cramér-Rao bound"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The records of accuracy."""
        return accuracy_trials(effort)

    def verdicts(self) -> int:
        """One of each problem of the quick effort and one of all; with more problems each gets less."""
        return len(QUICK) + 1

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Compare the errors with the bound of the contestant's structure, or else of the truth's own."""
        del referee
        given = [
            Values(
                label=name,
                values=power_against_bound(good, name, contestant.structure),
                run=run,
                single=single_records(name, contestant.structure, power, 1.0),
                theory=expectation(contestant, name, self.name),
            )
            for name, (good, run) in by_problem(measured).items()
        ]
        budget = false_alarm * self.verdicts()
        return figure_of_parts(
            self.name,
            self.title,
            "variance / bound",
            parts_of_means(given, JUDGED, budget) or [unjudged("all", NO_RECORD)],
            budget,
            "mean square error of the response over the Cramér-Rao variance, frequency by frequency, averaged; "
            "more than 1.05 times what chance allows a perfect estimator fails",
            {"records": {values.label: values.values.tolist() for values in given}},
        )


def power_against_bound(good: Sequence[Measured], name: str, structure: str | None) -> FloatArray:
    """Mean over frequencies of |error|^2 over the variance of the bound, record by record (n,)."""
    bound = bound_for(name, structure)
    if bound is None or not good:
        return np.empty(0)
    covariance = response_covariance(bound)
    errors = np.stack([parts_of(m.response - bound.response) for m in good if m.response is not None])
    return power(errors, covariance, free_parts(covariance))
