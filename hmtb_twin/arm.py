"""The arm as MuJoCo runs it: the MJCF of `models/hmtb` with the actuators and servos of one variant."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin.controller_model import ControllerModel, controller_model
from hmtb_twin.errors import TwinError
from hmtb_twin.parameters import (
    ACTUATORS,
    BUS,
    JOINTS,
    MOTIONS,
    OPERATING_POSE,
    PAYLOADS,
    POSES,
    SERVOS,
    Actuator,
    Servo,
)
from hmtb_twin.resources import model_file
from hmtb_twin.seats import SEATS
from hmtb_twin.servo import servo_gains
from hmtb_twin.worksite_model import LATCH_WELD, worksite_spec

VARIANTS = ("nominal",)
"""The arms that exist."""


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
        friction: Whether the seals rub.
        worksite: Whether the arm stands at its worksite: the model has contact, and the replacement unit as a free body
            behind the arm's joints.
        actuators: Actuator of each joint.
        servos: Servo of each joint.
        gains: kp (N m/rad) and kd (N m s/rad) of each joint.
    """

    model: mujoco.MjModel
    controller: ControllerModel
    variant: str
    payload: str
    friction: bool
    worksite: bool
    actuators: Mapping[str, Actuator]
    servos: Mapping[str, Servo]
    gains: Mapping[str, tuple[float, float]]

    @cached_property
    def valves_closed(self) -> mujoco.MjModel:
        """The arm after an emergency shutdown: no flow through the valves, the oil trapped but for the leakage."""
        shut = {name: replace(a, valve_open=False) for name, a in self.actuators.items()}
        return _compile(self.payload, shut, self.worksite)

    @property
    def delays(self) -> np.ndarray:
        """How late each measured angle reaches the record, samples, shape (7,)."""
        return np.array([BUS[name].delay for name in JOINTS])

    @property
    def velocity_limits(self) -> np.ndarray:
        """Velocity limit of each joint's command, rad/s, shape (7,)."""
        return np.array([MOTIONS[name].velocity_limit for name in JOINTS])

    @property
    def pressure_states(self) -> np.ndarray:
        """Index of each joint's load pressure in the activation vector, shape (7,)."""
        return self.model.actuator_actadr + self.model.actuator_actnum - 1

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

    def controls(self, command: np.ndarray) -> np.ndarray:
        """Return the control vectors that command poses with the torque that holds them.

        Args:
            command: Commanded angles (n, 7), rad.

        Returns:
            Controls (n, 14): angle and feedforward torque of each joint in turn.
        """
        controls = np.empty((len(command), 2 * len(JOINTS)))
        controls[:, 0::2] = command
        controls[:, 1::2] = self.controller.gravity_torque(command)
        return controls

    def rest(self, angles: np.ndarray) -> mujoco.MjData:
        """Return the state of the arm at rest at a pose, its oil already carrying the load.

        At the worksite the unit is where the end effector holds it, or stands in the holster.

        Args:
            angles: Joint angles (7,), rad.

        Returns:
            A new MuJoCo state with controls that hold the pose.
        """
        data = mujoco.MjData(self.model)
        data.qpos[: len(JOINTS)] = angles
        if self.worksite:
            held = PAYLOADS[self.payload] is not None
            data.eq_active[self.model.equality(LATCH_WELD).id] = held
            position, rotation = self.controller.tool_pose(angles) if held else SEATS["holster"].seated
            data.qpos[len(JOINTS) : len(JOINTS) + 3] = position
            mujoco.mju_mat2Quat(data.qpos[len(JOINTS) + 3 :], rotation.ravel())
        data.ctrl[:] = self.controls(angles[None])[0]
        displacement = np.array([self.actuators[name].displacement for name in JOINTS])
        data.act[self.pressure_states] = data.ctrl[1::2] / displacement
        mujoco.mj_forward(self.model, data)
        return data


def load_arm(variant: str = "nominal", payload: str = "rpcm", *, friction: bool = True, worksite: bool = False) -> Arm:
    """Load the arm.

    Args:
        variant: One of `VARIANTS`.
        payload: What the end effector holds, one of `PAYLOADS`. The servo gains are those of the RPCM either way. At
            the worksite, what it holds at first: "none" leaves the unit in its holster.
        friction: Whether the seals rub; without friction the arm is what `linearize` describes.
        worksite: Whether the arm stands at the worksite, with contact, instead of in free space.

    Returns:
        The arm. Calls with equal arguments return the same record.

    Raises:
        TwinError: Unknown variant or payload.
    """
    if variant not in VARIANTS:
        raise TwinError(f"unknown variant {variant!r}, available: {', '.join(VARIANTS)}")
    if payload not in PAYLOADS:
        raise TwinError(f"unknown payload {payload!r}, available: {', '.join(PAYLOADS)}")
    return _load(variant, payload, bool(friction), bool(worksite))


@lru_cache(maxsize=16)
def _load(variant: str, payload: str, friction: bool, worksite: bool) -> Arm:
    gains = tuned_gains(controller_model("rpcm"))
    actuators = ACTUATORS if friction else {name: replace(a, friction=None) for name, a in ACTUATORS.items()}
    return Arm(
        model=_compile(payload, actuators, worksite),
        controller=controller_model(payload),
        variant=variant,
        payload=payload,
        friction=friction,
        worksite=worksite,
        actuators=MappingProxyType(dict(actuators)),
        servos=MappingProxyType(dict(SERVOS)),
        gains=MappingProxyType(gains),
    )


def _compile(payload: str, actuators: Mapping[str, Actuator], worksite: bool) -> mujoco.MjModel:
    spec = worksite_spec() if worksite else _free_space_spec(payload)
    gains = tuned_gains(controller_model("rpcm"))
    for name in JOINTS:
        configure(spec.actuator(name), actuators[name], gains[name])
    return spec.compile()


def _free_space_spec(payload: str) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(model_file("hmtb/hmtb.xml")))
    for key in list(spec.keys):
        # Its activations would not fit an arm without friction, and `Arm.rest` computes the same state.
        spec.delete(key)
    if PAYLOADS[payload] is None:
        spec.delete(spec.body("rpcm"))
    return spec


def tuned_gains(controller: ControllerModel) -> dict[str, tuple[float, float]]:
    """Return kp and kd of each joint, tuned at the operating pose on the controller's own model."""
    inertia = np.diag(controller.inertia_matrix(np.array(POSES[OPERATING_POSE])))
    return {
        name: servo_gains(float(seen), SERVOS[name], ACTUATORS[name])
        for name, seen in zip(JOINTS, inertia, strict=True)
    }


def configure(target: mujoco.MjsActuator, actuator: Actuator, gains: tuple[float, float]) -> None:
    """Write a hydraulic actuator and its servo into a MuJoCo `dcmotor`, pressure for current and flow for voltage."""
    kp, kd = gains
    friction = actuator.friction
    lugre = [0.0] * 5
    if friction is not None:
        coulomb = friction.coulomb * actuator.maximum_torque
        stiffness = coulomb / friction.presliding
        lugre = [
            stiffness,
            stiffness * friction.bristle_time,
            coulomb,
            coulomb * friction.static_ratio,
            friction.stribeck_velocity,
        ]
    target.set_to_dcmotor(
        motorconst=[actuator.displacement, 0.0],
        resistance=actuator.flow_pressure_gain,
        saturation=[actuator.maximum_torque, 0.0, 0.0],
        inductance=[actuator.compliance, 0.0],
        controller=[kp, 0.0, kd, 0.0, 0.0, actuator.largest_flow],
        lugre=lugre,
        ctrlspec=target.ctrlspec,
    )
