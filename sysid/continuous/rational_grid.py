"""Transfer functions on the grid of a measured response, in polynomials orthogonal on it."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.records.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class OrthogonalPolynomials:
    """Real polynomials P_0, ..., P_n of x, orthonormal on the grid with some weights.

    Powers of s over decades would be as good as dependent; these are made by multiplication with x and
    orthogonalisation [Brubeck2021].

    Attributes:
        values: On the grid (nf, n + 1).
        recurrence: x P_k = sum of recurrence[j, k] P_j, (n + 1, n).
        weights: Of the grid (nf,).
    """

    values: ComplexArray
    recurrence: FloatArray
    weights: FloatArray

    @staticmethod
    def on(x: ComplexArray, weights: FloatArray, degree: int) -> "OrthogonalPolynomials":
        """Polynomials up to a degree."""
        vectors = np.zeros((len(x), degree + 1), dtype=complex)
        recurrence = np.zeros((degree + 1, degree))
        vectors[:, 0] = weights / np.linalg.norm(weights)
        for k in range(degree):
            v = x * vectors[:, k]
            for _ in range(2):  # a second pass makes up for the rounding of the first
                part = (vectors[:, : k + 1].conj().T @ v).real
                recurrence[: k + 1, k] += part
                v = v - vectors[:, : k + 1] @ part
            recurrence[k + 1, k] = np.linalg.norm(v)
            vectors[:, k + 1] = v / recurrence[k + 1, k]
        return OrthogonalPolynomials(np.asarray(vectors / weights[:, None]), recurrence, weights)

    def coefficients(self, values: ComplexArray) -> FloatArray:
        """Coefficients (n + 1,) of the polynomial with some values on the grid."""
        return np.asarray(((self.values * self.weights[:, None]).conj().T @ (values * self.weights)).real)

    def roots(self, coefficients: FloatArray) -> ComplexArray:
        """Zeros of a sum of the polynomials, from a comrade matrix."""
        n = len(coefficients) - 1
        comrade = self.recurrence[:n, :n].copy()
        if n:
            comrade[:, -1] -= self.recurrence[n, n - 1] * coefficients[:n] / coefficients[n]
        return np.linalg.eigvals(comrade).astype(complex)

    def powers(self) -> FloatArray:
        """Coefficients of falling powers of x, a column per polynomial (n + 1, n + 1)."""
        n = self.recurrence.shape[1]
        out = np.zeros((n + 1, n + 1))
        out[0, 0] = self.values[0, 0].real
        for k in range(n):
            shifted = np.roll(out[:, k], 1) - out[:, : k + 1] @ self.recurrence[: k + 1, k]
            out[:, k + 1] = shifted / self.recurrence[k + 1, k]
        return out[::-1]


@dataclass(frozen=True, eq=False)
class Fraction:
    """Transfer function N(x) / D(x) of one path with its delay, D monic.

    Attributes:
        numerator: Values on the grid (nf,).
        denominator: Values on the grid (nf,).
        nb: Number of coefficients of the numerator.
        nf: Degree of the denominator.
        weights: Inverse standard deviations of the response (nf,).
        delay: In units of 1/x; with x = z, the delay nk of B(q)/F(q) in samples.
        late: Whether the delay is a parameter.
    """

    numerator: ComplexArray
    denominator: ComplexArray
    nb: int
    nf: int
    weights: FloatArray
    delay: float
    late: bool

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.nb + self.nf + self.late

    def factor(self, x: ComplexArray, discrete: bool) -> ComplexArray:
        """What the delay multiplies N / D with (nf,)."""
        return np.asarray(x ** (self.nf - self.nb + 1 - self.delay) if discrete else np.exp(-x * self.delay))

    def bases(self, x: ComplexArray) -> tuple[OrthogonalPolynomials, OrthogonalPolynomials]:
        """Polynomial bases of numerator and denominator, orthogonal over the frequencies with the fit's weights."""
        size = np.abs(self.denominator)
        above = OrthogonalPolynomials.on(x, self.weights / size, self.nb - 1)
        # a floor, for the response may vanish
        gain = np.abs(self.numerator) / size
        below = OrthogonalPolynomials.on(x, self.weights * np.maximum(gain, 1e-6 * gain.max()) / size, self.nf)
        return above, below

    def with_numerator(self, x: ComplexArray, g: ComplexArray) -> "Fraction":
        """The path with the numerator that fits values of N / D best, the denominator kept."""
        above = OrthogonalPolynomials.on(x, self.weights / np.abs(self.denominator), self.nb - 1)
        table = above.values * (self.weights / self.denominator)[:, None]
        target = g * self.weights
        rows = np.vstack((table.real, table.imag))
        fitted = np.linalg.lstsq(rows, np.concatenate((target.real, target.imag)), rcond=None)[0]
        return replace(self, numerator=above.values @ fitted)

    def with_poles(self, x: ComplexArray, poles: ComplexArray) -> "Fraction":
        """The path with other poles, all of them."""
        denominator = np.ones(len(x), dtype=complex)
        for pole in poles:
            denominator = denominator * (x - pole)
        return replace(self, denominator=denominator)

    def refitted(self, x: ComplexArray, g: ComplexArray, stable: bool, discrete: bool) -> "Fraction":
        """The path after a step of linear least squares on N - D g, weighted by the last D [SanathananKoerner1963]."""
        above, below = self.bases(x)
        scaled = (self.weights / np.abs(self.denominator))[:, None]
        table = (
            np.hstack((above.values, -below.values[:, : self.nf] * g[:, None], (self.denominator * g)[:, None]))
            * scaled
        )
        rows = np.vstack((table.real, table.imag))
        size = np.linalg.norm(rows, axis=0)
        change = np.linalg.lstsq(rows[:, :-1] / size[:-1], rows[:, -1], rcond=None)[0] / size[:-1]
        out = replace(self, denominator=self.denominator + below.values[:, : self.nf] @ change[self.nb :])
        return (out.stabilised(x, discrete) if stable else out).with_numerator(x, g)

    def stabilised(self, x: ComplexArray, discrete: bool) -> "Fraction":
        """The path with unstable poles mirrored into the stable region."""
        poles = self.poles(x)
        return self.with_poles(x, mirrored_poles(poles, discrete)) if unstable(poles, discrete).any() else self

    def poles(self, x: ComplexArray) -> ComplexArray:
        """Poles in units of x."""
        below = self.bases(x)[1]
        return below.roots(below.coefficients(self.denominator))


@dataclass(frozen=True, eq=False)
class Fractions:
    """Transfer functions from all inputs to all outputs, a candidate of the likelihood.

    Attributes:
        x: Points of the grid (nf,).
        paths: Output by output, in each input by input.
        shape: Numbers of outputs and inputs.
        stable: Whether poles must be stable.
        discrete: Whether x is z.
    """

    x: ComplexArray
    paths: tuple[Fraction, ...]
    shape: tuple[int, int]
    stable: bool
    discrete: bool

    @property
    def free(self) -> int:
        """Number of parameters."""
        return sum(path.count for path in self.paths)

    def response(self) -> ComplexArray:
        """Response (nf, ny, nu)."""
        flat = [path.factor(self.x, self.discrete) * path.numerator / path.denominator for path in self.paths]
        return np.stack(flat, axis=-1).reshape(-1, *self.shape)

    def columns(self) -> ComplexArray:
        """Derivatives in numerator, denominator and delay, path by path (nf, ny, nu, p)."""
        nf, response = len(self.x), self.response().reshape(len(self.x), -1)
        out, at = np.zeros((nf, len(self.paths), self.free), dtype=complex), 0
        for k, path in enumerate(self.paths):
            above, below = path.bases(self.x)
            g = response[:, [k]]
            by_numerator = above.values * (path.factor(self.x, self.discrete) / path.denominator)[:, None]
            by_denominator = -below.values[:, : path.nf] * g / path.denominator[:, None]
            by_delay = (-self.x[:, None] * g)[:, : path.late]
            out[:, k, at : at + path.count] = np.hstack((by_numerator, by_denominator, by_delay))
            at += path.count
        return out.reshape(nf, *self.shape, self.free)

    def moved(self, step: FloatArray) -> Self | None:
        """After a step, unstable poles mirrored and delays at least zero; None if a value is infinite."""
        paths = []
        parts = np.split(step, np.cumsum([path.count for path in self.paths])[:-1])
        for path, own in zip(self.paths, parts, strict=True):
            above, below = path.bases(self.x)
            by_numerator, by_denominator, by_delay = np.split(own, [path.nb, path.nb + path.nf])
            moved = replace(
                path,
                numerator=path.numerator + above.values @ by_numerator,
                denominator=path.denominator + below.values[:, : path.nf] @ by_denominator,
                delay=max(path.delay + float(by_delay.sum()), 0.0),
            )
            if not np.isfinite(moved.numerator).all() or not np.abs(moved.denominator).min() > 0.0:
                return None
            paths.append(moved.stabilised(self.x, self.discrete) if self.stable else moved)
        return replace(self, paths=tuple(paths))

    def parameters(self, scale: float) -> tuple[FloatArray, FloatArray]:
        """Coefficients of falling powers and delays, path by path (p,), and their derivatives in `columns` (p, p).

        In units of s instead of x for a scale in rad/s.
        """
        theta, change = [], []
        for path in self.paths:
            above, below = path.bases(self.x)
            # G does not change if s is scaled; D stays monic
            up, down = scale ** np.arange(path.nf - path.nb + 1, path.nf + 1.0), scale ** np.arange(1.0, path.nf + 1.0)
            theta += [
                up * (above.powers() @ above.coefficients(path.numerator)),
                down * np.atleast_1d(np.poly(path.poles(self.x)).real)[1:],
            ]
            change += [up[:, None] * above.powers(), down[:, None] * below.powers()[1:, : path.nf]]
            if path.late:
                theta, change = [*theta, np.array([path.delay / scale])], [*change, np.array([[1.0 / scale]])]
        return np.concatenate(theta), scipy.linalg.block_diag(*change)


def unstable(poles: ComplexArray, discrete: bool) -> NDArray[np.bool_]:
    """Which poles are not strictly stable."""
    return np.asarray(np.abs(poles) >= 1.0 if discrete else poles.real >= 0.0)


def mirrored_poles(poles: ComplexArray, discrete: bool) -> ComplexArray:
    """Poles with unstable ones mirrored into the stable region."""
    poles, outside = poles.astype(complex), unstable(poles, discrete)
    poles[outside] = 1.0 / poles[outside].conj() if discrete else -poles[outside].conj()
    return poles
