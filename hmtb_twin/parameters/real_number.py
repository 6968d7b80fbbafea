"""Real numbers of any type as floats, so that one check of a range fits all tables of an experiment."""

from math import nan
from numbers import Real


def real_number(value: object) -> float:
    """Return a real number as a float; nan, which is in no range, for anything else and for what no float can hold."""
    # bool is a subclass of int, so True would pass as 1.
    if not isinstance(value, Real) or isinstance(value, bool):
        return nan
    try:
        return float(value)
    except OverflowError:
        return nan
