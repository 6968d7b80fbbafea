"""Which nonlinearity a joint has: models of a servo with dry friction, play or saturation, compared in simulation.

All are a second-order position servo with one parameter more; the one that simulates the record far better than the
linear servo and better than the others names the kind.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

FRICTION, PLAY, SATURATION = "dry friction", "play", "saturation"

LONGEST = 1500  # samples that are simulated: each model some hundred times
FEWEST = 100  # samples that tell a kind
BETTER = 0.75  # error of the kind named, relative to that of the linear servo, at most
DISTINCT = 0.85  # the same relative to that of any other kind
EXPLAINED = 0.3  # the same relative to the output, up to which the record is that of such a joint
EVALUATIONS = 12  # of each search, whose derivatives take one simulation per parameter more
SETTLED = 1e-3  # decrease by a step, relative to the cost, at which a search ends: kinds differ by far more
DAMPING = 0.7  # at the start
PARAMETERS = 4
"""Parameters of each joint: frequency, damping and gain of its servo, and the size of the nonlinearity."""

SIZES = {FRICTION: (0.03, 0.1, 0.3), PLAY: (0.03, 0.1, 0.3), SATURATION: (0.3, 1.0)}
"""Starts of the size of each nonlinearity, relative to the largest deviation of the output: error of the command
that is held, half of the gap, error from which on the drive is limited."""


def stop(signal: FloatArray, width: float) -> FloatArray:
    """Stop operator, the signal less `play` of it: displacement within the play [BrokateSprekels1996, sec. 2.1]."""
    return np.asarray(signal - play(signal, width))


def play(signal: FloatArray, width: float) -> FloatArray:
    """Output (N,) of play of half-width `width`: it follows its input at that distance at most."""
    # a sample limits the position to a range, and so do several in a row: their ranges are combined by doubling
    low, high = signal - width, signal + width
    reach = 1
    while reach < len(signal):
        low, high = (
            np.concatenate((low[:reach], np.clip(low[:-reach], low[reach:], high[reach:]))),
            np.concatenate((high[:reach], np.clip(high[:-reach], low[reach:], high[reach:]))),
        )
        reach *= 2
    return np.clip(float(signal[0]), low, high)


def told_kind(
    u: FloatArray, y: FloatArray, dt: float, delay: int, bandwidth: float, simulated: FloatArray | None = None
) -> str:
    """Kind of nonlinearity of a record of a joint; empty where the models do not tell one.

    Args:
        u: Command (N,).
        y: Angle (N,).
        dt: Sampling interval, s.
        delay: Dead time, samples.
        bandwidth: Bandwidth of a linear model, Hz, from which the searches start; NaN where it is not known.
        simulated: Simulation of a linear model that is no larger than these (N,), which counts beside the linear servo.
    """
    beside = None if simulated is None else simulated[:LONGEST] - simulated[:LONGEST].mean()
    y = y[:LONGEST] - y[:LONGEST].mean()
    reach = float(np.abs(y).max())
    if len(y) < FEWEST or not reach or np.ptp(u[: len(y)]) == 0.0:
        return ""
    natural = bandwidth if np.isfinite(bandwidth) and 0.0 < bandwidth < 0.25 / dt else 0.05 / dt
    start = np.array([np.log(2.0 * np.pi * natural), np.log(DAMPING), 1.0])
    linear_cost, costs = np.inf, dict.fromkeys(_SIMULATIONS, np.inf)
    if beside is not None:
        linear_cost = 0.5 * float(np.sum((y - beside) ** 2))
    # the dead time of a linear model may be the time that play or friction takes
    for dead_time in sorted({0, delay}):
        held = np.concatenate((np.full(dead_time, u[0]), u))[: len(y)]
        record = _Record(held - held.mean(), y, dt, reach)
        linear, cost = _searched(partial(_servo, record=record), y, start)
        linear_cost = min(linear_cost, cost)
        for kind in costs:
            costs[kind] = min(costs[kind], _least_cost(kind, linear, record))
    # costs are half of sums of squares
    best = min(costs, key=lambda kind: costs[kind])
    is_joint = costs[best] < EXPLAINED**2 * 0.5 * float(y @ y)
    others = min(value for kind, value in costs.items() if kind != best)
    is_told = costs[best] < BETTER**2 * linear_cost and costs[best] < DISTINCT**2 * others
    return best if is_joint and is_told else ""


@dataclass(frozen=True, eq=False)
class _Record:
    """Command and angle (N,) about their means, sampling interval in s, and the largest angle."""

    command: FloatArray
    y: FloatArray
    dt: float
    reach: float


def _least_cost(kind: str, linear: FloatArray, record: _Record) -> float:
    """Least square error of a kind, from the parameters of the linear servo and the best of some sizes."""

    def simulate(parameters: FloatArray) -> FloatArray:
        return _SIMULATIONS[kind](parameters, record)

    starts = [np.append(linear, np.log(size)) for size in SIZES[kind]]
    errors = [float(np.std(simulate(start) - record.y)) for start in starts]
    _, cost = _searched(simulate, record.y, starts[int(np.argmin(errors))])
    return cost


def _searched(
    simulate: Callable[[FloatArray], FloatArray], y: FloatArray, start: FloatArray
) -> tuple[FloatArray, float]:
    """Parameters (p,) with the least square error of the simulation apart from its mean, and half its sum."""

    def errors(parameters: FloatArray) -> FloatArray:
        difference = simulate(parameters) - y
        # limits of logarithms keep the simulation stable; what overflows nevertheless is far from the record
        difference = np.nan_to_num(difference, nan=1e6, posinf=1e6, neginf=-1e6)
        return np.asarray(difference - difference.mean())

    reach = np.full(len(start), 5.0)
    result = scipy.optimize.least_squares(
        errors,
        start,
        bounds=(start - reach, start + reach),
        diff_step=1e-3,
        x_scale=0.3,
        ftol=SETTLED,
        max_nfev=EVALUATIONS,
    )
    return result.x, float(result.cost)


def _steps(parameters: FloatArray, dt: float) -> tuple[list[float], float, float]:
    """Entries of the transition matrix, and inputs of angle and velocity, of a servo under held commands over dt."""
    natural, damping = np.exp(parameters[:2])
    stiffness = natural**2
    system = np.array([[0.0, 1.0, 0.0], [-stiffness, -2.0 * damping * natural, stiffness], [0.0, 0.0, 0.0]])
    transition = scipy.linalg.expm(system * dt)
    return transition[:2, :2].ravel().tolist(), float(transition[0, 2]), float(transition[1, 2])


def _servo(parameters: FloatArray, record: _Record) -> FloatArray:
    """Angle of the linear servo: logarithms of natural frequency and damping, gain."""
    (a, b, c, d), of_angle, of_velocity = _steps(parameters, record.dt)
    numerator = [0.0, of_angle, b * of_velocity - d * of_angle]
    denominator = [1.0, -(a + d), a * d - b * c]
    # at rest at the first angle
    first = float(record.y[0])
    angles, _ = scipy.signal.lfilter(numerator, denominator, parameters[2] * record.command, zi=[first, -d * first])
    return np.asarray(angles)


def _servo_with_friction(parameters: FloatArray, record: _Record) -> FloatArray:
    """Angle with dry friction, in units of the command error that it holds, in two steps a sample [Moreau1988].

    In each the friction is what would stop the joint at the end of the step, within its limits.
    """
    (a, b, c, d), of_angle, of_velocity = _steps(parameters, 0.5 * record.dt)
    limit = record.reach * float(np.exp(parameters[3]))
    angle, velocity, angles = float(record.y[0]), 0.0, []
    for value in (parameters[2] * record.command).tolist():
        angles.append(angle)
        for _ in range(2):
            free = c * angle + d * velocity + of_velocity * value
            friction = -free / of_velocity
            # `min` and `max` would take half of the time
            if friction > limit:
                friction = limit
            elif friction < -limit:
                friction = -limit
            angle = a * angle + b * velocity + of_angle * (value + friction)
            velocity = free + of_velocity * friction
    return np.array(angles)


def _servo_with_play(parameters: FloatArray, record: _Record) -> FloatArray:
    """Angle behind play of the output."""
    return play(_servo(parameters, record), record.reach * float(np.exp(parameters[3])))


def _servo_with_limit(parameters: FloatArray, record: _Record) -> FloatArray:
    """Angle with a limited drive, in two steps a sample."""
    (a, b, c, d), of_angle, of_velocity = _steps(parameters, 0.5 * record.dt)
    natural, damping = np.exp(parameters[:2])
    limit, rate = record.reach * float(np.exp(parameters[3])), float(2.0 * damping / natural)
    angle, velocity, angles = float(record.y[0]), 0.0, []
    for value in (parameters[2] * record.command).tolist():
        angles.append(angle)
        for _ in range(2):
            error = value - angle - rate * velocity
            drive = error
            if error > limit:
                drive = limit
            elif error < -limit:
                drive = -limit
            limited = value + drive - error
            angle, velocity = (
                a * angle + b * velocity + of_angle * limited,
                c * angle + d * velocity + of_velocity * limited,
            )
    return np.array(angles)


_SIMULATIONS: dict[str, Callable[[FloatArray, _Record], FloatArray]] = {
    FRICTION: _servo_with_friction,
    PLAY: _servo_with_play,
    SATURATION: _servo_with_limit,
}
