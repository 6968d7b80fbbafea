"""Which figure of the bench is drawn how."""

import warnings
from collections.abc import Callable, Mapping, Sequence

from matplotlib.figure import Figure

from scenarios.bench.leaderboard_bandwidth_drawing import bandwidths
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_part_drawing import parts_drawn
from scenarios.bench.leaderboard_response_drawing import responses
from scenarios.bench.leaderboard_split_drawing import splits
from scenarios.bench.leaderboard_work_precision import work_precision
from scenarios.report.figures import Gallery, Picture

Drawn = tuple[Figure, str]
"""A figure and its caption."""

DRAWINGS: Mapping[str, Callable[[Sequence[Entry]], Drawn | None]] = {
    "efficiency": lambda entries: parts_drawn(entries, "efficiency", logarithmic=True),
    "coverage": lambda entries: parts_drawn(entries, "coverage", chosen="response"),
    "frequency_response": responses,
    "amplitude_split": splits,
    "bias": lambda entries: parts_drawn(entries, "bias", far=True),
    "bandwidth": bandwidths,
}
"""Drawings by figure; the others are told by their tables."""


def drawing(entries: Sequence[Entry], name: str, gallery: Gallery) -> Picture | None:
    """The drawing of a figure; None where it has none or no row has the numbers for it."""
    return _added(DRAWINGS[name](entries), name.replace("_", "-"), gallery) if name in DRAWINGS else None


def overview(entries: Sequence[Entry], gallery: Gallery) -> Picture | None:
    """Accuracy against speed; None where no row has both."""
    return _added(work_precision(entries), "accuracy-and-time", gallery)


def _added(drawn: Drawn | None, name: str, gallery: Gallery) -> Picture | None:
    if drawn is None:
        return None
    with warnings.catch_warnings():
        # Names in scripts that the font lacks are boxes in the figure; the tables have them whole.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        return gallery.add(*drawn, name=name)
