"""Orders of a polynomial model, and the layout of its parameters."""

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.polynomial.polyutils import trimseq

from sysid.models.polynomials import ONE, Polynomials
from sysid.polynomial.regressors import first_row
from sysid.records.arguments import shown, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

P = ParamSpec("P")
R = TypeVar("R")

NO_TREND = -1
"""Degree of the trend of a model without one."""

SplitPolynomials = tuple[FloatArray, list[FloatArray], FloatArray, FloatArray, list[FloatArray]]
"""A, B of each input, C, D and F of each input; B with its nk leading zeros, the others with their leading 1."""


@dataclass(frozen=True)
class Orders:
    """Orders of A y = B/F u + C/D e; parameters in the sequence A, B, C, D, F, inputs one after the other.

    A trend of the output is no parameter: it belongs to an experiment, as its initial conditions do.

    Attributes:
        na: Degree of A.
        nb: Number of coefficients of B, per input.
        nc: Degree of C.
        nd: Degree of D.
        nf: Degree of F, per input.
        nk: Delay in samples, per input.
        trend: Degree of the polynomial of time that is part of every experiment's output, 0 for a constant.
    """

    na: int
    nb: tuple[int, ...]
    nc: int
    nd: int
    nf: tuple[int, ...]
    nk: tuple[int, ...]
    trend: int = NO_TREND

    @staticmethod
    def of(polynomials: Polynomials, *, padded: bool = False) -> "Orders":
        """Orders of polynomials; the leading zeros of B are the delay.

        Args:
            polynomials: Any.
            padded: Whether zeros behind the last coefficients of B and F are parameters too.
        """
        rows = [polynomials.channel(j) for j in range(polynomials.nu)]
        nk = tuple(_leading_zeros(b) for b, _ in rows)
        # `channel` has left out the zeros behind the last coefficient, which rows of equal length need
        if padded:
            rows = list(zip(np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F), strict=True))
        nb = tuple(len(b) - k for (b, _), k in zip(rows, nk, strict=True))
        nf = tuple(len(f) - 1 for _, f in rows)
        return Orders(
            na=len(polynomials.A) - 1,
            nb=nb,
            nc=len(polynomials.C) - 1,
            nd=len(polynomials.D) - 1,
            nf=nf,
            nk=nk,
        )

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.na + sum(self.nb) + self.nc + self.nd + sum(self.nf)

    @property
    def names(self) -> tuple[str, ...]:
        """One name per parameter: a1, b1, ..., with the suffix [j] if there are several inputs."""
        suffixes = [""] if len(self.nb) == 1 else [f"[{j + 1}]" for j in range(len(self.nb))]
        names = _numbered("a", self.na)
        for nb, suffix in zip(self.nb, suffixes, strict=True):
            names += _numbered("b", nb, suffix)
        names += _numbered("c", self.nc) + _numbered("d", self.nd)
        for nf, suffix in zip(self.nf, suffixes, strict=True):
            names += _numbered("f", nf, suffix)
        return tuple(names)

    def select(self, *names: str) -> dict[str, int | tuple[int, ...]]:
        """Orders by name, as an estimate reports them: one number if there is one input."""
        selected = {}
        for name in names:
            value = getattr(self, name)
            selected[name] = value[0] if isinstance(value, tuple) and len(value) == 1 else value
        return selected

    @property
    def trend_terms(self) -> int:
        """Number of terms of the trend."""
        return self.trend + 1

    def first_row(self, window: int) -> int:
        """First time whose prediction error needs no sample from before the record."""
        return first_row(self.na, self.nb, self.nk, window)

    def first_error(self, window: int) -> int:
        """First time whose prediction error counts when the initial conditions are free parameters.

        It precedes `first_row` by as many samples as there are such conditions, so that as many errors count as for a
        state-space model with a free initial state.
        """
        # v = A y - B/F u needs na earlier outputs, and inputs but for the last nf, which the free states of 1/F replace
        first_disturbance = self.na
        for nb, nk, nf in zip(self.nb, self.nk, self.nf, strict=True):
            first_disturbance = max(first_disturbance, nb + nk - 1 - nf)
        return max(window, first_disturbance + self.nd - max(self.nc, self.nd), 0)

    @functools.cached_property
    def ranges(self) -> tuple[slice, list[slice], slice, slice, list[slice]]:
        """Positions of the coefficients of A, [B], C, D, [F] among the parameters."""
        sizes = (self.na, *self.nb, self.nc, self.nd, *self.nf)
        ends = accumulate(sizes)
        positions = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
        nu = len(self.nb)
        return positions[0], positions[1 : 1 + nu], positions[1 + nu], positions[2 + nu], positions[3 + nu :]

    def split(self, theta: FloatArray) -> SplitPolynomials:
        """Parameters as polynomials A, [B], C, D, [F], each with its leading 1, B with its nk leading zeros."""
        of_a, of_b, of_c, of_d, of_f = self.ranges
        b = with_delays([theta[of_bj] for of_bj in of_b], self.nk)
        f = [_monic(theta[of_fj]) for of_fj in of_f]
        return _monic(theta[of_a]), b, _monic(theta[of_c]), _monic(theta[of_d]), f

    def join(
        self,
        a: FloatArray,
        b: Sequence[FloatArray],
        c: FloatArray | None = None,
        d: FloatArray | None = None,
        f: Sequence[FloatArray] | None = None,
    ) -> FloatArray:
        """Inverse of `split`; None stands for 1."""
        c_coefficients = np.zeros(self.nc) if c is None else c[1:]
        d_coefficients = np.zeros(self.nd) if d is None else d[1:]
        b_coefficients = [bj[k:] for bj, k in zip(b, self.nk, strict=True)]
        f_coefficients = [np.zeros(sum(self.nf))] if f is None else [fj[1:] for fj in f]
        return np.concatenate((a[1:], *b_coefficients, c_coefficients, d_coefficients, *f_coefficients))

    def polynomials(self, theta: FloatArray) -> Polynomials:
        """Parameters as a `Polynomials` record."""
        a, b, c, d, f = self.split(theta)
        return Polynomials(a, padded_rows(b), c, d, padded_rows(f))

    def parameters(self, polynomials: Polynomials) -> FloatArray:
        """Inverse of `polynomials`: parameters (p,), zero where a polynomial is shorter than its order.

        Raises:
            SysidError: No polynomials, a polynomial longer than its order, other inputs, or a shorter delay.
        """
        if not isinstance(polynomials, Polynomials):
            raise SysidError(f"expected Polynomials to start from, got {shown(polynomials)}")
        rows = [polynomials.channel(j) for j in range(polynomials.nu)]
        if len(rows) != len(self.nk):
            raise SysidError(f"expected polynomials of {len(self.nk)} input(s), got {len(rows)}")
        for j, ((b, _), k) in enumerate(zip(rows, self.nk, strict=True)):
            if b[:k].any():
                raise SysidError(f"expected nk = {k} zeros at the beginning of B of input {j + 1}, got {b}")
        a = _filled("A", polynomials.A, self.na + 1)
        c, d = _filled("C", polynomials.C, self.nc + 1), _filled("D", polynomials.D, self.nd + 1)
        numerators, denominators = [], []
        for (b, f), nb, nk, nf in zip(rows, self.nb, self.nk, self.nf, strict=True):
            numerators.append(_filled("B", b, nb + nk))
            denominators.append(_filled("F", f, nf + 1))
        return self.join(a, numerators, c, d, denominators)


def orders_apart(estimator: Callable[P, R]) -> Callable[P, R]:
    """Make an estimator refuse orders in one list, as MATLAB takes them, and show the expected call."""
    parameters = inspect.signature(estimator).parameters
    required = [name for name, parameter in parameters.items() if parameter.default is parameter.empty]
    # nk has a default, but MATLAB's list holds it too: the call that is shown must
    positional = [name for name, parameter in parameters.items() if parameter.kind is parameter.POSITIONAL_OR_KEYWORD]

    @functools.wraps(estimator)
    def call(*args: P.args, **options: P.kwargs) -> R:
        # with all orders present, a list is one order per input
        if len(required) > len(args) > 1 and isinstance(args[1], Sequence | np.ndarray):
            missing = [name for name in required[len(args) :] if name not in options]
            if missing:
                expected = f"{estimator.__name__}({', '.join(positional)})"
                raise SysidError(f"each order is an argument of its own: expected {expected}, got {shown(args[1])}")
        return estimator(*args, **options)

    return call


def make_orders(
    nu: int,
    *,
    nb: int | Sequence[int] = (),
    nk: int | Sequence[int] = (),
    na: int = 0,
    nc: int = 0,
    nd: int = 0,
    nf: int | Sequence[int] = 0,
    trend: int = NO_TREND,
) -> Orders:
    """Check orders; a single number for nb, nf or nk holds for all inputs, () stands for no input."""
    if nu == 0 and np.size(nb):
        raise SysidError(f"nb = {shown(nb)} given for a time series, which has no input: use ar or arma")
    return Orders(
        na=whole_number("na", na, 0),
        nb=_per_input("nb", nb, nu, lowest=1),
        nc=whole_number("nc", nc, 0),
        nd=whole_number("nd", nd, 0),
        nf=_per_input("nf", nf, nu),
        nk=_per_input("nk", nk, nu),
        trend=trend,
    )


def _per_input(name: str, value: int | Sequence[int], nu: int, lowest: int = 0) -> tuple[int, ...]:
    """One order per input, from a number for all of them or one for each."""
    if isinstance(value, int | np.integer) or (isinstance(value, np.ndarray) and not value.ndim):
        return (whole_number(name, value, lowest),) * nu
    if isinstance(value, str | bytes) or not isinstance(value, Sequence | np.ndarray):
        raise SysidError(f"{name} must be a whole number >= {lowest}, or one per input, got {shown(value)}")
    values = tuple(whole_number(name, v, lowest) for v in value)
    if len(values) != nu:
        raise SysidError(f"{name}: expected one value or one per input ({nu}), got {values}")
    return values


def _numbered(letter: str, count: int, suffix: str = "") -> list[str]:
    """Names of the coefficients of a polynomial, such as b1[2], b2[2]."""
    return [f"{letter}{i + 1}{suffix}" for i in range(count)]


def with_delays(coefficients: Iterable[FloatArray], nk: Sequence[int]) -> list[FloatArray]:
    """Polynomials B of each input: as many leading zeros as its delay, then its coefficients."""
    return [np.concatenate((np.zeros(k), b)) for k, b in zip(nk, coefficients, strict=True)]


def _monic(coefficients: FloatArray) -> FloatArray:
    return np.concatenate((ONE, coefficients))


def _leading_zeros(row: FloatArray) -> int:
    """Number of zeros before the first other coefficient; 0 if all are zero."""
    return int(np.flatnonzero(row)[0]) if row.any() else 0


def padded_rows(polynomials: Sequence[FloatArray]) -> FloatArray:
    """Rows of coefficients side by side, zeros behind the shorter ones (rows, longest); a single one as it is."""
    if len(polynomials) == 1:
        return polynomials[0]
    out = np.zeros((len(polynomials), max((len(p) for p in polynomials), default=1)))
    for row, p in zip(out, polynomials, strict=True):
        row[: len(p)] = p
    return out


def _filled(name: str, row: FloatArray, length: int) -> FloatArray:
    """Coefficients of a polynomial, filled with zeros up to a length; more than that are refused."""
    row = trimseq(row)
    if len(row) > length:
        raise SysidError(f"{name} has {len(row)} coefficients, expected at most {length}")
    return np.concatenate((row, np.zeros(length - len(row))))
