"""Records that mislead a choice of orders, their plants known: disturbances, integrators, feedback, friction.

`KINDS` draws a plant and its records by kind. Nothing of the laboratory is used.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from sysid import IOData, Polynomials
from sysid.models import innovations_form
from tests.benchmarks.nonlinear_joints import drawn_servo, joint, stiff_servo

SAMPLES, DT = 600, 0.02
TOLERANCE = 0.2  # of gain and bandwidth, relative
FAR = 1.5  # bandwidth, relative to the highest frequency of the input, from which on a record cannot tell it
POLE = 0.01  # of an integrating or unstable pole, absolute

FloatArray = np.ndarray


@dataclass(frozen=True)
class Plant:
    """B and F of a plant, and what of it an answer must find."""

    B: FloatArray
    F: FloatArray
    dt: float = DT
    is_linear: bool = True
    highest: float = np.inf
    """Highest frequency that the input excites, Hz: of a bandwidth far above it nothing is known."""

    @property
    def outermost(self) -> float:
        """Largest modulus of its poles."""
        return float(np.abs(np.roots(self.F)).max())

    @property
    def gain(self) -> float:
        """Gain at 0 Hz."""
        return float(self.B.sum() / self.F.sum())

    @property
    def bandwidth(self) -> float:
        """Half-power bandwidth, Hz."""
        return float(innovations_form(Polynomials(B=self.B, F=self.F), self.dt).bandwidth()[0, 0])

    def finds(self, model) -> bool:
        """Whether a model is right about it."""
        if not self.is_linear or self.bandwidth > FAR * self.highest:
            return False
        poles = np.abs(model.poles()).max(initial=0.0)
        if self.outermost > 1.0 - 1e-9:
            return bool(abs(poles - self.outermost) < POLE)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            bandwidth = float(model.model.bandwidth()[0, 0])
        errors = (model.dc_gain()[0, 0] / self.gain - 1.0, bandwidth / self.bandwidth - 1.0)
        return all(abs(error) <= TOLERANCE for error in errors)


def drawn_plant(rng: np.random.Generator) -> Plant:
    """A lag, two lags, or a damped pair, whose bandwidth is well below Nyquist and resolved by the record."""
    kind = rng.integers(3)
    slow, fast = rng.uniform(0.82, 0.94), rng.uniform(0.3, 0.8)
    if kind == 0:
        poles = [slow]
    elif kind == 1:
        poles = [slow, fast]
    else:
        poles = [0.88 * np.exp(1j * rng.uniform(0.05, 0.3))]
        poles.append(np.conj(poles[0]))
    F = np.poly(poles).real
    B = np.concatenate((np.zeros(1 + rng.integers(3)), [1.0], [0.5] if kind else []))
    return Plant(B * rng.uniform(0.5, 2.0) * F.sum() / B.sum(), F)


def binary(rng: np.random.Generator, samples: int = SAMPLES, hold: int = 5) -> FloatArray:
    """Random levels +-1, each held for some samples."""
    return np.repeat(rng.choice([-1.0, 1.0], -(-samples // hold)), hold)[:samples]


Kind = Callable[[np.random.Generator], tuple[Plant, tuple[IOData, ...]]]


def disturbed(disturbance: Callable[[np.random.Generator, FloatArray], FloatArray], size: float) -> Kind:
    """Records with a disturbance of a standard deviation relative to that of the output, beside white noise of 5 %."""

    def draw(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
        plant, u = drawn_plant(rng), binary(rng)
        y = lfilter(plant.B, plant.F, u)
        spread, shape = y.std(), disturbance(rng, np.arange(SAMPLES))
        shape = shape / shape.std() if shape.any() else shape
        return plant, (IOData(u, y + spread * (size * shape + 0.05 * rng.standard_normal(SAMPLES)), DT),)

    return draw


def walk(rng: np.random.Generator, t: FloatArray) -> FloatArray:
    return np.cumsum(rng.standard_normal(len(t)))


def coloured(rng: np.random.Generator, t: FloatArray) -> FloatArray:
    return lfilter([1.0], [1.0, -0.95], rng.standard_normal(len(t) + 200))[200:]


def sine(cycles: tuple[float, float]) -> Callable[[np.random.Generator, FloatArray], FloatArray]:
    """A sine of a number of cycles in the record between two limits."""

    def draw(rng: np.random.Generator, t: FloatArray) -> FloatArray:
        return np.sin(2.0 * np.pi * rng.uniform(*cycles) * t / len(t) + rng.uniform(0.0, 6.0))

    return draw


def shift(rng: np.random.Generator, t: FloatArray) -> FloatArray:
    return (t > rng.uniform(0.2, 0.8) * len(t)).astype(float)


def integrator(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """A motor's position by an encoder."""
    pole = rng.uniform(0.8, 0.95)
    plant = Plant(np.array([0.0, 0.02, 0.015]) * (1.0 - pole), np.poly([1.0, pole]))
    u = binary(rng, hold=20)
    y = lfilter(plant.B, plant.F, u)
    step = 0.01 * np.ptp(y)
    return plant, (IOData(u, np.round(y / step) * step, DT),)


def unstable(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """An unstable lag held by proportional feedback, with set-point changes."""
    pole = rng.uniform(1.02, 1.1)
    plant = Plant(np.array([0.0, 0.1]), np.array([1.0, -pole]))
    x, u, y = 0.0, [], []
    for request in binary(rng, hold=10):
        y.append(x + 0.02 * rng.standard_normal())
        u.append(request - 4.0 * y[-1])
        x = pole * x + 0.1 * u[-1]
    return plant, (IOData(u, y, DT),)


def feedback(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """Proportional control of the same sample, with set-point steps and a drifting disturbance."""
    pole = rng.uniform(0.6, 0.9)
    plant = Plant(np.array([0.0, 1.5 * (1.0 - pole)]), np.array([1.0, -pole]))
    drift = 0.02 * walk(rng, np.arange(SAMPLES))
    x, u, y = 0.0, [], []
    for request, level in zip(binary(rng, hold=25), drift, strict=True):
        y.append(x + level + 0.01 * rng.standard_normal())
        u.append(0.5 * (request - y[-1]))
        x = pole * x + (1.0 - pole) * 1.5 * u[-1]
    return plant, (IOData(u, y, DT),)


def several(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """Three runs of one plant, each about a level of its own."""
    plant, records = drawn_plant(rng), []
    for k in range(3):
        u = binary(rng, 300)
        y = lfilter(plant.B, plant.F, u)
        y = y + y.std() * (0.05 * rng.standard_normal(300) + rng.uniform(-10.0, 10.0))
        records.append(IOData(u, y, DT, name=f"run {k}"))
    return plant, tuple(records)


def step_test(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """A single step in the middle: the last quarter is steady."""
    plant = drawn_plant(rng)
    u = np.where(np.arange(SAMPLES) > rng.uniform(0.3, 0.6) * SAMPLES, 1.0, 0.0)
    y = lfilter(plant.B, plant.F, u)
    return plant, (IOData(u, y + 3.0 + 0.02 * rng.standard_normal(SAMPLES), DT),)


def joint_with(kind: str) -> Kind:
    """Joints with a nonlinearity, or none."""

    def draw(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
        servo, record = joint(rng, kind)
        return Plant(*servo.discrete(record.dt), record.dt, is_linear=kind in ("linear", "saturation")), (record,)

    return draw


def robot(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
    """A stiff servo under smooth commands at high rate, its noise coloured by the arm."""
    servo, record = stiff_servo(rng)
    b, a = servo.discrete(record.dt)
    return Plant(b, a, record.dt), (record,)


def excited_by(command: Callable[[np.random.Generator, FloatArray, float], tuple[FloatArray, float]]) -> Kind:
    """Servos at 100 Hz with quiet encoders under a command of limited band, which the function draws with its end."""

    def draw(rng: np.random.Generator) -> tuple[Plant, tuple[IOData, ...]]:
        servo, time = drawn_servo(rng), 0.01 * np.arange(3000)
        hz = servo.natural / (2 * np.pi)
        u, highest = command(rng, time, hz)
        b, a = servo.discrete(0.01)
        y = lfilter(b, a, u) + 10.0 ** rng.uniform(-4.0, -2.0) * rng.standard_normal(len(u))
        return Plant(b, a, 0.01, highest=highest), (IOData(u, y, 0.01),)

    return draw


def chirp(rng: np.random.Generator, time: FloatArray, hz: float) -> tuple[FloatArray, float]:
    """A linear sweep over the whole record, to beyond the servo's frequency."""
    first, last = rng.uniform(0.05, 0.2), hz * rng.uniform(1.5, 4.0)
    return np.sin(2 * np.pi * (first * time + 0.5 * (last - first) / time[-1] * time**2)), last


def tones(rng: np.random.Generator, time: FloatArray, hz: float) -> tuple[FloatArray, float]:
    """Twelve tones, the last beyond the servo's frequency."""
    last = hz * rng.uniform(1.2, 3.0)
    u = sum(np.sin(2 * np.pi * last * k / 12 * time + rng.uniform(0, 6)) for k in range(1, 13))
    return u / np.abs(u).max(), last


def slow_commands(rng: np.random.Generator, time: FloatArray, hz: float) -> tuple[FloatArray, float]:
    """Twelve tones far below the servo's frequency."""
    last = hz * rng.uniform(0.1, 0.4)
    u = sum(np.sin(2 * np.pi * last * k / 12 * time + rng.uniform(0, 6)) / k for k in range(1, 13))
    return u / np.abs(u).max(), last


KINDS: dict[str, Kind] = {
    "clean": disturbed(lambda rng, t: np.zeros(len(t)), 0.0),
    "ramp": disturbed(lambda rng, t: t.astype(float), 0.3),
    "slow sine": disturbed(sine((0.5, 5.0)), 0.3),
    "hum": disturbed(sine((60.0, 200.0)), 0.3),
    "random walk": disturbed(walk, 0.3),
    "coloured": disturbed(coloured, 0.3),
    "level shift": disturbed(shift, 0.3),
    "integrator": integrator,
    "unstable": unstable,
    "feedback": feedback,
    "several runs": several,
    "step test": step_test,
    "linear joint": joint_with("linear"),
    "friction": joint_with("friction"),
    "play": joint_with("play"),
    "saturation": joint_with("saturation"),
    "stiff servo": robot,
    "chirp": excited_by(chirp),
    "tones": excited_by(tones),
    "slow commands": excited_by(slow_commands),
}
