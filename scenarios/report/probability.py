"""Numbers as text: probabilities and marks of logarithmic axes."""

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

TINY = 1e-300
"""Probabilities below this are printed as such: the tail of the distribution is not computed further."""


def p_value(p: float) -> str:
    """A probability as text."""
    return f"p < {TINY:g}" if p < TINY else f"p = {p:.2g}"


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
