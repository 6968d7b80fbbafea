"""What was done of a build so far: JSON lines, only ever appended to."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.chunk import Made
from scenarios.errors import ScenarioError


def line_of(made: Made, hashes: Mapping[str, str]) -> dict[str, Any]:
    """The line of an experiment.

    Args:
        made: What came of it.
        hashes: Hash of each file.
    """
    return {
        "number": made.number,
        "experiment": made.name,
        **({"failed": made.failed} if made.failed else {"files": dict(hashes), "arrays": dict(made.arrays)}),
    }


def append(path: Path, lines: list[dict[str, Any]]) -> None:
    """Append lines and see them safely on the disk.

    Args:
        path: The manifest.
        lines: What they hold.
    """
    with path.open("a", encoding="utf-8") as stream:
        stream.writelines(json.dumps(line, sort_keys=True, allow_nan=False) + "\n" for line in lines)
        stream.flush()
        os.fsync(stream.fileno())


def read(path: Path) -> dict[int, dict[str, Any]]:
    """The lines by the experiment's place in the plan; a last line that a crash cut off counts for nothing.

    Args:
        path: The manifest; none there: nothing was done.

    Raises:
        ScenarioError: A line that is none, other than the last.
    """
    if not path.exists():
        return {}
    found: dict[int, dict[str, Any]] = {}
    lines = path.read_bytes().split(b"\n")
    for position, text in enumerate(lines):
        if not text or position == len(lines) - 1:
            continue
        try:
            entry = json.loads(text)
            found[int(entry["number"])] = entry
        except (ValueError, LookupError, TypeError) as error:
            raise ScenarioError(f"{path}, line {position + 1} is no line of a manifest: {error}") from error
    return found
