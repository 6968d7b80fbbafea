"""Monte Carlo repetition of the study over seeds, and its recorded results."""

import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib import resources
from pathlib import Path
from time import perf_counter

from hmtb_twin import TwinError
from scenarios.experiments.campaign import NOMINAL
from scenarios.files.codec import structure, unstructure
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.jobs.journal import Journal
from scenarios.thesis.findings import findings
from scenarios.thesis.study import planned_steps, run_study
from scenarios.thesis.tally import SeedOutcome, Tally, outcome, read_tally
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
                outcomes.append(structure(SeedOutcome, journal.get(key)))
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
                journal.add(key, unstructure(conclusions))
    if not outcomes:
        raise ScenarioError(f"none of {len(seeds)} seeds came to a conclusion: {failed}")
    return Tally(tuple(outcomes), failed)


def _run_seed(
    seed: int, duration: float | None, threads: int | None, report: Callable[[str, int, int], None]
) -> SeedOutcome:
    """Run one seed from excitation to conclusions; its records are released on return."""
    arms = (NOMINAL,)
    steps = planned_steps(arms, duration, thorough=False, report=report)
    study = run_study(seed=seed, duration=duration, conditions=arms, thorough=False, threads=threads, steps=steps)
    begin = perf_counter()
    decided = findings(study)
    return outcome(replace(study, cost=study.cost.later(perf_counter() - begin)), decided)


FILE = "findings.json"
"""File among the package's data; tests/benchmarks/findings.py writes it."""


@cache
def recorded() -> Tally:
    """The tally that comes with the package: whole records of the nominal arm, seeds 1 to 20."""
    text = resources.files("scenarios").joinpath("data", FILE).read_text(encoding="utf-8")
    return read_tally(text, recorded=True)
