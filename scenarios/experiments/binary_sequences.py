"""Binary sequences: maximum-length, and the thesis' recursion."""

import numpy as np
from scipy.signal import max_len_seq

from scenarios.experiments.waveform import POINTS, Waveform, check_seed
from scenarios.files.errors import ScenarioError

LONGEST_REGISTER = 32
"""Bits of the longest register that `scipy.signal.max_len_seq` has taps for."""


def prbs(*, amplitude: float = 1.0, clock: int = 2, seed: int = 0, register: int = 0) -> Waveform:
    """Maximum-length binary sequence between -amplitude and +amplitude [Soderstrom1989, compl. C5.3].

    The sequence is cut after 100 points. The shortest register that fills the file has few starts, and what begins one
    bit later is nearly the same file played later; a longer one has sequences that differ in earnest, with spectra less
    flat. With the shortest the file may keep a mean, of up
    to 0.12, 0.16 and 0.28 of the amplitude at one, two and three samples per bit, as a rule more at longer bits. Its
    spectrum is only nearly flat under the sinc-shaped envelope of the held bits, with zeros at multiples of 50/clock
    Hz.
    Equation (2.11) of [Morris1996] as printed has levels 2 C1 and 2 C2; here the levels are the amplitude itself.

    Args:
        amplitude: Level, V.
        clock: Samples per bit; a divisor of 100 keeps every bit equally long.
        seed: Chooses the start state of the register.
        register: Bits of the register; 0 for the shortest whose sequence fills the file.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: `clock` is not between 1 and 33, the seed is negative, or the register is too short to fill the
            file or longer than 32 bits.
    """
    check_seed(seed)
    # Three bits are the period of the shortest register: fewer may all be equal.
    if not 1 <= clock <= POINTS // 3:
        raise ScenarioError(f"clock must be 1 to {POINTS // 3} samples per bit, given {clock}")
    bits = -(-POINTS // clock)
    shortest = max(2, int(np.ceil(np.log2(bits + 1))))
    if register and not shortest <= register <= LONGEST_REGISTER:
        raise ScenarioError(
            f"register must be {shortest} to {LONGEST_REGISTER} bits at {clock} samples per bit, or 0 for the "
            f"shortest, given {register}"
        )
    state = np.random.default_rng(seed).integers(0, 2, register or shortest)
    if not state.any():
        state[0] = 1  # a register of zeros never leaves zero
    sequence, _ = max_len_seq(len(state), state=state, length=bits)
    points = amplitude * np.repeat(2.0 * sequence - 1.0, clock)[:POINTS]
    parameters = {"amplitude": amplitude, "clock": clock, "seed": seed}
    return Waveform(points, "prbs", {**parameters, "register": register} if register else parameters)


def sign_recursion(*, amplitude: float = 1.0, memory: float = 0.0, as_printed: bool = False, seed: int = 0) -> Waveform:
    """Equation (2.11): `u(t) = (C1 + C2)/2 + (C1 - C2)/2 sign(R u(t-1) + w(t))`, w white and normal [Morris1996].

    Here C1 = -C2 is the amplitude. As printed both factors 1/2 are missing, which doubles the levels. The thesis calls
    R the covariance function and gives no value; here it weighs the last level, taken as -1 or +1, against the noise of
    standard deviation 1: 0 gives independent bits, a large one long runs. Unlike `prbs` it is no maximum-length
    sequence: its spectrum is flat on average only, and the file may keep a mean.

    Args:
        amplitude: C1 = -C2, V.
        memory: R, against a standard deviation of the noise of 1.
        as_printed: Without the factors 1/2: levels of twice the amplitude.
        seed: Draws the noise.

    Returns:
        The 100-point file.

    Raises:
        ScenarioError: The seed is negative, or the level never changes: the memory is too strong.
    """
    check_seed(seed)
    noise = np.random.default_rng(seed).standard_normal(POINTS)
    signs, last = np.empty(POINTS), 1.0
    for t in range(POINTS):
        last = signs[t] = 1.0 if memory * last + noise[t] >= 0.0 else -1.0
    if abs(signs.sum()) == POINTS:
        raise ScenarioError(
            f"sign_recursion with memory {memory:g} and seed {seed} never changes its level; "
            "expected a memory nearer to 0"
        )
    points = (2.0 if as_printed else 1.0) * amplitude * signs
    parameters = {"amplitude": amplitude, "memory": memory, "as_printed": as_printed, "seed": seed}
    return Waveform(points, "sign_recursion", parameters)
