"""A shared waveform cannot tell the joints apart, a waveform for each axis can; each joint alone needs neither."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS, VARIANTS, Plant, linearize, load_arm, simulate
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios import Excitation, Scenario, load, names
from scenarios.experiments.joint_inputs import LIMIT, joint_inputs, moved_joints, settled_inputs
from scenarios.experiments.preview import preview
from tests.benchmarks.shared_waveform import COLUMNS, FREQUENCIES, errors

HMTB = VARIANTS["nominal"]


@pytest.fixture(scope="module")
def logs():
    """Of large motions."""
    stick = replace(LARGE_MOTION, compensation=0.95)
    # Without dry friction, which alone would account for errors of 0.2.
    setting = {"duration": 40.0, "hand_controller": stick, "plant": Plant(friction="viscous")}
    chosen = [replace(load(name), **setting) for name in ("mimo-7", "mimo-7-independent")]
    return {log.name: log for log in simulate(chosen)}


@pytest.mark.slow
def test_a_shared_waveform_is_flagged_and_independent_ones_are_not(logs):
    shared, apart = (settled_inputs(log.commanded, load(name)) for name, log in logs.items())
    assert shared.condition > 5 * LIMIT
    assert (shared.full, shared.block_diagonal) == (False, True)
    assert "no full model of several inputs can be identified" in str(shared.warning())
    assert apart.condition < LIMIT / 5
    assert (apart.full, apart.block_diagonal, apart.warning()) == (True, True, None)


@pytest.mark.slow
def test_estimates_bear_the_verdicts_out(logs):
    true = linearize(load_arm()).model.frequency_response(FREQUENCIES)[:, COLUMNS][:, :, COLUMNS]
    (shared, *diagonal), (apart, *others) = (errors(logs[name], true) for name in ("mimo-7", "mimo-7-independent"))
    # Errors of gains that are one at 0 Hz. A model of one joint cannot hold what its neighbours' commands add.
    coupling = np.abs(true - true * np.eye(3)).sum(axis=2).max()
    assert apart < 0.12 < 0.2 < shared
    assert max(*diagonal, *others) < 0.12 + coupling


def signals(*columns):
    commands = np.zeros((len(columns[0]), len(JOINTS)))
    commands[:, COLUMNS[: len(columns)]] = np.column_stack(columns)
    return commands


def test_poor_excitation_is_named_and_joints_at_rest_are_left_out():
    t = np.arange(2000) / 50
    tones = joint_inputs(signals(np.sin(2 * np.pi * t), np.sin(4 * np.pi * t)), STUDIED_JOINTS[:2], HMTB)
    assert (tones.full, tones.block_diagonal) == (False, False)
    assert "excite to the orders 2, 2, expected 8" in str(tones.warning())
    a, b = np.random.default_rng(4).standard_normal((2, 500))
    moving = joint_inputs(signals(a, 1e-12 * b, b), STUDIED_JOINTS, HMTB)
    assert moving.names == (STUDIED_JOINTS[0], STUDIED_JOINTS[2])
    assert moving.condition < 2.0
    assert joint_inputs(signals(a), STUDIED_JOINTS[:2], HMTB) is None


def test_joints_compared_are_those_of_the_stick_or_of_the_thesis():
    assert moved_joints(load("mimo-1")) == STUDIED_JOINTS
    assert moved_joints(load("siso-1-wrist_roll")) == ("wrist_roll",)
    two = Scenario("two", ("wrist_yaw", "elbow_pitch"), (Excitation("prbs"),))
    assert moved_joints(two) == ("wrist_yaw", "elbow_pitch")


def test_every_test_of_table_2_shares_its_waveform_and_is_flagged():
    """Commands alone show it, where the wires are quiet; the noise of each axis is a small input of its own."""
    for name in ("mimo-4", "mimo-9", "mimo-13", *names("independent")):
        noisy = replace(load(name), duration=12.0)
        seen = preview(replace(noisy, hand_controller=replace(LARGE_MOTION, compensation=0.95)))
        assert seen.inputs.full == (name in names("independent")), (name, seen.inputs.condition)
        assert seen.inputs.block_diagonal
        assert seen.inputs.full or preview(noisy).inputs.condition < 0.5 * seen.inputs.condition


def test_a_tool_that_moves_more_joints_than_it_has_directions_is_told_of_the_test_that_tells_them_apart():
    scenario = load("tool", duration=20.0, arm="ur10")
    (warning,) = [text for text in preview(scenario).warnings() if "move together" in text]
    assert "3 directions of the tool move 6 joints: a test that moves the joints themselves, as all-joints" in warning
    # Each has a channel of its own already.
    assert "independent_channels" not in warning
