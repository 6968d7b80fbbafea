"""Numbers, intervals and limits as `hmtb verify` prints them."""

import math


def number(value: float) -> str:
    """A number with four digits; a dash for one that there is none of."""
    return "—" if math.isnan(value) else f"{value:.4g}"


def interval(ends: tuple[float, float]) -> str:
    """An interval in words."""
    return "—" if math.isnan(ends[0]) or math.isnan(ends[1]) else f"{number(ends[0])} to {number(ends[1])}"


def limits(ends: tuple[float, float]) -> str:
    """What passes, in words; a dash for limits that any value passes."""
    low, high = ends
    if math.isinf(low) and math.isinf(high):
        return "—"
    if low == high:
        return number(low)
    if math.isinf(low):
        return f"at most {number(high)}"
    return f"at least {number(low)}" if math.isinf(high) else interval(ends)
