"""Compiles the MuJoCo model of an arm: writes bodies, drives and tuned servos into its MJCF."""

from collections.abc import Mapping
from math import ceil

import mujoco
import numpy as np

from hmtb_twin.arm.controller_model import model_of_controller
from hmtb_twin.arm.rigid_bodies import spec_of_test_bed, write_bodies
from hmtb_twin.arm.worksite_model import TOUCH_SENSOR, worksite_spec
from hmtb_twin.files.errors import TwinError
from hmtb_twin.hydraulics.drive_actuators import ORIFICE_STEP, add_linear_drives, add_orifice_actuators
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.drives import Actuator, Drive
from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
from hmtb_twin.parameters.servo_gains import ServoGains, gains_for_slope, servo_gains
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.parameters.values import HAND_CONTROLLER, PIN

STEPS = {"flow": 15, "torque": 20}
"""Physics steps of a tick in free space by servo law, where no joint is lighter than the wrist roll with the RPCM."""


LONGEST_STEP = 0.001
"""Longest physics step of an arm from files, s; drives and light joints may need a shorter one."""


def servo_law(variant: ArmDescription, plant: Plant) -> str:
    """Return the servo law of an arm, "flow" or "torque"."""
    return variant.servo if plant.servo == "variant" else plant.servo


def compile_arm(
    variant: ArmDescription,
    payload: str,
    plant: Plant,
    specimen: Specimen,
    drives: Mapping[str, Drive],
    gains: Mapping[str, ServoGains],
    worksite: bool,
) -> mujoco.MjModel:
    """Compile the model of an arm.

    Args:
        variant: The arm.
        payload: Payload of the end effector, one of the arm's.
        plant: Supply, oil, friction and noise of the drives.
        specimen: Deviations of the bodies from the variant's.
        drives: Drive of each joint under the conditions of the plant and on the specimen.
        gains: Gains of each joint's servo.
        worksite: Whether the arm stands at the worksite.
    """
    spec = _spec(variant, payload, plant, specimen, worksite)
    for joint in variant.joints:
        configure_joint(spec.joint(joint), drives[joint], indexed=joint in variant.indexed)
    if plant.actuator == "orifice":
        # Only hydraulic drives pass `Plant.applied` with this form.
        valves = {joint: drive for joint, drive in drives.items() if isinstance(drive, Actuator)}
        add_orifice_actuators(spec, valves, gains, power_unit=variant.power_unit)
    else:
        # Contact errs more than the step.
        add_linear_drives(spec, drives, gains, sample_time=variant.sample_time, refine=not worksite)
    if worksite:
        # The sensor remembers a whole tick.
        spec.sensor(TOUCH_SENSOR).nsample = round(variant.sample_time / spec.option.timestep)
    return spec.compile()


def _spec(variant: ArmDescription, payload: str, plant: Plant, specimen: Specimen, worksite: bool) -> mujoco.MjSpec:
    """Return the model of an arm's bodies, in free space or at the worksite, ahead of its drives."""
    if worksite:
        # Contact needs the shorter step of servo valves, whatever the drives.
        scene = worksite_spec(ORIFICE_STEP)
        # At the worksite the unit is a body of its own even if the end effector holds it at first.
        write_bodies(scene, variant, "rpcm", specimen)
        return scene
    if variant.rigid is not None:
        bodies = mujoco.MjSpec.from_string(variant.rigid.mjcf)
        write_bodies(bodies, variant, payload, specimen)
        bodies.option.timestep = variant.sample_time / ceil(variant.sample_time / LONGEST_STEP)
        return bodies
    # Without keyframes: `Arm.rest` computes states that fit any drives.
    spec = spec_of_test_bed("hmtb.xml")
    write_bodies(spec, variant, payload, specimen)
    # Nothing touches in free space, and pictures have a model of their own: shapes would cost a tenth of a step.
    for shape in (*spec.geoms, *spec.cameras):
        spec.delete(shape)
    spec.option.timestep = variant.sample_time / STEPS[servo_law(variant, plant)]
    return spec


def tuned_gains(variant: ArmDescription, plant: Plant = NOMINAL_PLANT) -> dict[str, ServoGains]:
    """Return the gains of each joint, tuned at the operating pose with the RPCM on the controller's own model.

    Args:
        variant: The arm, with nominal oil.
        plant: The servo law, and the slope of the load-flow line.

    Raises:
        TwinError: Seals hold a joint of the variant through the smallest test, a command by 1 V.
    """
    law = servo_law(variant, plant)
    model = model_of_controller(variant.tuned_payload, variant)
    inertia = np.diag(model.inertia_matrix(np.array(variant.poses[variant.operating_pose])))
    gains = {}
    for name, joint_inertia in zip(variant.joints, inertia, strict=True):
        drive = variant.actuators[name]
        try:
            tuned = servo_gains(float(joint_inertia), variant.servos[name], drive, law)
        except TwinError as error:
            raise TwinError(f"{variant.name}: the servo of {name.replace('_', ' ')}: {error}") from error
        if law == "flow" and isinstance(drive, Actuator):
            tuned = gains_for_slope(tuned, float(joint_inertia), drive, plant.load_flow_slope)
        if name in variant.given_gains:
            kp, kd = variant.given_gains[name]
            tuned = tuned._replace(kp=kp, kd=kd)
        gains[name] = tuned
    if variant.rigid is not None:
        # How far its tests move a joint, and whether that is enough, is for whoever plans them.
        return gains
    for name, drive in variant.actuators.items():
        # The servo has no integral action: a smaller error leaves the joint stuck.
        dead_zone = drive.breakaway_torque / gains[name].kp
        if law == variant.servo and dead_zone >= HAND_CONTROLLER.gain and name not in variant.indexed:
            raise TwinError(
                f"{variant.name}: the {name.replace('_', ' ')} stands still up to {1e3 * dead_zone:.3g} mrad, "
                f"expected less than the {1e3 * HAND_CONTROLLER.gain:.3g} mrad of its smallest test"
            )
    return gains


def configure_joint(joint: mujoco.MjsJoint, drive: Drive, *, indexed: bool) -> None:
    """Write rotor inertia, drag, brake and pin into a joint."""
    joint.armature, joint.damping, joint.stiffness = drive.motor.armature, [drive.drag, 0.0, 0.0], [0.0, 0.0, 0.0]
    if indexed:
        joint.armature += PIN.inertia
        joint.damping, joint.stiffness = [PIN.damping, 0.0, 0.0], [PIN.stiffness, 0.0, 0.0]
    joint.frictionloss = drive.motor.brake
    # The hardest possible constraint: the softer default lets a stuck joint creep.
    joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]
