"""Structures of paths: the parameters of their transfer functions, derivatives of coefficients by them, the model."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from sysid.continuous.path_response import TransferFunction
from sysid.models.continuous_model import ContinuousModel
from sysid.models.data_summary import DataSummary
from sysid.models.frequency_response import NORMAL_95
from sysid.models.state_space import StateSpace
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

COINCIDING = 0.99  # ratio of time constants from which they count as one


@dataclass(frozen=True)
class RationalPath:
    """Numerator and denominator, both of falling powers, the denominator monic; then the delay if it is estimated.

    Attributes:
        poles: Degree n of the denominator.
        zeros: Degree m of the numerator.
        delay: Known delay in s; None if it is estimated.
    """

    poles: int
    zeros: int
    delay: float | None = 0.0

    @property
    def integrators(self) -> int:
        """Number of poles fixed at zero."""
        return 0

    @property
    def names(self) -> tuple[str, ...]:
        """Letters b and a with the power of s, and Td."""
        numerator = [f"b{i}" for i in range(self.zeros, -1, -1)]
        return (*numerator, *(f"a{i}" for i in range(self.poles - 1, -1, -1)), *(["Td"] * (self.delay is None)))

    def transfer(self, theta: FloatArray) -> TransferFunction:
        """Transfer function for parameters (p,)."""
        b, a = theta[self.zeros :: -1], theta[self.zeros + self.poles : self.zeros : -1]
        return TransferFunction(b, np.append(a, 1.0), theta[-1] if self.delay is None else self.delay)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of b, a and the delay by the parameters: ones."""
        m, n = self.zeros, self.poles
        rows = [*range(m, -1, -1), *range(m + n, m, -1), *([m + n + 2] * (self.delay is None))]
        out = np.zeros((m + n + 3, len(rows)))
        out[rows, np.arange(len(rows))] = 1.0
        return out

    def arranged(self, theta: FloatArray) -> FloatArray:
        """The parameters (p,)."""
        return theta

    def warnings(self, theta: FloatArray, deviations: FloatArray) -> list[str]:
        """None: every value has its meaning."""
        return []

    def parameters(self, path: TransferFunction) -> FloatArray:
        """Parameters (p,) of a transfer function."""
        leading = path.a[-1]
        late = [path.delay] if self.delay is None else []
        return np.concatenate((path.b[::-1] / leading, path.a[-2::-1] / leading, late))


@dataclass(frozen=True)
class ProcessPath:
    """Kp (1 + Tz s) exp(-Td s) / (s (1 + 2 Zeta Tw s + Tw^2 s^2) (1 + Tp3 s)), factors as the kind has them.

    Attributes:
        kind: "P", the number of poles 0 to 3 besides an integrator, and any of D (delay), Z (zero), I (integrator) and
            U (a pair of poles that may be complex), such as "P2DZ" [MathWorks: procest].
    """

    kind: str

    def __post_init__(self) -> None:
        """Check the kind, and put its letters into one sequence."""
        text = self.kind.upper() if isinstance(self.kind, str) else ""
        if not re.fullmatch(r"P[0-3][DZIU]*", text) or len(set(text)) != len(text) or ("U" in text and text[1] in "01"):
            raise SysidError(
                f"a process model is P0, P1, P2 or P3 with any of D (delay), Z (zero), I (integrator) and, from P2 "
                f"on, U (underdamped), such as 'P2DZ'; got {shown(self.kind)}"
            )
        if text[1] == "0" and "Z" in text:
            raise SysidError(f"a zero needs a pole besides the integrator: expected P1{text[2:]}, got {text}")
        object.__setattr__(self, "kind", text[:2] + "".join(sorted(text[2:], key="DZIU".index)))

    @property
    def integrators(self) -> int:
        """1 for an integrator, else 0."""
        return int("I" in self.kind)

    @property
    def poles(self) -> int:
        """Number of poles, that of the integrator too."""
        return int(self.kind[1]) + self.integrators

    @property
    def zeros(self) -> int:
        """Degree of the numerator."""
        return int("Z" in self.kind)

    @property
    def delay(self) -> float | None:
        """None if the delay is estimated, else 0."""
        return None if "D" in self.kind else 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Kp, Tp1 ... or Tw, Zeta, Tp3; then Tz, Td."""
        count = int(self.kind[1])
        lags = ["Tw", "Zeta", *(["Tp3"] * (count - 2))] if "U" in self.kind else [f"Tp{i + 1}" for i in range(count)]
        return ("Kp", *lags, *(["Tz"] * self.zeros), *(["Td"] * (self.delay is None)))

    def arranged(self, theta: FloatArray) -> FloatArray:
        """The same transfer function with Tw > 0, and real time constants that fall (p,)."""
        first, end = 3 if "U" in self.kind else 1, int(self.kind[1]) + 1
        middle = theta[1:first] * np.sign(theta[1]) if first > 1 else theta[1:first]
        return np.concatenate((theta[:1], middle, np.sort(theta[first:end])[::-1], theta[end:]))

    def warnings(self, theta: FloatArray, deviations: FloatArray) -> list[str]:
        """Texts on real poles that coincide, otherwise on time constants that are zero within their intervals."""
        first, end = 3 if "U" in self.kind else 1, int(self.kind[1])
        return [
            f"Tp{i} and Tp{i + 1} coincide, and their intervals are wrong: the poles may be complex, as U allows"
            for i in range(first, end)
            if theta[i + 1] > COINCIDING * theta[i]
        ] or [
            f"the interval of {name} reaches zero and is not reliable: try fewer poles, or more data"
            for name, value, deviation in zip(self.names, theta, deviations, strict=True)
            if name.startswith(("Tp", "Tw")) and value <= NORMAL_95 * deviation
        ]

    def _factors(self, theta: FloatArray) -> tuple[list[FloatArray], dict[int, tuple[int, FloatArray]]]:
        """Factors of the denominator, and by parameter the factor that it is in and the derivative of that."""
        count = int(self.kind[1])
        factors = [np.array([0.0, 1.0])] * self.integrators
        slopes: dict[int, tuple[int, FloatArray]] = {}
        first = 1
        if "U" in self.kind:
            tw, zeta = theta[1:3]
            slopes[1] = len(factors), np.array([0.0, 2.0 * zeta, 2.0 * tw])
            slopes[2] = len(factors), np.array([0.0, 2.0 * tw, 0.0])
            factors.append(np.array([1.0, 2.0 * zeta * tw, tw**2]))
            first = 3
        for i in range(first, count + 1):
            slopes[i] = len(factors), np.array([0.0, 1.0])
            factors.append(np.array([1.0, theta[i]]))
        return factors, slopes

    def transfer(self, theta: FloatArray) -> TransferFunction:
        """Transfer function for parameters (p,)."""
        b = theta[0] * np.array([1.0, *theta[self.names.index("Tz") :][: self.zeros]]) if self.zeros else theta[:1]
        return TransferFunction(b, _product(self._factors(theta)[0]), theta[-1] if self.delay is None else 0.0)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of b, a and the delay by the parameters (m + n + 3, p)."""
        m, names = self.zeros, self.names
        out = np.zeros((m + self.poles + 3, len(theta)))
        out[0, 0] = 1.0
        if m:
            at = names.index("Tz")
            out[1, 0], out[1, at] = theta[at], theta[0]
        factors, slopes = self._factors(theta)
        for i, (k, slope) in slopes.items():
            out[m + 1 : m + 2 + self.poles, i] = _product([*factors[:k], slope, *factors[k + 1 :]])
        if self.delay is None:
            out[-1, -1] = 1.0
        return out

    def parameters(self, path: TransferFunction) -> FloatArray:
        """Parameters of the transfer function; complex poles of a kind without U become two near real ones."""
        rest = path.a[self.integrators :]
        roots = np.roots(rest[::-1])
        gain = path.b[0] / rest[0]
        pairs = roots[roots.imag > 0.0]
        if "U" in self.kind and len(pairs):
            size = abs(pairs[0])
            lags = [1.0 / size, -pairs[0].real / size, *(-1.0 / roots[roots.imag == 0.0].real)]
        else:
            spread = np.where(roots.imag == 0.0, 1.0, np.where(roots.imag > 0.0, 1.2, 1.0 / 1.2))
            lags = sorted(np.sign(-roots.real) * spread / np.abs(roots), reverse=True)
            if "U" in self.kind:
                lags[:2] = [np.sqrt(lags[0] * lags[1]), 0.5 * (lags[0] + lags[1]) / np.sqrt(lags[0] * lags[1])]
        zero = [path.b[1] / path.b[0]] if self.zeros else []
        return np.array([gain, *lags, *zero, *([path.delay] if self.delay is None else [])])


def _product(factors: list[FloatArray]) -> FloatArray:
    out = np.ones(1)
    for factor in factors:
        out = np.convolve(out, factor)
    return out


PathStructure = RationalPath | ProcessPath
PerPath = int | Sequence[int] | Sequence[Sequence[int]]


@dataclass(frozen=True, eq=False)
class RealisePaths:
    """Pure function from parameters to the continuous-time model; a class, so that estimates can be pickled.

    Attributes:
        structures: Structure of each path, one row per output.
        data: Sampling interval and names for the model.
        intersample: Input between samples, held or linear.
        covariance: Innovation covariance that the model carries (ny, ny); None if unknown.
    """

    structures: tuple[tuple[PathStructure, ...], ...]
    data: DataSummary
    intersample: str
    covariance: FloatArray | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters; with several paths each names its output and input."""
        ny, nu = len(self.structures), len(self.structures[0])
        return tuple(
            name + (f"[{i + 1},{j + 1}]" if ny > 1 else f"[{j + 1}]" if nu > 1 else "")
            for i, row in enumerate(self.structures)
            for j, structure in enumerate(row)
            for name in structure.names
        )

    def transfers(self, theta: FloatArray) -> list[TransferFunction]:
        """Transfer functions row by row for parameters (p,)."""
        parts = [s for row in self.structures for s in row]
        ends = np.cumsum([len(s.names) for s in parts])
        return [s.transfer(own) for s, own in zip(parts, np.split(theta, ends[:-1]), strict=True)]

    def __call__(self, theta: FloatArray) -> ContinuousModel:
        """Model for parameters (p,)."""
        ny, nu = len(self.structures), len(self.structures[0])
        paths = self.transfers(theta)
        blocks = [path.realisation() for path in paths]
        A = scipy.linalg.block_diag(*(a for a, *_ in blocks))
        B = np.vstack([b @ np.eye(nu)[[k % nu]] for k, (_, b, _, _) in enumerate(blocks)])
        C = np.hstack([np.eye(ny)[:, [k // nu]] @ c for k, (_, _, c, _) in enumerate(blocks)])
        D = np.reshape([d for *_, d in blocks], (ny, nu))
        delays = np.reshape([max(path.delay, 0.0) for path in paths], (ny, nu))
        return ContinuousModel(
            StateSpace(A, B, C, D, None, self.data.dt, self.covariance, **self.data.labels), delays, self.intersample
        )


def per_path(name: str, value: object, ny: int, nu: int) -> list[list[Any]]:
    """One value for each path (ny, nu), from one for all, one per input, or a row per output."""
    entries = np.array(value, dtype=object)
    if entries.ndim and entries.shape != (ny, nu) and (ny > 1 or entries.shape != (nu,)):
        expected = f"one per input ({nu})" if ny == 1 else f"{ny} rows, one per output, of {nu}, one per input"
        raise SysidError(f"{name}: expected one value or {expected}, got {shown(value)}")
    return [list(row) for row in np.broadcast_to(entries, (ny, nu))]
