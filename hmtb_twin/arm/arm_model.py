"""Compiles the MuJoCo model of an arm: writes bodies, drives and tuned servos into the MJCF of `models/hmtb`."""

from collections.abc import Mapping

import mujoco
import numpy as np

from hmtb_twin.arm.controller_model import controller_model
from hmtb_twin.arm.rigid_bodies import write_bodies
from hmtb_twin.arm.worksite_model import worksite_spec
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, POSES, Servo
from hmtb_twin.parameters.variants import Variant, variant_named


def servo_gains(inertia: float, servo: Servo, actuator: Drive) -> tuple[float, float]:
    """Place the poles of one joint that is held by its neighbours.

    With torque command kp (q_cmd - q) - kd dq/dt and a torque that follows it with the lag T of pressure or current,
    the joint obeys J s^2 (T s + 1) + kd s + kp = J T (s - p1) (s - p2) (s - p3); the lag fixes p1 + p2 + p3 = -1/T.

    Args:
        inertia: Inertia J that the joint sees at the operating pose, kg m^2.
        servo: The wanted poles p1 and p2, rad/s.
        actuator: The drive, whose pressure or current lags by T.

    Returns:
        kp in N m/rad and kd in N m s/rad.

    Raises:
        TwinError: The lag is too long for the wanted poles: the third one would be unstable.
    """
    lag = actuator.motor.lag
    slow, fast = servo.slow_pole, servo.fast_pole
    third = -1.0 / lag - slow - fast
    if max(slow, fast, third) >= 0.0:
        raise TwinError(
            f"wanted poles {slow:g} and {fast:g} rad/s with a lag of {lag:g} s leave the third pole at "
            f"{third:g} rad/s; expected three negative poles, so -(p1 + p2) below {1.0 / lag:g} rad/s"
        )
    kp = -inertia * lag * slow * fast * third
    kd = inertia * lag * (slow * fast + slow * third + fast * third)
    return kp, kd


def compile_arm(
    name: str,
    payload: str,
    plant: Plant,
    specimen: Specimen,
    drives: Mapping[str, Drive],
    gains: Mapping[str, tuple[float, float]],
    worksite: bool,
) -> mujoco.MjModel:
    """Compile the model of an arm.

    Args:
        name: One of `VARIANTS`.
        payload: Payload of the end effector, one of `PAYLOADS`.
        plant: Supply, oil, friction and noise of the drives.
        specimen: Deviations of the bodies from the variant's.
        drives: Drive of each joint under the conditions of the plant and on the specimen.
        gains: kp and kd of each joint's servo.
        worksite: Whether the arm stands at the worksite.
    """
    variant = variant_named(name)
    if plant.actuator == "orifice":
        # Numba takes a second to load, and only servo valves need it.
        from hmtb_twin.hydraulics.orifice import STEP, add_orifice_actuators

        spec = _spec(variant, payload, specimen, worksite_spec(STEP) if worksite else None)
        # Only hydraulic drives pass `Plant.applied` with this form.
        valves = {joint: drive for joint, drive in drives.items() if isinstance(drive, Actuator)}
        add_orifice_actuators(spec, valves, gains)
    else:
        spec = _spec(variant, payload, specimen, worksite_spec() if worksite else None)
        for joint in JOINTS:
            configure_actuator(spec.actuator(joint), drives[joint], gains[joint])
    for joint in JOINTS:
        configure_joint(spec.joint(joint), drives[joint])
    return spec.compile()


def _spec(variant: Variant, payload: str, specimen: Specimen, scene: mujoco.MjSpec | None) -> mujoco.MjSpec:
    if scene is not None:
        # At the worksite the unit is a body of its own even if the end effector holds it at first.
        write_bodies(scene, variant, "rpcm", specimen)
        return scene
    spec = mujoco.MjSpec.from_file(str(model_file("hmtb/hmtb.xml")))
    for key in list(spec.keys):
        # The activations of keyframes would not fit an arm without friction; `Arm.rest` computes the same state.
        spec.delete(key)
    write_bodies(spec, variant, payload, specimen)
    spec.option.timestep = variant.step
    return spec


def tuned_gains(variant: Variant) -> dict[str, tuple[float, float]]:
    """Return kp and kd of each joint, tuned at the operating pose with the RPCM on the controller's own model."""
    inertia = np.diag(controller_model("rpcm", variant.name).inertia_matrix(np.array(POSES[OPERATING_POSE])))
    return {
        name: servo_gains(float(seen), variant.servos[name], variant.actuators[name])
        for name, seen in zip(JOINTS, inertia, strict=True)
    }


def configure_joint(joint: mujoco.MjsJoint, drive: Drive) -> None:
    """Write rotor inertia, drag, brake, and Coulomb friction without bristles into a joint."""
    bristles = drive.friction is not None and drive.friction.bristles
    joint.armature = drive.motor.armature
    joint.damping = [drive.drag, 0.0, 0.0]
    joint.frictionloss = drive.motor.brake + (0.0 if bristles else drive.coulomb_torque)
    # The hardest possible constraint: the softer default lets a stuck joint creep.
    joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]


def configure_actuator(target: mujoco.MjsActuator, drive: Drive, gains: tuple[float, float]) -> None:
    """Write a drive and its servo into a MuJoCo `dcmotor`; pressure for current, flow for voltage if hydraulic."""
    kp, kd = gains
    motor, friction, coulomb = drive.motor, drive.friction, drive.coulomb_torque
    lugre = [0.0] * 5
    if friction is not None and friction.bristles:
        stiffness = coulomb / friction.presliding
        lugre = [
            stiffness,
            stiffness * friction.bristle_time,
            coulomb,
            coulomb * friction.static_ratio,
            friction.stribeck_velocity,
        ]
    target.set_to_dcmotor(
        motorconst=[motor.constant, 0.0],
        resistance=motor.resistance,
        saturation=[motor.maximum_torque, 0.0, 0.0],
        inductance=[motor.inductance, 0.0],
        controller=[kp, 0.0, kd, 0.0, 0.0, motor.largest_input],
        lugre=lugre,
        ctrlspec=target.ctrlspec,
    )
