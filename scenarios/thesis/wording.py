"""Numbers of the report as text."""

import numpy as np

from scenarios.thesis.finding import Finding
from scenarios.thesis.probability import TINY


def minus(text: str) -> str:
    """The text with the minus sign of print for every hyphen; for numbers only."""
    return text.replace("-", "−")


def number(value: float, digits: int = 4) -> str:
    """A number as text, counts without decimals, all others to the same significant digits."""
    if not np.isfinite(value):
        return "–"
    if value == 0.0 or (float(value).is_integer() and abs(value) < 1000):
        return minus(f"{value:.0f}")
    return minus(f"{value:#.{digits}g}".rstrip("."))


def measure(value: float, finding: Finding) -> str:
    """A number of a finding; a probability too small to have been computed is said to be so."""
    return f"< {TINY:g}" if value < TINY and "p-value" in finding.unit else number(value)


def root(value: complex, digits: int = 3) -> str:
    """A pole or zero as text."""
    value = complex(value)
    if abs(value.imag) < 0.5 * 10.0**-digits:
        return minus(f"{value.real:.{digits}f}")
    sign = "+" if value.imag > 0 else "−"
    return minus(f"{value.real:.{digits}f}") + f" {sign} {abs(value.imag):.{digits}f}j"


def plain(value: object) -> str:
    """A parameter's value as text: several numbers with crosses between them."""
    if isinstance(value, tuple | list):
        return " × ".join(plain(part) for part in value)
    return f"{value:.5g}" if isinstance(value, float | int) else str(value)
