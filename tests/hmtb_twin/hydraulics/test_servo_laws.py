"""Servo laws, flow and torque, in both forms of the actuator: stiffness, holding, stability; arms that cannot be."""

from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from hmtb_twin import JOINTS, PAYLOADS, POSES, OverloadError, Plant, linearize, load_arm
from hmtb_twin.arm.arm_model import tuned_gains
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.drive_actuators import drive_parameters
from hmtb_twin.parameters.drives import Friction
from hmtb_twin.parameters.servo_gains import servo_dynamics
from hmtb_twin.parameters.servo_valve import SERVO_VALVE
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import ACTUATORS, OPERATING_POSE, VARIANTS
from tests.hmtb_twin.altered_arms import natural_poles
from tests.refusals import refused

LAWS = pytest.mark.parametrize("law", ["flow", "torque"])


@pytest.mark.parametrize("temperature", [0.0, 40.0, 100.0])
def test_static_stiffness_of_a_flow_servo_falls_with_what_leaks(temperature):
    arm = load_arm(plant=Plant("linear", "flow", "viscous", oil_temperature=temperature))
    # Only the yaw moves without lifting weight: it shows its servo alone.
    yaw, drive, gains = JOINTS.index("shoulder_yaw"), arm.actuators["shoulder_yaw"], arm.gains["shoulder_yaw"]
    stiffness = gains.kp * gains.feed / drive.flow_pressure_gain
    data = arm.rest(arm.pose(OPERATING_POSE))
    data.qfrc_applied[yaw] = 2.0
    mujoco.mj_step(arm.model, data, nstep=round(6.0 / arm.model.opt.timestep))
    assert data.qpos[yaw] - arm.pose(OPERATING_POSE)[yaw] == pytest.approx(2.0 / stiffness, rel=1e-6)
    # The servo is tuned for the nominal oil: there feed and flow-pressure gain agree.
    assert stiffness / gains.kp == pytest.approx(1.0, rel=1e-12 if temperature == 40.0 else 0.15)


def held_gain(gains, drive, inertia, hz):
    """Gain of one joint at a frequency, its neighbours held, from the state matrix of joint, drive and servo."""
    A = servo_dynamics(inertia, drive.drag, drive.motor, gains)
    command = np.array([0.0, 0.0, gains.feed * gains.kp / drive.motor.constant / drive.motor.inductance, 0.0])
    return abs(np.linalg.solve(2j * np.pi * hz * np.eye(4) - A, command)[0])


def half_power_hz(gains, drive, inertia):
    """Frequency at which the gain of one joint falls to 0.707."""
    return brentq(lambda hz: held_gain(gains, drive, inertia, hz) - np.sqrt(0.5), 0.1, 5.0)


@pytest.mark.parametrize("slope", [0.02, 0.1, 1.0 / 3.0, 0.9])
def test_gains_for_a_flatter_line_keep_the_bandwidth_of_each_joint(slope):
    variant, inertias = (
        VARIANTS["nominal"],
        np.diag(load_arm().controller.inertia_matrix(load_arm().pose(OPERATING_POSE))),
    )
    straight, flat = tuned_gains(variant), tuned_gains(variant, Plant(load_flow_slope=slope))
    assert tuned_gains(variant, Plant(load_flow_slope=1.0)) == straight
    for joint, inertia in zip(JOINTS, inertias, strict=True):
        drive = variant.actuators[joint]
        flatter = Plant(load_flow_slope=slope).applied(drive)
        before, after = half_power_hz(straight[joint], drive, inertia), half_power_hz(flat[joint], flatter, inertia)
        assert after == pytest.approx(before, rel=1e-9)
        # Above the washout the pressure is fed back as much as before.
        lost = drive.flow_pressure_gain - flatter.flow_pressure_gain
        assert flat[joint].dynamic - straight[joint].dynamic == pytest.approx(lost)


@pytest.mark.parametrize("form", ["linear", "orifice"])
def test_a_flow_servo_is_stiffer_at_rest_the_flatter_the_line(form):
    yields = []
    for slope in (1.0, 0.25):
        arm = load_arm(plant=Plant(form, "flow", "viscous", load_flow_slope=slope))
        yaw = JOINTS.index("shoulder_yaw")
        data = arm.rest(arm.pose(OPERATING_POSE))
        data.qfrc_applied[yaw] = 2.0
        mujoco.mj_step(arm.model, data, nstep=round(6.0 / arm.model.opt.timestep))
        gains, drive = arm.gains["shoulder_yaw"], arm.actuators["shoulder_yaw"]
        stiffness = gains.kp * gains.feed / drive.flow_pressure_gain
        yields.append(data.qpos[yaw] - arm.pose(OPERATING_POSE)[yaw])
        # Orifices near null add a slope of their own.
        assert yields[-1] == pytest.approx(2.0 / stiffness, rel=1e-6 if form == "linear" else 0.15)
    assert yields[1] < 0.3 * yields[0]


def test_a_torque_servo_holds_the_same_at_any_slope():
    arms = [load_arm(plant=Plant(servo="torque", load_flow_slope=slope)) for slope in (1.0, 0.05)]
    bandwidths = [linearize(arm, amplitudes=()).joint("elbow_pitch").bandwidth_hz for arm in arms]
    assert bandwidths[1] == pytest.approx(bandwidths[0], rel=0.01)


@LAWS
@pytest.mark.parametrize(("supply", "temperature"), [(20.7, 100.0), (9.0, 40.0), (9.0, 100.0), (35.0, 0.0)])
def test_feedforward_holds_the_arm_exactly_whatever_the_oil(law, supply, temperature):
    arm = load_arm(plant=Plant("linear", law, "viscous", supply_pressure=supply, oil_temperature=temperature))
    data = arm.rest(arm.pose(OPERATING_POSE))
    mujoco.mj_step(arm.model, data, nstep=round(2.0 / arm.model.opt.timestep))
    np.testing.assert_allclose(data.qpos, arm.pose(OPERATING_POSE), rtol=0.0, atol=1e-9)


LEAST_DAMPING = {
    ("linear", "flow"): 0.12,
    ("linear", "torque"): 0.25,
    # The wrist rolls of heavy payloads, near the spool's own frequency.
    ("orifice", "flow"): 0.05,
    ("orifice", "torque"): 0.2,
}
"""Least damping ratio of any mode slower than the spool, which none above it can damp."""


@pytest.mark.slow
@pytest.mark.parametrize(("form", "law"), list(LEAST_DAMPING))
@pytest.mark.parametrize(
    ("supply", "temperature"), [(10.0, 0.0), (10.0, 100.0), (20.7, 40.0), (35.0, 0.0), (35.0, 100.0)]
)
def test_arms_are_stable_and_damped_with_every_payload_over_pressure_and_temperature(form, law, supply, temperature):
    plant, held = Plant(form, law, "viscous", supply_pressure=supply, oil_temperature=temperature), 0
    for variant, payload, pose in product(("nominal", "published"), PAYLOADS, POSES):
        try:
            poles = natural_poles(load_arm(variant, payload, plant=plant), pose)
        except OverloadError:
            continue
        held += 1
        # The mean pressures of the chambers settle slowest, through the null leakage of the lands; no joint feels them.
        assert poles.real.max() < (-0.1 if form == "orifice" else -0.8)
        swinging = poles[(poles.imag > 1.0) & (np.abs(poles) < SERVO_VALVE.angular_frequency)]
        assert (-swinging.real / np.abs(swinging)).min() > LEAST_DAMPING[form, law], (variant, payload, pose)
    assert held >= 8


@pytest.mark.slow
@pytest.mark.parametrize("name", list(VARIANTS))
@pytest.mark.parametrize("frequency", [2.0, 8.0])
def test_friction_of_any_level_stays_passive(name, frequency):
    """Along a motion from relaxed bristles it has always taken energy: its damping stays within the drag's bound."""
    arm, h = load_arm(name, plant=Plant(friction_level=100.0)), 1e-4
    w = 0.4 * np.sin(2.0 * np.pi * frequency * h * np.arange(4000)) + 0.1 * np.sin(37.0 * h * np.arange(4000))
    for p, joint in zip(drive_parameters(arm.model), JOINTS, strict=True):
        drag = arm.drives[joint].drag
        assert 0.0 < p[eq.BRISTLE_DAMPING] <= drag * p[eq.COULOMB] / (p[eq.STATIC] - p[eq.COULOMB]) * (1.0 + 1e-12)
        deflection, powers = 0.0, np.empty(len(w))
        for k, speed in enumerate(w):
            rate = eq.bristle_rate(p, deflection, speed)
            powers[k] = (eq.friction_torque(p, deflection, rate) + drag * speed) * speed
            middle = deflection + 0.5 * h * rate
            deflection += h * eq.bristle_rate(p, middle, speed)
        assert (np.cumsum(powers) >= 0.0).all()


def altered(name, **changes):
    """Actuators of the nominal arm, one of which differs."""
    return {**ACTUATORS, name: replace(ACTUATORS[name], **changes)}


@pytest.mark.parametrize(
    ("actuators", "words"),
    [
        (
            altered("elbow_pitch", trapped_volume=60.0),
            "odd: trapped volume 60 cm3 of the elbow pitch given, expected at least 79: 1.2 times what the joint",
        ),
        (
            altered("shoulder_roll", no_load_speed=4.0),
            "odd: valves that pass 5.. cm3/s together given, expected at most the pump's 500",
        ),
        (
            altered("wrist_yaw", friction=Friction(bristle_time=0.1)),
            "odd: LuGre damping 20.2 N m s/rad of the wrist yaw given, expected at most .*: beyond, .* not passive",
        ),
    ],
)
def test_hydraulics_that_cannot_be_are_refused(actuators, words):
    refused(words, replace, VARIANTS["nominal"], name="odd", actuators=actuators)


def test_seals_that_hold_a_joint_through_its_smallest_test_are_refused():
    nominal = VARIANTS["nominal"]
    zone = {
        name: ACTUATORS[name].breakaway_torque / gains.kp
        for name, gains in tuned_gains(nominal).items()
        if name != "shoulder_roll"
    }
    assert max(zone.values()) < HAND_CONTROLLER.gain
    factor = 1.01 * HAND_CONTROLLER.gain / zone["elbow_pitch"]
    friction = replace(Friction(), coulomb=factor * Friction().coulomb)
    # Damped in proportion to its stiffness, such a seal would not be passive either.
    friction = replace(friction, bristle_time=Friction().bristle_time / factor)
    stiff = replace(nominal, actuators=altered("elbow_pitch", friction=friction))
    refused(
        r"nominal: the elbow pitch stands still up to 4\.04 mrad, expected less than the 4 mrad", tuned_gains, stiff
    )
    # The other servo law is a choice of the experiment, and so are its seals.
    assert tuned_gains(stiff, Plant(servo="torque"))["elbow_pitch"].kd > 0.0
