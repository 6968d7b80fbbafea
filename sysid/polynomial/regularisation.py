"""Regularised least squares: Gaussian priors of impulse responses, their hyper-parameters by empirical Bayes.

y = Phi theta + e with theta ~ N(0, s^2 P(eta)) and e ~ N(0, s^2 I). The hyper-parameters eta maximise the marginal
likelihood of y, s^2 eliminated; the estimate is the posterior mean [ChenOhlssonLjung2012]. Each kernel has its square
root in closed form, P = L L', so that neither P, which is nearly singular, nor the covariance of y is ever formed or
inverted: one triangle of [Phi y], O(N n^2), serves all evaluations, each of which is a QR of O(n^3) [ChenLjung2013].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, cast, get_args

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.polynomial.least_squares import scaled_triangle
from sysid.records.arguments import one_of
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

Kernel = Literal["tc", "dc", "ss"]

RATES = (0.03, 0.1, 0.3, 1.0)  # initial decay rates, in powers of e per sample
GAINS = (0.0, 8.0, 12.0)  # initial scales, as logarithms about that of the data
BOUNDS = {"scale": (-35.0, 35.0), "rate": (-8.0, 2.0), "correlation": (-5.0, 5.0)}
STEP = 1e-6  # of the hyper-parameters, for central differences of the closed-form roots


def checked_kernel(name: str, value: str | None) -> Kernel | None:
    """Check the option of an estimator that names a kernel, or None for no prior."""
    return None if value is None else cast(Kernel, one_of(name, value, get_args(Kernel)))


def kernel_root(kernel: Kernel, n: int, eta: FloatArray) -> FloatArray:
    """Square root L of a kernel P = L L', of shape (n, n), or (n, 2 n) for "ss".

    The hyperparameters eta are log c, log(-log l) and, for "dc" alone, artanh r.

    With lags i, j = 1..n and decay l: TC c l^max(i, j); DC c l^((i + j)/2) r^|i - j|; SS (stable spline) c (l^(i + j +
    max(i, j))/2 - l^(3 max(i, j))/6) [ChenOhlssonLjung2012, eq. 31, 37, 38].
    """
    scale, rate = np.exp(0.5 * eta[0]), np.exp(eta[1])
    lag = np.arange(1, n + 1)
    if kernel == "ss":
        return np.asarray(scale * _stable_spline_root(lag, rate))
    # DC is a first-order autoregression under an exponential envelope; TC is its case r = sqrt(l)
    if kernel == "dc":
        r, innovation = np.tanh(eta[2]), 1.0 / np.cosh(eta[2])
    else:
        r, innovation = np.exp(-0.5 * rate), np.sqrt(-np.expm1(-rate))
    distance = lag[:, None] - lag
    root = np.where(distance >= 0, r ** np.maximum(distance, 0), 0.0)
    # sqrt(1 - r^2), in forms without cancellation where r is near 1
    root[:, 1:] *= innovation
    return np.asarray(scale * np.exp(-0.5 * rate * lag)[:, None] * root)


def _stable_spline_root(lag: NDArray[np.int_], rate: float) -> FloatArray:
    """Square root (n, 2 n) of the SS kernel with c = 1: the covariance of integrated white noise at the times l^lag.

    Increments of the noise and of its integral between two times are independent of those elsewhere.
    """
    times = np.append(np.exp(-rate * lag), 0.0)
    step, later = times[:-1] - times[1:], np.where(lag[:, None] <= lag, 1.0, 0.0)
    gap = times[:-1, None] - times[:-1]
    # within a step the integral has a part of its own, with a twelfth of the step's third power as variance
    of_integral = np.sqrt(step / 12.0) * step * later
    of_noise = np.sqrt(step) * (gap + 0.5 * step) * later
    return np.hstack((of_noise, of_integral))


@dataclass(frozen=True, eq=False)
class Posterior:
    """Regularised estimate.

    Attributes:
        mean: Posterior mean of the coefficients (p,).
        covariance: Posterior covariance (p, p).
        variance: Variance of e.
        diagnostics: `hyper_parameters`, per block c s^2, l, and of "dc" r (blocks, 2 or 3); `effective_parameters`, the
            trace of the matrix from y to its fit; `evidence`, the logarithm of the marginal likelihood; `converged`.
    """

    mean: FloatArray
    covariance: FloatArray
    variance: float
    diagnostics: dict[str, Any]


def empirical_bayes(phi: FloatArray, target: FloatArray, sizes: Sequence[int], kernel: Kernel) -> Posterior:
    """Posterior of blocks of coefficients, each an impulse response with hyper-parameters of its own.

    The regressors (rows, p), of which there may be fewer than coefficients, belong to blocks of these sizes; the
    right-hand side (rows,) is not zero.
    """
    triangle, lengths = scaled_triangle(np.column_stack((phi, target)))
    return posterior_of_triangle(triangle, lengths, len(phi), float(target @ target), sizes, kernel)


def posterior_of_triangle(
    triangle: FloatArray, lengths: FloatArray, rows: int, power: float, sizes: Sequence[int], kernel: Kernel
) -> Posterior:
    """`empirical_bayes` from the triangle of [Phi y] with columns divided by their lengths, `power` that of y."""
    p = len(lengths) - 1
    # in units of the output, the bounds of the scales hold for data of any unit
    size = float(np.sqrt(power / rows))
    if not size > 0.0:
        raise SysidError("the squares of the output vanish: expected an output in a unit that gives it usual values")
    x, y = triangle[:, :p] * lengths[:p], triangle[:, p] * lengths[p]
    evidence = Evidence(x / size, y / size, rows, tuple(sizes), kernel)
    regressor_power = np.sum(x**2, axis=0) / size**2 / rows
    levels, bounds = [], []
    for begin, end in pairwise(np.cumsum([0, *sizes])):
        # scale of a response whose effect would be as large as the output
        level = -np.log(max(float(regressor_power[begin:end].mean()), 1e-300))
        levels.append(level)
        bounds += evidence.bounds(level)
    results = []
    for gain in GAINS:
        starts = []
        for rate in RATES:
            starts.append(np.concatenate([evidence.start(gain + level, rate) for level in levels]))
        # the likelihood has a maximum at noise alone, which a start at a small scale runs into
        best = min(starts, key=lambda eta: evidence(eta)[0])
        results.append(scipy.optimize.minimize(evidence, best, jac=True, method="L-BFGS-B", bounds=bounds))
    result = min(results, key=lambda minimum: float(minimum.fun))
    return evidence.posterior(result.x, size, bool(result.success))


@dataclass(frozen=True, eq=False)
class Evidence:
    """-2 times the logarithm of the marginal likelihood, s^2 at its best value, with its gradient.

    Attributes:
        x: Columns of the triangle of [Phi y] that belong to Phi (k, p).
        y: Its last column (k,).
        rows: Rows of Phi.
        sizes: Coefficients of each block.
        kernel: Kernel of all blocks.
    """

    x: FloatArray
    y: FloatArray
    rows: int
    sizes: tuple[int, ...]
    kernel: Kernel

    def start(self, scale: float, rate: float) -> FloatArray:
        """Hyper-parameters of one block from the logarithm of its scale and its decay rate; DC as TC."""
        if self.kernel != "dc":
            return np.array([scale, np.log(rate)])
        correlation = np.exp(-0.5 * rate)
        return np.array([scale, np.log(rate), np.arctanh(correlation)])

    def bounds(self, level: float) -> list[tuple[float, float]]:
        """Bounds of the hyper-parameters of one block, the scale about a level."""
        low, high = BOUNDS["scale"]
        out = [(low + level, high + level), BOUNDS["rate"]]
        return [*out, BOUNDS["correlation"]] if self.kernel == "dc" else out

    def __call__(self, eta: FloatArray) -> tuple[float, FloatArray]:
        """Criterion and gradient.

        With X the regressors, L the roots of all blocks, and T the triangle of [X L; I], the criterion is N log(least
        |y - X L w|^2 + |w|^2) + log det(L' X' X L + I), the determinant that of T' T [ChenLjung2013].
        """
        block_roots = self._roots(eta)
        roots = np.asarray(scipy.linalg.block_diag(*block_roots))
        triangle, weights, remainder = self._solution(roots)
        energy = remainder**2
        value = self.rows * np.log(energy) + 2.0 * float(np.sum(np.log(np.abs(np.diag(triangle)))))
        # slopes of both terms by the entries of L
        errors = self.y - self.x @ (roots @ weights)
        half = scipy.linalg.solve_triangular(triangle, (self.x @ roots).T, trans="T").T
        of_determinant = 2.0 * (self.x.T @ scipy.linalg.solve_triangular(triangle, half.T).T)
        by_root = of_determinant - 2.0 * self.rows / energy * np.outer(self.x.T @ errors, weights)
        return float(value), self._gradient(eta, block_roots, by_root)

    def _gradient(self, eta: FloatArray, block_roots: Sequence[FloatArray], by_root: FloatArray) -> FloatArray:
        """Gradient by the hyper-parameters from the slopes by the entries of L."""
        count = len(eta) // len(self.sizes)
        gradient = np.empty(len(eta))
        row = column = 0
        for block, (n, root) in enumerate(zip(self.sizes, block_roots, strict=True)):
            slopes = by_root[row : row + n, column : column + root.shape[1]]
            own_eta = eta[block * count : (block + 1) * count]
            # L is proportional to the root of the scale
            gradient[block * count] = 0.5 * float(np.sum(slopes * root))
            for k in range(1, count):
                step = STEP * np.eye(count)[k]
                upper = kernel_root(self.kernel, n, own_eta + step)
                lower = kernel_root(self.kernel, n, own_eta - step)
                gradient[block * count + k] = float(np.sum(slopes * (upper - lower))) / (2.0 * STEP)
            row, column = row + n, column + root.shape[1]
        return gradient

    def posterior(self, eta: FloatArray, size: float, converged: bool) -> Posterior:
        """Posterior at hyper-parameters, the right-hand side in units of `size`."""
        roots = np.asarray(scipy.linalg.block_diag(*self._roots(eta)))
        triangle, weights, remainder = self._solution(roots)
        half = scipy.linalg.solve_triangular(triangle, roots.T, trans="T").T
        variance = size**2 * remainder**2 / self.rows
        by_block = eta.reshape(len(self.sizes), -1)
        # the variance in units of the data first: the product with a large scale would overflow
        scales, decays = np.exp(by_block[:, 0]) * (variance / size**2), np.exp(-np.exp(by_block[:, 1]))
        hyper_parameters = np.column_stack((scales, decays))
        if self.kernel == "dc":
            hyper_parameters = np.column_stack((hyper_parameters, np.tanh(by_block[:, 2])))
        # terms of the normal density that do not depend on eta, in the units of the data
        constant = self.rows * (1.0 + np.log(2.0 * np.pi * size**2 / self.rows))
        diagnostics = {
            "hyper_parameters": hyper_parameters,
            "effective_parameters": float(np.sum((self.x @ half) ** 2)),
            "evidence": -0.5 * (self(eta)[0] + float(constant)),
            "converged": converged,
        }
        return Posterior(roots @ weights, variance / size**2 * (half @ half.T), variance, diagnostics)

    def _roots(self, eta: FloatArray) -> list[FloatArray]:
        """Root of each block's kernel."""
        by_block = zip(self.sizes, eta.reshape(len(self.sizes), -1), strict=True)
        return [kernel_root(self.kernel, n, own_eta) for n, own_eta in by_block]

    def _solution(self, roots: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Triangle T of [Phi L; I], the coefficients w of L w, and the length of the remainder."""
        k, m = len(self.y), roots.shape[1]
        stacked = np.zeros((k + m, m + 1))
        stacked[:k, :m] = self.x @ roots
        stacked[:k, m] = self.y
        stacked[k + np.arange(m), np.arange(m)] = 1.0
        triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
        weights = scipy.linalg.solve_triangular(triangle[:m, :m], triangle[:m, m])
        # its logarithm is taken
        remainder = max(abs(float(triangle[m, m])), float(np.finfo(float).tiny))
        return triangle[:m, :m], weights, remainder
