"""Locked float arrays, the stuff that records are made of."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sysid.errors import SysidError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Scalar = TypeVar("Scalar", bound=np.generic)


class Locked:
    """A record whose arrays stay locked when it is copied or unpickled."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over the fields and lock their arrays again: NumPy forgets the lock on the way."""
        for value in state.values():
            for array in value.values() if isinstance(value, dict) else (value,):
                if isinstance(array, np.ndarray):
                    array.setflags(write=False)
        self.__dict__.update(state)


def lock(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a read-only copy of `array`."""
    out = np.array(array, order="C", copy=True)
    out.setflags(write=False)
    return out


def real_array(name: str, value: ArrayLike) -> FloatArray:
    """Convert to float64, refusing what is not a real, finite number.

    Raises:
        SysidError: `value` is complex, ragged, not numeric, or holds NaN or infinity.
    """
    try:
        raw: NDArray[Any] = np.asarray(value)
    except ValueError as error:
        raise SysidError(f"{name}: expected a rectangular array of real numbers, got a ragged sequence") from error
    if np.ma.is_masked(value):
        raise SysidError(f"{name}: {np.ma.count_masked(value)} masked value(s) given, expected numbers throughout")
    if raw.dtype.kind not in "biuf":
        raise SysidError(f"{name}: expected real numbers, got an array of type {raw.dtype}")
    out = raw.astype(np.float64)
    bad = np.argwhere(~np.isfinite(out))
    if len(bad):
        where = ", ".join(str(i) for i in bad[0])
        raise SysidError(f"{name}: {len(bad)} value(s) NaN or infinite, the first at index ({where})")
    return out
