"""Monte Carlo repetition of the study over seeds, and its recorded results."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib import resources
from pathlib import Path
from time import perf_counter

from hmtb_twin import TwinError
from scenarios.experiments.campaign import NOMINAL
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.jobs.journal import Journal
from scenarios.thesis.findings import findings
from scenarios.thesis.outcome import SeedOutcome, outcome, outcome_from
from scenarios.thesis.study import run_study
from scenarios.thesis.tally import Tally, read_tally
from sysid import SysidError

Progress = Callable[[int, int, str, int, int], None]
"""Progress callback: seed, number of finished seeds, step, work done in the step, total work of the step."""

JOURNAL = "seeds.sqlite"
"""Name of the file of finished seeds."""


def tally(
    seeds: Sequence[int],
    *,
    duration: float | None = None,
    threads: int | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Tally:
    """Run the study with every seed on the nominal arm and keep its conclusions.

    One seed's records are in memory at a time. The result does not depend on the number of threads.

    Args:
        seeds: The seeds.
        duration: Length of every record instead of 240 s, s.
        threads: Threads of the simulation.
        folder: Folder of the journal of finished seeds, from which an interrupted run resumes; seeds of other settings,
            versions or source text are run anew.
        progress: Called with every step.

    Returns:
        The conclusions, and the reason of every seed that failed.

    Raises:
        ScenarioError: Every seed failed, or the journal cannot be used.
    """
    setting = {"duration": duration, "versions": versions(), "sources": fingerprint()}
    made_with = sha256(json.dumps(setting, sort_keys=True).encode()).hexdigest()
    outcomes: list[SeedOutcome] = []
    failed: dict[int, str] = {}
    with ExitStack() as stack:
        # Settings are part of the key, not of the journal's fingerprint: one folder serves studies of several lengths.
        journal = None if folder is None else stack.enter_context(Journal(folder / JOURNAL, {"format": "thesis seeds"}))
        for number, seed in enumerate(seeds):
            key = f"{made_with} {seed}"
            if journal is not None and key in journal:
                outcomes.append(outcome_from(journal.get(key)))
                continue

            def report(step: str, done: int, whole: int, seed: int = seed, number: int = number) -> None:
                if progress is not None:
                    progress(seed, number, step, done, whole)

            try:
                conclusions = _run_seed(seed, duration, threads, report)
            except (ScenarioError, TwinError, SysidError) as error:
                failed[seed] = str(error)
                continue
            outcomes.append(conclusions)
            if journal is not None:
                journal.add(key, conclusions.record())
    if not outcomes:
        raise ScenarioError(f"none of {len(seeds)} seeds came to a conclusion: {failed}")
    return Tally(tuple(outcomes), failed)


def _run_seed(
    seed: int, duration: float | None, threads: int | None, report: Callable[[str, int, int], None]
) -> SeedOutcome:
    """Run one seed from excitation to conclusions; its records are released on return."""
    study = run_study(
        seed=seed, duration=duration, conditions=(NOMINAL,), thorough=False, threads=threads, progress=report
    )
    begin = perf_counter()
    decided = findings(study)
    return outcome(replace(study, cost=study.cost.later(perf_counter() - begin)), decided)


FILE = "findings.json"
"""File among the package's data; tests/benchmarks/findings.py writes it."""

ROUNDING = 0.01
"""Rounding on another machine changes a number by less than this fraction of the range over the seeds."""

DIGITS = 1e-6
"""Where the seeds agree, rounding changes a number by less than this fraction of its value."""


@cache
def recorded() -> Tally:
    """The tally that comes with the package: whole records of the nominal arm, seeds 1 to 20."""
    text = resources.files("scenarios").joinpath("data", FILE).read_text(encoding="utf-8")
    return read_tally(text, recorded=True)


def contradictions(outcome: SeedOutcome, reference: Tally) -> tuple[str, ...]:
    """List the contradictions between a study of one of the seeds and the tally.

    Args:
        outcome: Conclusions of the study.
        reference: The tally; it holds the same seed.

    Returns:
        A line for every verdict that is not the one recorded of this seed, for every number and bandwidth that lies
        outside those of all seeds (widened by what rounding moves), and for whatever one has and the other lacks.

    Raises:
        ScenarioError: The tally does not hold the seed.
    """
    return tuple(_contradictions(outcome, reference))


def _contradictions(outcome: SeedOutcome, reference: Tally) -> Iterator[str]:
    before = reference.of(outcome.seed if outcome.seed is not None else -1)
    for key in sorted({*before.verdicts, *outcome.verdicts}, key=lambda name: int(name[1:])):
        verdicts = before.verdicts.get(key, "not recorded"), outcome.verdicts.get(key, "not tried")
        if verdicts[0] != verdicts[1]:
            yield f"{key}: {verdicts[1]}, recorded of seed {outcome.seed}: {verdicts[0]}"
    yield from _outside(_numbers(outcome), [_numbers(entry) for entry in reference.outcomes])


def _numbers(outcome: SeedOutcome) -> dict[str, float]:
    """Every number of an outcome by a unique name."""
    of_findings = {f"{key} {name}": value for key, part in outcome.numbers.items() for name, value in part.items()}
    of_methods = {
        f"bandwidth of {joint}, {method}, {what}": value
        for joint, methods in outcome.recovered.items()
        for method, entry in methods.items()
        for what, value in (
            ("Hz", entry.hz),
            ("lower end", entry.ci95[0]),
            ("upper end", entry.ci95[1]),
            ("0.707 at", entry.half_power_hz),
        )
    }
    true = {f"bandwidth of {joint}, truth": value for joint, value in outcome.true_hz.items()}
    return {**of_findings, **of_methods, **true}


def _outside(numbers: dict[str, float], reference: list[dict[str, float]]) -> Iterator[str]:
    names = dict.fromkeys(name for entry in reference for name in entry)
    for name in {**names, **numbers}:
        values = [entry[name] for entry in reference if name in entry]
        if name not in numbers:
            if len(values) == len(reference):
                yield f"{name}: not there, but with every seed recorded"
        elif not values:
            yield f"{name}: {numbers[name]:.6g}, not recorded"
        else:
            low, high = min(values), max(values)
            room = ROUNDING * (high - low) + DIGITS * max(abs(low), abs(high))
            # The first comparison handles values that are infinite with some seed, such as ends of intervals.
            if numbers[name] not in values and not low - room <= numbers[name] <= high + room:
                yield f"{name}: {numbers[name]:.6g}, recorded {low:.6g} to {high:.6g}"
