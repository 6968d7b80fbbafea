"""Bandwidth and delay of a model with their gradients."""

import numpy as np

from sysid.models.bandwidth import HALF_POWER
from sysid.records.arrays import ComplexArray, FloatArray

LINES = 240  # of the grid on which the crossing is bracketed
LAGS = 33  # coefficients of the largest degree
REFINEMENTS = 4  # Newton steps from the grid
LOWEST = 2e-4  # first line, in cycles per sample


class ServoQuantities:
    """Bandwidth and phase delay of B(q)/F(q), evaluated many times.

    The bandwidth is the first frequency at which the gain falls to 0.707 of `gain`, of that at 0 Hz by default. The
    delay is the phase delay there, -arg G(f) / (2 pi f): dead time and lag together, as an operator feels them.
    """

    def __init__(self, nk: int, dt: float, gain: float | None) -> None:
        """Keep the delay in samples, the sampling interval in s, and the gain at 0 Hz where it is known."""
        self._nk, self._dt, self._gain = nk, dt, gain
        self._grid = np.geomspace(LOWEST, 0.5, LINES)
        self._lines = self._delays(self._grid)

    def __call__(self, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log bandwidth (Hz) and delay (s) (2,), and their gradients by B and F[1:] (2, 2n); NaN without."""
        n = len(B)
        unknown = np.full(2, np.nan), np.full((2, 2 * n), np.nan)
        level = HALF_POWER * (abs(B.sum() / F.sum()) if self._gain is None else self._gain)
        g = self._values(B, F, self._lines)
        below = np.flatnonzero(np.abs(g) < level)
        if not len(below) or below[0] == 0:
            return unknown
        k = int(below[0])
        low, high = np.log(self._grid[k - 1 : k + 1])
        f, h = self._grid[k], 1e-4
        for _ in range(REFINEMENTS):
            # Newton steps on logarithmic axes, where the gain is nearly straight
            at, ahead = np.log(np.abs(self._values(B, F, self._delays(np.array([f, f * (1 + h)]))))) - np.log(level)
            step = at * np.log1p(h) / (ahead - at) if ahead < at else 0.5 * (np.log(f) - low)
            f = float(np.exp(np.clip(np.log(f) - step, low, high)))
        z = self._delays(np.array([f * (1 - h), f, f * (1 + h), 0.0]))
        around = self._values(B, F, z)
        past = np.hstack((z[:, self._nk : self._nk + n], -around[:, None] * z[:, 1 : n + 1]))
        relative = past / (z[:, : n + 1] @ F)[:, None] / around[:, None]
        slope = np.log(np.abs(around[2] / around[0])) / (2.0 * h)
        level_move = relative[3].real if self._gain is None else 0.0
        log_f = -(relative[1].real - level_move) / slope
        turn = np.angle(around[2] / around[0]) / (2.0 * h)
        phase = float(np.unwrap(np.angle(g[: k + 1]))[-1])
        phase += float(np.angle(around[1] / g[k]))
        delay = -phase / (2.0 * np.pi * f) * self._dt
        delay_move = -(relative[1].imag + turn * log_f) / (2.0 * np.pi * f) * self._dt - delay * log_f
        return np.array([np.log(f / self._dt), delay]), np.stack((log_f, delay_move))

    def _delays(self, f: FloatArray) -> ComplexArray:
        return np.asarray(np.exp(-2j * np.pi * f[:, None] * np.arange(LAGS + self._nk)))

    def _values(self, B: FloatArray, F: FloatArray, z: ComplexArray) -> ComplexArray:
        n = len(B)
        return np.asarray(z[:, self._nk : self._nk + n] @ B / (z[:, : n + 1] @ F))
