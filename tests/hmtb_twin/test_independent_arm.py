"""The twin against a second simulation by Pinocchio and SciPy, written from the equations in docs/physics.md."""

from itertools import product

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin import JOINTS, PAYLOADS, VARIANTS, Plant, Specimen, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE, SAMPLE_TIME
from tests.hmtb_twin.altered_arms import at_step, bandwidths
from tests.independent_arm import COUNT, MOVING, IndependentArm, rigid_bodies

PRECISION = 1e-5
STEPS, WEIGHTS = np.array([1 / 4000, 1 / 8000, 1 / 16000]), np.array([1.0, -6.0, 8.0]) / 3.0
"""Steps of the twin, s, and the weights that cancel its errors of first and second order."""

HEAVY = Specimen(mass=tuple(1.0 + 0.02 * i for i in range(8)), shift=tuple(0.02 * np.arange(-12, 12)), payload_mass=1.2)


def offsets(kind, size, ticks=100):
    """Offsets of a command (N,), rad: pseudo-random binary held for five ticks, a multisine, or a step."""
    if kind == "binary":
        return size * np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], ticks // 5), 5)
    t = SAMPLE_TIME * np.arange(ticks)
    return size * (
        np.sin(np.outer([np.pi, 3.0 * np.pi, 7.0 * np.pi], t)).sum(axis=0) if kind == "multisine" else t > 0.1
    )


def commands(joint, kind, size):
    command = np.tile(load_arm().pose(OPERATING_POSE), (100, 1))
    command[:, JOINTS.index(joint)] += offsets(kind, size)
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
    return np.sqrt(((angles - reference)[:, MOVING] ** 2).mean(axis=0)).max() / np.sqrt((moved**2).mean())


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
        own_mass, twins_mass = np.triu(pin.crba(body, own, q)), np.triu(mass)
        pairs = {
            "mass": (own_mass, twins_mass),
            "bias": (pin.nonLinearEffects(body, own, q, w), data.qfrc_bias),
            "inertia at rest": (own_mass, np.triu(arm.inertia(q))),
            "weight": (pin.computeGeneralizedGravity(body, own, q), arm.weight(q)),
        }
        for name, (ours, twins) in pairs.items():
            # The MJCF of the nominal arm has its inertias to nine digits.
            np.testing.assert_allclose(ours, twins, rtol=0.0, atol=1e-10 * np.abs(twins).max(), err_msg=name)


EXPERIMENTS = [
    ("shoulder_yaw", "binary", 0.004, "rpcm", "lugre", "nominal"),
    ("shoulder_pitch", "binary", 0.004, "rpcm", "lugre", "nominal"),
    ("elbow_pitch", "binary", 0.004, "rpcm", "lugre", "nominal"),
    ("elbow_pitch", "binary", 0.067, "none", "lugre", "nominal"),
    ("shoulder_yaw", "binary", 0.067, "mdm", "viscous", "nominal"),
    ("shoulder_pitch", "binary", 0.067, "none", "none", "nominal"),
    ("shoulder_yaw", "multisine", 0.01, "rpcm", "lugre", "published"),
    ("elbow_pitch", "multisine", 0.01, "mdm", "lugre", "published"),
    ("wrist_pitch", "step", 0.1, "rpcm", "lugre", "nominal"),
    ("wrist_yaw", "step", 0.1, "none", "lugre", "published"),
    ("wrist_roll", "step", 0.5, "rpcm", "lugre", "nominal"),
    ("wrist_roll", "step", 0.1, "mdm", "viscous", "flight"),
    ("elbow_pitch", "binary", 0.01, "rpcm", "lugre", "flight"),
    ("shoulder_pitch", "multisine", 0.01, "none", "lugre", "flight"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "kind", "size", "payload", "friction", "variant"), EXPERIMENTS)
def test_twin_converges_to_the_equations(joint, kind, size, payload, friction, variant):
    arm, command = load_arm(variant, payload, plant=Plant(friction=friction)), commands(joint, kind, size)
    reference = IndependentArm(arm).simulate(command)
    runs = np.array([simulated(at_step(arm, step), command) for step in STEPS])
    errors = [error(run, reference, joint) for run in runs]
    extrapolated = error(np.tensordot(WEIGHTS, runs, 1), reference, joint)
    assert errors[2] < 0.6 * errors[1] < 0.36 * errors[0]
    assert extrapolated < PRECISION


@pytest.mark.slow
@pytest.mark.parametrize(("variant", "payload"), list(product(VARIANTS, ("rpcm", "none", "mdm"))))
def test_bandwidths_converge_to_the_equations(variant, payload):
    arm = load_arm(variant, payload)
    runs = [bandwidths(at_step(arm, step)) for step in STEPS]
    for name, hz in IndependentArm(arm).bandwidths(arm.pose(OPERATING_POSE)).items():
        assert np.dot(WEIGHTS, [run[name] for run in runs]) == pytest.approx(hz, rel=PRECISION)


@pytest.mark.parametrize(("feed", "gain", "feedback"), [(1.0, 0.0, 0.0), (1.0, 5.0, 0.0), (0.0, 0.0, 10.0)])
def test_linear_equations_are_those_of_small_motion(feed, gain, feedback):
    servo = {"velocity_feed": feed, "pressure_gain": gain, "feedback_gain": feedback, "washout_time": 0.05}
    arm = IndependentArm(load_arm(plant=Plant(friction="viscous"), specimen=HEAVY), **servo)
    command = commands("elbow_pitch", "binary", 1e-6)
    A, B = arm.linear(command[0])
    state, response = np.zeros(4 * COUNT), []
    for ask in (command - command[0])[:, MOVING]:
        state = A @ state + B @ ask
        response.append(state[:COUNT])
    motion = arm.simulate(command)[:, MOVING] - arm.rest(command[0])[:COUNT]
    np.testing.assert_allclose(motion, response, rtol=0.0, atol=PRECISION * np.abs(motion).max())
