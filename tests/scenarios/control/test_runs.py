"""Runs of scenarios under control, and their scores."""

from dataclasses import replace

import numpy as np
import pytest

import scenarios
from hmtb_twin import JOINTS
from scenarios.control.campaign import CONTROLLED, frequency_test
from scenarios.control.joint_controller import DeviationController
from scenarios.control.runs import run_scenarios
from scenarios.control.score import is_stable, request_of, score
from sysid.control import Controller
from tests.scenarios.control.test_campaign import model


def through(gain: float = 1.0) -> Controller:
    """A controller whose command is the request times a gain."""
    none, six = np.zeros((1, 6)), np.zeros((6, 6))
    return Controller(np.zeros((1, 1)), none, none, none, np.zeros((6, 1)), gain * np.eye(6), six, 0.02)


@pytest.fixture(scope="module")
def runs():
    (reach,) = run_scenarios([scenarios.load("reach", duration=6.0)], {"through": through(), "wild": through(30.0)})
    return reach


def test_a_law_that_passes_requests_on_changes_nothing(runs):
    log = runs.controlled["through"]
    np.testing.assert_allclose(log.true_angles, runs.without.true_angles, atol=1e-12)
    np.testing.assert_allclose(log.requested, runs.without.commanded, atol=1e-12)
    assert not runs.failed


def test_the_reference_arm_gets_the_same_requests(runs):
    assert np.ptp(request_of(runs.reference), axis=0).min() > 1e-3
    np.testing.assert_allclose(request_of(runs.reference), request_of(runs.without), atol=1e-12)
    assert runs.reference.provenance["variant"] == "flight"
    for other in runs.controlled.values():
        np.testing.assert_allclose(request_of(other), request_of(runs.without), atol=1e-12)


def test_scores_of_a_run(runs):
    plain, wild = (score(log, model(), runs.reference) for log in (runs.without, runs.controlled["wild"]))
    assert plain.stable
    assert plain.limited == 0.0 < 0.2 < wild.limited
    assert wild.total > 3.0 * plain.total > 0.0
    assert (wild.effort > plain.effort).all()
    assert score(runs.reference, model(), runs.reference).total_arm == 0.0
    assert np.isnan([plain.force, plain.force_99, score(runs.without, model()).total_arm]).all()


def test_the_seen_response_is_that_of_the_reference_where_requests_have_power():
    (run,) = run_scenarios([frequency_test()], {}, reference=None)
    seen = score(run.without, model()).reference_response
    exact = np.diagonal(model().frequency_response([0.5, 1.0, 2.0]), axis1=1, axis2=2)
    np.testing.assert_allclose(seen.gains, np.abs(exact), rtol=0.05)
    np.testing.assert_allclose(seen.phases, np.angle(exact), atol=0.1)
    np.testing.assert_allclose(seen.bandwidth_hz, np.diag(model().bandwidth()), rtol=0.1)
    (run,) = run_scenarios([scenarios.load("siso-5-elbow_pitch", duration=20.0)], {}, reference=None)
    seen, elbow = score(run.without, model()).reference_response, CONTROLLED.index("elbow_pitch")
    np.testing.assert_allclose(seen.gains[:, elbow], np.abs(exact[:, elbow]), rtol=0.05)
    assert np.isnan(np.delete(seen.gains, elbow, axis=1)).all()


def test_errors_that_grow_or_leave_bounds_are_unstable():
    time = np.linspace(0.0, 1.0, 400)[:, None]
    wave = 0.01 * np.sin(40.0 * time)
    assert is_stable(wave)
    assert not is_stable(wave * np.exp(6.0 * time))
    assert not is_stable(wave + 0.6)


def test_a_law_works_on_its_joints_in_deviations():
    law = Controller(0.5 * np.eye(1), *[np.ones((1, 1))] * 3, np.ones((1, 1)), np.zeros((1, 1)), np.ones((1, 1)), 0.02)
    joints = DeviationController(law, ["elbow_pitch"])
    column, pose = JOINTS.index("elbow_pitch"), np.arange(7.0)
    joints.restart(pose)
    moved = np.where(np.arange(7) == column, 0.1, 0.5)
    first = joints.command(pose + moved, pose + 2.0 * moved, pose)
    np.testing.assert_allclose(np.delete(first, column), np.delete(pose + moved, column))
    assert first[column] == pytest.approx(pose[column] + 0.2)
    # x = request 0.1 + measurement 0.2 + what was applied, 0.05; the command is x + y.
    sent = pose + np.where(np.arange(7) == column, 0.05, 0.0)
    assert joints.command(pose, pose, sent)[column] == pytest.approx(pose[column] + 0.35)
    joints.restart(pose)
    assert joints.command(pose, pose, sent)[column] == pose[column]


def test_reach_needs_free_space():
    reach = scenarios.load("reach")
    assert scenarios.Scenario.from_toml(reach.to_toml()) == reach
    with pytest.raises(scenarios.files.errors.ScenarioError, match="task 'reach' expects worksite = false"):
        replace(reach, worksite=True)
