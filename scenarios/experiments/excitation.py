"""Excitations, each one period as a 100-point file [Morris1996, sec. II.2], or a record; `KINDS` lists them by name.

At the default update rate of 50 Hz the file lasts 2 s, so a waveform repeats without a jump when it holds a whole
number of cycles in 2 s. Amplitudes are peaks in V; seeds draw all that is random.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.waveform import POINTS, WINDOW, Waveform, check_seed, points, record
from scenarios.files.errors import ScenarioError
from sysid.design import idinput, sum_of_sines
from sysid.design.idinput import LONGEST_REGISTER, shortest_register

TIME = np.arange(POINTS) / SAMPLE_RATE
"""Times of the points at the default update rate (100,), s."""


def sine(*, frequency: float, amplitude: float = 1.0) -> Waveform:
    """One sinusoid, `a sin(2 pi f t)`: order of excitation 2 [Morris1996, eq. 2.4].

    Args:
        frequency: Frequency, a multiple of 0.5 Hz.
        amplitude: Peak, V.

    Raises:
        ScenarioError: The frequency does not repeat in the file.
    """
    _check_whole_cycles(frequency)
    points = amplitude * np.sin(2.0 * np.pi * frequency * TIME)
    return Waveform(points, "sine", {"frequency": frequency, "amplitude": amplitude})


def two_sines(*, frequency: float, amplitude: float = 1.0) -> Waveform:
    """Two sinusoids of equal height at `f` and `4 f`: order of excitation 4 [Morris1996, eq. 2.8].

    "At 10 Hz" in the thesis means that the upper tone is at 10 Hz, the lower at 2.5 Hz. A lower tone at 1.25 Hz
    completes 2.5 cycles in 2 s; the file then plays at half the update rate and lasts 4 s.

    Args:
        frequency: Frequency of the lower tone, Hz.
        amplitude: Bound on the sum, V: each tone has half of it.

    Raises:
        ScenarioError: The lower tone does not repeat in 2 s nor in 4 s, or the upper one is above half the update rate.
    """
    rate = float(SAMPLE_RATE)
    if not abs(frequency) < rate:
        raise ScenarioError(f"lower tone {frequency} Hz: expected one below {rate / 8} Hz")
    # Tones between the lines of a 2 s file repeat in one of 4 s, which the same 100 points fill at half the rate.
    if abs(frequency * WINDOW - round(frequency * WINDOW)) > 1e-9:
        rate = rate / 2
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

    Raises:
        ScenarioError: The frequency does not repeat in the file, or the pulse does not fit.
    """
    _check_whole_cycles(frequency)
    half_period = SAMPLE_RATE / (2.0 * frequency)
    # Infinity and NaN cannot be rounded.
    width = round(pulse_width * SAMPLE_RATE) if abs(pulse_width) <= WINDOW else 0
    if not 1 <= width <= half_period:
        longest = half_period / SAMPLE_RATE
        raise ScenarioError(
            f"pulse width must be {1 / SAMPLE_RATE} to {longest} s at {frequency} Hz, given {pulse_width} s"
        )
    ramp = np.arange(1, width + 1) / width
    # Half a period need not be a whole number of points: starts are rounded one by one, so that errors do not add up.
    starts = np.round(np.arange(round(POINTS / half_period)) * half_period).astype(int)
    points = np.zeros(POINTS)
    for pulse, start in enumerate(starts):
        height = (pulse + 1) / len(starts) if growing else 1.0
        points[start : start + width] = (-1) ** pulse * height * ramp
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
        seed: Draws the phases.

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
    points = sum_of_sines(POINTS, lines[chosen], np.random.default_rng(seed).random(int(chosen.sum())))
    # Scaled by its peak, not by its power: the peak is what the converter limits.
    parameters = {"f_min": f_min, "f_max": f_max, "amplitude": amplitude, "odd": odd, "seed": seed}
    return Waveform(amplitude * points / np.abs(points).max(), "multisine", parameters)


def prbs(*, amplitude: float = 1.0, clock: int = 2, seed: int = 0, register: int = 0) -> Waveform:
    """Maximum-length binary sequence between -amplitude and +amplitude [Soderstrom1989, compl. C5.3].

    The sequence is cut after 100 points. The shortest register that fills the file has few starts, and neighbouring
    starts give nearly the same file shifted in time; a longer one has truly different sequences, with spectra less
    flat. With the shortest the file may keep a mean, of up to 0.12, 0.16 and 0.28 of the amplitude at one, two and
    three samples per bit. Its spectrum is only nearly flat under the sinc-shaped envelope of the held bits, with zeros
    at multiples of 50/clock Hz. Equation (2.11) of [Morris1996] as printed has levels 2 C1 and 2 C2; here the levels
    are the amplitude itself.

    Args:
        amplitude: Level, V.
        clock: Samples per bit; a divisor of 100 keeps every bit equally long.
        seed: Draws the start state of the register.
        register: Bits of the register; 0 for the shortest whose sequence fills the file.

    Raises:
        ScenarioError: `clock` is not between 1 and 33, the seed is negative, or the register is too short to fill the
            file or longer than 32 bits.
    """
    check_seed(seed)
    # Three bits are the period of the shortest register: fewer may all be equal.
    if not 1 <= clock <= POINTS // 3:
        raise ScenarioError(f"clock must be 1 to {POINTS // 3} samples per bit, given {clock}")
    shortest = shortest_register(POINTS, clock)
    if register and not shortest <= register <= LONGEST_REGISTER:
        raise ScenarioError(
            f"register must be {shortest} to {LONGEST_REGISTER} bits at {clock} samples per bit, or 0 for the "
            f"shortest, given {register}"
        )
    points = amplitude * idinput(POINTS, "prbs", clock=clock, register=register or shortest, seed=seed).u[:, 0]
    parameters = {"amplitude": amplitude, "clock": clock, "seed": seed}
    if register:
        parameters["register"] = register
    return Waveform(points, "prbs", parameters)


def sign_recursion(*, amplitude: float = 1.0, memory: float = 0.0, as_printed: bool = False, seed: int = 0) -> Waveform:
    """Equation (2.11): `u(t) = (C1 + C2)/2 + (C1 - C2)/2 sign(R u(t-1) + w(t))`, w white and normal [Morris1996].

    Here C1 = -C2 is the amplitude. The thesis calls R the covariance function and gives no value; here it weighs the
    last level, taken as -1 or +1, against the noise of standard deviation 1: 0 gives independent bits, a large one long
    runs. Unlike `prbs` its spectrum is flat on average only, and the file may keep a mean.

    Args:
        amplitude: C1 = -C2, V.
        memory: R, against a standard deviation of the noise of 1.
        as_printed: Without the factors 1/2, as the thesis prints it: levels of twice the amplitude.
        seed: Draws the noise.

    Raises:
        ScenarioError: The seed is negative, or the level never changes: the memory is too strong.
    """
    check_seed(seed)
    noise = np.random.default_rng(seed).standard_normal(POINTS)
    signs, last = np.empty(POINTS), 1.0
    for t in range(POINTS):
        # The sign of zero is taken as 1: the sequence has two levels.
        last = 1.0 if memory * last + noise[t] >= 0.0 else -1.0
        signs[t] = last
    if abs(signs.sum()) == POINTS:
        raise ScenarioError(
            f"sign_recursion with memory {memory:g} and seed {seed} never changes its level; "
            "expected a memory nearer to 0"
        )
    factor = 2.0 if as_printed else 1.0
    points = factor * amplitude * signs
    parameters = {"amplitude": amplitude, "memory": memory, "as_printed": as_printed, "seed": seed}
    return Waveform(points, "sign_recursion", parameters)


def chirp(*, f_start: float, f_end: float, amplitude: float = 1.0) -> Waveform:
    """Linear sweep over one window: `a cos(2 pi (f_start t + (f_end - f_start) t^2 / (2 T)))`, T = 2 s.

    Every chirp of the thesis' tables has a whole number of cycles in the window and so repeats without a jump.

    Args:
        f_start: Frequency at the start, Hz.
        f_end: Frequency at the end, Hz.
        amplitude: Peak, V.

    Raises:
        ScenarioError: A frequency lies outside 0 to 25 Hz.
    """
    _check_band(f_start, f_end)
    phase = f_start * TIME + (f_end - f_start) * TIME**2 / (2.0 * WINDOW)
    parameters = {"f_start": f_start, "f_end": f_end, "amplitude": amplitude}
    return Waveform(amplitude * np.cos(2.0 * np.pi * phase), "chirp", parameters)


def chirp_as_printed(*, f_low: float, f_high: float, f_center: float, amplitude: float = 1.0) -> Waveform:
    """Equation (2.15) of the thesis to the letter: `cos(2 pi (f_low + t D) + 2 pi f_center t)`, `D = f_high - f_low`.

    It does not sweep: it is one tone at `D + f_center` with phase `2 pi f_low` [Morris1996, eq. 2.15].

    Args:
        f_low: "Starting frequency", Hz.
        f_high: "Ending frequency", Hz.
        f_center: "Center frequency", Hz.
        amplitude: Peak, V.

    Raises:
        ScenarioError: The tone lies outside 0 to 25 Hz.
    """
    _check_band(f_high - f_low + f_center)
    phase = 2.0 * np.pi * (f_low + TIME * (f_high - f_low)) + 2.0 * np.pi * f_center * TIME
    points = amplitude * np.cos(phase)
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

    Raises:
        ScenarioError: A frequency lies outside 0 to 25 Hz, or the ramp outside 0 to 0.5.
    """
    _check_band(f_start, f_end, 2 * f_end - f_start)  # the last is the instantaneous frequency at the end
    if not 0.0 < ramp <= 0.5:
        raise ScenarioError(f"ramp must lie above 0 and up to 0.5 of the window, given {ramp}")
    k = np.arange(POINTS)
    envelope = np.clip(k / (ramp * POINTS), 0, 1) * np.clip((POINTS - k) / (ramp * POINTS), 0, 1)
    frequency = f_start + k / POINTS * (f_end - f_start)
    points = offset + amplitude * envelope * np.sin(2.0 * np.pi * frequency * k / SAMPLE_RATE)
    parameters = {"f_start": f_start, "f_end": f_end, "amplitude": amplitude, "ramp": ramp, "offset": offset}
    return Waveform(points, "chirp_franklin", parameters)


def white_noise(*, amplitude: float = 1.0, seed: int = 0) -> Waveform:
    """One hundred normal numbers, scaled so that the largest has the amplitude [Morris1996, fig. 11].

    Args:
        amplitude: Largest absolute value, V.
        seed: Draws the numbers.

    Raises:
        ScenarioError: The seed is negative.
    """
    check_seed(seed)
    points = np.random.default_rng(seed).standard_normal(POINTS)
    return Waveform(amplitude * points / np.abs(points).max(), "white_noise", {"amplitude": amplitude, "seed": seed})


def _check_whole_cycles(frequency: float) -> None:
    """Refuse a frequency that would jump where the file repeats."""
    cycles = frequency * WINDOW
    if not 0.0 < frequency < SAMPLE_RATE / 2 or abs(cycles - round(cycles)) > 1e-9:
        raise ScenarioError(
            f"frequency {frequency} Hz does not repeat in a {WINDOW} s file; "
            f"expected a multiple of {1 / WINDOW} Hz above 0 and below {SAMPLE_RATE / 2} Hz"
        )


def _check_band(*frequencies: float) -> None:
    """Refuse frequencies that the points would alias."""
    for frequency in frequencies:
        if not 0.0 <= frequency <= SAMPLE_RATE / 2:
            raise ScenarioError(f"frequencies must lie in 0 to {SAMPLE_RATE / 2} Hz, given {frequency} Hz")


_FUNCTIONS: tuple[Callable[..., Waveform], ...] = (
    *(sine, two_sines, multisine, prbs, sign_recursion, chirp, chirp_as_printed, chirp_franklin),
    *(bipolar_ramping_pulse, white_noise, points, record),
)

KINDS: Mapping[str, Callable[..., Waveform]] = MappingProxyType({f.__name__: f for f in _FUNCTIONS})
"""Every excitation by the name that scenario files use."""

COMPUTED: Mapping[str, Callable[..., Waveform]] = MappingProxyType(
    {name: function for name, function in KINDS.items() if function not in (points, record)}
)
"""Excitations that are computed from a few numbers; the others are a user's own."""

UNITS: Mapping[str, str] = {
    **dict.fromkeys(("amplitude", "offset"), "V"),
    **dict.fromkeys(("frequency", "f_start", "f_end", "f_min", "f_max", "f_low", "f_high", "f_center"), "Hz"),
    **{"pulse_width": "s", "clock": "samples per bit", "register": "bits", "sample_rate": "Hz", "ramp": "of the file"},
}
"""Units of the parameters of all kinds; those that are missing have none."""
