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
from sysid.records.optional import optional
from sysid.records.singular_values import svd

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
        x = np.asarray(np.exp(s * self.dt)) if self.dt else s
        return self.at(x)

    def at(self, x: ComplexArray) -> ComplexArray:
        """Response at s or z (nf, ny, nu)."""
        # a real pole counts once
        has_conjugate = np.where(self.poles.imag > 0.0, 1.0, 0.0)[:, None, None]
        upper = np.tensordot(1.0 / (x[:, None] - self.poles), self.residues, 1)
        lower = np.tensordot(1.0 / (x[:, None] - self.poles.conj()), has_conjugate * self.residues.conj(), 1)
        return np.asarray(upper + lower + self.direct)

    def matrices(self, rank: int | None = None) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, B, C and D of a block-diagonal realisation, residues of full rank or reduced to a lower one."""
        rank = min(self.direct.shape) if rank is None else rank
        A, B, C = [], [], []
        for pole, residue in zip(self.poles, self.residues, strict=True):
            u, values, vh = svd(residue) if pole.imag else svd(residue.real)
            # equal shares of a singular value make inputs and outputs of the states alike in size
            root = np.sqrt(values[:rank])
            b, c = root[:, None] * vh[:rank], u[:, :rank] * root
            identity = np.eye(len(b))
            if pole.imag:
                # y = 2 Re(c state) of a complex state
                A.append(np.kron([[pole.real, -pole.imag], [pole.imag, pole.real]], identity))
                B.append(np.sqrt(2.0) * np.vstack((b.real, b.imag)))
                C.append(np.sqrt(2.0) * np.hstack((c.real, -c.imag)))
            else:
                A.append(pole.real * identity)
                B.append(b)
                C.append(c)
        return scipy.linalg.block_diag(*A), np.vstack(B), np.hstack(C), self.direct

    def to_control(self) -> "control.StateSpace":
        """The response as a python-control system, in continuous time where `dt` is 0."""
        with optional("control"):
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
    determined = response.determined()
    x, scale = points(determined)
    poles = starting_poles(determined.frequencies, order, determined.dt)
    out = fitted(x, determined.response, _weights(determined), poles, direct, stable, determined.dt, max_iterations)
    return PartialFractions(scale * out.poles, scale * out.residues, out.direct, determined.dt)


def _weights(response: FrequencyResponse) -> FloatArray:
    """Inverse standard deviations (nf, ny, nu); ones without a covariance, or if all lines are known exactly."""
    equal = np.ones(response.response.shape)
    if response.covariance is None:
        return equal
    variance = np.trace(response.covariance, axis1=-2, axis2=-1)
    # lines known exactly are weighed like the best of the others
    smallest = variance[variance > 0.0].min(initial=np.inf)
    if not np.isfinite(smallest):
        return equal
    return np.asarray(1.0 / np.sqrt(np.maximum(variance, smallest)))


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
    pairs = np.full(order // 2, middle)
    if order > 3:
        pairs = np.geomspace(positive[0], positive[-1], order // 2)
    # lightly damped: imaginary parts apart make a well conditioned basis [Gustavsen1999]
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
    flat, w = g.reshape(len(x), -1), weights.reshape(len(x), -1)
    entries = flat.shape[1]
    order = len(poles) + int((poles.imag > 0.0).sum())
    if 2 * flat.size < order * (1 + entries) + direct * entries:
        raise SysidError(f"order {order} has more unknowns than {len(x)} frequencies with {entries} entries give")
    best: PartialFractions | None = None
    smallest_cost = np.inf
    # relocation need not lower the cost from step to step, and may cycle
    for _ in range(max_iterations + 1):
        coefficients, cost = _fit_residues(x, flat, w, poles, direct)
        if cost < smallest_cost:
            best, smallest_cost = _partial_fractions(coefficients, poles, direct, g.shape[1:], dt), cost
        relocated = _relocated(x, flat, w, poles, direct, stable, dt)
        if len(relocated) == len(poles) and np.allclose(relocated, poles, rtol=1e-12):
            break
        poles = relocated
    if best is None:
        raise SysidError("vector fitting did not reach a finite response")
    return best


def _fit_residues(
    x: ComplexArray, g: ComplexArray, w: FloatArray, poles: ComplexArray, direct: bool
) -> tuple[FloatArray, float]:
    """Real coefficients of the basis for each entry (columns, entries), and the weighted sum of squares left."""
    columns = _columns(x, poles)
    if direct:
        columns = np.hstack((columns, np.ones((len(x), 1))))
    coefficients, cost = np.zeros((columns.shape[1], g.shape[1])), 0.0
    for k in range(g.shape[1]):
        phi, target = _stacked(columns * w[:, [k]]), _stacked((g[:, k] * w[:, k])[:, None])
        size = np.linalg.norm(phi, axis=0)
        coefficients[:, [k]] = np.linalg.lstsq(phi / size, target, rcond=None)[0] / size[:, None]
        cost += float(np.sum((target - phi @ coefficients[:, [k]]) ** 2))
    return coefficients, cost


def _partial_fractions(
    coefficients: FloatArray, poles: ComplexArray, direct: bool, shape: tuple[int, ...], dt: float
) -> PartialFractions:
    """Residues of the coefficients of the real basis: real parts of all poles, imaginary ones of the pairs, then D."""
    q, upper = len(poles), poles.imag > 0.0
    order = q + int(upper.sum())
    residues = coefficients[:q].astype(complex)
    residues[upper] += 1j * coefficients[q:order]
    D = coefficients[order] if direct else np.zeros(coefficients.shape[1])
    return PartialFractions(poles, residues.reshape(q, *shape), D.reshape(shape), dt)


def _relocated(
    x: ComplexArray, g: ComplexArray, w: FloatArray, poles: ComplexArray, direct: bool, stable: bool, dt: float
) -> ComplexArray:
    """Next poles: the zeros of sigma = d + sum c / (x - p), in the closed upper half plane."""
    c, d = _denominator(x, g, w, poles, direct)
    # the zeros of a quotient are the poles of its inverse: eigenvalues of A - b c / d [Gustavsen1999]
    upper = poles.imag > 0.0
    A = np.diag(np.concatenate((poles.real, poles[upper].real)))
    b = np.concatenate((np.where(upper, 2.0, 1.0), np.zeros(int(upper.sum()))))
    real_state, imaginary_state = np.flatnonzero(upper), np.arange(len(poles), len(A))
    A[real_state, imaginary_state] = poles[upper].imag
    A[imaginary_state, real_state] = -poles[upper].imag
    zeros = np.linalg.eigvals(A - np.outer(b, c) / d).astype(complex)
    # a real zero may be computed with an imaginary part of rounding
    zeros = np.where(np.abs(zeros.imag) <= 1e-14 * np.abs(zeros), zeros.real, zeros)
    if stable:
        zeros = _reflected(zeros, dt)
    return np.asarray(np.sort_complex(zeros[zeros.imag >= 0.0]))


def _reflected(poles: ComplexArray, dt: float) -> ComplexArray:
    """Poles with the unstable ones reflected into the stable region."""
    if not dt:
        return np.asarray(-np.abs(poles.real) + 1j * poles.imag)
    without_zeros = np.where(poles == 0.0, 1.0, poles)
    return np.where(np.abs(poles) > 1.0, 1.0 / without_zeros.conj(), poles)


def _denominator(
    x: ComplexArray, g: ComplexArray, w: FloatArray, poles: ComplexArray, direct: bool
) -> tuple[FloatArray, float]:
    """Coefficients c (n,) and d of sigma by relaxed vector fitting [Gustavsen2006].

    The numerators of the entries are eliminated one by one by orthogonal triangles, which leaves equations in c and d
    alone [Deschrijver2008].
    """
    basis = _columns(x, poles)
    n = basis.shape[1]
    relaxed = np.hstack((basis, np.ones((len(x), 1))))
    numerator = relaxed if direct else basis
    eliminated = numerator.shape[1]
    rows = []
    for k in range(g.shape[1]):
        phi = _stacked(np.hstack((numerator * w[:, [k]], -relaxed * (w[:, k] * g[:, k])[:, None])))
        size = np.linalg.norm(phi[:, :eliminated], axis=0)
        phi[:, :eliminated] /= size
        triangle = np.asarray(np.linalg.qr(phi, mode="r"))
        rows.append(triangle[eliminated:, eliminated:])
    # sigma is one on average, not at infinity
    share = np.linalg.norm(w * g) / len(x) or 1.0
    rows.append(share * relaxed.real.sum(axis=0)[None])
    table = np.vstack(rows)
    size = np.linalg.norm(table, axis=0)
    target = np.zeros(len(table))
    target[-1] = share * len(x)
    solution = np.linalg.lstsq(table / size, target, rcond=None)[0] / size
    d = float(np.copysign(max(abs(solution[n]), SMALLEST_DIRECT), solution[n]))
    return solution[:n], d


def _columns(x: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Real basis: 1/(x - p), for pairs the sum with its conjugate, and behind them i times the difference."""
    upper = poles.imag > 0.0
    at_pole, at_conjugate = 1.0 / (x[:, None] - poles), 1.0 / (x[:, None] - poles.conj())
    sums = np.where(upper, at_pole + at_conjugate, at_pole)
    return np.hstack((sums, 1j * (at_pole - at_conjugate)[:, upper]))


def _stacked(values: ComplexArray) -> FloatArray:
    """Real parts above imaginary parts: complex equations with real unknowns."""
    return np.vstack((values.real, values.imag))
