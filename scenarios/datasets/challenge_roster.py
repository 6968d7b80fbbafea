"""The roster of a class: a text file with the id of a student on every line."""

from pathlib import Path

from scenarios.datasets.spec import STUDENT, STUDENT_IS
from scenarios.files.errors import ScenarioError

MOST = 10_000
"""More students than that are a wrong file."""


def read_roster(path: Path) -> tuple[str, ...]:
    """Read a roster, strictly.

    Args:
        path: UTF-8 text, one id per line.

    Raises:
        ScenarioError: No such file, none of text, an empty line, an id that cannot name a folder, or one that is there
            twice; upper and lower case are the same, as they are on many disks.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"cannot read the roster {path}: {error}") from error
    if not 1 <= len(lines) <= MOST:
        raise ScenarioError(f"{path}: {len(lines)} lines given, expected 1 to {MOST}, an id on each")
    seen: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        if not STUDENT.fullmatch(line):
            raise ScenarioError(f"{path}, line {number}: {line[:100]!r} given, expected an id of {STUDENT_IS}")
        if line.casefold() in seen:
            raise ScenarioError(f"{path}, line {number}: {line!r} stands on line {seen[line.casefold()]} already")
        seen[line.casefold()] = number
    return tuple(lines)
