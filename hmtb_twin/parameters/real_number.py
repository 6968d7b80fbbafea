"""Conversion of any real number to a float, so that one range check serves all tables of an experiment."""

from math import nan
from numbers import Real


def real_number(value: object) -> float:
    """Convert a real number to a float, and anything else to nan, which fails every range check.

    A bool or a number too large for a float becomes nan too.
    """
    # bool is a subclass of int, so True would pass as 1.
    if not isinstance(value, Real) or isinstance(value, bool):
        return nan
    try:
        return float(value)
    except OverflowError:
        return nan
