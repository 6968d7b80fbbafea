"""Excitations, each giving one period as a 100-point file [Morris1996, sec. II.2].

At the default update rate of 50 Hz the file lasts 2 s, so a waveform repeats without a jump when it holds a whole
number of cycles in 2 s. `KINDS` lists every excitation by the name that scenario files use.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.binary_sequences import prbs, sign_recursion
from scenarios.experiments.chirp import chirp, chirp_as_printed, chirp_franklin
from scenarios.experiments.waveform import POINTS, WINDOW, Waveform, check_seed, points
from scenarios.files.errors import ScenarioError

__all__ = [
    "KINDS",
    "bipolar_ramping_pulse",
    "chirp",
    "chirp_as_printed",
    "chirp_franklin",
    "multisine",
    "points",
    "prbs",
    "sign_recursion",
    "sine",
    "two_sines",
    "white_noise",
]


def _whole_cycles(frequency: float) -> float:
    cycles = frequency * WINDOW
    if not 0.0 < frequency < SAMPLE_RATE / 2 or abs(cycles - round(cycles)) > 1e-9:
        raise ScenarioError(
            f"frequency {frequency} Hz does not repeat in a {WINDOW} s file; "
            f"expected a multiple of {1 / WINDOW} Hz above 0 and below {SAMPLE_RATE / 2} Hz"
        )
    return frequency


def sine(*, frequency: float, amplitude: float = 1.0) -> Waveform:
    """One sinusoid, `a sin(2 pi f t)`: order of excitation 2 [Morris1996, eq. 2.4].

    Args:
        frequency: Frequency, a multiple of 0.5 Hz.
        amplitude: Peak, V.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The frequency does not repeat in the file.
    """
    t = np.arange(POINTS) / SAMPLE_RATE
    points = amplitude * np.sin(2.0 * np.pi * _whole_cycles(frequency) * t)
    return Waveform(points, "sine", {"frequency": frequency, "amplitude": amplitude})


def two_sines(*, frequency: float, amplitude: float = 1.0) -> Waveform:
    """Two sinusoids of equal height at `f` and `4 f`: order of excitation 4 [Morris1996, eq. 2.8].

    "At 10 Hz" in the thesis means that the upper tone is at 10 Hz, the lower at 2.5 Hz. A lower tone at 1.25 Hz
    completes 2.5 cycles in 2 s; the file then plays at half the update rate and lasts 4 s, as one would set the
    converter.

    Args:
        frequency: Frequency of the lower tone, Hz.
        amplitude: Bound on the sum, V: each tone has half of it.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The lower tone does not repeat in 2 s nor in 4 s, or the upper one is above half the update rate.
    """
    rate = float(SAMPLE_RATE)
    if not abs(frequency) < SAMPLE_RATE:
        raise ScenarioError(f"lower tone {frequency} Hz: expected one below {SAMPLE_RATE / 8} Hz")
    if abs(frequency * WINDOW - round(frequency * WINDOW)) > 1e-9:
        rate = SAMPLE_RATE / 2
    cycles = frequency * POINTS / rate
    if frequency <= 0 or abs(cycles - round(cycles)) > 1e-9 or 4 * frequency > rate / 2:
        raise ScenarioError(
            f"lower tone {frequency} Hz: expected a multiple of {1 / (2 * WINDOW)} Hz "
            f"with four times it below half the update rate ({rate / 2} Hz)"
        )
    t = np.arange(POINTS) / rate
    points = 0.5 * amplitude * (np.sin(2 * np.pi * frequency * t) + np.sin(8 * np.pi * frequency * t))
    return Waveform(points, "two_sines", {"frequency": frequency, "amplitude": amplitude}, update_rate=rate)


def bipolar_ramping_pulse(
    *, frequency: float = 1.0, pulse_width: float = 0.1, amplitude: float = 4.0, growing: bool = False
) -> Waveform:
    """Alternating ramps: 0 to +A over the pulse width, its mirror image half a period later, zero between.

    The thesis gives no formula; this is a reading of its text and figure 16 [Morris1996, sec. II.2A].

    Args:
        frequency: Repetitions per second, a multiple of 0.5 Hz.
        pulse_width: Length of each ramp, at most half a period, s.
        amplitude: Height of the ramp, V.
        growing: The other reading: pulse heights themselves grow linearly up to A over the file.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The frequency does not repeat in the file, or the pulse does not fit.
    """
    half = SAMPLE_RATE / (2.0 * _whole_cycles(frequency))
    width = round(pulse_width * SAMPLE_RATE) if abs(pulse_width) <= WINDOW else 0
    if not 1 <= width <= half:
        raise ScenarioError(
            f"pulse width must be {1 / SAMPLE_RATE} to {half / SAMPLE_RATE} s at {frequency} Hz, given {pulse_width} s"
        )
    ramp = np.arange(1, width + 1) / width
    starts = np.round(np.arange(round(POINTS / half)) * half).astype(int)
    points = np.zeros(POINTS)
    for number, start in enumerate(starts):
        height = (number + 1) / len(starts) if growing else 1.0
        points[start : start + width] = (-1) ** number * height * ramp
    parameters = {"frequency": frequency, "pulse_width": pulse_width, "amplitude": amplitude, "growing": growing}
    return Waveform(amplitude * points, "bipolar_ramping_pulse", parameters)


def multisine(
    *, f_min: float = 0.5, f_max: float = 10.0, amplitude: float = 1.0, odd: bool = False, seed: int = 0
) -> Waveform:
    """Random-phase multisine: equal lines every 0.5 Hz, uniformly random phases [Pintelon2012, ch. 5].

    Args:
        f_min: Lowest line, Hz.
        f_max: Highest line, below 25 Hz.
        amplitude: Largest absolute value, V.
        odd: Only odd multiples of 0.5 Hz, so that even distortion falls between the lines.
        seed: Chooses the phases.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: No line lies in the band, or the band leaves 0 to 25 Hz.
    """
    check_seed(seed)
    lines = np.arange(1, POINTS // 2)
    chosen = (lines >= f_min * WINDOW - 1e-9) & (lines <= f_max * WINDOW + 1e-9)
    if odd:
        chosen &= lines % 2 == 1
    if not chosen.any() or f_max >= SAMPLE_RATE / 2:
        raise ScenarioError(f"no line of a multisine in {f_min} to {f_max} Hz; expected 0.5 to 24.5 Hz")
    spectrum = np.zeros(POINTS // 2 + 1, dtype=complex)
    spectrum[lines[chosen]] = np.exp(2j * np.pi * np.random.default_rng(seed).random(int(chosen.sum())))
    points = np.fft.irfft(spectrum, POINTS)
    parameters = {"f_min": f_min, "f_max": f_max, "amplitude": amplitude, "odd": odd, "seed": seed}
    return Waveform(amplitude * points / np.abs(points).max(), "multisine", parameters)


def white_noise(*, amplitude: float = 1.0, seed: int = 0) -> Waveform:
    """One hundred normal numbers, scaled so that the largest has the amplitude [Morris1996, fig. 11].

    Args:
        amplitude: Largest absolute value, V.
        seed: Chooses the numbers.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The seed is negative.
    """
    check_seed(seed)
    points = np.random.default_rng(seed).standard_normal(POINTS)
    return Waveform(amplitude * points / np.abs(points).max(), "white_noise", {"amplitude": amplitude, "seed": seed})


KINDS: Mapping[str, Callable[..., Waveform]] = MappingProxyType(
    {
        function.__name__: function
        for function in (
            sine,
            two_sines,
            multisine,
            prbs,
            sign_recursion,
            chirp,
            chirp_as_printed,
            chirp_franklin,
            bipolar_ramping_pulse,
            white_noise,
            points,
        )
    }
)
"""Every excitation by name."""
