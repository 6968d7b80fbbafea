"""Where the oil and the energy of a run went: the two books that must balance, whatever the actuator's form."""

from dataclasses import dataclass, fields
from numbers import Integral

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.values import JOINTS
from hmtb_twin.run.engine_warnings import warned_of

FINEST = 1000
"""Physics steps in place of one, at most: with more a run of seconds takes hours."""

FARTHEST = 2.0 * np.pi
"""Largest commanded angle, rad: a whole turn, and more than any joint can."""


@dataclass(frozen=True)
class OilBalance:
    """Oil of each drive over a run: what came in through the valve is where it went. Volumes (n,), cm^3.

    Attributes:
        ports: Net flow through the valve's load ports.
        leaked: Past the actuator.
        swept: Displaced by the joint's travel.
        stored: By compression.
        underway: Not yet taken or given by the joint, by which the oil lags one physics step: D h (w at the end less w
            at the start). Zero from rest to rest, and with the step.
        throughput: Integral of the magnitude of the flow through the load ports.
    """

    ports: np.ndarray
    leaked: np.ndarray
    swept: np.ndarray
    stored: np.ndarray
    underway: np.ndarray
    throughput: np.ndarray

    def __post_init__(self) -> None:
        for item in fields(self):
            volumes = np.array(getattr(self, item.name), dtype=float)
            volumes.setflags(write=False)
            object.__setattr__(self, item.name, volumes)

    @property
    def residual(self) -> np.ndarray:
        """Oil that came in and is nowhere, (n,) cm^3."""
        return self.ports - self.leaked - self.swept - self.stored + self.underway

    @property
    def closure(self) -> float:
        """Sum of the residuals' magnitudes over all the oil that flowed."""
        return float(np.abs(self.residual).sum() / self.throughput.sum())


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of all drives and the arm over a run: what the supply gave is where it went. Energies in J.

    Attributes:
        supplied: By the supply: its pressure times the flow it delivers.
        throttled: Lost in the valves, between supply and load ports.
        leaked: Lost in leakage past the actuators.
        compressed: Stored in the oil's compression.
        limited: Taken by the limit of the actuators' torque, which cuts the torque but not the pressure; negative where
            a load overruns the limit: a real actuator's relief valves would open before.
        rubbed: Lost in dry friction.
        dragged: Lost in viscous drag.
        constrained: Taken by the pin of the indexed joint and by stops.
        kinetic: Gained by the links in kinetic energy.
        potential: Gained by the links in height.
    """

    supplied: float
    throttled: float
    leaked: float
    compressed: float
    limited: float
    rubbed: float
    dragged: float
    constrained: float
    kinetic: float
    potential: float

    @property
    def delivered(self) -> float:
        """Net energy through the load ports, J."""
        return self.supplied - self.throttled

    @property
    def residual(self) -> float:
        """Energy that came in and is nowhere, J."""
        return self.supplied - sum(getattr(self, item.name) for item in fields(self) if item.name != "supplied")

    @property
    def closure(self) -> float:
        """Magnitude of the residual over the energy supplied."""
        return abs(self.residual) / self.supplied


def checked_run(arm: Arm, actuator: str, command: np.ndarray, refined: int) -> np.ndarray:
    """Check what a run whose books are drawn up is asked for.

    Args:
        arm: The arm.
        actuator: The form of its actuators that the books are for.
        command: Commanded angles (N, 7) at 50 Hz, rad.
        refined: Physics steps in place of one.

    Returns:
        The commanded angles as floats.

    Raises:
        TwinError: Actuators of another form, an arm at its worksite, commands that are not finite angles of seven
            joints within a turn, or no whole number of steps from 1 to `FINEST`.
    """
    if arm.plant.actuator != actuator or arm.worksite:
        where = "at the worksite" if arm.worksite else "in free space"
        raise TwinError(
            f"balances of {arm.plant.actuator} actuators {where} asked, expected {actuator} ones in free space"
        )
    if not isinstance(refined, Integral) or isinstance(refined, bool) or not 1 <= refined <= FINEST:
        raise TwinError(f"refined = {refined!r} given, expected a whole number from 1 to {FINEST}")
    try:
        angles = np.asarray(command)
    except ValueError as error:
        raise TwinError(f"command given that is no array of angles ({error}), expected (N, {len(JOINTS)})") from error
    if angles.dtype.kind not in "iuf":
        raise TwinError(f"command of type {angles.dtype} given, expected angles in rad, (N, {len(JOINTS)})")
    if angles.ndim != 2 or angles.shape[1] != len(JOINTS) or not len(angles):
        raise TwinError(f"command of shape {angles.shape} given, expected (N, {len(JOINTS)}), N at least 1")
    angles = angles.astype(float)
    wrong = ~(np.abs(angles) <= FARTHEST)
    if wrong.any():
        tick, joint = np.argwhere(wrong)[0]
        raise TwinError(
            f"command of {angles[tick, joint]:g} rad given to the {JOINTS[joint].replace('_', ' ')} at tick {tick}, "
            f"expected finite angles within {FARTHEST:.4g} rad"
        )
    return angles


def check_course(data: mujoco.MjData) -> None:
    """Refuse to draw up the books of a run in which the physics engine had to start anew.

    Args:
        data: The state at the run's end.

    Raises:
        TwinError: The engine warned.
    """
    raised = warned_of(np.array([stat.number for stat in data.warning]))
    if raised:
        raise TwinError(f"the physics engine warned of {raised} in this run: there are no books to draw up")


def link_energy(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, float]:
    """Return the potential and the kinetic energy of the links, J, at a state whose positions are worked out."""
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return float(data.energy[0]), float(data.energy[1])
