"""Marks of a logarithmic axis as plain numbers."""

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

WIDE = 100.0
"""An axis that reaches further than this factor is marked at powers of ten alone."""


def plain_marks(axis: Axis, ends: tuple[float, float]) -> None:
    """Mark an axis so that numbers do not meet.

    Args:
        axis: A logarithmic one.
        ends: Between which it reaches.
    """
    wide = ends[1] > WIDE * ends[0]
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
