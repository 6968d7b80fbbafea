"""Rates of `delayest` on records with a known delay: how often exact, how often its interval holds it, how wide it is.

    PYTHONPATH=. python tests/benchmarks/delays.py [--records 60] [--seed 0] [--kinds binary step chirp slow]

Plants are drawn anew for every record: lags or damped pairs, delays 0 to 20, noise of 0, 5 and 20 % of the output,
white or coloured by turns.
"""

import argparse
import warnings
from dataclasses import dataclass
from time import process_time

import numpy as np
from scipy.signal import chirp, lfilter

from sysid import IOData, delayest

LARGEST = 20
NOISES = (0.0, 0.05, 0.2)
DT = 0.01

FloatArray = np.ndarray


def binary_input(rng: np.random.Generator) -> FloatArray:
    """Random levels held for 1, 3 or 5 samples, or white noise."""
    samples, hold = int(rng.integers(600, 2000)), int(rng.choice([0, 1, 3, 5]))
    if hold == 0:
        return rng.standard_normal(samples)
    return np.repeat(rng.choice([-1.0, 1.0], samples // hold + 1), hold)[:samples]


def step_input(rng: np.random.Generator) -> FloatArray:
    """One step from rest, in the first sixth of the record."""
    samples = int(rng.integers(300, 1000))
    return (np.arange(samples) >= rng.integers(2, samples // 6)).astype(float)


def chirp_input(rng: np.random.Generator) -> FloatArray:
    """A linear sweep from 0.1 % to 15 % of the sampling rate."""
    samples = int(rng.integers(1500, 4000))
    t = np.arange(samples) * DT
    return chirp(t, 0.001 / DT, t[-1], 0.15 / DT)


def slow_input(rng: np.random.Generator) -> FloatArray:
    """Six slow sines, from 0.03 % to 0.9 % of the sampling rate."""
    samples = int(rng.integers(1500, 4000))
    t = np.arange(samples)
    total = np.zeros(samples)
    for size, frequency in zip((0.3, 0.2, 0.1, 0.05, 0.03, 0.02), (3e-4, 9e-4, 2e-3, 3e-3, 6e-3, 9e-3), strict=True):
        total += size * np.sin(2.0 * np.pi * frequency * t + rng.uniform(0.0, 6.0))
    return total


INPUTS = {"binary": binary_input, "step": step_input, "chirp": chirp_input, "slow": slow_input}


def drawn_plant(rng: np.random.Generator, kind: str) -> tuple[FloatArray, FloatArray]:
    """B and F of a lag, two lags or a damped pair; a resonance beside the sweep, a servo behind slow commands."""
    if kind == "chirp":
        angle, damping = 2.0 * np.pi * rng.uniform(0.02, 0.12), rng.uniform(0.005, 0.1)
        pole = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * angle)
        F = np.poly([pole, np.conj(pole)]).real
        B = np.concatenate(([1.0], rng.uniform(-1.0, 1.0, int(rng.integers(1, 3)))))
        return B, F
    shape = int(rng.integers(3))
    if kind == "slow":
        angle, damping = rng.uniform(0.05, 0.2), rng.uniform(0.6, 1.0)
        pole = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2 + 1e-6)) * angle)
        return np.array([1.0, 0.9]), np.poly([pole, np.conj(pole)]).real
    if shape == 0:
        F = np.poly([rng.uniform(0.5, 0.97)])
    elif shape == 1:
        F = np.poly([rng.uniform(0.8, 0.97), rng.uniform(0.2, 0.8)])
    else:
        pole = rng.uniform(0.8, 0.97) * np.exp(1j * rng.uniform(0.03, 0.5))
        F = np.poly([pole, np.conj(pole)]).real
    B = np.array([1.0]) if shape == 0 else np.array([1.0, rng.uniform(-0.5, 0.9)])
    return B, F


def record(kind: str, seed: int, number: int) -> tuple[IOData, int, float]:
    """A record, its delay in samples, and its noise."""
    rng = np.random.default_rng((seed, sorted(INPUTS).index(kind), number))
    u = INPUTS[kind](rng)
    B, F = drawn_plant(rng, kind)
    delay, noise = int(rng.integers(0, LARGEST + 1)), NOISES[number % len(NOISES)]
    # before the record the input was at its first value
    rest = 3000
    before = np.concatenate((np.full(rest, u[0]), u))
    y = lfilter(np.concatenate((np.zeros(delay), B / B.sum() * F.sum())), F, before)[rest:]
    colour = [1.0] if number // len(NOISES) % 2 else [1.0, -0.8]
    e = lfilter([1.0], colour, rng.standard_normal(len(u) + 100))[100:]
    return IOData(u, y + noise * y.std() * e / e.std(), DT), delay, noise


@dataclass(frozen=True)
class Answer:
    """What `delayest` says of one record."""

    noise: float
    truth: int
    delay: int
    interval: tuple[int, int]
    warned: bool
    seconds: float

    @property
    def holds(self) -> bool:
        """Whether the interval holds the truth."""
        return self.interval[0] <= self.truth <= self.interval[1]


def answer(kind: str, seed: int, number: int) -> Answer:
    """Ask about one record."""
    data, truth, noise = record(kind, seed, number)
    begin = process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        delays = delayest(data, largest=LARGEST)
    seconds = process_time() - begin
    least, most = delays.interval[:, 0, 0].tolist()
    warned = any("cannot be told" in str(warning.message) for warning in caught)
    return Answer(noise, truth, int(delays.arx[0, 0]), (least, most), warned, seconds)


def main() -> None:
    """Print a line for each kind of input and size of noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=sorted(INPUTS))
    parser.add_argument("--wrong", action="store_true", help="list the records whose interval misses the delay")
    arguments = parser.parse_args()
    print(f"{'input':8} {'noise':>6} {'records':>8} {'exact':>6} {'held':>6} {'wide, median':>13} {'CPU s':>6}")
    for kind in arguments.kinds:
        answers = [answer(kind, arguments.seed, number) for number in range(arguments.records)]
        for noise in (*NOISES, None):
            chosen = [a for a in answers if noise is None or a.noise == noise]
            exact = sum(a.delay == a.truth for a in chosen)
            held = sum(a.holds for a in chosen)
            width = np.median([a.interval[1] - a.interval[0] for a in chosen])
            seconds = np.mean([a.seconds for a in chosen])
            label = "all" if noise is None else f"{noise:.0%}"
            print(f"{kind:8} {label:>6} {len(chosen):8} {exact:6} {held:6} {width:13.1f} {seconds:6.2f}", flush=True)
        if arguments.wrong:
            for number, a in enumerate(answers):
                if not a.holds or a.delay != a.truth:
                    print(f"    {number}: {a}")


if __name__ == "__main__":
    main()
