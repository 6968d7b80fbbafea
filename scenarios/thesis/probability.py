"""Probabilities as text."""

TINY = 1e-300
"""Probabilities below this are printed as such: the tail of the distribution is not computed further."""


def p_value(p: float) -> str:
    """A probability as text."""
    return f"p < {TINY:g}" if p < TINY else f"p = {p:.2g}"
