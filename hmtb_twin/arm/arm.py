"""The arm as MuJoCo runs it: the MJCF of `models/hmtb` with the actuators and servos of one variant."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin.arm.arm_model import compile_arm, tuned_gains
from hmtb_twin.arm.controller_model import ControllerModel, controller_model
from hmtb_twin.arm.worksite_model import LATCH_WELD
from hmtb_twin.hydraulics.rest import drooping, inertia, lean_on_pins, scales
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.errors import OverloadError, TwinError
from hmtb_twin.parameters.payloads import PAYLOADS, SEATS, WORKSITE_PAYLOADS
from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
from hmtb_twin.parameters.specimen import NOMINAL_SPECIMEN, Specimen
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS, MOTIONS, POSES, Servo
from hmtb_twin.parameters.variants import variant_named


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm, ready to simulate or linearise.

    The model is shared between calls and must not be changed; its control vector holds, joint by joint, the commanded
    angle in rad and the feedforward torque in N m.

    Attributes:
        model: The compiled MuJoCo model.
        controller: The controller's own rigid-body model.
        variant: One of `VARIANTS`.
        payload: One of `PAYLOADS`; at the worksite, what the end effector holds at first.
        plant: What its drives run on and rub with.
        specimen: How it deviates from its variant, which alone its controller knows.
        worksite: Whether the arm stands at its worksite: the model has contact, and the replacement unit as a free body
            behind the arm's joints.
        drives: Drive of each joint, as it is under the conditions of the plant.
        servos: Servo of each joint.
        gains: kp (N m/rad) and kd (N m s/rad) of each joint, as its servo has them.
    """

    model: mujoco.MjModel
    controller: ControllerModel
    variant: str
    payload: str
    plant: Plant
    specimen: Specimen
    worksite: bool
    drives: Mapping[str, Drive]
    servos: Mapping[str, Servo]
    gains: Mapping[str, tuple[float, float]]

    @property
    def actuators(self) -> Mapping[str, Actuator]:
        """Hydraulic actuator of each joint.

        Raises:
            TwinError: The drives of this arm are electric.
        """
        hydraulic = {name: drive for name, drive in self.drives.items() if isinstance(drive, Actuator)}
        if len(hydraulic) < len(self.drives):
            raise TwinError(f"hydraulic actuators of the arm {self.variant!r} asked for; its drives are electric")
        return MappingProxyType(hydraulic)

    @property
    def drives_kind(self) -> str:
        """What drives it: "hydraulic" or "electric"."""
        return "hydraulic" if all(isinstance(drive, Actuator) for drive in self.drives.values()) else "electric"

    @cached_property
    def unpowered(self) -> mujoco.MjModel:
        """The arm after an emergency shutdown.

        No flow passes the valves, the oil is trapped but for the leakage; electric drives are held by their brakes.
        """
        shut = {name: drive.unpowered for name, drive in self.drives.items()}
        return compile_arm(self.variant, self.payload, self.plant, self.specimen, shut, self.gains, self.worksite)

    @property
    def friction(self) -> bool:
        """Whether the drives rub: dry friction, not the oil's drag."""
        return self.plant.friction in ("coulomb", "lugre")

    @property
    def delays(self) -> np.ndarray:
        """How late each measured angle reaches the record, samples, shape (7,)."""
        bus = variant_named(self.variant).bus
        return np.array([bus[name].delay for name in JOINTS])

    @property
    def velocity_limits(self) -> np.ndarray:
        """Velocity limit of each joint's command, rad/s, shape (7,)."""
        return np.array([MOTIONS[name].velocity_limit for name in JOINTS])

    @property
    def pressure_states(self) -> np.ndarray:
        """Index of each joint's load pressure, or motor current, in the activation vector, shape (7,)."""
        valves = [self.model.actuator(name).id for name in JOINTS]
        return self.model.actuator_actadr[valves] + self.model.actuator_actnum[valves] - 1

    @property
    def spool_states(self) -> np.ndarray | None:
        """Index of each servo valve's spool position in the activation vector, (7,); None without servo valves."""
        if self.plant.actuator != "orifice":
            return None
        from hmtb_twin.hydraulics.valve_equations import SPOOL, STATES

        return 1 + STATES * np.arange(len(JOINTS)) + SPOOL

    @property
    def supply_state(self) -> np.ndarray | None:
        """Index of the supply pressure in the activation vector, (1,); None without servo valves."""
        return None if self.plant.actuator != "orifice" else np.array([0])

    def pose(self, name: str) -> np.ndarray:
        """Return the joint angles of a named pose.

        Args:
            name: A keyframe of the model.

        Returns:
            Angles (7,), rad.

        Raises:
            TwinError: There is no such pose.
        """
        if name not in POSES:
            raise TwinError(f"unknown pose {name!r}, available: {', '.join(POSES)}")
        return np.array(POSES[name])

    def controls(self, command: np.ndarray, noise: np.ndarray | None = None) -> np.ndarray:
        """Return the control vectors that command poses with the torque that holds them.

        Args:
            command: Commanded angles (n, 7), rad.
            noise: Torques (n, 7) that noise in the valve drives adds, N m.

        Returns:
            Controls (n, 14): angle and feedforward torque of each joint in turn.
        """
        controls = np.empty((len(command), 2 * len(JOINTS)))
        controls[:, 0::2] = command
        controls[:, 1::2] = self.controller.gravity_torque(command)
        if noise is not None:
            controls[:, 1::2] += noise
        return controls

    @property
    def process_noise(self) -> np.ndarray:
        """Standard deviation of the torque that noise in each valve drive adds, (7,) N m."""
        return self.plant.process_noise * np.array([self.drives[name].rated_torque for name in JOINTS])

    def rest(self, angles: np.ndarray) -> mujoco.MjData:
        """Return the state of the arm at rest at a commanded pose, its oil already carrying the load.

        A linear arm that weighs what its controller feeds forward stands exactly there; one that does not droops, and
        servo valves under load leave any arm a little off. At the worksite the unit is
        where the end effector holds it, or stands in the holster.

        Args:
            angles: Commanded joint angles (7,), rad.

        Returns:
            A new MuJoCo state with controls that hold the pose.

        Raises:
            OverloadError: The drives cannot hold the arm there.
        """
        self._check_load(angles)
        data = mujoco.MjData(self.model)
        data.ctrl[:] = self.controls(angles[None])[0]
        command = angles
        angles, data.act[:] = self._settled(command)
        if not self.specimen.as_designed:
            self._check_load(angles)
        data.qpos[: len(JOINTS)] = angles
        if self.worksite:
            held = PAYLOADS[self.payload] is not None
            data.eq_active[self.model.equality(LATCH_WELD).id] = held
            position, rotation = self.controller.tool_pose(angles) if held else SEATS["holster"].seated
            data.qpos[len(JOINTS) : len(JOINTS) + 3] = position
            mujoco.mju_mat2Quat(data.qpos[len(JOINTS) + 3 :], rotation.ravel())
        if self.plant.actuator == "orifice":
            from hmtb_twin.hydraulics.orifice import install_valve_equations

            install_valve_equations()
            lean_on_pins(self.model, data)
            data.qpos[: len(JOINTS)], data.act[:] = self._settled(command, data.qpos[: len(JOINTS)].copy())
        mujoco.mj_forward(self.model, data)
        return data

    def _check_load(self, angles: np.ndarray) -> None:
        """Refuse a pose (7,), rad, whose weight takes all the torque of a drive; pins need none."""
        needed = np.abs(self.weight(angles))
        # What servo valves leak at rest is not known before their balance is.
        valves = self.plant.actuator == "orifice"
        drives = [self.drives[name] for name in JOINTS]
        has = [drive.maximum_torque if valves else drive.motor.holding_torque for drive in drives]
        short = [
            f"{name.replace('_', ' ')} needs {torque:.0f} N m and has {most:.0f}"
            for name, torque, most in zip(JOINTS, needed, has, strict=True)
            if name not in INDEXED_JOINTS and torque >= most
        ]
        if short:
            at = f"at {self.plant.supply_pressure:g} MPa " if self.drives_kind == "hydraulic" else ""
            raise OverloadError(f"{at}the drives cannot hold the arm at this pose: {', '.join(short)}")

    def _settled(self, command: np.ndarray, pinned: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return angles (7,) and activations at which the commanded arm rests.

        Args:
            command: Commanded angles (7,), rad.
            pinned: Angles (7,) of which pins hold those of the indexed joints; the commanded ones by default. Of servo
                valves only: linear actuators settle with their pins.
        """
        feedforward = self.controller.gravity_torque(command[None])[0]
        if self.plant.actuator == "orifice":
            from hmtb_twin.hydraulics.orifice import settled_arm

            return settled_arm(self.model, command, feedforward, self.weight, pinned)
        if self.specimen.as_designed:
            # What is fed forward is what it weighs.
            return command, self._pressed(feedforward)
        stiffness = np.array([self.gains[name][0] for name in JOINTS])
        angles, torque = drooping(self._in_free_space, self._scales, command, feedforward, stiffness, self._pressed)
        return angles, self._pressed(torque)

    def _pressed(self, torque: np.ndarray) -> np.ndarray:
        """Return the activations at which linear drives exert torques (7,), N m."""
        act = np.zeros(self.model.na)
        constant = np.array([self.drives[name].motor.constant for name in JOINTS])
        act[self.pressure_states] = torque / constant
        return act

    def weight(self, angles: np.ndarray) -> np.ndarray:
        """Return the torques that hold the arm at a pose, which its controller may not know.

        Args:
            angles: Joint angles (7,), rad.

        Returns:
            Torques (7,), N m.
        """
        if self.specimen.as_designed:
            return self.controller.gravity_torque(angles[None])[0]
        return self._scales(angles)

    def inertia(self, angles: np.ndarray) -> np.ndarray:
        """Return the joint-space inertia matrix at a pose, which its controller may not know.

        Args:
            angles: Joint angles (7,), rad.

        Returns:
            Inertia (7, 7), kg m^2.
        """
        if self.specimen.as_designed:
            return self.controller.inertia_matrix(angles)
        return inertia(self._in_free_space, angles)

    @cached_property
    def _scales(self) -> Callable[[np.ndarray], np.ndarray]:
        return scales(self._in_free_space)

    @cached_property
    def _in_free_space(self) -> mujoco.MjModel:
        """The model in which what the end effector holds is part of the arm."""
        if not self.worksite:
            return self.model
        return load_arm(self.variant, self.payload, plant=self.plant, specimen=self.specimen).model


def load_arm(
    variant: str = "nominal",
    payload: str = "rpcm",
    *,
    plant: Plant = NOMINAL_PLANT,
    specimen: Specimen = NOMINAL_SPECIMEN,
    friction: bool = True,
    worksite: bool = False,
) -> Arm:
    """Load the arm.

    Args:
        variant: One of `VARIANTS`.
        payload: What the end effector holds, one of `PAYLOADS`. The servo gains are those of the RPCM either way. At
            the worksite, what it holds at first: "none" leaves the unit in its holster.
        plant: What the drives run on and rub with.
        specimen: How this arm deviates from its variant.
        friction: Whether the seals rub as the plant says; without, the oil's drag is left, and the arm is what
            `linearize` describes.
        worksite: Whether the arm stands at the worksite, with contact, instead of in free space.

    Returns:
        The arm. Calls with equal arguments return the same record.

    Raises:
        TwinError: Unknown variant or payload, no `Plant` or `Specimen` or one that the variant has not, or an arm
            or a payload for which the worksite has no place.
    """
    check_arm(variant, payload, plant, worksite=bool(worksite), specimen=specimen)
    if not friction:
        plant = plant.sliding
    if plant.actuator == "orifice":
        from hmtb_twin.hydraulics.orifice import install_valve_equations

        # An arm from the cache, too, needs them in force.
        install_valve_equations()
    return _load(variant, payload, plant, specimen, bool(worksite))


def check_arm(
    variant: str, payload: str, plant: Plant, *, worksite: bool, specimen: Specimen = NOMINAL_SPECIMEN
) -> None:
    """Refuse what `load_arm` cannot load.

    Raises:
        TwinError: See `load_arm`.
    """
    arm = variant_named(variant)
    if not isinstance(plant, Plant):
        raise TwinError(f'plant = {plant!r} given, expected a Plant, such as Plant(actuator="orifice")')
    if not isinstance(specimen, Specimen):
        raise TwinError(f"specimen = {specimen!r} given, expected a Specimen, such as Specimen(payload_mass=1.1)")
    if not isinstance(payload, str) or payload not in PAYLOADS:
        raise TwinError(f"unknown payload {payload!r}, available: {', '.join(PAYLOADS)}")
    if worksite and payload not in WORKSITE_PAYLOADS:
        raise TwinError(
            f"payload {payload!r} at the worksite given, expected {' or '.join(WORKSITE_PAYLOADS)}: the seats are the "
            "RPCM's"
        )
    if worksite and not arm.gravity:
        raise TwinError(
            f"variant {variant!r} at the worksite given, expected an arm on the ground: the seats hold the unit by its "
            "weight"
        )
    for joint, drive in arm.actuators.items():
        specimen.applied(joint, plant.applied(drive))


@lru_cache(maxsize=64)
def _load(name: str, payload: str, plant: Plant, specimen: Specimen, worksite: bool) -> Arm:
    variant = variant_named(name)
    drives = {joint: specimen.applied(joint, plant.applied(drive)) for joint, drive in variant.actuators.items()}
    gains = {joint: specimen.gains(joint, tuned) for joint, tuned in tuned_gains(variant).items()}
    return Arm(
        model=compile_arm(name, payload, plant, specimen, drives, gains, worksite),
        controller=controller_model(payload, name),
        variant=name,
        payload=payload,
        plant=plant,
        specimen=specimen,
        worksite=worksite,
        drives=MappingProxyType(drives),
        servos=MappingProxyType(dict(variant.servos)),
        gains=MappingProxyType(gains),
    )
