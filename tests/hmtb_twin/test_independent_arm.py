"""The twin against a second simulation by Pinocchio and SciPy, written from the equations in docs/physics.md."""

from itertools import product

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import JOINTS, PAYLOADS, VARIANTS, Plant, Specimen, linearize, load_arm
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import OPERATING_POSE
from tests.hmtb_twin.altered_arms import at_step
from tests.independent_arm import IndependentArm, rigid_bodies

PRECISION = 1e-5
"""Largest relative error of the twin's angles and bandwidths against the differential equations."""

HEAVY = Specimen(mass=tuple(1.0 + 0.02 * i for i in range(8)), shift=tuple(0.02 * np.arange(-12, 12)), payload_mass=1.2)


def offsets(kind, size, ticks):
    """Offsets of a command (N,), rad: pseudo-random binary held for five ticks, a multisine, or a step."""
    if kind == "binary":
        return size * np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], ticks // 5), 5)
    t = SAMPLE_TIME * np.arange(ticks)
    return size * (
        np.sin(np.outer([np.pi, 3.0 * np.pi, 7.0 * np.pi], t)).sum(axis=0) if kind == "multisine" else (t > 0.1)
    )


def commands(arm, joint, kind, size, ticks=150):
    """Commands (N, 7), rad, about the operating pose, as fast as the velocity limit of the joint allows."""
    j, wanted = JOINTS.index(joint), offsets(kind, size, ticks)
    largest = arm.velocity_limits[j] * SAMPLE_TIME
    for k in range(1, ticks):
        wanted[k] = wanted[k - 1] + np.clip(wanted[k] - wanted[k - 1], -largest, largest)
    command = np.tile(arm.pose(OPERATING_POSE), (ticks, 1))
    command[:, j] += wanted
    return command


def simulated(arm, command, noise=None):
    """Angles (N, 7) of the twin at the end of each tick, rad."""
    data, angles = arm.rest(command[0]), np.empty_like(command)
    for row, control in zip(angles, arm.controls(command, noise), strict=True):
        data.ctrl[:] = control
        mujoco.mj_step(arm.model, data, nstep=round(SAMPLE_TIME / arm.model.opt.timestep))
        row[:] = data.qpos
    return angles


def error(angles, reference, joint):
    """Root mean square of the worst joint's difference over that of the excited joint's motion."""
    moved = reference[:, JOINTS.index(joint)] - reference[0, JOINTS.index(joint)]
    return np.sqrt(((angles - reference)[:, np.ptp(reference, axis=0) > 0.0] ** 2).mean(axis=0)).max() / np.sqrt(
        (moved**2).mean()
    )


def altered(arm, name):
    """Return the independent arm with a tenth more of one of its numbers."""
    independent = IndependentArm(arm)
    setattr(independent, name, 1.1 * getattr(independent, name))
    return independent


@pytest.mark.slow
@pytest.mark.parametrize(("variant", "payload"), list(product(VARIANTS, PAYLOADS)))
@pytest.mark.parametrize("specimen", [Specimen(), HEAVY], ids=["designed", "deviating"])
def test_rigid_bodies(variant, payload, specimen):
    arm, body = load_arm(variant, payload, specimen=specimen), rigid_bodies(variant, payload, specimen)
    data, own, rng = mujoco.MjData(arm.model), body.createData(), np.random.default_rng(3)
    for _ in range(20):
        data.qpos[:], data.qvel[:] = rng.uniform(-3, 3, (2, 7))
        mujoco.mj_forward(arm.model, data)
        mass = np.empty((7, 7))
        mujoco.mj_fullM(arm.model, data, mass)
        q, w = data.qpos.copy(), data.qvel.copy()
        # The inertia of an indexed joint itself is that of its pin.
        inertia, first = np.triu(pin.crba(body, own, q)), len(arm.indexed)
        pairs = {
            "mass": (inertia[:, first:], np.triu(mass)[:, first:]),
            "inertia": (inertia, np.triu(arm.inertia(q))),
            "bias": (pin.nonLinearEffects(body, own, q, w), data.qfrc_bias),
            "weight": (pin.computeGeneralizedGravity(body, own, q), arm.weight(q)),
        }
        for name, (ours, twins) in pairs.items():
            # The MJCF of the nominal arm has its inertias to nine digits.
            np.testing.assert_allclose(ours, twins, rtol=0.0, atol=1e-10 * np.abs(twins).max(), err_msg=name)


def thorough(*values):
    """Parameters of a test that runs with the thorough ones."""
    return pytest.param(*values, marks=pytest.mark.thorough)


EXPERIMENTS = [
    ("shoulder_yaw", "binary", 0.004, "nominal", "rpcm", "lugre", "flow"),
    ("shoulder_pitch", "binary", 0.004, "nominal", "rpcm", "lugre", "flow"),
    thorough("elbow_pitch", "binary", 0.004, "nominal", "rpcm", "lugre", "flow"),
    ("shoulder_yaw", "binary", 0.004, "nominal", "none", "coulomb", "flow"),
    ("shoulder_pitch", "multisine", 0.004, "nominal", "mdm", "lugre", "flow"),
    ("elbow_pitch", "binary", 0.067, "published", "mdm", "coulomb", "flow"),
    ("wrist_pitch", "step", 0.01, "nominal", "rpcm", "lugre", "flow"),
    ("wrist_roll", "binary", 0.002, "nominal", "rpcm", "lugre", "flow"),
    ("shoulder_yaw", "binary", 0.067, "nominal", "mdm", "none", "torque"),
    ("elbow_pitch", "binary", 0.004, "nominal", "none", "lugre", "torque"),
    thorough("shoulder_yaw", "multisine", 0.01, "published", "rpcm", "lugre", "torque"),
    ("shoulder_pitch", "binary", 0.01, "published", "none", "viscous", "torque"),
    ("wrist_yaw", "step", 0.01, "published", "none", "coulomb", "torque"),
    ("wrist_roll", "binary", 0.004, "nominal", "none", "coulomb", "torque"),
    ("elbow_pitch", "binary", 0.01, "flight", "rpcm", "lugre", "torque"),
    thorough("shoulder_pitch", "multisine", 0.01, "flight", "none", "coulomb", "torque"),
    ("shoulder_roll", "multisine", 0.01, "released", "rpcm", "lugre", "flow"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "kind", "size", "variant", "payload", "friction", "servo"), EXPERIMENTS)
def test_angles(joint, kind, size, variant, payload, friction, servo):
    arm = load_arm(variant, payload, plant=Plant(servo=servo, friction=friction))
    command = commands(arm, joint, kind, size)
    assert error(simulated(arm, command), IndependentArm(arm).simulate(command), joint) < PRECISION


@pytest.mark.slow
@pytest.mark.parametrize("servo", ["flow", "torque"])
def test_angles_of_a_deviating_arm_with_noise_at_its_limits(servo):
    """Bodies and oil unknown to the controller, and a jump that opens the valve fully and takes all torque."""
    plant = Plant(servo=servo, supply_pressure=14.0, oil_temperature=20.0, process_noise=0.01)
    arm = load_arm("nominal", "mdm", plant=plant, specimen=HEAVY)
    command = np.tile(arm.pose(OPERATING_POSE), (75, 1))
    command[10:, JOINTS.index("elbow_pitch")] += 0.8
    noise = arm.process_noise * np.random.default_rng(4).normal(size=command.shape)
    angles = simulated(arm, command, noise)
    assert error(angles, IndependentArm(arm).simulate(command, noise), "elbow_pitch") < PRECISION
    for name in ("largest", "limit"):
        assert error(angles, altered(arm, name).simulate(command, noise, rtol=1e-8), "elbow_pitch") > 3.0 * PRECISION


@pytest.mark.slow
def test_angles_with_a_flat_load_flow_line():
    arm = load_arm(plant=Plant(servo="flow", load_flow_slope=0.1))
    command = commands(arm, "shoulder_yaw", "binary", 0.004)
    assert error(simulated(arm, command), IndependentArm(arm).simulate(command), "shoulder_yaw") < PRECISION
    # As sharp as with the straight line: friction times slope is what differs.
    nominal = IndependentArm(load_arm(plant=Plant(servo="flow"))).simulate(command)
    assert error(simulated(arm, command), nominal, "shoulder_yaw") > 1000.0 * PRECISION


@pytest.mark.slow
def test_angles_with_worn_seals():
    """Friction a hundred times larger, the stiffness of its bristles at the bound for light joints."""
    arm = load_arm("nominal", "none", plant=Plant(servo="flow", friction_level=100.0))
    command, independent = commands(arm, "wrist_roll", "step", 0.3, ticks=75), IndependentArm(arm)
    seal, stiffness = arm.drives["wrist_roll"], independent.s0[-1]
    assert stiffness < 0.7 * seal.coulomb_torque / seal.friction.presliding
    assert error(simulated(arm, command), independent.simulate(command), "wrist_roll") < PRECISION


NUMBERS = {
    "flow": ("D", "K", "k", "F", "kp", "T", "H", "B", "s0", "s1", "w0", "coulomb", "excess", "ws"),
    "torque": ("G", "c", "kd"),
}


@pytest.mark.slow
@pytest.mark.parametrize("servo", NUMBERS)
def test_every_number_of_the_equations_shows(servo):
    """The comparison is sharp: a tenth more of any one number exceeds the precision by far."""
    arm = load_arm(plant=Plant(servo=servo))
    command = commands(arm, "shoulder_yaw", "binary", 0.004, ticks=75)
    angles = simulated(arm, command)
    for name in NUMBERS[servo]:
        assert error(angles, altered(arm, name).simulate(command, rtol=1e-8), "shoulder_yaw") > 3.0 * PRECISION, name


@pytest.mark.slow
def test_error_falls_with_the_fourth_power_of_the_step():
    arm = load_arm(plant=Plant(servo="torque", friction="viscous"))
    command = commands(arm, "elbow_pitch", "binary", 0.004)
    reference, halved = IndependentArm(arm).simulate(command), at_step(arm, 0.5 * arm.model.opt.timestep)
    first, second = (error(simulated(one, command), reference, "elbow_pitch") for one in (arm, halved))
    assert second < first / 12.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variant", "servo"),
    [
        *(("nominal", "flow"), ("published", "torque"), ("flight", "torque")),
        pytest.param("nominal", "torque", marks=pytest.mark.thorough),
        pytest.param("published", "flow", marks=pytest.mark.thorough),
        pytest.param("released", "flow", marks=pytest.mark.thorough),
    ],
)
def test_bandwidths_of_the_truth(variant, servo):
    for payload, specimen in product(PAYLOADS, (Specimen(), HEAVY)):
        arm = load_arm(variant, payload, plant=Plant(servo=servo), specimen=specimen)
        truth, expected = linearize(arm, amplitudes=()), IndependentArm(arm).bandwidths(arm.pose(OPERATING_POSE))
        measured = {name: truth.joint(name).bandwidth_hz for name in expected}
        assert measured == pytest.approx(expected, rel=PRECISION), payload


@pytest.mark.slow
@pytest.mark.parametrize("servo", ["flow", "torque"])
def test_linear_equations_are_those_of_small_motion(servo):
    """The second simulation against itself: its matrices are differentiated by hand."""
    twin = load_arm(plant=Plant(servo=servo, friction="viscous"), specimen=HEAVY)
    arm, command = IndependentArm(twin), commands(twin, "elbow_pitch", "binary", 1e-6)
    A, B = arm.linear(command[0])
    state, response = np.zeros(4 * arm.count), []
    for ask in (command - command[0])[:, arm.moving]:
        state = A @ state + B @ ask
        response.append(state[: arm.count])
    motion = arm.simulate(command)[:, arm.moving] - arm.rest(command[0])[: arm.count]
    np.testing.assert_allclose(motion, response, rtol=0.0, atol=PRECISION * np.abs(motion).max())
