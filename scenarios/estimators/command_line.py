"""The command line of a program: words without a shell, and places for the files of a request."""

import os
import shlex
import shutil
from pathlib import Path

from scenarios.estimators.contestant import Contestant
from scenarios.estimators.model_file import MODEL_STEM
from scenarios.estimators.task_files import FORMATS, TASK_FILE
from scenarios.files.errors import ScenarioError

PLACES = (*FORMATS, "task", "model")
"""Placeholders, in braces on the command line."""


def words(contestant: Contestant) -> list[str]:
    """The command line in words, its program found.

    Args:
        contestant: A program.

    Raises:
        ScenarioError: It cannot be split, has no place for the record or the model, or there is no such program.
    """
    line = contestant.target
    try:
        split = shlex.split(line)
    except ValueError as error:
        raise ScenarioError(f"command {line!r} cannot be split into words: {error}") from error
    if not split or not formats(line) or "{model}" not in line:
        raise ScenarioError(
            f"command {line!r} given, expected one of {', '.join(f'{{{name}}}' for name in FORMATS)} where it reads "
            "the record, {model} where it writes its model, and {task} where it reads what is asked, if it does"
        )
    home = Path(contestant.home or ".").resolve()
    if not home.is_dir():
        raise ScenarioError(f"folder {str(home)!r} given for {contestant.name!r}, expected one that is there")
    # A program with a folder in its name is looked for from home, as a shell there would.
    program = shutil.which(str(home / split[0]) if "/" in split[0] else split[0])
    if program is None:
        raise ScenarioError(
            f"no program {split[0]!r} for {contestant.name!r}, neither in {str(home)!r} nor on the path"
        )
    return [program, *split[1:]]


def formats(line: str) -> tuple[str, ...]:
    """Formats of the record that a command line has places for."""
    return tuple(name for name in FORMATS if f"{{{name}}}" in line)


def paths(folder: Path, line: str) -> dict[str, str]:
    """What stands for each placeholder of a command line: files in a folder."""
    files = {**{name: FORMATS[name] for name in formats(line)}, "task": TASK_FILE, "model": MODEL_STEM}
    return {name: str(folder / file) for name, file in files.items()}


def filled(split: list[str], places: dict[str, str]) -> list[str]:
    """Words with the placeholders filled in; other braces stay."""
    out = []
    for word in split:
        for name, path in places.items():
            word = word.replace(f"{{{name}}}", path)
        out.append(word)
    return out


def unfilled(text: str, places: dict[str, str], folder: Path) -> str:
    """A text with placeholders again, so that what is said of one request reads as what is said of another.

    Args:
        text: What a program said, or what is said of it.
        places: What stands for each placeholder.
        folder: Of the request; what else stands in it is told by `{folder}`.
    """
    for name, path in (*places.items(), ("folder", str(folder))):
        # what a link to the folder of temporary files leads to is the name that some programs have of it
        for known in (os.path.realpath(path), path):
            text = text.replace(known, f"{{{name}}}")
    return text
