"""Joints whose nonlinearity is known: dry friction, play, saturation; and stiff servos under smooth commands.

Own equations of motion, integrated in small steps: nothing of the laboratory or of the toolbox is used.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import cont2discrete, lfilter

from sysid import IOData

AMPLITUDE = 0.1  # of commands, rad
RESOLUTION = 2 * np.pi / 2**16  # of the encoder, rad
STEP = 1e-3  # of the integration, s, at most


@dataclass(frozen=True)
class Servo:
    """A second-order position servo: natural frequency in rad/s and damping."""

    natural: float
    damping: float

    def discrete(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Numerator with its delay and denominator of the sampled servo under held inputs."""
        numerator = [self.natural**2]
        b, a, _ = cont2discrete((numerator, [1.0, 2 * self.damping * self.natural, self.natural**2]), dt)
        return b.ravel(), a


def drawn_servo(rng: np.random.Generator) -> Servo:
    return Servo(2 * np.pi * rng.uniform(1.0, 4.0), rng.uniform(0.5, 1.2))


@njit(cache=False)
def _with_friction(u, natural, damping, band, limit, dt, steps):
    """Angle of a servo with dry friction that holds errors up to `band`, and accelerations at most `limit`."""
    h = dt / steps
    q, v = u[0], 0.0
    y = np.empty(len(u))
    stiffness = natural * natural
    for k in range(len(u)):
        y[k] = q
        for _ in range(steps):
            drive = stiffness * (u[k] - q) - 2.0 * damping * natural * v
            drive = min(max(drive, -limit), limit)
            friction = stiffness * band
            if v == 0.0:
                if abs(drive) <= friction:
                    continue
                v = h * (drive - friction * np.sign(drive))
            else:
                changed = v + h * (drive - friction * np.sign(v))
                # a joint that stops within the step stays, unless the drive exceeds the friction in the next one
                v = 0.0 if changed * v < 0.0 else changed
            q += h * v
    return y


@njit(cache=False)
def play(x, half_width):
    """Output of play: it follows its input at a distance of half the gap at most."""
    y = np.empty(len(x))
    position = x[0]
    for k in range(len(x)):
        position = min(max(position, x[k] - half_width), x[k] + half_width)
        y[k] = position
    return y


def command(rng: np.random.Generator, samples: int, dt: float, fastest: float) -> np.ndarray:
    """Held levels, a multisine or smooth moves, of about `AMPLITUDE`, with power up to some `fastest` Hz."""
    kind = rng.integers(4)
    time = dt * np.arange(samples)
    hold = max(int(0.5 / (fastest * dt)), 2)
    if kind == 0:
        u = np.repeat(rng.choice([-1.0, 1.0], samples // hold + 1), hold)[:samples]
    elif kind == 1:
        u = np.repeat(rng.uniform(-1.0, 1.0, samples // hold + 1), hold)[:samples]
    elif kind == 2:
        frequencies = np.linspace(fastest / 20, fastest, 20)
        phases = rng.uniform(0, 2 * np.pi, 20)
        u = np.sin(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1)
        u /= np.abs(u).max()
    else:
        u = minimum_jerk(rng, samples, hold)
    return AMPLITUDE * u


def minimum_jerk(rng: np.random.Generator, samples: int, hold: int) -> np.ndarray:
    """Moves between random levels along polynomials of degree five, some with rests between."""
    u, level = [], 0.0
    while len(u) < samples:
        target, length = rng.uniform(-1.0, 1.0), int(hold * rng.uniform(1.0, 4.0))
        s = np.arange(length) / length
        u += list(level + (target - level) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        u += [target] * int(hold * rng.uniform(0.0, 1.0))
        level = target
    return np.array(u[:samples])


def _measured(rng: np.random.Generator, u: np.ndarray, y: np.ndarray, dt: float) -> IOData:
    noise = AMPLITUDE * 10.0 ** rng.uniform(-4.0, -2.0)
    y = y + noise * rng.standard_normal(len(y))
    return IOData(u, RESOLUTION * np.round(y / RESOLUTION), dt)


def joint(rng: np.random.Generator, kind: str) -> tuple[Servo, IOData]:
    """A record of a servo: "linear", "friction", "play" or "saturation"."""
    servo, dt, samples = drawn_servo(rng), 0.02, int(rng.choice([1000, 2000]))
    u = command(rng, samples, dt, servo.natural / 2 / np.pi * rng.uniform(0.5, 2.0))
    steps = round(dt / STEP)
    part = rng.uniform(0.05, 0.3)
    if kind == "friction":
        y = _with_friction(u, servo.natural, servo.damping, part * AMPLITUDE, np.inf, dt, steps)
    elif kind == "saturation":
        limit = rng.uniform(0.3, 0.7) * servo.natural**2 * AMPLITUDE
        y = _with_friction(u, servo.natural, servo.damping, 0.0, limit, dt, steps)
    else:
        b, a = servo.discrete(dt)
        y = lfilter(b, a, u - u[0]) + u[0]
        if kind == "play":
            y = play(y, part * np.abs(y - y.mean()).max())
    return servo, _measured(rng, u, y, dt)


def stiff_servo(rng: np.random.Generator) -> tuple[Servo, IOData]:
    """A record of a stiff servo under filtered or minimum-jerk moves at 100 to 1000 Hz.

    The arm's vibration and friction of the cables are a coloured disturbance of a hundredth of the motion or less.
    """
    dt = float(rng.choice([1e-3, 2e-3, 5e-3, 1e-2]))
    samples = int(rng.choice([10.0, 20.0]) / dt)
    slowest = rng.uniform(0.5, 2.0)
    servo = Servo(2 * np.pi * slowest * rng.uniform(1.0, 6.0), rng.uniform(0.6, 1.1))
    if rng.integers(2):
        u = minimum_jerk(rng, samples, round(0.5 / (slowest * dt)))
    else:
        levels = np.repeat(rng.uniform(-1.0, 1.0, samples), round(0.5 / (slowest * dt)))[:samples]
        b, a = Servo(2 * np.pi * slowest, 1.0).discrete(dt)
        u = lfilter(b, a, levels)
    b, a = servo.discrete(dt)
    y = lfilter(b, a, u)
    vibration = lfilter([1.0], [1.0, -(1.0 - 10.0 * dt)], rng.standard_normal(samples))
    y += y.std() * 10.0 ** rng.uniform(-3.0, -2.0) * vibration / vibration.std() + 1e-4 * rng.standard_normal(samples)
    return servo, IOData(u, y, dt)


def robot_joint(rng: np.random.Generator) -> IOData:
    """A stiff joint with friction and gravity under smooth commands at high rate, as robots log it."""
    dt, samples = float(rng.choice([2e-3, 5e-3])), 4000
    servo = Servo(2 * np.pi * rng.uniform(4.0, 10.0), rng.uniform(0.4, 1.0))
    u = 5.0 * AMPLITUDE * minimum_jerk(rng, samples, round(0.3 / dt))
    sag = rng.uniform(0.02, 0.1)
    # gravity sags the joint by a part that depends on the pose; friction holds some percent of the command
    loaded = u - sag * np.sin(u + 0.5)
    band = rng.uniform(0.01, 0.05) * np.abs(u).max()
    y = _with_friction(loaded, servo.natural, servo.damping, band, np.inf, dt, max(round(dt / STEP), 2))
    delayed = np.concatenate((np.full(3, y[0]), y[:-3]))
    return IOData(u, delayed + 2e-4 * rng.standard_normal(samples), dt)
