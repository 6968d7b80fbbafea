"""The 100-point file on disk: one point per line, V, written and read as the excitation computer does it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.waveform import POINTS, Waveform

KIND = "file"
"""What a scenario file calls an excitation that stands in a file of its own."""


def points(*, points: tuple[float, ...]) -> Waveform:
    """A waveform of one's own, point by point.

    Args:
        points: One period (100,), V.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: Not 100 finite points, or one beyond reason.
    """
    if len(points) != POINTS:
        raise ScenarioError(f"a waveform file holds {POINTS} points, one period; given {len(points)}")
    return Waveform(np.array(points, dtype=float), "points", {"points": tuple(float(value) for value in points)})


def read_points(path: str | Path) -> tuple[float, ...]:
    """Read a 100-point file: numbers apart by spaces, commas or lines; what follows a # is a remark.

    Args:
        path: The file.

    Returns:
        Its points (100,), V.

    Raises:
        ScenarioError: The file cannot be read, holds something else than numbers, or another number of them.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text, or no path"
        raise ScenarioError(
            f"cannot read waveform file {str(path)!r}: {why}; expected {POINTS} numbers in V, one per line"
        ) from error
    values: list[float] = []
    for number, line in enumerate(lines, start=1):
        for word in line.partition("#")[0].replace(",", " ").split():
            try:
                values.append(float(word))
            except ValueError:
                raise ScenarioError(
                    f"waveform file {str(path)!r}, line {number}: expected a number in V, given {word!r}"
                ) from None
            if not np.isfinite(values[-1]):
                raise ScenarioError(
                    f"waveform file {str(path)!r}, line {number}: expected a finite number in V, given {word!r}"
                )
    try:
        return tuple(float(value) for value in points(points=tuple(values)).points)
    except ScenarioError as error:
        raise ScenarioError(f"waveform file {str(path)!r}: {error}") from error


def write_points(values: Sequence[float], path: Path) -> Path:
    """Write a 100-point file that reads back equal to the last bit.

    Args:
        values: The points (100,), V.
        path: The file.

    Returns:
        The path.
    """
    path.write_text("".join(f"{float(value)!r}\n" for value in values), encoding="utf-8")
    return path
