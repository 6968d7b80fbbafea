"""Vector fitting: rational approximation of a response by relocation of its poles."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.continuous_model import ContinuousModel
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.records.arguments import sampling_interval, truth_value, whole_number
from sysid.records.arrays import ComplexArray, FloatArray, Locked, real_array
from sysid.records.errors import SysidError

if TYPE_CHECKING:
    import control

SMALLEST_DIRECT = 1e-8  # of the relaxed denominator's constant, below which its zeros run to infinity [Gustavsen2006]


@dataclass(frozen=True, eq=False, repr=False)
class PartialFractions(Locked):
    """Rational response G(x) = D + sum of R / (x - p), x = s or z; conjugate poles have conjugate residues.

    Attributes:
        poles: Real poles, and of every pair the one in the upper half plane (q,), in rad/s or of z.
        residues: R of these poles (q, ny, nu).
        direct: D (ny, nu).
        dt: Sampling interval in s; 0 in continuous time.
    """

    poles: ComplexArray
    residues: ComplexArray
    direct: FloatArray
    dt: float

    def frequency_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response at frequencies in Hz (nf, ny, nu)."""
        s: ComplexArray = np.asarray(2j * np.pi * np.atleast_1d(real_array("f_hz", f_hz)), dtype=np.complex128)
        return self.at(np.asarray(np.exp(s * self.dt)) if self.dt else s)

    def at(self, x: ComplexArray) -> ComplexArray:
        """Response at s or z (nf, ny, nu)."""
        both = np.where(self.poles.imag > 0.0, 1.0, 0.0)[:, None, None] * self.residues.conj()
        out = np.tensordot(1.0 / (x[:, None] - self.poles), self.residues, 1)
        return np.asarray(out + np.tensordot(1.0 / (x[:, None] - self.poles.conj()), both, 1) + self.direct)

    def matrices(self, rank: int | None = None) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, B, C and D of a block-diagonal realisation, residues of full rank or reduced to a lower one."""
        rank = min(self.direct.shape) if rank is None else rank
        A, B, C = [], [], []
        for pole, residue in zip(self.poles, self.residues, strict=True):
            u, values, vh = np.linalg.svd(residue if pole.imag else residue.real)
            b, c = np.sqrt(values[:rank, None]) * vh[:rank], u[:, :rank] * np.sqrt(values[:rank])
            one = np.eye(len(b))
            if pole.imag:
                # y = 2 Re(c state) of a complex state
                A.append(np.kron([[pole.real, -pole.imag], [pole.imag, pole.real]], one))
                b, c = np.sqrt(2.0) * np.vstack((b.real, b.imag)), np.sqrt(2.0) * np.hstack((c.real, -c.imag))
            else:
                A.append(pole.real * one)
            B.append(b)
            C.append(c)
        return scipy.linalg.block_diag(*A), np.vstack(B), np.hstack(C), self.direct

    def to_control(self) -> "control.StateSpace":
        """The response as a python-control system, in continuous time where `dt` is 0."""
        import control

        return control.ss(*self.matrices(), self.dt)

    def to_state_space(self, dt: float | None = None) -> StateSpace:
        """The response as a model; in continuous time its sampling with held inputs.

        Args:
            dt: Sampling interval in s; needed in continuous time, otherwise that of the response.

        Raises:
            SysidError: No sampling interval, or another one than that of the response.
        """
        if self.dt and dt not in (None, self.dt):
            raise SysidError(f"the response is sampled every {self.dt:g} s, got dt = {dt!r}")
        A, B, C, D = self.matrices()
        states = StateSpace(A, B, C, D, None, self.dt or sampling_interval(dt))
        return states if self.dt else ContinuousModel(states, np.zeros(D.shape)).sampled()


def vector_fit(
    response: FrequencyResponse, order: int, *, direct: bool = True, stable: bool = True, max_iterations: int = 30
) -> PartialFractions:
    """Rational approximation with common poles by vector fitting [Gustavsen1999; Gustavsen2006; Deschrijver2008].

    Each iteration fits sigma G = sum R / (x - p) + D, sigma = d + sum c / (x - p), by weighted least squares; the
    zeros of sigma are the next poles. The best iterate is returned. Weights are the inverse standard deviations where
    the response has a covariance. It is no minimum of the likelihood, and biased by noise.

    Args:
        response: Response in continuous or discrete time; any numbers of inputs and outputs.
        order: Number of poles, in common for all entries.
        direct: Whether D is fitted; otherwise it is zero.
        stable: Whether unstable poles are reflected into the stable region.
        max_iterations: Relocations of the poles.

    Returns:
        Poles and residues.

    Raises:
        SysidError: More unknowns than values of the response.
    """
    direct, stable = truth_value("direct", direct), truth_value("stable", stable)
    if not isinstance(response, FrequencyResponse):
        raise SysidError(f"expected a FrequencyResponse, got {type(response).__name__}")
    order = whole_number("order", order, 1, 2 * response.response.size)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    known = response.determined()
    weights = np.ones(known.response.shape)
    if known.covariance is not None:
        variance = np.trace(known.covariance, axis1=-2, axis2=-1)
        # lines known exactly are weighed like the best of the others
        least = variance[variance > 0.0].min(initial=np.inf)
        weights = 1.0 / np.sqrt(np.maximum(variance, least)) if np.isfinite(least) else weights
    x, scale = points(known)
    poles = starting_poles(known.frequencies, order, known.dt)
    out = fitted(x, known.response, weights, poles, direct, stable, known.dt, max_iterations)
    return PartialFractions(scale * out.poles, scale * out.residues, out.direct, known.dt)


def points(response: FrequencyResponse) -> tuple[ComplexArray, float]:
    """The frequencies as z, or as s relative to the highest one in rad/s, which is the second result (z: 1)."""
    s: ComplexArray = np.asarray(2j * np.pi * response.frequencies, dtype=np.complex128)
    if response.dt:
        return np.asarray(np.exp(s * response.dt)), 1.0
    scale = float(np.abs(s[-1])) or 1.0
    return s / scale, scale


def starting_poles(f: FloatArray, order: int, dt: float) -> ComplexArray:
    """Lightly damped pairs over the range of the frequencies, and a real pole for an odd order."""
    positive = f[f > 0.0]
    if not len(positive):
        raise SysidError("expected frequencies above 0 Hz")
    middle = np.sqrt(positive[0] * positive[-1])
    pairs = np.geomspace(positive[0], positive[-1], order // 2) if order > 3 else np.full(order // 2, middle)
    s = np.append((-0.01 + 1j) * pairs, np.full(order % 2, -middle))
    if dt:
        # the highest pair would fall on Nyquist
        z = np.exp(2 * np.pi * dt * (s.real + 1j * np.minimum(s.imag, 0.49 / dt)))
        return np.where(s.imag > 0.0, z, z.real)
    return s / positive[-1]


def fitted(
    x: ComplexArray,
    g: ComplexArray,
    weights: FloatArray,
    poles: ComplexArray,
    direct: bool,
    stable: bool,
    dt: float,
    max_iterations: int,
) -> PartialFractions:
    """Relocate poles, and return those with the least weighted sum of squares."""
    shape = g.shape[1:]
    flat, w = g.reshape(len(x), -1), weights.reshape(len(x), -1)
    order = len(poles) + int((poles.imag > 0.0).sum())
    if 2 * flat.size < order * (1 + flat.shape[1]) + direct * flat.shape[1]:
        raise SysidError(f"order {order} has more unknowns than {len(x)} frequencies with {flat.shape[1]} entries give")
    best: PartialFractions | None = None
    least = np.inf
    for _ in range(max_iterations + 1):
        columns = _columns(x, poles)
        columns = np.hstack((columns, np.ones((len(x), 1)))) if direct else columns
        values, cost = np.zeros((columns.shape[1], flat.shape[1])), 0.0
        for k in range(flat.shape[1]):
            phi, target = _real(columns * w[:, [k]]), _real((flat[:, k] * w[:, k])[:, None])
            size = np.linalg.norm(phi, axis=0)
            values[:, [k]] = np.linalg.lstsq(phi / size, target, rcond=None)[0] / size[:, None]
            cost += float(np.sum((target - phi @ values[:, [k]]) ** 2))
        if cost < least:
            q, upper = len(poles), poles.imag > 0.0
            residues = values[:q].astype(complex)
            residues[upper] += 1j * values[q:order]
            end = values[order] if direct else np.zeros(flat.shape[1])
            best, least = PartialFractions(poles, residues.reshape(q, *shape), end.reshape(shape), dt), cost
        moved = _relocated(x, flat, w, poles, direct, stable, dt)
        if len(moved) == len(poles) and np.allclose(moved, poles, rtol=1e-12):
            break
        poles = moved
    if best is None:
        raise SysidError("vector fitting did not reach a finite response")
    return best


def _relocated(
    x: ComplexArray, g: ComplexArray, w: FloatArray, poles: ComplexArray, direct: bool, stable: bool, dt: float
) -> ComplexArray:
    basis = _columns(x, poles)
    n = basis.shape[1]
    ones = np.ones((len(x), 1))
    relaxed = np.hstack((basis, ones))
    own = relaxed if direct else basis
    rows = []
    for k in range(g.shape[1]):
        phi = _real(np.hstack((own * w[:, [k]], -relaxed * (w[:, k] * g[:, k])[:, None])))
        size = np.linalg.norm(phi[:, : own.shape[1]], axis=0)
        phi[:, : own.shape[1]] /= size
        rows.append(np.asarray(np.linalg.qr(phi, mode="r"))[own.shape[1] :, own.shape[1] :])
    # sigma is one on average, not at infinity
    share = np.linalg.norm(w * g) / len(x) or 1.0
    rows.append(share * relaxed.real.sum(axis=0)[None])
    table = np.vstack(rows)
    size = np.linalg.norm(table, axis=0)
    target = np.zeros(len(table))
    target[-1] = share * len(x)
    c = np.linalg.lstsq(table / size, target, rcond=None)[0] / size
    d = float(np.copysign(max(abs(c[n]), SMALLEST_DIRECT), c[n]))
    upper = poles.imag > 0.0
    q = len(poles)
    A = np.diag(np.concatenate((poles.real, poles[upper].real)))
    b = np.concatenate((np.where(upper, 2.0, 1.0), np.zeros(int(upper.sum()))))
    first, second = np.flatnonzero(upper), np.arange(q, n)
    A[first, second], A[second, first] = poles[upper].imag, -poles[upper].imag
    zeros = np.linalg.eigvals(A - np.outer(b, c[:n]) / d).astype(complex)
    zeros = np.where(np.abs(zeros.imag) <= 1e-14 * np.abs(zeros), zeros.real, zeros)
    if stable:
        inside = np.where(np.abs(zeros) > 1.0, 1.0 / np.where(zeros == 0.0, 1.0, zeros).conj(), zeros)
        zeros = inside if dt else -np.abs(zeros.real) + 1j * zeros.imag
    return np.asarray(np.sort_complex(zeros[zeros.imag >= 0.0]))


def _columns(x: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Real basis: 1/(x - p), for pairs the sum with its conjugate, and behind them i times the difference."""
    upper = poles.imag > 0.0
    one, other = 1.0 / (x[:, None] - poles), 1.0 / (x[:, None] - poles.conj())
    return np.hstack((np.where(upper, one + other, one), 1j * (one - other)[:, upper]))


def _real(values: ComplexArray) -> FloatArray:
    return np.vstack((values.real, values.imag))
