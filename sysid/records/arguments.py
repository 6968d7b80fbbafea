"""Checks of arguments: whole numbers, real numbers, flags, windows."""

import operator
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.records.arrays import FloatArray, real_array, rectangular
from sysid.records.errors import SysidError, SysidWarning

LONGEST = 80  # longest quotation of a wrong value, in characters


def whole_number(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Check a whole number within bounds and return it as `int`; NumPy integers pass, Booleans do not."""
    try:
        number = None if isinstance(value, bool | np.bool_) else operator.index(value)
    except TypeError:
        number = None
    if number is None or number < least or (most is not None and number > most):
        bounds = f">= {least}" if most is None else f"from {least} to {most}"
        raise SysidError(f"{name} must be a whole number {bounds}, got {shown(value)}")
    return number


def real_number(name: str, value: Any, expected: str, allowed: Callable[[float], bool]) -> float:
    """Return an argument as `float`, or refuse one that is no single real number or not an allowed one.

    `expected` completes the message "NAME must ...".
    """
    try:
        single = np.shape(value) == () and not isinstance(value, bool | np.bool_ | str | bytes | None)
        number = float(value) if single else np.nan
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if np.isnan(number) or not allowed(number):
        raise SysidError(f"{name} must {expected}, got {shown(value)}")
    return number


def number_pair(name: str, value: Any, expected: str) -> tuple[float, float]:
    """Check two finite numbers; `expected` completes the message "NAME must be ..."."""
    numbers = rectangular(name, value)
    if numbers.shape != (2,) or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():
        raise SysidError(f"{name} must be {expected}, got {shown(value)}")
    return float(numbers[0]), float(numbers[1])


def sampling_interval(value: Any, *, continuous: bool = False) -> float:
    """Check a sampling interval in s; 0 means continuous time where that is allowed."""
    expected = "be 0 (continuous time) or " * continuous + "lie between 1e-15 and 1e15 s"
    return real_number("dt", value, expected, lambda dt: 1e-15 <= dt <= 1e15 or (continuous and dt == 0.0))


def confidence_level(value: Any) -> float:
    """Check a confidence level between 0 and 1."""
    return real_number("level", value, "lie between 0 and 1", lambda level: 0.0 < level < 1.0)


def warn_beyond_nyquist(f_hz: ArrayLike, dt: float) -> None:
    """Warn of frequencies above Nyquist, as those in rad/s are: the response there is that of a mirror image below."""
    highest, nyquist = float(np.abs(real_array("f_hz", f_hz)).max(initial=0.0)), 0.5 / dt
    if highest > nyquist * (1.0 + 1e-9):
        text = f"f_hz reaches {highest:g} Hz, above Nyquist ({nyquist:g} Hz), where responses are mirror images"
        # the delta method comes here often: one place, one warning
        warnings.warn(f"{text}; frequencies are in Hz, not rad/s", SysidWarning, stacklevel=1)


def truth_value(name: str, value: Any) -> bool:
    """Check a Boolean; 0 and 1 are refused."""
    if not isinstance(value, bool | np.bool_):
        raise SysidError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def one_of(name: str, value: Any, choices: Sequence[str]) -> str:
    """Check a choice by name; what is no text is refused before it is compared, which an array would not survive."""
    if not isinstance(value, str) or value not in choices:
        raise SysidError(f"{name} must be one of {', '.join(choices)}, got {shown(value)}")
    return value


def optional_text(name: str, value: Any) -> str | None:
    """Check a text, or None where the argument is left out."""
    if value is not None and not isinstance(value, str):
        raise SysidError(f"{name} must be a text or None, got {shown(value)}")
    return value


def channel_names(side: str, value: Any) -> tuple[str, ...]:
    """Check the names of the channels of a side, "inputs" or "outputs"; one alone may stand without a list."""
    if not isinstance(value, Iterable):
        raise SysidError(f"expected {side} by name, got {shown(value)}")
    names = (value,) if isinstance(value, str) else tuple(value)
    for name in names:
        if not isinstance(name, str):
            raise SysidError(f"expected {side} by name, got {shown(name)}")
    return names


def function(name: str, value: Any, expected: str) -> Callable[..., Any]:
    """Check that a value can be called; `expected` completes the message "NAME must be a function ..."."""
    if not callable(value):
        raise SysidError(f"{name} must be a function {expected}, got {shown(value)}")
    return value


def file_path(value: Any) -> Path:
    """Check the path of a file, a text or a `Path`."""
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise SysidError(f"expected the path of a file, got {shown(value)}")
    return Path(value)


def frequency_list(f_hz: ArrayLike) -> FloatArray:
    """Check frequencies in Hz, one or a list of them, and return them as an array (nf,)."""
    frequencies = np.atleast_1d(real_array("f_hz", f_hz))
    if frequencies.ndim != 1:
        raise SysidError(f"f_hz: expected a list of frequencies, got an array of shape {frequencies.shape}")
    return frequencies


def window_values(window: Callable[[int], Any], length: int) -> FloatArray:
    """Values (length,) of a window function such as `np.hanning`."""
    if not callable(window):
        raise SysidError(f"window must be a function from a length to values, such as np.hanning, got {shown(window)}")
    try:
        values = np.asarray(window(length), dtype=float)
    except (TypeError, ValueError) as error:
        raise SysidError(f"window({length}) must give {length} values: {error}") from error
    if values.shape != (length,) or not np.isfinite(values).all():
        raise SysidError(f"window({length}) must give as many finite values, got shape {values.shape}")
    return values


def shown(value: Any) -> str:
    """Quote a wrong value in an error: in full if short, otherwise the beginning of a text, the type of others."""
    if isinstance(value, str):
        return repr(shortened(value))
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # whole numbers of thousands of digits, lists in lists without end
        text = "\n"
    return text if len(text) <= LONGEST and "\n" not in text else f"a value of type {type(value).__name__}"


def shortened(text: str, most: int = LONGEST) -> str:
    """Put foreign text on one line, without what steers a terminal, and cut it where it is long."""
    line = " ".join(text.split())
    for character in {character for character in line if not character.isprintable()}:
        line = line.replace(character, "\N{REPLACEMENT CHARACTER}")
    return line if len(line) <= most else f"{line[: most - 3]}..."
