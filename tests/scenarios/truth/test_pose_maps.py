"""Maps over the workspace."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, linearize, load_arm
from hmtb_twin.parameters.values import MOTIONS, OPERATING_POSE, POSES
from scenarios.files.errors import ScenarioError
from scenarios.truth.local_dynamics import COLUMNS, MOVING, LocalDynamics, described
from scenarios.truth.pose_maps import Cut, anywhere, change, cuts, near, plane, reach

HERE = np.array(POSES[OPERATING_POSE])


@pytest.fixture(scope="module")
def here() -> LocalDynamics:
    return described(linearize(load_arm(), HERE, amplitudes=()))


def test_plane_varies_shoulder_and_elbow_pitch_alone() -> None:
    surface = plane(load_arm(), HERE, (3, 4))
    bandwidth = surface.grid(surface.dynamics.bandwidth)
    assert bandwidth.shape == (3, 4, len(MOVING))
    angles = surface.grid(surface.dynamics.angles)
    first, second = (JOINTS.index(name) for name in surface.joints)
    assert np.array_equal(angles[:, 0, first], surface.axes[0])
    assert np.array_equal(angles[0, :, second], surface.axes[1])
    others = [k for k in range(7) if k not in (first, second)]
    assert (angles[..., others] == HERE[others]).all()
    one = linearize(load_arm(), angles[2, 1], amplitudes=()).joint("shoulder_pitch").bandwidth_hz
    assert bandwidth[2, 1, MOVING.index("shoulder_pitch")] == pytest.approx(one, rel=1e-7)


def test_turning_about_the_vertical_changes_nothing(here: LocalDynamics) -> None:
    lines = {cut.joint: cut for cut in cuts(load_arm(), HERE, 3)}
    assert tuple(lines) == MOVING
    # But for the pin of the shoulder roll, which gives a little when the arm pulls sideways.
    assert np.abs(change(lines["shoulder_yaw"].dynamics, here)).max() < 1e-3
    assert np.abs(change(lines["elbow_pitch"].dynamics, here)).max() > 0.05
    start = HERE[JOINTS.index("shoulder_yaw")]
    assert reach(lines["shoulder_yaw"], here, start) == (np.inf, np.inf)


def test_reach_interpolates_between_poses(here: LocalDynamics) -> None:
    turns = np.array([-0.2, -0.1, 0.0, 0.1, 0.2, 0.3])
    factor = 1.0 + np.array([0.16, 0.04, 0.0, 0.0, 0.05, 0.25])
    bandwidth = here.bandwidth * factor[:, None]
    whole = replace(here, **{name: np.repeat(value, 6, axis=0) for name, value in vars(here).items()})
    down, up = reach(Cut("elbow_pitch", turns, replace(whole, bandwidth=bandwidth)), here, 0.0)
    assert down == pytest.approx(0.15)
    assert up == pytest.approx(0.225)


def test_no_bandwidth_counts_as_another_one(here: LocalDynamics) -> None:
    turns = np.array([0.0, 0.1])
    whole = replace(here, **{name: np.repeat(value, 2, axis=0) for name, value in vars(here).items()})
    gone = whole.bandwidth.copy()
    gone[1] = np.nan
    _, up = reach(Cut("elbow_pitch", turns, replace(whole, bandwidth=gone)), here, -0.05)
    assert up == pytest.approx(0.05)


def test_random_poses_stay_in_range_and_repeat() -> None:
    low, high = np.array([(MOTIONS[name].lower, MOTIONS[name].upper) for name in MOVING]).T
    for sample in (anywhere(load_arm(), HERE, 12, 3), near(load_arm(), HERE, 12, 3, np.radians(60.0))):
        turns = sample.dynamics.angles[:, COLUMNS]
        assert ((turns > low) & (turns < high)).all()
        assert sample.distance == pytest.approx(np.abs(turns - HERE[COLUMNS]).max(axis=1))
        assert (sample.dynamics.angles[:, 0] == HERE[0]).all()
    again = near(load_arm(), HERE, 12, 3, np.radians(60.0))
    assert np.array_equal(again.dynamics.angles, sample.dynamics.angles)
    assert sample.distance == pytest.approx(np.radians(np.linspace(5.0, 60.0, 12)))
    assert not np.array_equal(anywhere(load_arm(), HERE, 3, 4).distance, anywhere(load_arm(), HERE, 3, 3).distance)


def test_a_pose_on_a_stop_has_no_neighbourhood() -> None:
    stopped = HERE.copy()
    stopped[JOINTS.index("elbow_pitch")] = 0.0
    with pytest.raises(ScenarioError, match="end of a joint's range"):
        near(load_arm(), stopped, 3, 0, 0.1)
