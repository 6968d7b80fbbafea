"""One experiment as the fits of state-space predictors see it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.subspace.predictor import Scales

PRIOR = 300.0  # standard deviations of a state that its initial value may reach; less would bend the criterion
Correlations = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Record:
    """One experiment, channels scaled, behind its initialisation window.

    Attributes:
        u: Inputs (N, nu).
        y: Outputs (N, ny).
        w: What drives the predictor (N, nu + ny) or (N, nu).
        transforms: Fourier transform of w and its lagged products, by length of the transform.
        known: Which outputs are on record (N, ny), zeros in `y` for the others; None for all.
    """

    u: FloatArray
    y: FloatArray
    w: FloatArray
    transforms: dict[int, Correlations] = field(default_factory=dict)
    known: NDArray[np.bool_] | None = None

    @staticmethod
    def of(experiment: IOData, scales: Scales, gain: bool) -> "Record":
        """Scale and cut."""
        u, y = experiment.u[experiment.window :] / scales.u, experiment.y[experiment.window :] / scales.y
        known = None if experiment.complete else np.isfinite(y)
        y = y if known is None else np.where(known, y, 0.0)
        return Record(u, y, np.hstack((u, y)) if gain else u, known=known)

    def correlations(self, e: FloatArray, lags: int) -> Correlations:
        """Sums over t of w(t - j) w(t)' and of w(t - j) e(t)', j = 1..lags, (lags, nw, nw) and (lags, nw, ny)."""
        size = next_fast_len(len(self.w) + (1 << lags.bit_length()), real=True)
        if size not in self.transforms:
            spectrum = rfft(self.w.T, size)
            products = irfft(spectrum.conj()[:, None] * spectrum, size)
            self.transforms[size] = spectrum, np.ascontiguousarray(products[:, :, : size - len(self.w)].T)
        spectrum, own = self.transforms[size]
        cross = irfft(spectrum.conj()[:, None] * rfft(e.T, size), size)[:, :, 1 : lags + 1]
        # axes of `own` are (lag, t, t - lag) after the transposition
        return own[1 : lags + 1].transpose(0, 2, 1), cross.transpose(2, 0, 1)


def initial_spread(free: FloatArray) -> FloatArray:
    """In balanced coordinates a state's variance and its power in the output are one number."""
    return PRIOR * np.maximum(np.sqrt(np.einsum("tln,tln->n", free, free)), np.sqrt(np.finfo(float).tiny))
