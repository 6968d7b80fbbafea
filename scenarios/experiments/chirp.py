"""Swept sines: the one to use, the one that the thesis prints, and the one that it cites."""

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.waveform import POINTS, WINDOW, Waveform
from scenarios.files.errors import ScenarioError


def _time() -> np.ndarray:
    return np.arange(POINTS) / SAMPLE_RATE


def _check_band(*frequencies: float) -> None:
    for frequency in frequencies:
        if not 0.0 <= frequency <= SAMPLE_RATE / 2:
            raise ScenarioError(f"frequencies must lie in 0 to {SAMPLE_RATE / 2} Hz, given {frequency} Hz")


def chirp(*, f_start: float, f_end: float, amplitude: float = 1.0) -> Waveform:
    """Linear sweep over one window: `a cos(2 pi (f_start t + (f_end - f_start) t^2 / (2 T)))`, T = 2 s.

    Every chirp of the thesis' tables has a whole number of cycles in the window and so repeats without a jump.

    Args:
        f_start: Frequency at the start, Hz.
        f_end: Frequency at the end, Hz.
        amplitude: Peak, V.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: A frequency lies outside 0 to 25 Hz.
    """
    _check_band(f_start, f_end)
    t = _time()
    phase = f_start * t + (f_end - f_start) * t**2 / (2.0 * WINDOW)
    parameters = {"f_start": f_start, "f_end": f_end, "amplitude": amplitude}
    return Waveform(amplitude * np.cos(2.0 * np.pi * phase), "chirp", parameters)


def chirp_as_printed(*, f_low: float, f_high: float, f_center: float, amplitude: float = 1.0) -> Waveform:
    """Equation (2.15) of the thesis to the letter: `cos(2 pi (f_low + t D) + 2 pi f_center t)`, `D = f_high - f_low`.

    It sweeps nothing: it is one tone at `D + f_center` with phase `2 pi f_low` [Morris1996, eq. 2.15].

    Args:
        f_low: "Starting frequency", Hz.
        f_high: "Ending frequency", Hz.
        f_center: "Center frequency", Hz.
        amplitude: Peak, V.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The tone lies outside 0 to 25 Hz.
    """
    _check_band(f_high - f_low + f_center)
    t = _time()
    points = amplitude * np.cos(2.0 * np.pi * (f_low + t * (f_high - f_low)) + 2.0 * np.pi * f_center * t)
    parameters = {"f_low": f_low, "f_high": f_high, "f_center": f_center, "amplitude": amplitude}
    return Waveform(points, "chirp_as_printed", parameters)


def chirp_franklin(
    *, f_start: float, f_end: float, amplitude: float = 1.0, ramp: float = 0.1, offset: float = 0.0
) -> Waveform:
    """Franklin, Powell and Workman's sweep, equations (2.12) to (2.14) of [Morris1996].

    `r_k = A0 + a_k sin(2 pi f_k k dt)`, with `f_k = f_start + (k / N) (f_end - f_start)` and an amplitude that ramps up
    and down over the fraction `ramp` of the window. The phase is `f_k k`, so the instantaneous frequency ends at
    `2 f_end - f_start`, not at `f_end`; that too is as printed.

    Args:
        f_start: Frequency at the start, Hz.
        f_end: Frequency that `f_k` reaches, Hz.
        amplitude: Peak of the swept part, V.
        ramp: Fraction of the window for each amplitude ramp.
        offset: Constant added, V.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: A frequency lies outside 0 to 25 Hz, or the ramp outside 0 to 0.5.
    """
    _check_band(f_start, f_end, 2 * f_end - f_start)
    if not 0.0 < ramp <= 0.5:
        raise ScenarioError(f"ramp must lie above 0 and up to 0.5 of the window, given {ramp}")
    k = np.arange(POINTS)
    envelope = np.clip(k / (ramp * POINTS), 0, 1) * np.clip((POINTS - k) / (ramp * POINTS), 0, 1)
    frequency = f_start + k / POINTS * (f_end - f_start)
    points = offset + amplitude * envelope * np.sin(2.0 * np.pi * frequency * k / SAMPLE_RATE)
    parameters = {"f_start": f_start, "f_end": f_end, "amplitude": amplitude, "ramp": ramp, "offset": offset}
    return Waveform(points, "chirp_franklin", parameters)
