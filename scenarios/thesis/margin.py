"""Least difference of two fits that counts."""

MARGIN = 0.2
"""Two fits that differ by less are tied, percentage points: the thesis reads fits off its plots to no more digits."""


def ahead(difference: float) -> bool:
    """Whether a fit is ahead of another by more than a tie.

    Args:
        difference: The fit less the other, percentage points.
    """
    return difference >= MARGIN


def tied(difference: float) -> bool:
    """Whether two fits are tied.

    Args:
        difference: One fit less the other, percentage points.
    """
    return abs(difference) < MARGIN


def said(difference: float) -> str:
    """`ahead`, `tied` or `behind` in words.

    Args:
        difference: One fit less the other, percentage points.
    """
    return "tied" if tied(difference) else ("ahead" if difference > 0 else "behind")
