"""Least squares over neighbouring lines: a local polynomial or rational model of response and transient."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.frequency.spectra import SILENT
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

MOST_TESTED = 40  # frequencies at which a response is tested, at most
SIGNIFICANT = 0.01  # p-value of such tests, of all frequencies together
UPPER_95 = 0.975  # probability at the upper end of a 95 % interval
SPARE = 6  # equations beyond the unknowns, by default: they show the variance of the noise
ADDED = 2  # degree of the denominators that show whether polynomials suffice
DEPENDENT = (
    1e-8  # singular value of the scaled regressors, relative to the largest, of a response that is not determined
)


@dataclass(frozen=True)
class Lines:
    """Transforms of one experiment, of unit power per sample, without 0 Hz.

    Attributes:
        frequencies: Hz (n,).
        inputs: (n, nu).
        outputs: (n, ny).
        numbers: Number of each line, the same for its image past 0 Hz or Nyquist (n,).
        is_odd: Whether the number of samples is odd, so that no line lies at Nyquist.
    """

    frequencies: FloatArray
    inputs: ComplexArray
    outputs: ComplexArray
    numbers: NDArray[np.int_]
    is_odd: bool

    @classmethod
    def of(cls, experiment: IOData) -> "Lines":
        """Transform an experiment."""
        n = len(experiment)
        inner = slice(1, (n + 1) // 2)
        root = np.sqrt(n)
        return cls(
            scipy.fft.rfftfreq(n, experiment.dt)[inner],
            scipy.fft.rfft(experiment.u, axis=0)[inner] / root,
            scipy.fft.rfft(experiment.y, axis=0)[inner] / root,
            np.arange(1, (n + 1) // 2),
            n % 2 == 1,
        )

    def about(self, frequency: float, width: int) -> "Lines":
        """The 2 width + 1 lines about a frequency, past both ends of the spectrum too.

        There they are those of negative frequencies and beyond Nyquist, where all transforms are the conjugates: a
        window that ended at the first line would extrapolate the response at its edge.
        """
        all_lines = self._circle
        f = all_lines.frequencies
        nearest = int(np.clip(np.searchsorted(f, frequency), 1, len(f) - 1))
        if frequency - f[nearest - 1] <= f[nearest] - frequency:
            nearest -= 1
        rows = slice(nearest - width, nearest + width + 1)
        signals = all_lines.inputs[rows], all_lines.outputs[rows]
        return Lines(f[rows], *signals, all_lines.numbers[rows], self.is_odd)

    @cached_property
    def strongest(self) -> FloatArray:
        """Largest power of a line of each input (nu,)."""
        return np.asarray(np.max(np.abs(self.inputs) ** 2, axis=0))

    @cached_property
    def _circle(self) -> "Lines":
        """The lines, their conjugates at negative frequencies and those between Nyquist and twice Nyquist."""
        # evenly spaced lines, but for 0 Hz and Nyquist between them: the last one and its image surround the latter
        nyquist = self.frequencies[-1] + (0.5 if self.is_odd else 1.0) * self.frequencies[0]
        back = self.frequencies[::-1]
        f = np.concatenate((-back, self.frequencies, 2.0 * nyquist - back))
        inputs, outputs = (np.concatenate((z[::-1].conj(), z, z[::-1].conj())) for z in (self.inputs, self.outputs))
        numbers = np.concatenate((self.numbers[::-1], self.numbers, self.numbers[::-1]))
        return Lines(f, inputs, outputs, numbers, self.is_odd)


@dataclass(frozen=True)
class _Regression:
    """Equations of the lines about a frequency.

    Attributes:
        regressors: Of response and transients (n, p).
        outputs: (n, ny).
        distances: From the frequency, scaled (n,).
        images: Pairs of rows that are conjugates of each other, whose noise is the same (m, 2).
    """

    regressors: ComplexArray
    outputs: ComplexArray
    distances: FloatArray
    images: NDArray[np.int_]


@dataclass(frozen=True)
class LocalFit:
    """Least squares over the lines about a frequency.

    Attributes:
        records: The lines of each experiment.
        degree: Of the polynomials of response and transients.
        denominator: Degree of the denominator.
    """

    records: tuple[Lines, ...]
    degree: int
    denominator: int

    @property
    def unknowns(self) -> int:
        """Unknowns of an output."""
        nu = self.records[0].inputs.shape[1]
        return (self.degree + 1) * (nu + len(self.records)) + self.denominator

    def spare(self, width: int) -> int:
        """Equations of an output beyond its unknowns."""
        return len(self.records) * (2 * width + 1) - self.unknowns

    def default_half_width(self) -> int:
        """Fewest lines on either side that leave `SPARE` equations, and as many as there are outputs."""
        ny = self.records[0].outputs.shape[1]
        width = 1
        while self.spare(width) < SPARE + ny - 1:
            width += 1
        return width

    def check(self, width: int) -> None:
        """Refuse a width with too few equations, or with more lines than an experiment has."""
        ny = self.records[0].outputs.shape[1]
        if self.spare(width) < ny:
            raise SysidError(
                f"half_width = {width} gives {len(self.records) * (2 * width + 1)} equations for {self.unknowns} "
                f"unknowns per output, expected {self.unknowns + ny} at least: use a larger one, or a lower degree"
            )
        fewest = min(len(record.frequencies) for record in self.records)
        if 2 * width + 1 > fewest:
            raise SysidError(
                f"half_width = {width} takes {2 * width + 1} lines, the shortest experiment has {fewest}: use more "
                "samples, a lower degree or a longer period"
            )

    def solve_all(self, f: FloatArray, width: int) -> tuple[ComplexArray, FloatArray, ComplexArray]:
        """Response (nf, ny, nu), its covariance (nf, ny, nu, 2, 2), and that of the noise (nf, ny, ny); NaN if open."""
        ny, nu = self.records[0].outputs.shape[1], self.records[0].inputs.shape[1]
        response = np.full((len(f), ny, nu), np.nan, dtype=complex)
        covariance = np.full((len(f), ny, nu, 2, 2), np.nan)
        noise = np.full((len(f), ny, ny), np.nan, dtype=complex)
        for k, frequency in enumerate(f):
            fit = self.solve(float(frequency), width)
            if fit is not None:
                response[k], covariance[k], noise[k] = fit
        return response, covariance, noise

    def solve(self, frequency: float, width: int) -> tuple[ComplexArray, FloatArray, ComplexArray] | None:
        """Response (ny, nu), covariance of its parts (ny, nu, 2, 2) and of the noise (ny, ny) at a frequency.

        None where the inputs do not determine the response.
        """
        if self._is_silent(frequency, width):
            return None
        about = self._regression(frequency, width)
        nu, ny = self.records[0].inputs.shape[1], self.records[0].outputs.shape[1]
        response = np.empty((ny, nu), dtype=complex)
        weights = np.empty((ny, nu, len(about.outputs)), dtype=complex)
        errors = np.empty_like(about.outputs)
        # the constant terms of the polynomials of the response
        places = np.arange(nu) * (self.degree + 1)
        for i in range(ny):
            columns, y = about.regressors, about.outputs[:, i]
            if self.denominator:
                columns = np.hstack((columns, _of_denominator(y, about.distances, self.denominator)))
            lengths = np.linalg.norm(columns, axis=0)
            if (lengths[places] == 0.0).any():
                return None
            lengths[lengths == 0.0] = 1.0
            left, values, right = np.linalg.svd(columns / lengths, full_matrices=False)
            kept = values > DEPENDENT * values[0]
            inverse = right[kept].conj().T / values[kept] / lengths[:, None]
            # a combination of inputs that has no effect leaves the response open
            if not kept.all() and np.abs(right[~kept][:, places]).max() > np.sqrt(DEPENDENT):
                return None
            theta = inverse @ (left[:, kept].conj().T @ y)
            errors[:, i] = y - columns @ theta
            response[i] = theta[places]
            weights[i] = inverse[places] @ left[:, kept].conj().T
        noise = errors.T @ errors.conj() / self.spare(width)
        widened = noise.diagonal().real * self._few_values(len(about.images), width)
        return response, _covariance(weights, about.images) * widened[:, None, None, None], noise

    def _few_values(self, images: int, width: int) -> float:
        """Factor on variances from lines of which some are images of others, and so tell less of the noise."""
        spare = 2.0 * self.spare(width)
        fewer = max(spare - 2.0 * images, 1.0)
        return float(scipy.stats.t.ppf(UPPER_95, fewer) / scipy.stats.t.ppf(UPPER_95, spare)) ** 2

    def _is_silent(self, frequency: float, width: int) -> bool:
        """Whether an input has no power but rounding at all lines about a frequency, in any experiment."""
        whole, near = np.zeros((2, self.records[0].inputs.shape[1]))
        for record in self.records:
            whole = np.maximum(whole, record.strongest)
            near = np.maximum(near, record.about(frequency, width).strongest)
        return bool((near <= SILENT * whole).any())

    def _regression(self, frequency: float, width: int) -> _Regression:
        """Equations of the lines about a frequency."""
        powers = np.arange(self.degree + 1)
        count = self.degree + 1
        # the polynomial of the response, which all experiments share, needs one scale of frequency
        reach = max(float(record.frequencies[width] - record.frequencies[0]) for record in self.records)
        regressors, outputs, distances, images = [], [], [], []
        for k, record in enumerate(self.records):
            near = record.about(frequency, width)
            r = (near.frequencies - frequency) / reach
            terms = r[:, None] ** powers
            of_response = near.inputs[:, :, None] * terms[:, None, :]
            of_transients = np.zeros((len(r), len(self.records), count))
            of_transients[:, k] = terms
            regressors.append(np.hstack((of_response.reshape(len(r), -1), of_transients.reshape(len(r), -1))))
            outputs.append(near.outputs)
            distances.append(r)
            first, second = np.nonzero(np.triu(near.numbers[:, None] == near.numbers, 1))
            images.append(k * len(r) + np.column_stack((first, second)))
        return _Regression(np.vstack(regressors), np.vstack(outputs), np.concatenate(distances), np.concatenate(images))

    def p_of_polynomials(self, frequency: float, width: int) -> float:
        """Least p-value of an output of the hypothesis that polynomials suffice, and denominators explain nothing."""
        about = self._regression(frequency, width)
        phi, y, distances = about.regressors, about.outputs, about.distances
        basis = _orthonormal_basis(phi)
        least = 1.0
        for i in range(y.shape[1]):
            # the output without noise, which would explain itself
            fitted = basis @ (basis.conj().T @ y[:, i])
            whole = np.hstack((phi, _of_denominator(fitted, distances, ADDED)))
            rational = _orthonormal_basis(whole)
            freedom = len(y) - len(about.images) - rational.shape[1]
            added = rational.shape[1] - basis.shape[1]
            if freedom < ADDED or added < 1:
                continue
            left = _squares_left(basis, y[:, i])
            explained = left - _squares_left(rational, y[:, i])
            ratio = explained / added / max((left - explained) / freedom, np.finfo(float).tiny)
            # complex equations and unknowns count twice
            least = min(least, float(scipy.stats.f.sf(ratio, 2 * added, 2 * freedom)) * y.shape[1])
        return least

    def of_constant(self, frequency: float, width: int) -> tuple[float, float, float]:
        """What a response that is constant over the lines about a frequency leaves beyond what polynomials leave.

        Returns:
            Of the output with the least p-value: the p-value of "constant", the ratio of the powers of the noise, that
            beside a constant over that beside polynomials, and their difference over the power of the output.
        """
        about = self._regression(frequency, width)
        phi, y = about.regressors, about.outputs
        nu, count = self.records[0].inputs.shape[1], self.degree + 1
        varying = [i * count + power for i in range(nu) for power in range(1, count)]
        constant = _orthonormal_basis(np.delete(phi, varying, axis=1))
        polynomial = _orthonormal_basis(phi)
        freedom = len(y) - len(about.images) - polynomial.shape[1]
        added = polynomial.shape[1] - constant.shape[1]
        if freedom < 1 or added < 1:
            return 1.0, 1.0, 0.0
        of_outputs = []
        for i in range(y.shape[1]):
            left = max(_squares_left(polynomial, y[:, i]), np.finfo(float).tiny)
            explained = max(_squares_left(constant, y[:, i]) - left, 0.0)
            # complex equations and unknowns count twice
            p_value = float(scipy.stats.f.sf(explained / added / (left / freedom), 2 * added, 2 * freedom))
            ratio = (left + explained) / (freedom + added) / (left / freedom)
            share = explained / max(float(np.sum(np.abs(y[:, i]) ** 2)), np.finfo(float).tiny)
            of_outputs.append((p_value * y.shape[1], ratio, share))
        return min(of_outputs)


def tested_rows(count: int) -> NDArray[np.int_]:
    """Places of the frequencies at which a response is tested: all of few, else `MOST_TESTED` spread over them."""
    return np.arange(count) if count <= MOST_TESTED else np.linspace(0, count - 1, MOST_TESTED).astype(int)


def where_in_words(hz: FloatArray) -> str:
    """One frequency, or the first and last of several (n,), in words."""
    return f"at {hz[0]:.3g} Hz" if len(hz) == 1 else f"from {hz[0]:.3g} to {hz[-1]:.3g} Hz"


def _covariance(weights: ComplexArray, images: NDArray[np.int_]) -> FloatArray:
    """Covariance of real and imaginary part (..., 2, 2) of weighted sums of the noise of lines, weights (..., n).

    The noise of a line is circular. That of its image is the conjugate: together they make the parts unlike, and at
    0 Hz and Nyquist the sum real.
    """
    variance = np.sum(np.abs(weights) ** 2, axis=-1)
    of_images = 2.0 * np.sum(weights[..., images[:, 0]] * weights[..., images[:, 1]], axis=-1)
    # the mean of the square of the sum is no larger than that of its absolute value, but for rounding
    size = np.abs(of_images)
    of_images *= np.where(size > variance, variance / np.where(size > variance, size, 1.0), 1.0)
    covariance = np.empty((*variance.shape, 2, 2))
    covariance[..., 0, 0] = 0.5 * (variance + of_images.real)
    covariance[..., 1, 1] = 0.5 * (variance - of_images.real)
    covariance[..., 0, 1] = covariance[..., 1, 0] = 0.5 * of_images.imag
    return covariance


def left_by_rational(u: ComplexArray | FloatArray, y: ComplexArray, distances: FloatArray, degree: int) -> float:
    """Sum of squares of an output (n,) that no rational function of the distances, times an input (n,), explains.

    Numerator and denominator have the degree; distances are scaled, so that the denominator is one at zero.
    """
    numerator = u[:, None] * distances[:, None] ** np.arange(degree + 1)
    columns = np.hstack((numerator, _of_denominator(y, distances, degree))).astype(np.complex128)
    return _squares_left(_orthonormal_basis(columns), y)


def _of_denominator(y: ComplexArray, distances: FloatArray, degree: int) -> ComplexArray:
    """Regressors (n, degree) of a common denominator: Y = N U + T - (D - 1) Y."""
    return np.asarray(-y[:, None] * distances[:, None] ** np.arange(1, degree + 1))


def _orthonormal_basis(columns: ComplexArray) -> ComplexArray:
    """Orthonormal basis (n, r) of what columns (n, p) span beyond rounding."""
    lengths = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    return np.asarray(left[:, values > DEPENDENT * max(values[0], np.finfo(float).tiny)])


def _squares_left(basis: ComplexArray, y: ComplexArray) -> float:
    """Sum of squares of a signal (n,) beyond what a basis (n, r) explains."""
    return float(np.sum(np.abs(y - basis @ (basis.conj().T @ y)) ** 2))
