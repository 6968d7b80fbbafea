"""Simulated arm: a compiled MuJoCo model with its drives, servo gains and the controller's own model."""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin.arm.arm_model import compile_arm, servo_law, tuned_gains
from hmtb_twin.arm.controller_model import ControllerModel, model_of_controller
from hmtb_twin.arm.worksite_model import LATCH_WELD
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.files.errors import OverloadError, TwinError, shown
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.callbacks import install_equations
from hmtb_twin.hydraulics.drive_actuators import drive_parameters
from hmtb_twin.hydraulics.equilibrium import drooping, inertia, pin_stiffnesses, weight_function
from hmtb_twin.hydraulics.valve_equilibrium import settled_arm
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.payloads import Load
from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
from hmtb_twin.parameters.servo_gains import ServoGains
from hmtb_twin.parameters.specimen import NOMINAL_SPECIMEN, Specimen
from hmtb_twin.parameters.values import Servo
from hmtb_twin.parameters.worksite import SEATS, WORKSITE_PAYLOADS


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm, ready to simulate or linearise.

    The model is shared between calls and must not be changed; its control vector holds, joint by joint, the commanded
    angle in rad and the feedforward torque in N m.

    Attributes:
        model: The compiled MuJoCo model.
        controller: The controller's own rigid-body model.
        variant: Name of the arm, as of `load_arm`.
        payload: Name of its payload; at the worksite, the initial payload of the end effector.
        plant: Supply, oil, friction and noise of its drives.
        specimen: Its deviations from its variant; its controller knows only the variant.
        description: The description that it was built from.
        worksite: Whether the arm stands at its worksite: the model has contact, and the replacement unit as a free body
            behind the arm's joints.
        drives: Drive of each joint under the conditions of the plant.
        servos: Servo of each joint.
        gains: Gains of each joint's servo.
    """

    model: mujoco.MjModel
    controller: ControllerModel
    variant: str
    payload: str
    plant: Plant
    specimen: Specimen
    description: ArmDescription
    worksite: bool
    drives: Mapping[str, Drive]
    servos: Mapping[str, Servo]
    gains: Mapping[str, ServoGains]

    def __repr__(self) -> str:
        """Name what it was loaded from, not its matrices."""
        return f"Arm({self.variant!r}, payload={self.payload!r}, {len(self.joints)} joints, {self.drives_kind} drives)"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints from the base outward."""
        return self.description.joints

    @property
    def actuators(self) -> Mapping[str, Actuator]:
        """Hydraulic actuator of each joint; raises `TwinError` for electric drives."""
        hydraulic = {name: drive for name, drive in self.drives.items() if isinstance(drive, Actuator)}
        if len(hydraulic) < len(self.drives):
            raise TwinError(f"hydraulic actuators of the arm {self.variant!r} requested; its drives are electric")
        return MappingProxyType(hydraulic)

    @property
    def drives_kind(self) -> str:
        """Kind of its drives: "hydraulic" or "electric"."""
        return "hydraulic" if all(isinstance(drive, Actuator) for drive in self.drives.values()) else "electric"

    @cached_property
    def unpowered(self) -> mujoco.MjModel:
        """The arm after an emergency shutdown.

        No flow passes the valves, the oil is trapped but for the leakage; electric drives are held by their brakes.
        """
        drives = {name: drive.unpowered for name, drive in self.drives.items()}
        model = compile_arm(
            self.description, self.payload, self.plant, self.specimen, drives, self.gains, self.worksite
        )
        # Power fails in the middle of a run: the step stays.
        model.opt.timestep = self.model.opt.timestep
        return model

    def at_step(self, step: float) -> "Arm":
        """Return the arm with another physics step, s."""
        model = copy(self.model)
        model.opt.timestep = step
        return replace(self, model=model)

    @property
    def friction(self) -> bool:
        """Whether the joints have dry friction, which the oil's drag is not."""
        return self.plant.friction in ("coulomb", "lugre")

    @property
    def indexed(self) -> tuple[str, ...]:
        """Joints that a pin holds, which follow no command."""
        return self.description.indexed

    @property
    def delays(self) -> np.ndarray:
        """Delay of each measured angle on the bus, samples, shape (7,)."""
        bus = self.description.bus
        return np.array([bus[name].delay for name in self.joints])

    @property
    def velocity_limits(self) -> np.ndarray:
        """Velocity limit of each joint's command, rad/s, shape (7,)."""
        return np.array([self.description.motions[name].velocity_limit for name in self.joints])

    @property
    def pressure_states(self) -> np.ndarray:
        """Index of each joint's load pressure, or motor current, in the activation vector, shape (7,)."""
        valves = [self.model.actuator(name).id for name in self.joints]
        return self.model.actuator_actadr[valves] + self.model.actuator_actnum[valves] - 1

    @property
    def spool_states(self) -> np.ndarray | None:
        """Index of each servo valve's spool position in the activation vector, (7,); None without servo valves."""
        if self.plant.actuator != "orifice":
            return None
        return 1 + eq.STATES * np.arange(len(self.joints)) + eq.SPOOL

    @property
    def supply_state(self) -> np.ndarray | None:
        """Index of the supply pressure in the activation vector, (1,); None without servo valves."""
        return None if self.plant.actuator != "orifice" else np.array([0])

    def pose(self, name: str) -> np.ndarray:
        """Return the joint angles (7,), rad, of a keyframe; raises `TwinError` for an unknown one."""
        poses = self.description.poses
        if name not in poses:
            raise TwinError(f"unknown pose {name!r}, available: {', '.join(poses)}")
        return np.array(poses[name])

    def controls(self, command: np.ndarray, noise: np.ndarray | None = None) -> np.ndarray:
        """Return the control vectors that command poses and feed forward the torques that hold them.

        Args:
            command: Commanded angles (n, 7), rad.
            noise: Torque noise of the drives (n, 7), N m.

        Returns:
            Controls (n, 14): angle and feedforward torque of each joint in turn.
        """
        controls = np.empty((len(command), 2 * len(self.joints)))
        controls[:, 0::2] = command
        controls[:, 1::2] = self.controller.gravity_torque(command)
        if noise is not None:
            controls[:, 1::2] += noise
        return controls

    @property
    def process_noise(self) -> np.ndarray:
        """Standard deviation of the torque noise of each drive, (7,) N m."""
        return self.plant.process_noise * np.array([self.drives[name].rated_torque for name in self.joints])

    def rest(self, angles: np.ndarray) -> mujoco.MjData:
        """Return the state of the arm at rest under a commanded pose, its oil already carrying the load.

        A linear arm whose weight its controller knows rests exactly there; any other droops, and servo valves under
        load leave a small offset. At the worksite the unit is held by the end effector or stands in the holster.

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
            # A specimen of another weight rests elsewhere than commanded.
            self._check_load(angles)
        n = len(self.joints)
        data.qpos[:n] = angles
        if self.worksite:
            held = self.description.held(self.payload) is not None
            data.eq_active[self.model.equality(LATCH_WELD).id] = held
            position, rotation = self.controller.tool_pose(angles) if held else SEATS["holster"].seated
            data.qpos[n : n + 3] = position
            mujoco.mju_mat2Quat(data.qpos[n + 3 :], rotation.ravel())
        install_equations()
        mujoco.mj_forward(self.model, data)
        return data

    def _check_load(self, angles: np.ndarray) -> None:
        """Raise `OverloadError` if a drive that no pin relieves cannot hold the arm at a pose (7,), rad."""
        needed = np.abs(self.weight(angles))
        # The leakage of servo valves at rest is known only after their balance is solved.
        valves = self.plant.actuator == "orifice"
        overloads = []
        for name, torque in zip(self.joints, needed, strict=True):
            drive = self.drives[name]
            available = drive.maximum_torque if valves else drive.motor.holding_torque
            if name not in self.indexed and torque >= available:
                overloads.append(f"{name.replace('_', ' ')} needs {torque:.0f} N m and has {available:.0f}")
        if overloads:
            pressure = f"at {self.plant.supply_pressure:g} MPa " if self.drives_kind == "hydraulic" else ""
            raise OverloadError(f"{pressure}the drives cannot hold the arm at this pose: {', '.join(overloads)}")

    def _settled(self, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return angles (7,), rad, and activations at which the commanded arm rests."""
        feedforward = self.controller.gravity_torque(command[None])[0]
        if self.plant.actuator == "orifice":
            return settled_arm(self.model, command, feedforward, self._load)
        if self.specimen.as_designed:
            # The feedforward torque is exactly the weight.
            return command, self._activations(feedforward)
        p = drive_parameters(self.model)
        # At rest no flow: (F + G) u / D + (S + G) f / D = (S + G) P, with the symbols of `servo_flow`.
        flow_gain, pressure_loss = p[:, eq.FEED] + p[:, eq.PRESSURE_GAIN], p[:, eq.SLOPE] + p[:, eq.PRESSURE_GAIN]
        stiffness = p[:, eq.STIFFNESS] * flow_gain / pressure_loss
        angles, torque = drooping(self._load, command, feedforward, stiffness, pin_stiffnesses(self.model))
        return angles, self._activations(torque)

    def _activations(self, torque: np.ndarray) -> np.ndarray:
        """Return the activations at which linear drives exert torques (7,), N m."""
        states = np.zeros((len(self.joints), eq.LINEAR_STATES))
        pressure = torque / np.array([self.drives[name].motor.constant for name in self.joints])
        states[:, eq.LINEAR_FILTERED] = states[:, eq.LINEAR_LOAD] = pressure
        return states.ravel()

    def _load(self, angles: np.ndarray) -> np.ndarray:
        """Return the torques (7,), N m, that hold this specimen at angles (7,), rad, against its weight and its pin."""
        return self.weight(angles) + pin_stiffnesses(self.model) * angles

    def weight(self, angles: np.ndarray) -> np.ndarray:
        """Return the torques (7,), N m, that hold this specimen at joint angles (7,), rad."""
        if self.specimen.as_designed:
            return self.controller.gravity_torque(angles[None])[0]
        return self._weight_function(angles)

    def inertia(self, angles: np.ndarray) -> np.ndarray:
        """Return the joint-space inertia matrix (7, 7), kg m^2, of this specimen at joint angles (7,), rad."""
        if self.specimen.as_designed:
            return self.controller.inertia_matrix(angles)
        return inertia(self._in_free_space, angles)

    @cached_property
    def _weight_function(self) -> Callable[[np.ndarray], np.ndarray]:
        return weight_function(self._in_free_space)

    @cached_property
    def _in_free_space(self) -> mujoco.MjModel:
        """The model in which the payload is part of the arm."""
        if not self.worksite:
            return self.model
        return load_arm(self.variant, self.payload, plant=self.plant, specimen=self.specimen).model


def load_arm(
    variant: str = "nominal",
    payload: str | Load | None = None,
    *,
    plant: Plant = NOMINAL_PLANT,
    specimen: Specimen = NOMINAL_SPECIMEN,
    friction: bool = True,
    worksite: bool = False,
) -> Arm:
    """Load the arm.

    Args:
        variant: The arm: one of `VARIANTS`, a name of example-robot-data as "panda", or the path of an MJCF, a URDF or
            a folder; see `arm_named`.
        payload: Payload of the end effector: one of the arm's by name, or a `Load` of your own. By default the one for
            which its servos are tuned, of the test bed the RPCM. At the worksite, the initial payload: "none" leaves
            the unit in its holster.
        plant: Supply, oil, friction and noise of the drives.
        specimen: Deviations of this arm from its variant.
        friction: Whether the joints have the dry friction of the plant; without it the oil's drag stays, and the arm
            is the one that `linearize` describes.
        worksite: Whether the arm stands at the worksite, with contact, instead of in free space.

    Returns:
        The arm. Calls with equal arguments return the same record.

    Raises:
        TwinError: Unknown variant or payload, a plant or specimen that the variant cannot have, or an arm or a payload
            that does not fit the worksite.
    """
    if payload is None:
        payload = arm_named(variant).tuned_payload
    if isinstance(payload, Load):
        payload = payload.text
    check_arm(variant, payload, plant, worksite=bool(worksite), specimen=specimen)
    if not friction:
        plant = plant.sliding
    # MuJoCo needs the equations for arms from the cache, too.
    install_equations()
    return _load(arm_named(variant), payload, plant, specimen, bool(worksite))


def check_arm(
    variant: str, payload: str, plant: Plant, *, worksite: bool, specimen: Specimen = NOMINAL_SPECIMEN
) -> None:
    """Raise `TwinError` for arguments that `load_arm` cannot load."""
    arm = arm_named(variant)
    if not isinstance(plant, Plant):
        raise TwinError(f'plant = {shown(plant)} given, expected a Plant, such as Plant(actuator="orifice")')
    if not isinstance(specimen, Specimen):
        raise TwinError(f"specimen = {shown(specimen)} given, expected a Specimen, such as Specimen(payload_mass=1.1)")
    # Called for its error.
    arm.held(payload)
    if worksite and arm.rigid is not None:
        raise TwinError(f"arm {variant!r} at the worksite given, expected an arm of the test bed, whose worksite it is")
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
    specimen.check(arm)
    drives = _drives(arm, plant, specimen)
    valves = plant.actuator == "orifice" and servo_law(arm, plant) == "flow"
    outermost = arm.joints[-1]
    if valves and drives[outermost].drag == 0.0:
        raise TwinError(
            f'plant: actuator = "orifice" with the servo "flow" and no drag given (friction = "{plant.friction}"): '
            f"nothing damps the oil of the {outermost.replace('_', ' ')}, and the arm is unstable; expected viscous "
            'friction, or servo = "torque"'
        )


@lru_cache(maxsize=64)
def _drives(variant: ArmDescription, plant: Plant, specimen: Specimen) -> Mapping[str, Drive]:
    """The drive of each joint, computed once for all experiments on an arm: each of them checks it."""
    drives = {}
    for joint, drive in variant.actuators.items():
        drives[joint] = specimen.applied(variant.joint_index(joint), plant.applied(drive))
    return MappingProxyType(drives)


@lru_cache(maxsize=64)
def _load(variant: ArmDescription, payload: str, plant: Plant, specimen: Specimen, worksite: bool) -> Arm:
    """Assemble an arm from drives, gains and model; equal arguments give the same record."""
    drives = _drives(variant, plant, specimen)
    # Tuned for the variant: a specimen's own weights are unknown to whoever tunes its servos.
    tuned = tuned_gains(variant, plant)
    gains = {joint: specimen.gains(place, tuned[joint]) for place, joint in enumerate(variant.joints)}
    model = compile_arm(variant, payload, plant, specimen, drives, gains, worksite)
    return Arm(
        model=model,
        controller=model_of_controller(payload, variant),
        variant=variant.name,
        payload=payload,
        plant=plant,
        specimen=specimen,
        description=variant,
        worksite=worksite,
        drives=drives,
        servos=MappingProxyType(dict(variant.servos)),
        gains=MappingProxyType(gains),
    )
