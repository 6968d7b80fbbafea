"""Friction that goes with the load, as of gears: against an independent ODE, and against its own definition."""

import mujoco
import numpy as np
import pytest

from hmtb_twin import Plant, Specimen, linearize, load_arm
from hmtb_twin.truth.linearization import simulated
from scenarios import load
from tests.independent_arm import IndependentArm
from tests.refusals import refused
from tests.user_arm import write_arm


@pytest.fixture
def folder(tmp_path):
    return write_arm(tmp_path)


def loaded(folder, text, **plant):
    (folder / "arm.toml").write_text(text)
    return load_arm(str(folder), plant=Plant(**plant))


def sweep(arm, joint, speed, seconds):
    """Commands of a joint that moves up and then down at one speed."""
    ticks = round(seconds * arm.description.sample_rate)
    angles = np.tile(arm.pose(arm.description.operating_pose), (2 * ticks, 1))
    way = speed * arm.description.sample_time * np.arange(ticks)
    angles[:, arm.description.joint_index(joint)] += np.concatenate([way, way[::-1]])
    return angles


@pytest.mark.slow
@pytest.mark.parametrize("drives", ["electric", "hydraulic"])
def test_trajectories_are_those_of_an_independent_ode(folder, drives):
    arm = loaded(folder, f"drives = '{drives}'\n[every_joint]\nload_loss = 0.1\nbandwidth = 1.0\n")
    command, pose = sweep(arm, "lift", 0.3, 0.5), arm.pose(arm.description.operating_pose)
    exact = IndependentArm(arm).simulate(command)[:, 1] - pose[1]

    def error(one):
        # ours are read at the start of a tick, and late by the bus
        late = int(one.delays[1])
        ours = simulated(one, pose, command)[1 + late :, 1]
        return np.abs(ours - exact[: len(ours)]).max() / np.abs(exact).max()

    assert error(arm) < 1e-5
    # The term is not too small to be seen.
    assert error(loaded(folder, f"drives = '{drives}'\n[every_joint]\nbandwidth = 1.0\n")) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.15])
def test_up_and_down_the_drive_differs_by_twice_the_friction(folder, loss):
    text = f"[joint.lift]\neffort = 200.0\ncoulomb = 2.0\nviscous = 0.5\nload_loss = {loss}\n"
    arm = loaded(folder, text, friction="coulomb")
    independent = IndependentArm(arm)
    joint, speed = arm.description.joint_index("lift"), 0.05
    command = sweep(arm, "lift", speed, 4.0)
    data, steps = arm.rest(command[0]), round(arm.description.sample_time / arm.model.opt.timestep)
    torques, wanted = [], []
    for k, row in enumerate(arm.controls(command)):
        data.ctrl[:] = row
        mujoco.mj_step(arm.model, data, nstep=steps)
        # Steady motion, first the one way, then the other.
        if not (100 < k < 195 or 300 < k < 395):
            continue
        mujoco.mj_forward(arm.model, data)
        torque = data.act[arm.pressure_states][joint] * independent.D[joint]
        velocity = data.qvel[joint]
        # Commands come in steps of a tick, so that the joint always speeds up or slows down a little.
        inertial = (arm.inertia(data.qpos) @ data.qacc)[joint]
        friction = np.sign(velocity) * (2.0 + loss * abs(torque)) + independent.B[joint] * velocity
        torques.append(torque)
        wanted.append(independent.weight(data.qpos)[joint] + inertial + friction)
    assert np.abs(wanted).min() > 10.0
    # A smooth reversal leaves a part of the friction at this speed: w0^2 / (2 w^2).
    np.testing.assert_allclose(torques, wanted, atol=0.05 * (2.0 + loss * np.abs(torques).max()))


def test_the_level_of_friction_and_a_specimen_scale_it_and_sliding_takes_it_away(folder):
    text = "[every_joint]\nload_loss = 0.05\n"
    for arm, expected in (
        (loaded(folder, text), 0.05),
        (loaded(folder, text, friction_level=2.0), 0.1),
        (loaded(folder, text, friction="viscous"), 0.0),
        (load_arm(str(folder), friction=False), 0.0),
        (load_arm(str(folder), specimen=Specimen(dry_friction=(3.0,) * 3)), 0.15),
    ):
        assert arm.drives["lift"].friction.load_loss == pytest.approx(expected)
        assert arm.model.actuator_dynprm[2, 1] == pytest.approx(expected)
    # The linear truth is without dry friction, whatever it goes with.
    lossy, plain = linearize(loaded(folder, text), amplitudes=()), linearize(loaded(folder, ""), amplitudes=())
    np.testing.assert_allclose(lossy.model.A, plain.model.A, rtol=0, atol=1e-12)


def test_commands_of_tests_overcome_what_the_weight_adds(folder):
    # A weak servo, so that friction decides the gain of the command.
    text = "[joint.lift]\nkp = 300.0\nkd = 60.0\ncoulomb = 1.0\nload_loss = {}\n"
    gains = []
    for loss in (0.0, 0.3):
        (folder / "arm.toml").write_text(text.format(loss))
        gains.append(load("prbs-lift", arm=str(folder)).hand_controller.gain)
    assert gains[1] > gains[0]


def test_a_loss_that_cannot_be_is_refused(folder):
    refused(
        "load_loss = 0.1 without Coulomb friction", loaded, folder, "[joint.lift]\ncoulomb = 0.0\nload_loss = 0.1\n"
    )
    refused("load_loss = 1 given, expected less than 1", loaded, folder, "[joint.lift]\nload_loss = 1.0\n")
    refused("load_loss = -0.1 given, expected 0 or more", loaded, folder, "[joint.lift]\nload_loss = -0.1\n")
    refused("servo = 'flow' given, which opens a valve", loaded, folder, "servo = 'flow'\n")
