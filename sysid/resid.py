"""Residual tests: are the prediction errors white, and independent of the input?"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2, norm

from sysid.arrays import FloatArray, lock
from sysid.autoregression import autoregression
from sysid.correlation import covariance_function
from sysid.data import IOData
from sysid.errors import SysidError
from sysid.estimate import Estimate
from sysid.residuals import residuals
from sysid.state_space import StateSpace

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ResidualTest:
    """Correlations of the residuals, with bounds and tests.

    Attributes:
        residuals: One-step prediction errors behind the initialisation window (N, ny).
        lags: 0, 1, ..., (lags + 1,).
        autocorrelation: Normalised R_e (lags + 1, ny, ny).
        cross_lags: -lags, ..., lags (2 lags + 1,).
        cross_correlation: Normalised R_eu (2 lags + 1, ny, nu): e(t + tau) with u(t); correlation at tau > 0 means
            dynamics not modelled, at tau < 0 feedback.
        level: Confidence level of bounds and tests.
        whiteness_bound: Bound on the autocorrelation at every lag but zero: 2.58/sqrt(N) at 99 %.
        independence_bound: Bound on the cross-correlation per pair (ny, nu), from the correlations of input and
            residual.
        whiteness_p: p-value per output (ny,) of N sum r(tau)^2, tau = 1..lags (Ljung and Box's form).
        independence_p: p-value per pair (ny, nu) of the quadratic form of r(tau), tau = 0..lags.
        outside_whiteness: Number of lags 1..lags outside the bound, per output (ny,).
        outside_independence: Number of lags 0..lags outside the bound, per pair (ny, nu).
        output_names: One name per output.
        input_names: One name per input.
    """

    residuals: FloatArray
    lags: NDArray[np.int_]
    autocorrelation: FloatArray
    cross_lags: NDArray[np.int_]
    cross_correlation: FloatArray
    level: float
    whiteness_bound: float
    independence_bound: FloatArray
    whiteness_p: FloatArray
    independence_p: FloatArray
    outside_whiteness: NDArray[np.int_]
    outside_independence: NDArray[np.int_]
    output_names: tuple[str, ...] = field(default=(), kw_only=True)
    input_names: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Lock."""
        for attribute, value in list(self.__dict__.items()):
            if isinstance(value, np.ndarray):
                object.__setattr__(self, attribute, lock(value))

    @property
    def white(self) -> BoolArray:
        """Whether whiteness stands at the level, per output (ny,)."""
        return np.asarray(self.whiteness_p >= 1.0 - self.level)

    @property
    def independent(self) -> BoolArray:
        """Whether independence of past inputs stands at the level, per pair (ny, nu)."""
        return np.asarray(self.independence_p >= 1.0 - self.level)

    @property
    def passed(self) -> bool:
        """Whether every output is white and every pair independent."""
        return bool(self.white.all() and self.independent.all())


def resid(estimate: Estimate | StateSpace, data: IOData, *, lags: int = 25, level: float = 0.99) -> ResidualTest:
    """Test the one-step prediction errors of a model on data [Ljung1999, sec. 16.6; LjungBox1978].

    Under the null hypothesis r_e(tau) ~ N(0, 1/N), and r_eu(tau) is normal with covariance
    sum_k r_e(k) r_u(k + tau - s) / N between lags tau and s [Ljung1999, sec. 16.6]. Means are removed first. On the
    data that a model was fitted to the tests are conservative, since fitted parameters use up degrees of freedom.

    Args:
        estimate: The estimate, or the model itself.
        data: Inputs and outputs, the fitted ones or fresh ones.
        lags: Largest lag.
        level: Confidence level, between 0 and 1.

    Returns:
        Correlations, bounds, p-values and flags.

    Raises:
        SysidError: Channels that do not fit the model, lags or level out of range, residuals that vanish.
    """
    if not 0.0 < level < 1.0:
        raise SysidError(f"level must lie between 0 and 1, got {level!r}")
    errors = residuals(estimate, data)[data.window :]
    u = data.u[data.window :]
    n, ny = errors.shape
    nu = u.shape[1]
    if isinstance(lags, bool) or not isinstance(lags, int | np.integer) or not 1 <= lags < n // 2:
        raise SysidError(f"lags must be a whole number from 1 to {n // 2 - 1}, got {lags!r}")
    largest = float(np.abs(errors).max())
    if not np.isfinite(largest) or largest <= 1e-14 * np.abs(data.y).max():
        raise SysidError("the residuals vanish or are not finite: there is nothing to test")
    # an unstable predictor's residuals may be too large to square
    errors_scaled = errors / largest
    e, v = errors_scaled - errors_scaled.mean(axis=0), u - u.mean(axis=0)
    e_size, v_size = e.std(axis=0), v.std(axis=0)
    if (e_size <= 1e-14).any():
        raise SysidError("the residuals of an output vanish beside those of another: there is nothing to test")
    if (v_size == 0.0).any():
        raise SysidError("an input is constant: independence of it cannot be tested")
    auto = covariance_function([e], [e], lags)[lags:] / (e_size[:, None] * e_size)
    cross = covariance_function([e], [v], lags) / (e_size[:, None] * v_size)
    z = float(norm.ppf(0.5 + 0.5 * level))
    single = np.einsum("kii->ki", auto)[1:]
    box = n * (n + 2) * np.sum(single**2 / (n - np.arange(1, lags + 1))[:, None], axis=0)

    bound, p_cross = np.empty((ny, nu)), np.empty((ny, nu))
    for i in range(ny):
        whitener, r_e = autoregression(e[:, i], lags)
        white_e = lfilter(whitener, [1.0], e[:, i])[lags:, None]
        reach = len(r_e) - 1
        for j in range(nu):
            r_u = covariance_function([v[:, [j]]], [v[:, [j]]], reach)[reach:, 0, 0] / v_size[j] ** 2
            # the sum is a spectrum's integral and positive, but the sample correlations in it are not exact
            variance = max(r_u[0] * r_e[0] + 2.0 * float(r_u[1:] @ r_e[1:]), 1.0 / n)
            bound[i, j] = z * np.sqrt(variance / n)
            white_u = lfilter(whitener, [1.0], v[:, j])[lags:, None]
            p_cross[i, j] = _independence_p(white_e, white_u, lags)
    outside = (np.abs(cross[lags:]) > bound).sum(axis=0)
    return ResidualTest(
        residuals=errors,
        lags=np.arange(lags + 1),
        autocorrelation=auto,
        cross_lags=np.arange(-lags, lags + 1),
        cross_correlation=cross,
        level=level,
        whiteness_bound=z / float(np.sqrt(n)),
        independence_bound=bound,
        whiteness_p=chi2.sf(box, lags),
        independence_p=p_cross,
        outside_whiteness=(np.abs(single) > z / np.sqrt(n)).sum(axis=0),
        outside_independence=outside,
        output_names=data.output_names or (),
        input_names=data.input_names or (),
    )


def _independence_p(white_e: FloatArray, filtered_u: FloatArray, lags: int) -> float:
    """p-value of r' P^-1 r, r the covariances of e and u at lags 0..lags, P = R_e(0) R_u / N.

    With the whitener of the residuals applied to both, P is the input's Toeplitz matrix alone. Directions in which the
    input has no power are left out.
    """
    n = len(white_e)
    r = covariance_function([white_e], [filtered_u], lags)[lags:, 0, 0]
    r_u = covariance_function([filtered_u], [filtered_u], lags)[lags:, 0, 0]
    values, vectors = np.linalg.eigh(toeplitz(r_u))
    kept = values > 1e-6 * values[-1]
    statistic = float(np.sum((vectors[:, kept].T @ r) ** 2 / values[kept])) * n / float(np.mean(white_e**2))
    return float(chi2.sf(statistic, int(kept.sum())))
