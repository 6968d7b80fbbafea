"""Names and shapes of the numbers of a model, in files, messages and what functions return."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from scenarios.estimators.outcome import NoModelError
from sysid.records.arrays import FloatArray

Numbers = Mapping[str, FloatArray]
"""Real numbers by name, one of `NAMES`."""

MATRICES = ("A", "B", "C", "D", "K")
"""Of the innovation form."""

POLYNOMIALS = {"poly_a": "A", "poly_b": "B", "poly_c": "C", "poly_d": "D", "poly_f": "F"}
"""Of polynomials, with their names in `sysid.Polynomials`."""

FRACTION = ("num", "den")
"""Of a transfer function."""

CLAIMS = ("covariance", "response_covariance", "bandwidth_ci95")
"""Of the accuracy that an estimator claims."""

NAMES = ("dt", *MATRICES, *POLYNOMIALS, *FRACTION, "innovation_covariance", *CLAIMS)
"""All."""


def real(name: str, value: Any) -> FloatArray:
    """Real numbers of any shape, else NoModelError; None among them is NaN, which JSON cannot write."""
    try:
        array = np.array(value)
        if array.dtype == object:
            array = array.astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise NoModelError(f"{name} of type {type(value).__name__} given, expected real numbers") from error
    if array.dtype.kind not in "biuf":
        raise NoModelError(f"{name} of type {array.dtype} given, expected real numbers")
    return np.array(array, dtype=np.float64)


def real_numbers(values: Mapping[str, Any]) -> dict[str, FloatArray]:
    """Real numbers by name, those that are None left out; NoModelError for other names than `NAMES`."""
    if unknown := sorted(values.keys() - set(NAMES)):
        raise NoModelError(f"unknown {unknown[0][:50]!r} given, expected some of {', '.join(NAMES)}")
    return {name: real(name, value) for name, value in values.items() if value is not None}


def shaped(name: str, values: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Values in a shape, else NoModelError; a plain list does where no choice is left. Nothing is transposed."""
    if values.shape == shape:
        return values
    single = sum(n != 1 for n in shape) <= 1
    flat = values.ndim <= 1 or values.size == 1
    if values.size == int(np.prod(shape)) and ((single and flat) or values.size == 0):
        return values.reshape(shape)
    raise NoModelError(f"{name} of shape {values.shape} given, expected {shape}")


def row(name: str, values: FloatArray) -> FloatArray:
    """Coefficients (k,), else NoModelError: programs that know only matrices write (1, k) or (k, 1)."""
    if values.size == 0 or sum(n != 1 for n in values.shape) > 1:
        raise NoModelError(f"{name} of shape {values.shape} given, expected a row of coefficients")
    return values.ravel()
