"""Conversion of any real number to a float, so that one range check serves all tables of an experiment."""

from math import nan
from numbers import Real


def real_number(value: object) -> float:
    """Return a real number as a float, or nan, which fails every range check.

    Nan stands for a value that is no real number, a bool, or a number too large for a float.
    """
    # bool is a subclass of int, so True would pass as 1.
    if not isinstance(value, Real) or isinstance(value, bool):
        return nan
    try:
        return float(value)
    except OverflowError:
        return nan
