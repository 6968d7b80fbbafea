"""Orders of a polynomial model, and the layout of its parameters."""

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.polynomial.polyutils import trimseq

from sysid.models.polynomials import Polynomials
from sysid.polynomial.regressors import first_row
from sysid.records.arguments import shown, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Orders:
    """Orders of A y = B/F u + C/D e; parameters in the sequence A, B, C, D, F, inputs one after the other.

    Attributes:
        na: Degree of A.
        nb: Number of coefficients of B, per input.
        nc: Degree of C.
        nd: Degree of D.
        nf: Degree of F, per input.
        nk: Delay in samples, per input.
    """

    na: int
    nb: tuple[int, ...]
    nc: int
    nd: int
    nf: tuple[int, ...]
    nk: tuple[int, ...]

    @staticmethod
    def of(polynomials: Polynomials, *, padded: bool = False) -> "Orders":
        """Orders of polynomials; the leading zeros of B are the delay.

        Args:
            polynomials: Any.
            padded: Whether zeros behind the last coefficients of B and F are parameters too.
        """
        rows = [polynomials.channel(j) for j in range(polynomials.nu)]
        nk = tuple(int(np.flatnonzero(b)[0]) if b.any() else 0 for b, _ in rows)
        if padded:
            rows = list(zip(np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F), strict=True))
        return Orders(
            na=len(polynomials.A) - 1,
            nb=tuple(len(b) - k for (b, _), k in zip(rows, nk, strict=True)),
            nc=len(polynomials.C) - 1,
            nd=len(polynomials.D) - 1,
            nf=tuple(len(f) - 1 for _, f in rows),
            nk=nk,
        )

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.na + sum(self.nb) + self.nc + self.nd + sum(self.nf)

    @property
    def names(self) -> tuple[str, ...]:
        """One name per parameter: a1, b1, ..., with the suffix [j] if there are several inputs."""
        suffix = [""] if len(self.nb) == 1 else [f"[{j + 1}]" for j in range(len(self.nb))]
        names = [f"a{i + 1}" for i in range(self.na)]
        names += [f"b{i + 1}{s}" for n, s in zip(self.nb, suffix, strict=True) for i in range(n)]
        names += [f"c{i + 1}" for i in range(self.nc)] + [f"d{i + 1}" for i in range(self.nd)]
        names += [f"f{i + 1}{s}" for n, s in zip(self.nf, suffix, strict=True) for i in range(n)]
        return tuple(names)

    def select(self, *names: str) -> dict[str, int | tuple[int, ...]]:
        """Orders by name, as an estimate reports them: one number if there is one input."""
        values = {name: getattr(self, name) for name in names}
        return {name: v[0] if isinstance(v, tuple) and len(v) == 1 else v for name, v in values.items()}

    def first_row(self, window: int) -> int:
        """First time whose prediction error needs no sample from before the record."""
        return first_row(self.na, self.nb, self.nk, window)

    def first_error(self, window: int) -> int:
        """First time whose prediction error counts when the initial conditions are free parameters.

        It precedes `first_row` by as many samples as there are such conditions, so that as many errors count as for a
        state-space model with a free initial state.
        """
        disturbance = max(self.na, *(n + k - 1 - f for n, k, f in zip(self.nb, self.nk, self.nf, strict=True)), 0)
        return max(window, disturbance + self.nd - max(self.nc, self.nd), 0)

    def split(self, theta: FloatArray) -> tuple[FloatArray, list[FloatArray], FloatArray, FloatArray, list[FloatArray]]:
        """Parameters as polynomials A, [B], C, D, [F], each with its leading 1, B with its nk leading zeros."""
        sizes = [self.na, *self.nb, self.nc, self.nd, *self.nf]
        nu = len(self.nb)
        parts, begin = [], 0
        for size in sizes:
            parts.append(theta[begin : begin + size])
            begin += size
        b = [np.concatenate((np.zeros(k), part)) for k, part in zip(self.nk, parts[1 : 1 + nu], strict=True)]
        f = [np.concatenate(([1.0], part)) for part in parts[3 + nu :]]
        a, c, d = (np.concatenate(([1.0], part)) for part in (parts[0], parts[1 + nu], parts[2 + nu]))
        return a, b, c, d, f

    def join(
        self,
        a: FloatArray,
        b: Sequence[FloatArray],
        c: FloatArray | None = None,
        d: FloatArray | None = None,
        f: Sequence[FloatArray] | None = None,
    ) -> FloatArray:
        """Inverse of `split`; None stands for 1."""
        parts = [a[1:], *(bj[k:] for bj, k in zip(b, self.nk, strict=True))]
        parts.append(np.zeros(self.nc) if c is None else c[1:])
        parts.append(np.zeros(self.nd) if d is None else d[1:])
        parts += [np.zeros(n) for n in self.nf] if f is None else [fj[1:] for fj in f]
        return np.concatenate(parts)

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
        return self.join(
            _filled("A", polynomials.A, self.na + 1),
            [_filled("B", b, n + k) for (b, _), n, k in zip(rows, self.nb, self.nk, strict=True)],
            _filled("C", polynomials.C, self.nc + 1),
            _filled("D", polynomials.D, self.nd + 1),
            [_filled("F", f, n + 1) for (_, f), n in zip(rows, self.nf, strict=True)],
        )


def orders_apart(estimator: Callable[P, R]) -> Callable[P, R]:
    """Refuse orders as one list, as MATLAB takes them, with the call that is expected."""
    required = [n for n, one in inspect.signature(estimator).parameters.items() if one.default is one.empty]

    @functools.wraps(estimator)
    def call(*args: P.args, **options: P.kwargs) -> R:
        if len(required) > len(args) > 1 and isinstance(args[1], Sequence | np.ndarray):
            missing = [name for name in required[len(args) :] if name not in options]
            if missing:
                expected = f"{estimator.__name__}({', '.join(required)})"
                raise SysidError(f"orders are arguments of their own, expected {expected}, got {shown(args[1])}")
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
) -> Orders:
    """Check orders; a single number for nb, nf or nk holds for all inputs, () stands for no input."""
    if nu == 0 and np.size(nb):
        raise SysidError(f"nb = {shown(nb)} given for a time series, which has no input: use ar or arma")
    return Orders(
        na=whole_number("na", na, 0),
        nb=_per_input("nb", nb, nu, least=1),
        nc=whole_number("nc", nc, 0),
        nd=whole_number("nd", nd, 0),
        nf=_per_input("nf", nf, nu),
        nk=_per_input("nk", nk, nu),
    )


def _per_input(name: str, value: int | Sequence[int], nu: int, least: int = 0) -> tuple[int, ...]:
    if isinstance(value, int | np.integer) or (isinstance(value, np.ndarray) and not value.ndim):
        return (whole_number(name, value, least),) * nu
    if isinstance(value, str | bytes) or not isinstance(value, Sequence | np.ndarray):
        raise SysidError(f"{name} must be a whole number >= {least}, or one per input, got {shown(value)}")
    values = tuple(whole_number(name, v, least) for v in value)
    if len(values) != nu:
        raise SysidError(f"{name}: expected one value or one per input ({nu}), got {values}")
    return values


def padded_rows(polynomials: Sequence[FloatArray]) -> FloatArray:
    """Rows of coefficients side by side, zeros behind the shorter ones (rows, longest); a single one as it is."""
    if len(polynomials) == 1:
        return polynomials[0]
    out = np.zeros((len(polynomials), max((len(p) for p in polynomials), default=1)))
    for row, p in zip(out, polynomials, strict=True):
        row[: len(p)] = p
    return out


def _filled(name: str, row: FloatArray, length: int) -> FloatArray:
    row = trimseq(row)
    if len(row) > length:
        raise SysidError(f"{name} has {len(row)} coefficients, expected at most {length}")
    return np.concatenate((row, np.zeros(length - len(row))))
