"""To be drawn."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from scenarios.leaderboard.entry import Entry


def bandwidths(entries: Sequence[Entry]) -> tuple[Figure, str] | None:
    """None yet."""
    return None
