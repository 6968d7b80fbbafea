"""Small-signal dynamics against what the arm carries and what its drives run on."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import PAYLOADS, Arm, Plant, load_arm
from hmtb_twin.parameters.drives import COLDEST, HOTTEST
from scenarios.truth.local_dynamics import LocalDynamics, Progress, dynamics_at, together
from scenarios.truth.truth_summary import hydraulic

PRESSURES = (7.0, 35.0)
"""Supply pressures looked at, MPa: a third of the nominal one to the 350 bar of industrial hydraulics."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """One condition varied at the operating pose, the others as the arm has them.

    Attributes:
        name: What is varied.
        unit: Its unit; empty for names.
        values: Its values (n,): numbers, or the names of payloads.
        dynamics: At these.
    """

    name: str
    unit: str
    values: tuple[float, ...] | tuple[str, ...]
    dynamics: LocalDynamics


def payloads(arm: Arm, angles: np.ndarray) -> Conditions:
    """Linearise with everything that the end effector may hold, lightest first; the servos keep their gains."""
    masses = {name: payload.mass if payload else 0.0 for name, payload in PAYLOADS.items()}
    names = tuple(sorted(masses, key=lambda name: masses[name]))
    arms = (load_arm(arm.variant, name, plant=arm.plant, specimen=arm.specimen) for name in names)
    return Conditions("payload", "", names, _dynamics(arms, angles))


def supply_pressures(arm: Arm, angles: np.ndarray, count: int) -> Conditions:
    """Linearise over the pressure of the supply; the lowest may be too low to hold the arm."""
    values = tuple(float(value) for value in np.linspace(*PRESSURES, count))
    arms = (_under(arm, replace(arm.plant, supply_pressure=value)) for value in values)
    return Conditions("supply pressure", "MPa", values, _dynamics(arms, angles))


def oil_temperatures(arm: Arm, angles: np.ndarray, count: int) -> Conditions:
    """Linearise over the temperature of the oil, which sets drag and leakage."""
    values = tuple(float(value) for value in np.linspace(COLDEST, HOTTEST, count))
    arms = (_under(arm, replace(arm.plant, oil_temperature=value)) for value in values)
    return Conditions("oil temperature", "°C", values, _dynamics(arms, angles))


def conditions(arm: Arm, angles: np.ndarray, count: int, progress: Progress | None = None) -> tuple[Conditions, ...]:
    """Vary payload and, where there is oil, supply pressure and oil temperature in turn.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad.
        count: Values of each pressure and temperature.
        progress: Called before each that takes time.
    """
    done = [payloads(arm, angles)]
    if hydraulic(arm):
        for vary in (supply_pressures, oil_temperatures):
            if progress is not None:
                progress(len(done), 3)
            done.append(vary(arm, angles, count))
    return tuple(done)


def _under(arm: Arm, plant: Plant) -> Arm:
    return load_arm(arm.variant, arm.payload, plant=plant, specimen=arm.specimen)


def _dynamics(arms: Iterable[Arm], angles: np.ndarray) -> LocalDynamics:
    return together(dynamics_at(arm, angles) for arm in arms)
