"""Bandwidth and delay of a model with their gradients."""

import numpy as np

from sysid.models.bandwidth import HALF_POWER
from sysid.records.arrays import ComplexArray, FloatArray

LINES = 240  # of the grid on which the crossing is bracketed
LAGS = 33  # coefficients of the largest degree
REFINEMENTS = 4  # Newton steps from the grid
RELATIVE_STEP = 1e-4  # of a frequency, for slopes of gain and phase
LOWEST = 2e-4  # first line, in cycles per sample


class ServoQuantities:
    """Bandwidth and phase delay of B(q)/F(q), evaluated many times.

    The bandwidth is the first frequency at which the gain falls to 0.707 of `gain`, of that at 0 Hz by default. The
    delay is the phase delay there, -arg G(f) / (2 pi f): dead time and lag together, as an operator feels them.
    """

    def __init__(self, nk: int, dt: float, gain: float | None) -> None:
        """Keep the delay in samples, the sampling interval in s, and the gain at 0 Hz where it is known."""
        self.nk, self.dt, self._gain = nk, dt, gain
        self.knows_gain = gain is not None
        self._grid = np.geomspace(LOWEST, 0.5, LINES)
        # powers of the shift operator on the grid: most of the time of an evaluation, were they computed anew
        self._grid_shifts = self._shifts(self._grid)

    def __call__(self, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log bandwidth (Hz) and delay (s) (2,), and their gradients by B and F[1:] (2, 2n); NaN without."""
        n = len(B)
        gain_at_dc = abs(B.sum() / F.sum()) if self._gain is None else self._gain
        level = HALF_POWER * gain_at_dc
        responses = self._responses(B, F, self._grid_shifts)
        below = np.flatnonzero(np.abs(responses) < level)
        if not len(below) or below[0] == 0:
            return np.full(2, np.nan), np.full((2, 2 * n), np.nan)
        k = int(below[0])
        f = self._crossing(B, F, level, k)
        h = RELATIVE_STEP
        shifts = self._shifts(np.array([f * (1 - h), f, f * (1 + h), 0.0]))
        around = self._responses(B, F, shifts)
        relative = self._relative_gradients(F, shifts, around)
        slope, turn = _by_log_frequency(around[2] / around[0])
        # the crossing moves so far along the slope as gain and level part
        level_gradient = relative[3].real if self._gain is None else 0.0
        log_f_gradient = -(relative[1].real - level_gradient) / slope
        # from 0 Hz on along the grid: a phase beyond half a turn would jump
        phase = float(np.unwrap(np.angle(responses[: k + 1]))[-1])
        phase += float(np.angle(around[1] / responses[k]))
        delay = -phase / (2.0 * np.pi * f) * self.dt
        phase_gradient = relative[1].imag + turn * log_f_gradient
        delay_gradient = -phase_gradient / (2.0 * np.pi * f) * self.dt - delay * log_f_gradient
        return np.array([np.log(f / self.dt), delay]), np.stack((log_f_gradient, delay_gradient))

    def along(self, B: FloatArray, F: FloatArray, hz: float) -> tuple[float, float]:
        """Changes of log gain and of phase, rad, with the logarithm of the frequency, at a frequency in Hz."""
        h = RELATIVE_STEP
        around = self._responses(B, F, self._shifts(hz * self.dt * np.array([1 - h, 1 + h])))
        return _by_log_frequency(around[1] / around[0])

    def relative_changes(self, B: FloatArray, F: FloatArray, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Response (nf,) and its relative change by B and F[1:] (nf, 2n) at frequencies in Hz (nf,)."""
        shifts = self._shifts(hz * self.dt)
        responses = self._responses(B, F, shifts)
        return responses, self._relative_gradients(F, shifts, responses)

    def _crossing(self, B: FloatArray, F: FloatArray, level: float, k: int) -> float:
        """Frequency, in cycles per sample, at which the gain crosses a level between grid lines k - 1 and k."""
        low, high = np.log(self._grid[k - 1 : k + 1])
        f, h = self._grid[k], RELATIVE_STEP
        for _ in range(REFINEMENTS):
            # Newton steps on logarithmic axes, where the gain is nearly straight
            gains = np.abs(self._responses(B, F, self._shifts(np.array([f, f * (1 + h)]))))
            at, ahead = np.log(gains) - np.log(level)
            step = at * np.log1p(h) / (ahead - at) if ahead < at else 0.5 * (np.log(f) - low)
            f = float(np.exp(np.clip(np.log(f) - step, low, high)))
        return f

    def _relative_gradients(self, F: FloatArray, shifts: ComplexArray, responses: ComplexArray) -> ComplexArray:
        """Gradients of log G by B and F[1:] at several frequencies (frequencies, 2n)."""
        n = len(F) - 1
        by_coefficient = np.hstack((shifts[:, self.nk : self.nk + n], -responses[:, None] * shifts[:, 1 : n + 1]))
        denominators = shifts[:, : n + 1] @ F
        return np.asarray(by_coefficient / denominators[:, None] / responses[:, None])

    def _shifts(self, f: FloatArray) -> ComplexArray:
        """Powers 0, 1, ... of exp(-2 pi i f), f in cycles per sample (frequencies, powers)."""
        return np.asarray(np.exp(-2j * np.pi * f[:, None] * np.arange(LAGS + self.nk)))

    def _responses(self, B: FloatArray, F: FloatArray, shifts: ComplexArray) -> ComplexArray:
        """Frequency response G = B/F."""
        n = len(B)
        return np.asarray(shifts[:, self.nk : self.nk + n] @ B / (shifts[:, : n + 1] @ F))


def _by_log_frequency(ratio: complex) -> tuple[float, float]:
    """Changes of log gain and of phase with log frequency, from the ratio of responses on both sides of one."""
    return float(np.log(np.abs(ratio)) / (2.0 * RELATIVE_STEP)), float(np.angle(ratio) / (2.0 * RELATIVE_STEP))
