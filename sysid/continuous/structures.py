"""Structures of paths: the parameters of their transfer functions, derivatives of coefficients by them, the model."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
SLOW = 1e-9  # pole, relative to the coefficients of the denominator, in place of an integrator
SPREAD = 1.2  # ratio to their geometric mean of two real time constants in place of a complex pair


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
    def resonates(self) -> bool:
        """Whether poles may be complex."""
        return self.poles > 1

    @property
    def names(self) -> tuple[str, ...]:
        """Letters b and a with the power of s, and Td."""
        numerator = [f"b{i}" for i in range(self.zeros, -1, -1)]
        denominator = [f"a{i}" for i in range(self.poles - 1, -1, -1)]
        delay = ["Td"] if self.delay is None else []
        return (*numerator, *denominator, *delay)

    def transfer(self, theta: FloatArray) -> TransferFunction:
        """Transfer function for parameters (p,)."""
        m, n = self.zeros, self.poles
        b, a = theta[m::-1], theta[m + n : m : -1]
        delay = theta[-1] if self.delay is None else self.delay
        return TransferFunction(b, np.append(a, 1.0), delay)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of b, a and the delay by the parameters (m + n + 3, p): a one in each column."""
        m, n = self.zeros, self.poles
        # parameters have falling powers, b and a rising ones; the leading coefficient of a is fixed at 1
        rows = [*range(m, -1, -1), *range(m + n, m, -1)]
        if self.delay is None:
            rows.append(m + n + 2)
        derivatives = np.zeros((m + n + 3, len(rows)))
        derivatives[rows, np.arange(len(rows))] = 1.0
        return derivatives

    def smaller(self) -> "RationalPath | None":
        """The structure with a pole less, and a zero less if there is one; None below one pole."""
        if self.poles < 2:
            return None
        return replace(self, poles=self.poles - 1, zeros=max(self.zeros - 1, 0))

    def arranged(self, theta: FloatArray) -> FloatArray:
        """The parameters (p,): no others have the same transfer function."""
        return theta

    def warnings(self, theta: FloatArray, deviations: FloatArray) -> list[str]:
        """None: every value has its meaning."""
        return []

    def parameters(self, path: TransferFunction) -> FloatArray:
        """Parameters (p,) of a transfer function."""
        # a fraction is the same with all its coefficients over the leading one, which is no parameter
        leading = path.a[-1]
        delay = [path.delay] if self.delay is None else []
        return np.concatenate((path.b[::-1] / leading, path.a[-2::-1] / leading, delay))


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
        kind = self.kind.upper() if isinstance(self.kind, str) else ""
        well_formed = re.fullmatch(r"P[0-3][DZIU]*", kind) and len(set(kind)) == len(kind)
        if not well_formed or ("U" in kind and kind[1] in "01"):
            raise SysidError(
                f"a process model is P0, P1, P2 or P3 with any of D (delay), Z (zero), I (integrator) and, from P2 "
                f"on, U (underdamped), such as 'P2DZ'; got {shown(self.kind)}"
            )
        if kind[1] == "0" and "Z" in kind:
            raise SysidError(f"a zero needs a pole besides the integrator: expected P1{kind[2:]}, got {kind}")
        letters = sorted(kind[2:], key="DZIU".index)
        object.__setattr__(self, "kind", kind[:2] + "".join(letters))

    @property
    def integrators(self) -> int:
        """1 for an integrator, else 0."""
        return int("I" in self.kind)

    @property
    def resonates(self) -> bool:
        """Whether poles may be complex."""
        return "U" in self.kind

    @property
    def lags(self) -> int:
        """Number of poles but for that of the integrator; a complex pair counts as two."""
        return int(self.kind[1])

    @property
    def _first_real(self) -> int:
        """Index of the parameter that is the first time constant of a real pole, behind Kp, or Kp, Tw and Zeta."""
        return 3 if "U" in self.kind else 1

    @property
    def poles(self) -> int:
        """Number of poles, that of the integrator too."""
        return self.lags + self.integrators

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
        lags = [f"Tp{i + 1}" for i in range(self.lags)]
        if "U" in self.kind:
            lags[:2] = ["Tw", "Zeta"]
        zero = ["Tz"] if self.zeros else []
        delay = ["Td"] if self.delay is None else []
        return ("Kp", *lags, *zero, *delay)

    def smaller(self) -> "ProcessPath | None":
        """The kind without its zero, else with a time constant less; None where neither is there."""
        if self.zeros:
            return ProcessPath(self.kind.replace("Z", ""))
        if self.lags < 2:
            return None
        fewer = f"P{self.lags - 1}{self.kind[2:]}"
        return ProcessPath(fewer.replace("U", "") if self.lags == 2 else fewer)

    def arranged(self, theta: FloatArray) -> FloatArray:
        """The same transfer function with Tw > 0, and real time constants that fall (p,)."""
        first, end = self._first_real, self.lags + 1
        pair = theta[1:first]
        if len(pair):
            # 1 + 2 Zeta Tw s + (Tw s)^2 stays the same where Tw and Zeta both change their signs
            pair = pair * np.sign(theta[1])
        return np.concatenate((theta[:1], pair, np.sort(theta[first:end])[::-1], theta[end:]))

    def warnings(self, theta: FloatArray, deviations: FloatArray) -> list[str]:
        """Texts on real poles that coincide, otherwise on time constants that are zero within their intervals."""
        messages = []
        for i in range(self._first_real, self.lags):
            # with a known time constant the second may be the longer one
            if COINCIDING < theta[i + 1] / theta[i] < 1.0 / COINCIDING:
                pair = f"Tp{i} and Tp{i + 1}"
                messages.append(
                    f"{pair} coincide, and their intervals are wrong: the poles may be complex, as U allows"
                )
        if messages:
            return messages
        for name, value, deviation in zip(self.names, theta, deviations, strict=True):
            if name.startswith(("Tp", "Tw")) and value <= NORMAL_95 * deviation:
                messages.append(
                    f"the interval of {name} reaches zero and is not reliable: try fewer poles, or more data"
                )
        return messages

    def _factors(self, theta: FloatArray) -> tuple[list[FloatArray], dict[int, tuple[int, FloatArray]]]:
        """Factors of the denominator, coefficients of rising powers, with their derivatives.

        The derivatives are by index of the parameter: the index of the factor that it is in, and the derivative of that
        factor. Each parameter is in one factor alone.
        """
        factors = [np.array([0.0, 1.0])] * self.integrators
        slopes: dict[int, tuple[int, FloatArray]] = {}
        if "U" in self.kind:
            tw, zeta = theta[1:3]
            slopes[1] = len(factors), np.array([0.0, 2.0 * zeta, 2.0 * tw])
            slopes[2] = len(factors), np.array([0.0, 2.0 * tw, 0.0])
            factors.append(np.array([1.0, 2.0 * zeta * tw, tw**2]))
        for i in range(self._first_real, self.lags + 1):
            # 1 + Tp s
            slopes[i] = len(factors), np.array([0.0, 1.0])
            factors.append(np.array([1.0, theta[i]]))
        return factors, slopes

    def transfer(self, theta: FloatArray) -> TransferFunction:
        """Transfer function for parameters (p,)."""
        b = theta[:1]
        if self.zeros:
            b = theta[0] * np.array([1.0, theta[self.names.index("Tz")]])
        factors, _ = self._factors(theta)
        delay = theta[-1] if self.delay is None else 0.0
        return TransferFunction(b, _product(factors), delay)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of b, a and the delay by the parameters (m + n + 3, p)."""
        m, n = self.zeros, self.poles
        derivatives = np.zeros((m + n + 3, len(theta)))
        derivatives[0, 0] = 1.0
        if m:
            tz = self.names.index("Tz")
            derivatives[1, 0], derivatives[1, tz] = theta[tz], theta[0]
        factors, slopes = self._factors(theta)
        for i, (k, slope) in slopes.items():
            derivatives[m + 1 : m + 2 + n, i] = _product([*factors[:k], slope, *factors[k + 1 :]])
        if self.delay is None:
            derivatives[-1, -1] = 1.0
        return derivatives

    def parameters(self, path: TransferFunction) -> FloatArray:
        """Parameters of the transfer function; complex poles of a kind without U become two near real ones."""
        without_integrator = path.a[self.integrators :]
        if not without_integrator[0]:
            # a kind without this integrator gets a very slow pole in its place
            slow_pole = np.eye(1, len(without_integrator))[0] * SLOW * np.abs(without_integrator).max()
            without_integrator = without_integrator + slow_pole
        gain = path.b[0] / without_integrator[0]
        lags = self._time_constants(np.roots(without_integrator[::-1]))
        zero = []
        if self.zeros:
            # of a path without gain at 0 Hz, which the kind cannot hold, the zero starts at infinity
            zero.append(path.b[1] / path.b[0] if path.b[0] else 0.0)
        delay = [path.delay] if self.delay is None else []
        return np.array([gain, *lags, *zero, *delay])

    def _time_constants(self, poles: np.ndarray) -> list[float]:
        """Tp1 ..., or Tw, Zeta, Tp3, of poles in rad/s."""
        upper = poles[poles.imag > 0.0]
        if "U" in self.kind and len(upper):
            size = abs(upper[0])
            real = -1.0 / poles[poles.imag == 0.0].real
            return [1.0 / size, -upper[0].real / size, *real]
        # of two equal time constants the derivatives would be the same, so a search could not part them
        spread = np.where(poles.imag == 0.0, 1.0, np.where(poles.imag > 0.0, SPREAD, 1.0 / SPREAD))
        time_constants = sorted(np.sign(-poles.real) * spread / np.abs(poles), reverse=True)
        if "U" in self.kind:
            slow, fast = time_constants[:2]
            tw = np.sqrt(slow * fast)
            time_constants[:2] = [tw, 0.5 * (slow + fast) / tw]
        return time_constants


def _product(factors: list[FloatArray]) -> FloatArray:
    """Coefficients of a product of polynomials, of powers in one direction."""
    product = np.ones(1)
    for factor in factors:
        product = np.convolve(product, factor)
    return product


PathStructure = RationalPath | ProcessPath
PerPath = int | Sequence[int] | Sequence[Sequence[int]]


def names_of_paths(structures: Sequence[Sequence[PathStructure]]) -> tuple[str, ...]:
    """Names of all parameters, one row of paths per output; with several paths each names its output and input."""
    ny, nu = len(structures), len(structures[0])
    names = []
    for i, row in enumerate(structures):
        for j, structure in enumerate(row):
            channel = f"{i + 1},{j + 1}" if ny > 1 else f"{j + 1}"
            suffix = f"[{channel}]" if ny * nu > 1 else ""
            names += [name + suffix for name in structure.names]
    return tuple(names)


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
        return names_of_paths(self.structures)

    def transfers(self, theta: FloatArray) -> list[TransferFunction]:
        """Transfer functions row by row for parameters (p,)."""
        structures = [structure for row in self.structures for structure in row]
        ends = np.cumsum([len(structure.names) for structure in structures])
        values_by_path = np.split(theta, ends[:-1])
        return [structure.transfer(values) for structure, values in zip(structures, values_by_path, strict=True)]

    def __call__(self, theta: FloatArray) -> ContinuousModel:
        """Model for parameters (p,)."""
        ny, nu = len(self.structures), len(self.structures[0])
        paths = self.transfers(theta)
        state_matrices, inputs, outputs, direct = [], [], [], []
        for k, path in enumerate(paths):
            i, j = divmod(k, nu)
            a, b, c, d = path.realisation()
            state_matrices.append(a)
            # every path has states of its own: b drives them from its input, c adds them to its output
            inputs.append(b @ np.eye(nu)[[j]])
            outputs.append(np.eye(ny)[:, [i]] @ c)
            direct.append(d)
        A, B, C = scipy.linalg.block_diag(*state_matrices), np.vstack(inputs), np.hstack(outputs)
        D = np.reshape(direct, (ny, nu))
        # the interval of a delay estimated as 0 asks for models with negative ones
        delays = np.reshape([max(path.delay, 0.0) for path in paths], (ny, nu))
        states = StateSpace(A, B, C, D, None, self.data.dt, self.covariance, **self.data.labels)
        return ContinuousModel(states, delays, self.intersample)


def per_path(name: str, value: object, ny: int, nu: int) -> list[list[Any]]:
    """One value for each path (ny, nu), from one for all, one per input, or a row per output."""
    table = np.array(value, dtype=object)
    per_input = ny == 1 and table.shape == (nu,)
    if table.ndim and table.shape != (ny, nu) and not per_input:
        expected = f"one per input ({nu})" if ny == 1 else f"{ny} rows, one per output, of {nu}, one per input"
        raise SysidError(f"{name}: expected one value or {expected}, got {shown(value)}")
    return [list(row) for row in np.broadcast_to(table, (ny, nu))]


FAST = 0.03  # time constant, in samples, of a pole that a smaller model gets on the way to a larger one
CANCELLED = 3.0  # the same of a pole that a zero cancels, whatever it is


def enlarged(structure: PathStructure, path: TransferFunction, dt: float) -> FloatArray:
    """Parameters of the structure whose response is nearly that of a smaller model."""
    b, a = path.b, path.a
    # a zero goes with its pole where the path has room for both, else it is at infinity
    while len(a) <= structure.poles:
        cancelled = len(b) <= structure.zeros
        time_constant = CANCELLED if cancelled else FAST
        pole = np.array([1.0, time_constant * dt])
        a = np.convolve(a, pole)
        if cancelled:
            b = np.convolve(b, pole)
    return structure.parameters(TransferFunction(np.pad(b, (0, max(structure.zeros + 1 - len(b), 0))), a, path.delay))
