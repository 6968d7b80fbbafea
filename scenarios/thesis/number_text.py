"""Numbers of the study as text: significant digits, probabilities, roots, and the numbers of findings."""

import numpy as np

from scenarios.thesis.finding import Finding

TINY = 1e-300
"""Probabilities below this are printed as such: the tail of the distribution is not computed further."""


def minus(text: str) -> str:
    """A number as text with the minus sign of print for every hyphen."""
    return text.replace("-", "−")


def number(value: float, digits: int = 4) -> str:
    """A number as text, counts without decimals, all others to the same significant digits."""
    if not np.isfinite(value):
        return "–"
    if value == 0.0 or (float(value).is_integer() and abs(value) < 1000):
        return minus(f"{value:.0f}")
    # The form with # keeps zeros at the end, but also a point without digits behind it.
    return minus(f"{value:#.{digits}g}".rstrip("."))


def p_value(p: float) -> str:
    """A probability as text."""
    return f"p < {TINY:g}" if p < TINY else f"p = {p:.2g}"


def measure(value: float, finding: Finding) -> str:
    """A number of a finding; a probability too small to have been computed is said to be so."""
    return f"< {TINY:g}" if value < TINY and "p-value" in finding.about.unit else number(value)


def parts(finding: Finding) -> list[tuple[str, str, str | None]]:
    """The numbers of a finding as they are shown: name, number, and the whole that it is a part of.

    A number named `of`, or `of ...`, is the whole of which the one before it counts a part.
    """
    shown: list[tuple[str, str, str | None]] = []
    for name, value in finding.value.items():
        formatted = measure(value, finding)
        if shown and (name == "of" or name.startswith("of ")):
            counted, count, _ = shown[-1]
            shown[-1] = (counted, count, formatted)
        else:
            shown.append((name, formatted, None))
    return shown


def root(value: complex, digits: int = 3) -> str:
    """A pole or zero as text."""
    value = complex(value)
    # An imaginary part that would be printed as zero.
    if abs(value.imag) < 0.5 * 10.0**-digits:
        return minus(f"{value.real:.{digits}f}")
    sign = "+" if value.imag > 0 else "−"
    return minus(f"{value.real:.{digits}f}") + f" {sign} {abs(value.imag):.{digits}f}j"


def value_text(value: object) -> str:
    """Value of a parameter as text; several numbers are joined by crosses."""
    if isinstance(value, tuple | list):
        return " × ".join(value_text(component) for component in value)
    return f"{value:.5g}" if isinstance(value, float | int) else str(value)
