"""Correlation analysis: the impulse response from correlations with a whitened input."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.polynomial.correlation import autoregression, prewhitened
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import solve
from sysid.polynomial.regressors import lagged
from sysid.records.arguments import confidence_level, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.labelled import Labelled

RESOLVED = 1e-6  # share of other lags in a value beyond which it is not determined
COLOUR = 20  # order of the autoregressive model of the residual


@dataclass(frozen=True, eq=False, repr=False)
class ImpulseResponse(Labelled, Locked):
    """An impulse response without a model, with its standard deviation.

    Attributes:
        lags: 0, 1, ..., in samples (lags + 1,).
        response: Response to a unit pulse in each input (lags + 1, ny, nu), output units per input unit.
        deviation: Standard deviation of the response (lags + 1, ny, nu); infinite where the inputs do not determine it.
        level: Confidence level.
        dt: Sampling interval in s.
        input_names: One name per input.
        output_names: One name per output.
    """

    lags: NDArray[np.int_]
    response: FloatArray
    deviation: FloatArray
    level: float
    dt: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        axes = ("lag", "output", "input")
        coordinates = {"lag": self.lags, "output": list(self.output_names), "input": list(self.input_names)}
        arrays = {"response": (axes, self.response), "response_deviation": (axes, self.deviation)}
        return arrays, coordinates, {"dt": self.dt}

    @property
    def time(self) -> FloatArray:
        """Lags in s (lags + 1,)."""
        return self.lags.astype(np.float64) * self.dt

    @property
    def step_response(self) -> FloatArray:
        """Running sum of the response (lags + 1, ny, nu)."""
        return np.asarray(np.cumsum(self.response, axis=0), dtype=np.float64)

    @property
    def bound(self) -> FloatArray:
        """Bound at the level on the estimate of a zero response, lag by lag (lags + 1, ny, nu)."""
        return float(scipy.stats.norm.ppf(0.5 + 0.5 * self.level)) * self.deviation

    def interval(self) -> tuple[FloatArray, FloatArray]:
        """Confidence interval of the response, lag by lag (lags + 1, ny, nu) each."""
        return self.response - self.bound, self.response + self.bound


def cra(
    data: IOData | Sequence[IOData], *, lags: int = 20, whitening: int = 10, level: float = 0.99
) -> ImpulseResponse:
    """Impulse response by correlation analysis with a prewhitened input [Ljung1999, sec. 6.1].

    All signals are filtered by the inverse of an autoregressive model of the input; then the equations R_yu(tau) =
    sum_k h(k) R_u(tau - k), tau = 0..lags, are solved with sample correlations. Whitening keeps the response beyond the
    last lag from leaking into the others. Several inputs are whitened in turn and solved for together, so that they may
    correlate. The deviations account for the colour of the residual. Means are removed first.

    Args:
        data: One experiment, or several that share the response.
        lags: Largest lag.
        whitening: Order of the autoregressive model of each input; 0 for an input that is white.
        level: Confidence level of bound and interval, between 0 and 1.

    Returns:
        The response with deviations.

    Raises:
        SysidError: Constant input; lags, whitening or level out of range; too little data.

    Warns:
        SysidWarning: The input excites too little for so many lags.
    """
    experiments = tuple(e.detrend() for e in as_experiments(data))
    first = experiments[0]
    lags, whitening = whole_number("lags", lags, 1), whole_number("whitening", whitening, 0)
    level = confidence_level(level)
    messages = check_excitation(experiments, [lags + 1] * first.nu)
    width = first.nu * (lags + 1)
    starts = [max(whitening + lags, e.window) for e in experiments]
    rows = sum(max(len(e) - start, 0) for e, start in zip(experiments, starts, strict=True))
    if rows <= 2 * width or any(len(e) <= start for e, start in zip(experiments, starts, strict=True)):
        raise SysidError(
            f"too little data: lags = {lags} give {width} unknowns per output, "
            f"{rows} usable samples in {len(experiments)} experiment(s), at least twice as many are needed"
        )
    warn_each(messages)
    response, deviation = np.empty((2, lags + 1, first.ny, first.nu))
    deficiency = 0
    for j in range(first.nu):
        whitened = prewhitened(experiments, j, int(whitening))
        regressors, outputs = _equations(whitened, lags, starts)
        phi, y = np.vstack(regressors), np.vstack(outputs)
        fit = solve(phi, y)
        lags_of_input = slice(j * (lags + 1), (j + 1) * (lags + 1))
        response[:, :, j] = fit.solution[lags_of_input]
        errors = y - phi @ fit.solution
        # the least-norm solution is one of many: only lags without a share of others are determined
        determined = np.ones(phi.shape[1], dtype=bool)
        if fit.rank < phi.shape[1]:
            determined = np.abs(np.einsum("ij,ij->i", fit.inverse_gram, phi.T @ phi) - 1.0) < RESOLVED
            deficiency = max(deficiency, phi.shape[1] - fit.rank)
        for i in range(first.ny):
            deviations = _deviation(regressors, fit.inverse_gram, errors[:, i])
            deviation[:, i, j] = np.where(determined, deviations, np.inf)[lags_of_input]
    if deficiency and not messages:
        rank = f"rank {width - deficiency} for {width} values of the response: some are not determined"
        warnings.warn(f"the lagged inputs have {rank}", SysidWarning, stacklevel=2)
    return ImpulseResponse(
        lags=np.arange(lags + 1),
        response=response,
        deviation=deviation,
        level=level,
        dt=first.dt,
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )


def _equations(
    whitened: Sequence[tuple[FloatArray, FloatArray]], lags: int, starts: Sequence[int]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Lagged inputs and outputs of each experiment from its first sample with a past.

    The regressors have lags 0..lags of every input, and a constant per experiment: the mean of the rows is not that of
    the record.
    """
    constants = np.eye(len(whitened))
    regressors, outputs = [], []
    for (u, y), start, constant in zip(whitened, starts, constants, strict=True):
        columns = [lagged(u[:, j], range(lags + 1), start) for j in range(u.shape[1])]
        columns.append(np.broadcast_to(constant, (len(u) - start, len(constant))))
        regressors.append(np.hstack(columns))
        outputs.append(y[start:])
    return regressors, outputs


def _deviation(regressors: Sequence[FloatArray], inverse_gram: FloatArray, errors: FloatArray) -> FloatArray:
    """Standard deviations of least squares with errors that are not white [Ljung1999, ch. 9].

    Of (Phi'Phi)^-1 Phi' R Phi (Phi'Phi)^-1, R the covariance of the errors by an autoregressive model.
    """
    rows, width = sum(len(phi) for phi in regressors), len(inverse_gram)
    scale = float(np.abs(errors).max())
    if scale <= np.finfo(float).tiny:
        return np.zeros(width)
    # of about unit size, since squares of huge or tiny errors leave the range of numbers
    whitener, _ = autoregression(errors / scale, COLOUR)
    innovations = scipy.signal.lfilter(whitener, [1.0], errors)
    variance = float(np.mean(innovations**2)) * rows / (rows - width)
    total = np.zeros((width, width))
    # R = variance / |whitener|^2: its root filters the columns, which is exact but for the ends of the experiments
    for phi in regressors:
        filtered = scipy.signal.lfilter([1.0], whitener, phi, axis=0)
        total += filtered.T @ filtered
    squares = np.maximum(np.diagonal(inverse_gram @ total @ inverse_gram), 0.0)
    return np.asarray(np.sqrt(variance * squares), dtype=np.float64)
