"""Transfer functions on the grid of a measured response, in polynomials orthogonal on it."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.records.arrays import ComplexArray, FloatArray

GAIN_FLOOR = 1e-6  # of the response, relative to its peak, in the weights of the denominator's polynomials


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
                along_lower = (vectors[:, : k + 1].conj().T @ v).real
                recurrence[: k + 1, k] += along_lower
                v = v - vectors[:, : k + 1] @ along_lower
            recurrence[k + 1, k] = np.linalg.norm(v)
            vectors[:, k + 1] = v / recurrence[k + 1, k]
        return OrthogonalPolynomials(np.asarray(vectors / weights[:, None]), recurrence, weights)

    def coefficients(self, values: ComplexArray) -> FloatArray:
        """Coefficients (n + 1,) of the polynomial with some values on the grid."""
        weighted = self.values * self.weights[:, None]
        return np.asarray((weighted.conj().T @ (values * self.weights)).real)

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
        rising = np.zeros((n + 1, n + 1))
        rising[0, 0] = self.values[0, 0].real
        for k in range(n):
            # multiplication with x shifts the coefficients by one power
            shifted = np.roll(rising[:, k], 1) - rising[:, : k + 1] @ self.recurrence[: k + 1, k]
            rising[:, k + 1] = shifted / self.recurrence[k + 1, k]
        return rising[::-1]


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
        searched: Whether the delay is a parameter.
    """

    numerator: ComplexArray
    denominator: ComplexArray
    nb: int
    nf: int
    weights: FloatArray
    delay: float
    searched: bool

    @property
    def count(self) -> int:
        """Number of parameters."""
        return self.nb + self.nf + self.searched

    def factor(self, x: ComplexArray, discrete: bool) -> ComplexArray:
        """Response of the delay, which N / D is multiplied with (nf,).

        In discrete time it has the powers of z by which B(q)/F(q), of rising powers of 1/z, differs from N / D too.
        """
        if discrete:
            return np.asarray(x ** (self.nf - self.nb + 1 - self.delay))
        return np.asarray(np.exp(-x * self.delay))

    def bases(self, x: ComplexArray) -> tuple[OrthogonalPolynomials, OrthogonalPolynomials]:
        """Polynomial bases of numerator and denominator, orthogonal over the frequencies with the fit's weights."""
        size = np.abs(self.denominator)
        numerators = OrthogonalPolynomials.on(x, self.weights / size, self.nb - 1)
        # a change dD moves the response by G dD / D; a floor of the gain, for the response may vanish
        gain = np.abs(self.numerator) / size
        weights = self.weights * np.maximum(gain, GAIN_FLOOR * gain.max()) / size
        denominators = OrthogonalPolynomials.on(x, weights, self.nf)
        return numerators, denominators

    def with_numerator(self, x: ComplexArray, g: ComplexArray) -> "Fraction":
        """The path with the numerator that fits values of N / D best, the denominator kept."""
        numerators = OrthogonalPolynomials.on(x, self.weights / np.abs(self.denominator), self.nb - 1)
        table = numerators.values * (self.weights / self.denominator)[:, None]
        target = g * self.weights
        # real coefficients: real and imaginary part are one equation each
        rows = np.vstack((table.real, table.imag))
        coefficients = np.linalg.lstsq(rows, np.concatenate((target.real, target.imag)), rcond=None)[0]
        return replace(self, numerator=numerators.values @ coefficients)

    def with_poles(self, x: ComplexArray, poles: ComplexArray) -> "Fraction":
        """The path with other poles, all of them."""
        denominator = np.ones(len(x), dtype=complex)
        for pole in poles:
            denominator = denominator * (x - pole)
        return replace(self, denominator=denominator)

    def refitted(self, x: ComplexArray, g: ComplexArray, stable: bool, discrete: bool) -> "Fraction":
        """The path after a step of linear least squares on N - D g, weighted by the last D [SanathananKoerner1963]."""
        numerators, denominators = self.bases(x)
        # D stays monic: only the polynomials below its degree are added to it
        lower = denominators.values[:, : self.nf]
        scaled = (self.weights / np.abs(self.denominator))[:, None]
        table = np.hstack((numerators.values, -lower * g[:, None], (self.denominator * g)[:, None])) * scaled
        rows = np.vstack((table.real, table.imag))
        lengths = np.linalg.norm(rows, axis=0)
        scaled_change = np.linalg.lstsq(rows[:, :-1] / lengths[:-1], rows[:, -1], rcond=None)[0]
        change = scaled_change / lengths[:-1]
        refitted = replace(self, denominator=self.denominator + lower @ change[self.nb :])
        if stable:
            refitted = refitted.stabilised(x, discrete)
        return refitted.with_numerator(x, g)

    def stabilised(self, x: ComplexArray, discrete: bool) -> "Fraction":
        """The path with unstable poles mirrored into the stable region."""
        poles = self.poles(x)
        if not unstable(poles, discrete).any():
            return self
        return self.with_poles(x, mirrored_poles(poles, discrete))

    def poles(self, x: ComplexArray) -> ComplexArray:
        """Poles in units of x."""
        _, denominators = self.bases(x)
        return denominators.roots(denominators.coefficients(self.denominator))


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
        flat = []
        for path in self.paths:
            flat.append(path.factor(self.x, self.discrete) * path.numerator / path.denominator)
        return np.stack(flat, axis=-1).reshape(-1, *self.shape)

    def columns(self) -> ComplexArray:
        """Derivatives in numerator, denominator and delay, path by path (nf, ny, nu, p)."""
        nf, response = len(self.x), self.response().reshape(len(self.x), -1)
        derivatives = np.zeros((nf, len(self.paths), self.free), dtype=complex)
        begin = 0
        for k, path in enumerate(self.paths):
            numerators, denominators = path.bases(self.x)
            g = response[:, [k]]
            by_numerator = numerators.values * (path.factor(self.x, self.discrete) / path.denominator)[:, None]
            by_denominator = -denominators.values[:, : path.nf] * g / path.denominator[:, None]
            # no column where the delay is known
            by_delay = (-self.x[:, None] * g)[:, : path.searched]
            derivatives[:, k, begin : begin + path.count] = np.hstack((by_numerator, by_denominator, by_delay))
            begin += path.count
        return derivatives.reshape(nf, *self.shape, self.free)

    def moved(self, step: FloatArray) -> Self | None:
        """After a step, unstable poles mirrored and delays at least zero; None if a value is infinite."""
        paths = []
        steps = np.split(step, np.cumsum([path.count for path in self.paths])[:-1])
        for path, step_of_path in zip(self.paths, steps, strict=True):
            numerators, denominators = path.bases(self.x)
            numerator_step, denominator_step, delay_step = np.split(step_of_path, [path.nb, path.nb + path.nf])
            moved = replace(
                path,
                numerator=path.numerator + numerators.values @ numerator_step,
                denominator=path.denominator + denominators.values[:, : path.nf] @ denominator_step,
                delay=max(path.delay + float(delay_step.sum()), 0.0),
            )
            # a pole on a frequency of the grid; the comparison refuses NaN too
            if not np.isfinite(moved.numerator).all() or not np.abs(moved.denominator).min() > 0.0:
                return None
            if self.stable:
                moved = moved.stabilised(self.x, self.discrete)
            paths.append(moved)
        return replace(self, paths=tuple(paths))

    def parameters(self, scale: float) -> tuple[FloatArray, FloatArray]:
        """Coefficients of falling powers and delays, path by path (p,), and their derivatives in `columns` (p, p).

        In units of s instead of x for a scale in rad/s.
        """
        theta, change = [], []
        for path in self.paths:
            numerators, denominators = path.bases(self.x)
            # G does not change if s is scaled; D stays monic
            b_scale = scale ** np.arange(path.nf - path.nb + 1, path.nf + 1.0)
            f_scale = scale ** np.arange(1.0, path.nf + 1.0)
            b = numerators.powers() @ numerators.coefficients(path.numerator)
            # from the poles, which keep their digits where powers over decades lose them
            f = np.atleast_1d(np.poly(path.poles(self.x)).real)[1:]
            theta += [b_scale * b, f_scale * f]
            change += [b_scale[:, None] * numerators.powers(), f_scale[:, None] * denominators.powers()[1:, : path.nf]]
            if path.searched:
                theta.append(np.array([path.delay / scale]))
                change.append(np.array([[1.0 / scale]]))
        return np.concatenate(theta), scipy.linalg.block_diag(*change)


def unstable(poles: ComplexArray, discrete: bool) -> NDArray[np.bool_]:
    """Which poles are not strictly stable."""
    if discrete:
        return np.asarray(np.abs(poles) >= 1.0)
    return np.asarray(poles.real >= 0.0)


def mirrored_poles(poles: ComplexArray, discrete: bool) -> ComplexArray:
    """Poles with unstable ones mirrored into the stable region."""
    mirrored, outside = poles.astype(complex), unstable(poles, discrete)
    mirrored[outside] = 1.0 / mirrored[outside].conj() if discrete else -mirrored[outside].conj()
    return mirrored
