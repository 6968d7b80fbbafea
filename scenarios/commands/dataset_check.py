"""`hmtb dataset check`: whether a copy of a data set is whole, and still what its spec gives."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, progress, say


def check(
    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")],
    /,
    *,
    key: Path | None = None,
    regenerate: int = 3,
    seed: int = 0,
    workers: int | None = None,
    json: bool = False,
) -> int:
    """Check a data set: files, hashes, metadata, and some experiments by simulating them again.

    hmtb dataset check hmtb-siso-v1

    Exits with 1 if anything differs. With the software that the data set was built with, experiments that are simulated
    again must have the same bits; with other versions the same numbers to nine digits, measured angles to one count of
    the resolver.

    Args:
        folder: The data set.
        key: The key file of a data set whose truth is hidden: with it everything is checked.
        regenerate: How many experiments to simulate again.
        seed: Draws them.
        workers: Threads for the physics.
        json: Print JSON.
    """
    from scenarios.datasets.challenge_key_check import examine_with_key
    from scenarios.datasets.check import examine

    with progress("checking") as report:
        if key is None:
            found = examine(folder, regenerate=regenerate, seed=seed, workers=workers, progress=report)
        else:
            found = examine_with_key(folder, key, regenerate=regenerate, seed=seed, workers=workers, progress=report)
    if json:
        print_json({"passed": found.passed, "problems": found.problems, "notes": found.notes})
        return 0 if found.passed else 1
    for problem in found.problems:
        say(f"problem: {problem}")
    for note in found.notes:
        say(f"note: {note}")
    count = len(found.problems)
    said = "passed" if found.passed else f"{count} problem{'s' if count > 1 else ''}"
    say(f"{folder}: {said}")
    return 0 if found.passed else 1
