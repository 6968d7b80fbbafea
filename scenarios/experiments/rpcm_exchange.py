"""The exchange of the replacement unit: what the operator does, from the holster to the receptacle and back."""

from functools import cache
from math import radians

import numpy as np

from hmtb_twin import load_arm
from hmtb_twin.parameters.payloads import SEATS, Seat
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.experiments.operator import Pose, Step

CLEAR = 0.06
"""How far above the unit the empty end effector stays clear of it, m."""


@cache
def approach_point() -> Pose:
    """Return the holster-out approach point: where the tool is at the operating pose."""
    arm = load_arm()
    return arm.controller.tool_pose(arm.pose(OPERATING_POSE))


def rpcm_script() -> tuple[Step, ...]:
    """Return the steps of the whole task.

    The operator takes hold of the unit in its holster, draws it out to the approach point, holds there, brings it to
    the receptacle, aligns and inserts it and lets it go; then takes hold of it again, extracts it and returns.
    """
    approach = approach_point()
    holster, receptacle = SEATS["holster"], SEATS["receptacle"]
    over = _over(receptacle)
    return (
        Step("approach", _above(holster, CLEAR)),
        Step(
            "grip", None, near=0.0025, turn=radians(3.0), speed=0.03, stride=0.04, touching=True, closed=True, pause=0.8
        ),
        Step("draw out", approach, closed=True, speed=0.06, stride=0.06, near=0.008, touching=True),
        Step("hold", approach, closed=True, near=0.006, pause=5.0),
        Step("transfer", over, carry=True, closed=True, near=0.008, speed=0.08, pause=1.5),
        Step(
            "align",
            _above(receptacle, receptacle.mouth + 0.015),
            carry=True,
            closed=True,
            near=0.003,
            speed=0.04,
            pause=1.5,
        ),
        Step(
            "insert",
            receptacle.seated,
            carry=True,
            closed=True,
            near=0.002,
            aside=0.004,
            speed=0.02,
            stride=0.012,
            touching=True,
            pause=1.0,
        ),
        Step("release", None, near=0.01, touching=True, pause=1.0),
        Step("withdraw", _above(receptacle, CLEAR), near=0.006, speed=0.05, pause=5.0),
        Step(
            "grip again",
            None,
            near=0.0025,
            turn=radians(3.0),
            speed=0.03,
            stride=0.04,
            touching=True,
            closed=True,
            pause=0.8,
        ),
        Step("extract", over, carry=True, closed=True, speed=0.05, stride=0.06, near=0.01, touching=True),
        Step("return", approach, closed=True, near=0.006, speed=0.08),
    )


def unloaded_script() -> tuple[Step, ...]:
    """Return the same way with the empty end effector: the unit stays in its holster."""
    receptacle = SEATS["receptacle"]
    approach, over = approach_point(), _over(receptacle)
    return (
        Step("hold", approach, near=0.006, pause=5.0),
        Step("transfer", over, near=0.008, speed=0.08, pause=1.5),
        Step("align", _above(receptacle, receptacle.mouth + 0.015), near=0.003, speed=0.04, pause=1.5),
        Step("lower", receptacle.seated, near=0.003, speed=0.02, stride=0.012, pause=5.0),
        Step("raise", over, speed=0.05, stride=0.06, near=0.01),
        Step("return", approach, near=0.006, speed=0.08),
    )


def _above(seat: Seat, height: float) -> Pose:
    position, rotation = seat.seated
    return position + np.array([0.0, 0.0, height]), rotation


def _over(seat: Seat) -> Pose:
    """Over a seat, as high as the approach point."""
    (x, y, _), rotation = seat.seated
    return np.array([x, y, approach_point()[0][2]]), rotation
