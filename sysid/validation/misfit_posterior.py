"""Posterior of the relative error of a model's response, from the errors of its simulation line by line.

Stochastic embedding [Goodwin1992]: the error of the response is what the parameters can still change, plus a smooth
random function of the logarithm of the frequency, which stands for too low an order; what is left from line to line is
noise and nonlinear distortion, which is rough because the phases of the lines are. The size of both parts follows from
the data, by their marginal likelihood [Rasmussen2006, ch. 5].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.records.arrays import ComplexArray, FloatArray

OCTAVES = 1.2  # over which the error of a response changes: the width of a pair of poles beside a pair of zeros
NARROWER = (0.15, 0.4)  # tried besides: a response beside a resonance that the model lacks changes faster
UNLIKELY = 1e-3  # probability of a width that is left out
SIZES = tuple(
    10.0 ** np.arange(-2.0, 5.0)
)  # variances of the smooth part, over those of the rough part, that are tried
# powers of the frequency that the variance of the rough part may follow, relative to the response: friction distorts
# slow motion most; and the share of noise at the output, which a falling response makes larger
SLOPES = (-1.0, -2.0)
RISING_SHARES = (0.0, 0.003, 0.03)
RISING = 3.0  # power of the frequency of that share
NEGLIGIBLE = 1e-6  # weight of a hypothesis that is left out
RANK = 1e-6  # singular value of the sensitivities, relative to the largest, that counts as zero


@dataclass(frozen=True)
class Lines:
    """Errors of a model's simulation at lines of the input, relative to the model's response.

    Attributes:
        frequencies: Hz (n,).
        inputs: Outputs of the paths, relative to the root of the sum of their squared gains (n, nu).
        errors: Measured less simulated output, relative likewise (n,).
        sensitivities: Change of the simulated output per parameter direction, relative likewise (n, p).
        variances: Variance of the rough part (n,), where it can be seen apart from the smooth one; None where not.
        freedom: Degrees of freedom of these variances; 0 without them.
    """

    frequencies: FloatArray
    inputs: ComplexArray
    errors: ComplexArray
    sensitivities: ComplexArray
    variances: FloatArray | None
    freedom: float

    def __len__(self) -> int:
        """Number of lines."""
        return len(self.frequencies)

    def chosen(self, rows: np.ndarray) -> "Lines":
        """Some of the lines."""
        return Lines(
            self.frequencies[rows],
            self.inputs[rows],
            self.errors[rows],
            self.sensitivities[rows],
            None if self.variances is None else self.variances[rows],
            self.freedom,
        )


@dataclass(frozen=True)
class Hypotheses:
    """Posterior of the relative error at one frequency, one row for each hypothesis on its parts.

    Attributes:
        weights: Posterior probabilities (m,).
        means: Relative error of each path (m, nu).
        covariances: Of its real and imaginary part (m, nu, 2, 2).
        freedom: Degrees of freedom of the common scale.
    """

    weights: FloatArray
    means: ComplexArray
    covariances: FloatArray
    freedom: float

    def log_gain_quantile(self, path: int, probability: float) -> float:
        """Quantile of the logarithm of the true gain over the model's, of one path."""
        ratio = 1.0 + self.means[:, path]
        gain = np.maximum(np.abs(ratio), 1e-12)
        return self._quantile(path, probability, np.log(gain), ratio / gain**2)

    def phase_quantile(self, path: int, probability: float) -> float:
        """Quantile of the true phase less the model's, of one path, rad."""
        ratio = 1.0 + self.means[:, path]
        gain = np.maximum(np.abs(ratio), 1e-12)
        return self._quantile(path, probability, np.angle(ratio), 1j * ratio / gain**2)

    def _quantile(self, path: int, probability: float, centre: FloatArray, gradient: ComplexArray) -> float:
        """Quantile of a quantity with a centre (m,) and its gradient (m,) by real and imaginary part of the error."""
        along = np.stack((gradient.real, gradient.imag), axis=1)
        variance = np.einsum("mi,mij,mj->m", along, self.covariances[:, path], along)
        deviation = np.sqrt(np.maximum(variance, 1e-30))

        def excess(value: float) -> float:
            below = scipy.stats.t.cdf((value - centre) / deviation, self.freedom)
            return float(self.weights @ below) - probability

        reach = 40.0 * float(deviation.max()) + 1.0
        low, high = float(centre.min()) - reach, float(centre.max()) + reach
        if excess(low) >= 0.0 or excess(high) <= 0.0:
            # the tails of few degrees of freedom reach further than any use
            return low if probability < 0.5 else high
        return float(scipy.optimize.brentq(excess, low, high, xtol=1e-6))


@dataclass(frozen=True)
class _Whitened:
    """Lines in coordinates in which noise is white and the smooth part has independent entries.

    Attributes:
        values: Variance of each entry of the smooth part, for a size of one (2 n,).
        errors: (2 n,).
        basis: Orthonormal combinations of the sensitivities before the change of coordinates (2 n, q).
        cross: Covariance of real and imaginary part of each path at the frequency with the entries (nu, 2, 2 n).
        log_root: Logarithm of the determinant of the change of coordinates.
    """

    values: FloatArray
    errors: FloatArray
    basis: FloatArray
    cross: FloatArray
    log_root: float


def posterior(
    lines: Lines,
    frequency: float,
    sensitivities: ComplexArray,
    widths: Sequence[tuple[float, float]] = ((OCTAVES, 1.0),),
) -> Hypotheses:
    """Posterior of the relative error at a frequency.

    Args:
        lines: The lines about it.
        frequency: Hz, above 0.
        sensitivities: Relative change of the response of each path per parameter direction there (nu, p).
        widths: Octaves over which the smooth part may change there, and their probabilities.
    """
    weights, means, covariances = [], [], []
    for octaves, probability in widths:
        logarithms, of_means, of_covariances, freedom = _hypotheses(lines, frequency, sensitivities, octaves)
        relative = np.exp(logarithms - logarithms.max())
        weights.append(probability * relative / relative.sum())
        means.append(of_means)
        covariances.append(of_covariances)
    weight = np.concatenate(weights)
    kept = weight > NEGLIGIBLE * weight.sum()
    return Hypotheses(
        weight[kept] / weight[kept].sum(), np.concatenate(means)[kept], np.concatenate(covariances)[kept], freedom
    )


def width_probabilities(lines: Lines, frequency: float) -> list[tuple[float, float]]:
    """Octaves over which the smooth part of the errors changes about a frequency, and their probabilities.

    Lines near the frequency tell: beside a resonance that the model lacks the error changes faster than elsewhere.
    """
    nowhere = np.zeros((lines.inputs.shape[1], lines.sensitivities.shape[1]), dtype=complex)
    tried = (*NARROWER, OCTAVES)
    likelihoods = np.array(
        [scipy.special.logsumexp(_hypotheses(lines, frequency, nowhere, octaves)[0]) for octaves in tried]
    )
    probabilities = np.exp(likelihoods - likelihoods.max())
    probabilities /= probabilities.sum()
    return [pair for pair in zip(tried, probabilities.tolist(), strict=True) if pair[1] > UNLIKELY]


def _hypotheses(
    lines: Lines, frequency: float, sensitivities: ComplexArray, octaves: float
) -> tuple[FloatArray, ComplexArray, FloatArray, float]:
    """Log likelihoods (m,), means (m, nu), covariances (m, nu, 2, 2) and degrees of freedom of the errors of one width.

    A row for each shape of the rough part and each size of the smooth one.
    """
    scale = float(np.median(np.sum(np.abs(lines.inputs) ** 2, axis=1)))
    basis, to_basis = _orthonormal(_stacked(lines.sensitivities))
    at_frequency = np.stack((sensitivities.real, sensitivities.imag), axis=1) @ to_basis
    freedom = 2.0 * len(lines) - basis.shape[1] + lines.freedom
    prior, cross = _prior(lines, frequency, scale, octaves)
    # shapes of an unknown variance are about one
    rough = 1.0 if lines.variances is None else float(np.exp(np.mean(np.log(lines.variances))))
    logarithms, means, covariances = [], [], []
    for variances in _shapes(lines, frequency):
        whitened = _whiten(lines, basis, variances, prior, cross)
        for size in (0.0, *(rough * ratio for ratio in SIZES)):
            logarithm, mean, covariance = _at_size(whitened, size, scale, at_frequency, lines.freedom, freedom)
            if size == 0.0:
                # no smooth part is as probable beforehand as all sizes of it together
                logarithm += np.log(len(SIZES))
            logarithms.append(logarithm)
            means.append(mean)
            covariances.append(covariance)
    return np.array(logarithms), np.array(means), np.array(covariances), freedom


def _prior(lines: Lines, frequency: float, scale: float, octaves: float) -> tuple[FloatArray, FloatArray]:
    """Covariance of the smooth part of the lines (2 n, 2 n), and of each path at the frequency with it (nu, 2, 2 n)."""
    nu = lines.inputs.shape[1]
    at_frequency, unit = np.array([frequency]), np.eye(nu, dtype=complex)
    prior = _smooth_covariance(lines.frequencies, lines.inputs, lines.frequencies, lines.inputs, octaves)
    cross = []
    for j in range(nu):
        of_path = lines.inputs[:, [j]]
        cross.append(_smooth_covariance(at_frequency, unit[[j]][:, [j]], lines.frequencies, of_path, octaves))
    return prior / scale, np.array(cross) / scale


def _whiten(lines: Lines, basis: FloatArray, variances: FloatArray, prior: FloatArray, cross: FloatArray) -> _Whitened:
    """Change coordinates for variances of the rough part (n,)."""
    root = np.sqrt(np.concatenate((variances, variances)))
    values, vectors = np.linalg.eigh(prior / np.outer(root, root))
    onto = vectors.T / root
    return _Whitened(
        np.maximum(values, 0.0),
        onto @ _stacked(lines.errors[:, None])[:, 0],
        onto @ basis,
        cross @ onto.T,
        float(np.sum(np.log(root))),
    )


def _at_size(
    whitened: _Whitened,
    size: float,
    scale: float,
    at_frequency: FloatArray,
    prior_squares: float,
    freedom: float,
) -> tuple[float, ComplexArray, FloatArray]:
    """Logarithm of the marginal likelihood, mean of each path (nu,) and covariance (nu, 2, 2) for a size.

    Parameters have a flat prior, the common variance that of Jeffreys: generalised least squares, then the conditional
    mean of the smooth part [Rasmussen2006, eq. 2.41 to 2.45].
    """
    weight = 1.0 / (1.0 + size * whitened.values)
    basis, cross = whitened.basis, whitened.cross
    gram = basis.T @ (weight[:, None] * basis)
    inverse = np.linalg.inv(gram)
    theta = inverse @ (basis.T @ (weight * whitened.errors))
    remainder = whitened.errors - basis @ theta
    squares = float(remainder @ (weight * remainder)) + prior_squares
    mean = at_frequency @ theta + size * np.einsum("jci,i->jc", cross, weight * remainder)
    unexplained = at_frequency - size * np.einsum("jci,ip->jcp", cross, weight[:, None] * basis)
    smooth = size / scale * np.eye(2) - size**2 * np.einsum("jci,i,jdi->jcd", cross, weight, cross)
    of_basis = np.einsum("jcp,pq,jdq->jcd", unexplained, inverse, unexplained)
    logarithm = 0.5 * float(np.sum(np.log(weight))) - whitened.log_root
    logarithm -= 0.5 * float(np.linalg.slogdet(gram)[1])
    logarithm -= 0.5 * freedom * np.log(max(squares, np.finfo(float).tiny))
    return logarithm, mean[:, 0] + 1j * mean[:, 1], squares / freedom * (smooth + of_basis)


def _stacked(columns: ComplexArray) -> FloatArray:
    """Real parts above imaginary parts (2 n, m)."""
    return np.concatenate((columns.real, columns.imag))


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis (n, q) of columns (n, p), and the map (p, q) from the columns to it."""
    lengths = np.linalg.norm(columns, axis=0)
    lengths[lengths == 0.0] = 1.0
    left, values, right = np.linalg.svd(columns / lengths, full_matrices=False)
    kept = values > RANK * max(values[0], np.finfo(float).tiny) if len(values) else np.zeros(0, dtype=bool)
    return left[:, kept], (right[kept] / lengths).T / values[kept]


def _smooth_covariance(
    f: FloatArray, inputs: ComplexArray, other_f: FloatArray, other_inputs: ComplexArray, octaves: float
) -> FloatArray:
    """Covariance (2 n, 2 m) of real and imaginary parts of the smooth errors, which are independent between paths.

    Each part is a Matern process of order 5/2 in octaves [Rasmussen2006, eq. 4.17].
    """
    distance = np.sqrt(5.0) * np.abs(np.log2(f)[:, None] - np.log2(other_f)) / octaves
    kernel = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    product = inputs @ other_inputs.conj().T
    real, imaginary = kernel * product.real, kernel * product.imag
    return np.block([[real, -imaginary], [imaginary, real]])


def _shapes(lines: Lines, frequency: float) -> list[FloatArray]:
    """Variances of the rough part that are tried (n,), each with a geometric mean of one if they are not known."""
    if lines.variances is not None:
        return [lines.variances]
    relative = lines.frequencies / frequency
    shapes = []
    for slope in SLOPES:
        for share in RISING_SHARES:
            shape = relative**slope + share * relative**RISING
            shapes.append(shape / np.exp(np.mean(np.log(shape))))
    return shapes
