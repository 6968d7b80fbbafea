"""Tests of any arm: a binary sequence, a multisine and a chirp on each of its joints, and all joints at once."""

from collections.abc import Iterator, Sequence
from math import floor, log10
from typing import Any

import numpy as np

from hmtb_twin import load_arm
from hmtb_twin.parameters.arm_description import ArmDescription

EXCITATIONS: dict[str, dict[str, Any]] = {
    "prbs": {"kind": "prbs", "clock": 2, "register": 10},
    "multisine": {"kind": "multisine", "f_min": 0.5, "f_max": 10.0},
    "chirp": {"kind": "chirp", "f_start": 0.5, "f_end": 10.0},
}
"""Excitations of one joint by name, each of 1 V."""

SWEPT = {
    "prbs": "binary sequence",
    "multisine": "random-phase multisine, 0.5 to 10 Hz",
    "chirp": "chirp from 0.5 to 10 Hz",
}
"""The same in words."""

ALL_JOINTS = "all-joints"
"""Name of the test of all joints at once."""

TOOL = "tool"
"""Name of the test that moves the tool along its three axes."""

TASK = 6
"""Joints that an arm needs to move its tool and to keep its orientation."""

FASTEST_TOOL = 0.02
"""Largest gain of the tool's command, m/V."""

DURATION = 120.0
"""Length of every test, s."""

LARGEST_GAIN = 0.05
"""Largest gain of a joint's command, rad/V: larger moves are no small ones."""

REACH = 0.25
"""Part of the distance to the nearer end of a joint's range that its command may take at 1 V."""

MOVES = 3.0
"""Least command of 1 V over the error at which the servo overcomes dry friction: joints then move 0.7 of what they
would without it, or more; where both are equal 0.1 to 0.4."""

FIRST_SEED = 8000
"""Seeds of the tests: each has noise of its own, none that of a test of the thesis."""


def command_gain(arm: ArmDescription, joint: str) -> float:
    """Gain of a joint's command, rad/V: the largest round one at which no test of 1 V moves at the velocity limit.

    A binary sequence changes by 2 V from one tick to the next, as the thesis' tests on the test bed do. A joint that
    its dry friction would hold at that gain gets a larger one, at which steps become ramps at the velocity limit.
    """
    limit, angle = arm.motions[joint], arm.poses[arm.operating_pose][arm.joint_index(joint)]
    slewing = limit.velocity_limit * arm.sample_time / 2.0
    ending = REACH * min(angle - limit.lower, limit.upper - angle)
    gain = _rounded(min(slewing, ending, LARGEST_GAIN))
    # The error at which the servo overcomes the friction of a joint at rest, with that of the weight that it carries.
    drive, loaded = arm.actuators[joint], load_arm(arm.name)
    lost = drive.friction.load_loss if drive.friction else 0.0
    weight = abs(loaded.weight(loaded.pose(arm.operating_pose))[arm.joint_index(joint)]) if lost else 0.0
    breakaway = (drive.breakaway_torque + lost * weight) / loaded.gains[joint][0]
    return max(gain, _rounded(min(MOVES * breakaway, ending)))


def _rounded(largest: float) -> float:
    """Round a gain down to one significant digit."""
    digit = 10.0 ** floor(log10(largest))
    return floor(largest / digit * (1.0 + 1e-9)) * digit


def arm_tests(arm: ArmDescription) -> Iterator[dict[str, Any]]:
    """Yield the tests of an arm as tables of TOML files."""
    position = 0
    for test, excitation in EXCITATIONS.items():
        for joint in arm.free:
            position += 1
            yield {
                **_test(arm, f"{test}-{joint}", (joint,)),
                "seed": FIRST_SEED + position,
                "description": f"{joint}: {SWEPT[test]}",
                "tags": [test, joint],
                "excitation": dict(excitation),
            }
    multisines = [{**EXCITATIONS["multisine"], "seed": seed} for seed in range(len(arm.free))]
    yield {
        **_test(arm, ALL_JOINTS, arm.free),
        "seed": FIRST_SEED,
        "independent_channels": True,
        "description": f"all {len(arm.free)} joints at once, each with a multisine of its own",
        "tags": ["multisine"],
        "excitation": multisines,
    }
    # The chain of the test bed has tests of its tool among those of the thesis.
    if arm.rigid is None or len(arm.free) < TASK:
        return
    yield {
        **_test(arm, TOOL, arm.free),
        "axes": ["x", "y", "z"],
        "mode": "cartesian",
        "seed": FIRST_SEED + position + 1,
        "independent_channels": True,
        "description": "the tool along its x, y and z, each with a multisine of its own",
        "tags": ["multisine"],
        "hand_controller": {**interface(arm, arm.free), "translation_gain": translation_gain(arm)},
        "excitation": multisines[:3],
    }


def translation_gain(arm: ArmDescription) -> float:
    """Gain of the tool's command, m/V: the largest round one at which 1 V on three axes moves no joint at its limit."""
    loaded = load_arm(arm.name)
    # Joint motion of a tool that moves along its axes and does not turn.
    motion = np.abs(np.linalg.pinv(loaded.controller.tool_jacobian(loaded.pose(arm.operating_pose)))[:, :3]).sum(axis=1)
    angles = np.array(arm.poses[arm.operating_pose])
    slewing = loaded.velocity_limits * arm.sample_time / 2.0
    ending = REACH * np.minimum(angles - arm.lower, arm.upper - angles)
    # A joint that does not move bounds nothing.
    moved = motion > 1e-9
    largest = float((np.minimum(slewing, ending)[moved] / motion[moved]).min(initial=np.inf))
    return _rounded(min(largest, FASTEST_TOOL))


def interface(arm: ArmDescription, joints: Sequence[str]) -> dict[str, Any]:
    """Settings of the hand-controller interface at which a test of 1 V moves none of the joints at its limit.

    Nobody holds a stick: only what its converter rounds and a little noise are left of a hand controller.
    """
    return {"gain": min(command_gain(arm, joint) for joint in joints), "noise": 0.01, "hold": 1, "bias": 0.0}


def _test(arm: ArmDescription, name: str, joints: tuple[str, ...]) -> dict[str, Any]:
    """What all tests of an arm have: its payload and pose, and an interface that is nearly ideal."""
    return {
        "name": name,
        "axes": list(joints),
        "duration": DURATION,
        "variant": arm.name,
        "payload": arm.tuned_payload,
        "pose": arm.operating_pose,
        "hand_controller": interface(arm, joints),
    }
