"""The study again with other seeds, of which only the conclusions are kept."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from hmtb_twin import TwinError
from scenarios.experiments.campaign import NOMINAL
from scenarios.files.atomic_write import check_place
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.thesis.findings import findings
from scenarios.thesis.kept_seed import keep, kept
from scenarios.thesis.outcome import Outcome, outcome
from scenarios.thesis.study import run_study
from scenarios.thesis.tally import Tally
from sysid import SysidError

Progress = Callable[[int, int, str, int, int], None]
"""Called with the seed, how many came before it, the step, what is done of it and what there is in all."""


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
        folder: Where the conclusions of each seed are kept as a file as soon as they are there; those of an earlier
            run with the same settings, versions and source text are taken from there if they are whole, else the seed
            is run and its file written anew.
        progress: Told of every step.

    Returns:
        The conclusions, and the reason of every seed that came to none.

    Raises:
        ScenarioError: No seed came to an end, or a folder stands where a file is to be.
    """
    setting = {"duration": duration, "versions": versions(), "sources": fingerprint()}
    outcomes: list[Outcome] = []
    failed: dict[int, str] = {}
    paths = {} if folder is None else {seed: folder / f"seed-{seed}.json" for seed in seeds}
    for path in paths.values():
        check_place(path)
    for number, seed in enumerate(seeds):
        before = kept(paths[seed], seed, setting) if paths else None
        if before is not None:
            outcomes.append(before)
            continue

        def told(step: str, done: int, whole: int, seed: int = seed, number: int = number) -> None:
            if progress is not None:
                progress(seed, number, step, done, whole)

        try:
            found = _one(seed, duration, threads, told)
        except (ScenarioError, TwinError, SysidError) as error:
            failed[seed] = str(error)
            continue
        outcomes.append(found)
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            keep(found, setting, paths[seed])
    if not outcomes:
        raise ScenarioError(f"none of {len(seeds)} seeds came to a conclusion: {failed}")
    return Tally(tuple(outcomes), failed)


def _one(seed: int, duration: float | None, threads: int | None, told: Callable[[str, int, int], None]) -> Outcome:
    """One seed from excitation to conclusions; its records are forgotten on return."""
    study = run_study(
        seed=seed, duration=duration, conditions=(NOMINAL,), thorough=False, threads=threads, progress=told
    )
    begin = perf_counter()
    found = findings(study)
    return outcome(replace(study, cost=study.cost.later(perf_counter() - begin)), found)
