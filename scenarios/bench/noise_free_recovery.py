"""Recovery without noise: how many digits of the frequency response are right."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarios.bench.accuracy_records import NO_RECORD, by_problem
from scenarios.bench.familiar_fault import familiar_fault
from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS, Figure, Part
from scenarios.bench.theory import expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

ORDERS = (1, 2, 3, 4, 5, 6)
DELAYS = (1, 2, 3)
DEMANDED = 6.0
"""Digits. Double precision has 15.7; normal equations may lose half of them, and a search that stops when the sum of
squares no longer changes in its 12th digit knows its minimum to half as many. What has fewer has another fault than
rounding: a delay, a transient that is not allowed for, a term that is left out."""
MOST = 16.0
"""Digits that are told at most."""
FAULT = "the response is "
"""How what is familiar about a wrong response is told."""
WHERE_IT_FAILS = "where it fails, "
"""What all parts that fail have in common, behind what is counted."""


@dataclass(frozen=True)
class NoiseFreeRecovery:
    """Digits of the response, -log10 of the relative root mean square error, by order and delay."""

    name: str = "noise_free_recovery"
    title: str = "Recovery without noise"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """One record of a system of each order and delay, or several."""
        return tuple(
            Trial(f"quiet-{order}-{delay}", draw)
            for order in ORDERS
            for delay in DELAYS
            for draw in range(DRAWS[effort])
        )

    def verdicts(self) -> int:
        """None that chance can turn: there is none in the records."""
        return 0

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Count the digits."""
        del false_alarm, referee
        parts = [
            _part(name, good, run, contestant, self.name) for name, (good, run) in by_problem(measured).items()
        ] or [unjudged("all", NO_RECORD)]
        judged = [part for part in parts if part.passed is not None]
        table = [
            [next((part.value for part in parts if part.label == f"quiet-{order}-{delay}"), None) for delay in DELAYS]
            for order in ORDERS
        ]
        whole = figure_of_parts(
            self.name,
            self.title,
            "digits",
            parts,
            0.0,
            f"digits of the response that are right without noise, the fewest of all orders and delays; {DEMANDED:g} "
            "are demanded",
            {"orders": list(ORDERS), "delays": list(DELAYS), "digits": table},
        )
        if not judged:
            return whole
        if faults := {part.why for part in judged if not part.passed}:
            common = next(iter(faults)) if len(faults) == 1 else ""
            whole = replace(whole, why=f"{whole.why}; {WHERE_IT_FAILS}{common}" if FAULT in common else whole.why)
        # all that pass are as good as expected: the worst is the one with the fewest digits
        worst = min(judged, key=lambda part: part.value)
        whole = replace(whole, value=worst.value, expected=worst.expected, interval=worst.interval)
        if 2 * len(judged) < len(parts) and whole.passed:
            told = f"; no verdict: {len(judged)} of {len(parts)} systems have a model"
            return replace(whole, passed=None, why=whole.why + told)
        return whole


def _part(name: str, good: Sequence[Measured], run: int, contestant: Contestant, figure: str) -> Part:
    if 2 * len(good) < run or not good:
        return unjudged(name, f"no verdict: {len(good)} of {run} records have a model", len(good))
    true = problem(name).truth.frequency_response(problem(name).frequencies)
    size = np.sqrt(np.mean(np.abs(true) ** 2))
    responses = [m.response for m in good if m.response is not None]
    errors = [np.sqrt(np.mean(np.abs(response - true) ** 2)) / size for response in responses]
    digits = float(np.min(-np.log10(np.maximum(errors, 10.0**-MOST)))) + 0.0  # no -0
    theory = expectation(contestant, name, figure)
    fault = ""
    if digits < DEMANDED:
        told = familiar_fault(responses, true, problem(name).frequencies, problem(name).truth.dt, 10.0**-DEMANDED)
        fault = f"{FAULT}{told}" if told else ""
    return Part(
        label=name,
        value=digits,
        expected=DEMANDED,
        interval=(digits, digits),
        limits=(DEMANDED, np.inf),
        passed=digits >= DEMANDED,
        theory=theory.passes,
        why="; ".join(filter(None, (theory.why, fault))),
        draws=len(good),
    )
