"""Few numbers of many linear models, against the models themselves."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import NOMINAL_PLANT, OverloadError, TwinError, linearize, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE, POSES
from scenarios.files.errors import ScenarioError
from scenarios.truth.local_dynamics import COLUMNS, MOVING, LocalDynamics, local_dynamics

HERE = np.array(POSES[OPERATING_POSE])
STRETCHED = np.radians([0.0, 10.0, -60.0, 10.0, 20.0, 30.0, 40.0])


@pytest.fixture(scope="module")
def found() -> LocalDynamics:
    return local_dynamics(load_arm(), np.array([HERE, STRETCHED]))


@pytest.mark.parametrize(("row", "pose"), [(0, HERE), (1, STRETCHED)])
def test_numbers_are_those_of_the_truth(found: LocalDynamics, row: int, pose: np.ndarray) -> None:
    truth = linearize(load_arm(), pose, amplitudes=())
    for column, name in enumerate(MOVING):
        entry = truth.joint(name)
        assert found.bandwidth[row, column] == pytest.approx(entry.bandwidth_hz, rel=1e-7)
        assert found.gain[row, column] == pytest.approx(entry.dc_gain, abs=1e-7)
        poles = entry.dominant_poles
        slow = poles[np.abs(poles) < 62.8]
        assert found.damping[row, column] == pytest.approx(min((-slow.real / np.abs(slow)).tolist()), abs=1e-4)
    assert found.stable.all()
    assert np.array_equal(found.of("elbow_pitch"), found.bandwidth[:, MOVING.index("elbow_pitch")])


def test_real_poles_here_and_complex_ones_when_stretched(found: LocalDynamics) -> None:
    assert found.damping[0].min() == 1.0
    assert found.damping[1].min() < 0.9


def test_cross_gains_are_those_of_the_responses(found: LocalDynamics) -> None:
    model = linearize(load_arm(), STRETCHED, amplitudes=()).model
    response = np.abs(model.frequency_response(np.linspace(0.0, 5.0, 501)))[:, COLUMNS[:, None], COLUMNS]
    largest = response.max(axis=0) / np.diagonal(response[0])[:, None]
    off = ~np.eye(len(MOVING), dtype=bool)
    # The record looks at fewer frequencies, so it may miss a little of a peak.
    assert found.cross[1][off] == pytest.approx(largest[off], rel=0.01, abs=1e-6)
    assert (np.diagonal(found.cross, axis1=1, axis2=2) == 0.0).all()


def test_relative_gain_compares_with_the_others_kept_still(found: LocalDynamics) -> None:
    i = MOVING.index("shoulder_pitch")
    model = linearize(load_arm(), STRETCHED, amplitudes=()).model
    g = model.frequency_response([found.bandwidth[1, i]])[0][COLUMNS[:, None], COLUMNS]
    # Commands that move this joint by one and no other.
    commands = np.linalg.solve(g, np.eye(len(MOVING))[i])
    assert found.relative_gain[1, i] == pytest.approx(g[i, i] * commands[i])
    assert found.interaction[1, i] == pytest.approx(abs(g[i, i] * commands[i] - 1.0))


def test_an_arm_that_cannot_hold_itself_has_no_bandwidth() -> None:
    weak = load_arm(plant=replace(NOMINAL_PLANT, supply_pressure=7.0))
    with pytest.raises(OverloadError, match=r"at 7 MPa the drives cannot hold"):
        linearize(weak, amplitudes=())
    hanging = np.radians([0.0, 0.0, -89.0, 1.0, 0.0, 0.0, 0.0])
    seen = local_dynamics(weak, np.array([HERE, hanging]))
    assert seen.stable.tolist() == [False, True]
    assert np.array_equal(seen.angles, [HERE, hanging])
    for name in ("bandwidth", "gain", "damping", "cross", "relative_gain"):
        assert np.isnan(vars(seen)[name][0]).all()
        assert np.isfinite(vars(seen)[name][1]).all()


def test_records_are_locked_and_poses_needed(found: LocalDynamics) -> None:
    with pytest.raises(ValueError, match="read-only"):
        found.bandwidth[0, 0] = 1.0
    with pytest.raises(ScenarioError, match="no pose given"):
        local_dynamics(load_arm(), np.empty((0, 7)))
    with pytest.raises(TwinError, match="expected a name or 7 finite"):
        local_dynamics(load_arm(), np.full((1, 7), np.nan))


def test_progress_reaches_the_end() -> None:
    told: list[tuple[int, int]] = []
    local_dynamics(load_arm(), np.tile(HERE, (3, 1)), lambda done, total: told.append((done, total)))
    assert told[-1] == (3, 3)
