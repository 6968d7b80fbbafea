"""What counts as about 1 Hz."""

ABOUT_1_HZ = (0.8, 1.25)
"""What counts as about 1 Hz, Hz."""


def near_1_hz(hz: float) -> bool:
    """Whether a bandwidth is about 1 Hz."""
    low, high = ABOUT_1_HZ
    return low <= hz <= high
