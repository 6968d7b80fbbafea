"""Polynomials and fractions of polynomials from the numbers of a model."""

from collections.abc import Mapping

import numpy as np

from scenarios.estimators.model_names import FRACTION, POLYNOMIALS
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.shapes import row
from sysid import IOData, Polynomials, StateSpace, SysidError
from sysid.models import innovations_form
from sysid.records.arrays import FloatArray


def polynomials_of(numbers: Mapping[str, FloatArray], data: IOData) -> Polynomials | None:
    """The polynomials among the numbers of a model; None where there are none.

    Raises:
        NoModelError: They are not those of a model of the record.
    """
    if "num" in numbers:
        if (data.nu, data.ny) != (1, 1):
            return None
        num, den = _fraction(*(row(name, numbers[name]) for name in FRACTION))
        return Polynomials(B=num, F=den)
    if "poly_b" not in numbers:
        return None
    if data.ny != 1:
        raise NoModelError(
            "malformed", f"polynomials given for {data.ny} outputs, expected matrices: they have one output"
        )
    several = data.nu > 1
    read = {}
    for name, letter in POLYNOMIALS.items():
        if name not in numbers:
            continue
        if several and letter in "BF":
            if numbers[name].ndim != 2 or len(numbers[name]) != data.nu:
                raise NoModelError(
                    "malformed",
                    f"{name} of shape {numbers[name].shape} given, expected a row for each of {data.nu} inputs",
                )
            read[letter] = numbers[name]
        else:
            read[letter] = row(name, numbers[name])
    for letter, values in read.items():
        if letter != "B" and not (np.atleast_2d(values)[:, 0] == 1.0).all():
            raise NoModelError("malformed", f"poly_{letter.lower()} begins with {values.ravel()[0]:g}, expected 1")
    try:
        return Polynomials(**{letter: read[letter] for letter in "ABCDF" if letter in read})
    except SysidError as error:
        raise NoModelError("malformed", str(error)) from error


def _fraction(num: FloatArray, den: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator, the denominator beginning with 1."""
    if len(num) != len(den):
        raise NoModelError(
            "malformed",
            f"num with {len(num)} and den with {len(den)} coefficients given, expected as many of both: filled up "
            "with zeros  powers of z and of 1/z mean the same",
        )
    if den[0] == 0.0:
        raise NoModelError("malformed", "den begins with 0, expected the coefficient of its highest power of z")
    with np.errstate(over="ignore"):
        num, den = num / den[0], den / den[0]
    if not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise NoModelError("not_finite", f"num and den divided by {den[0]:g}, the first of den, are not finite")
    return num, den


def of_fractions(numbers: Mapping[str, FloatArray], data: IOData) -> StateSpace:
    """The model of fractions (ny, nu, k), one for each pair of output and input.

    Raises:
        NoModelError: They have another shape, or denominators that begin with 0.
    """
    num, den = (numbers[name] for name in FRACTION)
    for name in FRACTION:
        if numbers[name].ndim != 3 or numbers[name].shape[:2] != (data.ny, data.nu):
            raise NoModelError(
                "malformed",
                f"{name} of shape {numbers[name].shape} given, expected ({data.ny}, {data.nu}, number of coefficients)",
            )
    paths = [
        [innovations_form(_output_error(num[i, j], den[i, j]), data.dt) for j in range(data.nu)] for i in range(data.ny)
    ]
    states = [path.order for line in paths for path in line]
    n, at = sum(states), 0
    a, b, c = np.zeros((n, n)), np.zeros((n, data.nu)), np.zeros((data.ny, n))
    for i, line in enumerate(paths):
        for j, path in enumerate(line):
            part = slice(at, at + path.order)
            a[part, part], b[part, [j]], c[[i], part] = path.A, path.B, path.C
            at += path.order
    direct = np.array([[path.D[0, 0] for path in line] for line in paths])
    return StateSpace(a, b, c, direct, None, data.dt)


def _output_error(num: FloatArray, den: FloatArray) -> Polynomials:
    b, f = _fraction(num, den)
    return Polynomials(B=b, F=f)
