"""Numbers and their shapes from languages in which a row, a column and a matrix of one row are the same or are not."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.estimators.no_model import NoModelError


def shaped(name: str, values: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Values in a shape; a plain list or one number does where the shape leaves no choice. Nothing is transposed.

    Raises:
        NoModelError: They have another shape.
    """
    if values.shape == shape:
        return values
    single = sum(n != 1 for n in shape) <= 1
    flat = sum(n != 1 for n in values.shape) <= 1 and (values.ndim <= 1 or values.size == 1)
    if values.size == int(np.prod(shape)) and ((single and flat) or values.size == 0):
        return values.reshape(shape)
    raise NoModelError("malformed", f"{name} of shape {values.shape} given, expected {shape}")


def row(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients (k,): programs that know matrices alone write (1, k) or (k, 1).

    Raises:
        NoModelError: A matrix, or nothing.
    """
    if values.size == 0 or sum(n != 1 for n in values.shape) > 1:
        raise NoModelError("malformed", f"{name} of shape {values.shape} given, expected a row of coefficients")
    return values.ravel()


def real(name: str, value: Any) -> NDArray[np.float64]:
    """Real numbers of any shape.

    Raises:
        NoModelError: They are none.
    """
    try:
        array = np.array(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise NoModelError(
            "malformed", f"{name} of type {type(value).__name__} given, expected real numbers"
        ) from error
    if array.dtype.kind not in "biuf":
        raise NoModelError("malformed", f"{name} of type {array.dtype} given, expected real numbers")
    return np.array(array, dtype=np.float64)
