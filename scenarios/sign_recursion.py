"""The thesis' own binary sequence: the sign of noise that remembers the last level."""

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.waveform import POINTS, Waveform, check_seed


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
