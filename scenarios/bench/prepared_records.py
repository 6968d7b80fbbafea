"""Records of the twin, simulated side by side before they are asked for."""

from collections.abc import Sequence
from pathlib import Path

from scenarios.problems.trial import Trial

MARK = "twin-"
"""By which names of the twin's problems begin."""


def is_twin(problem: str) -> bool:
    """Whether records of a problem come from the physics, which is loaded only where they do."""
    return problem.startswith(MARK)


def use_records(folder: Path) -> None:
    """Let problems of this process draw from the files of a folder."""
    from scenarios.problems.twin_records import use_folder

    use_folder(folder)


def simulate_records(trials: Sequence[Trial], seed: int, folder: Path | None, *, threads: int | None = None) -> int:
    """Simulate the records of the twin's trials in one batch; a tenth of what they cost one by one.

    Args:
        trials: Trials of whatever problems.
        seed: Of the run.
        folder: In which they are kept for other processes; None: they are kept in this one.
        threads: Threads for the physics, all processors by default.

    Returns:
        How many were simulated; others were there already, or are of other problems.
    """
    of_twin = [trial for trial in trials if is_twin(trial.problem)]
    if not of_twin:
        return 0
    from scenarios.problems.twin_records import prepare

    return prepare(of_twin, seed, folder=folder, threads=threads)
