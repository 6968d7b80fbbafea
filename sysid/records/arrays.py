"""Read-only float arrays, and the base class of all records that hold them."""

import textwrap
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sysid.records.errors import SysidError
from sysid.records.printing import Part, as_html, as_text, brief, fields_table

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Scalar = TypeVar("Scalar", bound=np.generic)

LINE = 160  # characters of a record's short form
FEW = 4  # entries of a tuple that it lists


class Locked:
    """A record whose arrays are read-only copies, and stay read-only when it is copied or unpickled."""

    def __post_init__(self) -> None:
        """Replace every array, those in tuples too, by a read-only copy."""
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, lock(value))
            elif isinstance(value, tuple) and any(isinstance(item, np.ndarray) for item in value):
                object.__setattr__(self, name, tuple(lock(np.asarray(item)) for item in value))

    def __getstate__(self) -> dict[str, Any]:
        """The fields, mappings as plain `dict`: their read-only views cannot be copied or pickled."""
        state = dict(vars(self))
        for name, value in state.items():
            if isinstance(value, MappingProxyType):
                state[name] = dict(value)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the fields and lock them again: NumPy drops the read-only flag in a copy."""
        self.__dict__.update({name: locked_within(value) for name, value in state.items()})

    def __repr__(self) -> str:
        """One short line: few numbers in full, other arrays by their shape."""
        fields = [f"{name}={brief(value, FEW)}" for name, value in vars(self).items() if value is not None]
        return textwrap.shorten(f"{type(self).__name__}({', '.join(fields)})", LINE, placeholder=" ...)")

    def __str__(self) -> str:
        """What the record is, and its numbers."""
        return as_text(self._parts())

    def _repr_html_(self) -> str:
        """The text with a small figure, as notebooks show a result."""
        has_text_of_its_own = type(self).__str__ is not Locked.__str__
        paragraphs = [str(self)] if has_text_of_its_own else self._parts()
        return as_html(paragraphs, "".join(draw(self) for draw in _DRAWERS))

    def _parts(self) -> Sequence[Part]:
        """Paragraphs and tables that print shows, the heading first: by default all fields."""
        return [(type(self).__doc__ or "").partition("\n")[0], *fields_table(vars(self))]


def register_drawer(draw: Callable[[object], str]) -> None:
    """Register the function that draws results in notebooks: HTML of a result, empty where there is no figure of it.

    Figures are made in the last room of the package, which the records, in the first, may not import.
    """
    _DRAWERS.append(draw)


_DRAWERS: list[Callable[[object], str]] = []


def locked_within(value: Any) -> Any:
    """Make all arrays in a value read-only, those in tuples and mappings too; a `dict` becomes a read-only view."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for item in value:
            locked_within(item)
    elif isinstance(value, dict):
        for item in value.values():
            locked_within(item)
        return MappingProxyType(value)
    return value


def lock(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a read-only copy of `array`."""
    out = np.array(array, order="C", copy=True)
    out.setflags(write=False)
    return out


def rectangular(name: str, value: ArrayLike) -> NDArray[Any]:
    """Convert to an array of any type; refuse ragged sequences."""
    try:
        return np.asarray(value)
    except ValueError as error:
        raise SysidError(f"{name}: expected a rectangular array of numbers, got a ragged sequence") from error


def real_array(name: str, value: ArrayLike) -> FloatArray:
    """Convert to float64; refuse complex, ragged, non-numeric, masked, NaN and infinite values."""
    raw = rectangular(name, value)
    if np.ma.is_masked(value):
        raise SysidError(f"{name}: {np.ma.count_masked(value)} masked value(s) given, expected numbers throughout")
    if raw.dtype.kind not in "biuf":
        raise SysidError(f"{name}: expected real numbers, got an array of type {raw.dtype}")
    out = raw.astype(np.float64)
    if not np.isfinite(out).all():
        bad = np.argwhere(~np.isfinite(out))
        where = ", ".join(str(i) for i in bad[0])
        raise SysidError(f"{name}: {len(bad)} value(s) NaN or infinite, the first at index ({where})")
    return out


def complex_array(name: str, value: ArrayLike) -> ComplexArray:
    """Convert to complex; refuse what `real_array` refuses, NaN and infinite parts."""
    raw = rectangular(name, value)
    return np.asarray(real_array(name, raw.real) + 1j * real_array(name, raw.imag))
