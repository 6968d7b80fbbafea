"""Runs of scenarios under control, and their scores."""

from dataclasses import replace

import numpy as np
import pytest

import scenarios
from hmtb_twin import JOINTS, Plant
from scenarios.control.campaign import CONTROLLED, IdentifiedPair, channels, frequency_test
from scenarios.control.result_tables import beyond_the_arm, fit_table, result_tables
from scenarios.control.runs import DeviationController, run_scenarios
from scenarios.control.score import is_stable, request_of, score
from scenarios.control.study import results
from sysid.control import Controller
from tests.refusals import refused
from tests.scenarios.control.test_campaign import model


def law(pole: float = 0.0, gain: float = 1.0, inside: float = 0.0) -> Controller:
    """A law with a state for each joint, which takes all signals and adds to the request times a gain."""
    six, zero = np.eye(6), np.zeros((6, 6))
    return Controller(pole * six, *[inside * six] * 3, inside * six, gain * six, zero, 0.02)


@pytest.fixture(scope="module")
def runs():
    (reach,) = run_scenarios([scenarios.load("reach", duration=6.0)], {"through": law(), "wild": law(gain=30.0)})
    return reach


def test_a_law_that_passes_requests_on_changes_nothing(runs):
    log, plain = runs.logs["through"], runs.logs["without"]
    np.testing.assert_allclose(log.true_angles, plain.true_angles, atol=1e-12)
    np.testing.assert_allclose(log.requested, plain.commanded, atol=1e-12)


def test_all_runs_have_the_same_requests(runs):
    assert runs.logs["reference"].provenance["variant"] == "flight"
    request = request_of(runs.logs["without"])
    assert np.ptp(request, axis=0).min() > 1e-3
    for log in runs.logs.values():
        np.testing.assert_allclose(request_of(log), request, atol=1e-12)


def test_a_run_that_failed_has_no_score(runs):
    pair, of = IdentifiedPair(model(), model(), None), {"through": ("following", "worn seals")}
    (one,) = results(pair, replace(runs, logs={"without": runs.logs["without"]}, failed={"through": "why"}), of)
    record = one.record()
    assert [record[key] for key in ("method", "condition", "stable", "failed")] == [*of["through"], False, "why"]
    assert record["rmse_with"] is record["joints"]["wrist_roll"]["gains"]["with"] is None
    weak = replace(scenarios.load("reach", duration=1.0), payload="mdm", plant=Plant(supply_pressure=6.0))
    (run,) = run_scenarios([weak], {})
    assert list(run.logs) == ["reference"]
    refused("reach fails without control: .* the drives cannot hold the arm", results, pair, run, {})


def test_factors_stand_against_the_model_and_against_the_simulated_arm(runs):
    pair, laws = IdentifiedPair(model(), model(), None), {"through": ("following", ""), "wild": ("adaptive", "")}
    through, wild = results(pair, runs, laws)
    assert through.factor == pytest.approx(1.0)
    assert through.factor_arm == pytest.approx(1.0)
    record = wild.record()
    assert record["factor"] == wild.factor == wild.without.total / wild.controlled.total
    assert record["factor_arm"] == wild.factor_arm == wild.without.total_arm / wild.controlled.total_arm
    table, *_ = result_tables([wild], [])
    assert f"{wild.factor:.2g} ({wild.factor_arm:.2g})" in table.rows[0]
    # Without a run of the reference arm its factor is unknown, as at the worksite.
    logs = {name: log for name, log in runs.logs.items() if name != "reference"}
    (alone,) = results(pair, replace(runs, logs=logs), {"wild": ("adaptive", "")})
    assert np.isnan(alone.factor_arm)
    assert f"{alone.factor:.2g}" in result_tables([alone], [])[0].rows[0]


def test_poor_models_and_answers_worse_than_none_are_said(runs):
    fits = {"ground": np.full(6, 95.0), "reference": np.array([95.0, 95.0, 88.0, 50.4, 48.9, 96.0])}
    pair = IdentifiedPair(model(), model(), None, fits)
    (line,) = pair.warnings()
    assert "model of the reference arm" in line and "wrist_pitch to 50 %, wrist_yaw to 49 %" in line
    assert not IdentifiedPair(model(), model(), None, {"ground": np.full(6, 95.0)}).warnings()
    table = fit_table(pair)
    assert table.rows[1] == ["reference", "95", "95", "88", "50.4", "48.9", "96"]
    through, wild = results(pair, runs, {"through": ("following", ""), "wild": ("adaptive", "")})
    assert wild.factor_arm < 1.0 < 1.001 > through.factor_arm
    (worse,) = beyond_the_arm([wild])
    assert "with adaptive the arm is further from the simulated reference arm" in worse


def test_scores_of_a_run(runs):
    without, wild, reference = (runs.logs[name] for name in ("without", "wild", "reference"))
    plain, wild = (score(log, model(), reference) for log in (without, wild))
    assert plain.stable
    assert plain.limited == 0.0 < 0.2 < wild.limited
    assert wild.total > 3.0 * plain.total > 0.0
    assert (wild.effort > plain.effort).all()
    assert score(reference, model(), reference).total_arm == 0.0
    assert np.isnan([plain.force, plain.force_99, score(without, model()).total_arm]).all()


@pytest.mark.slow
def test_the_seen_response_is_that_of_the_reference_where_requests_have_power():
    (run,) = run_scenarios([frequency_test()], {}, reference=None)
    seen = score(run.logs["without"], model()).reference_response
    exact = np.diagonal(model().frequency_response([0.5, 1.0, 2.0]), axis1=1, axis2=2)
    np.testing.assert_allclose(seen.gains, np.abs(exact), rtol=0.05)
    np.testing.assert_allclose(seen.phases, np.angle(exact), atol=0.1)
    np.testing.assert_allclose(seen.bandwidth_hz, np.diag(model().bandwidth()), rtol=0.1)
    (run,) = run_scenarios([scenarios.load("siso-5-elbow_pitch", duration=20.0)], {}, reference=None)
    seen, elbow = score(run.logs["without"], model()).reference_response, CONTROLLED.index("elbow_pitch")
    np.testing.assert_allclose(seen.gains[:, elbow], np.abs(exact[:, elbow]), rtol=0.05)
    assert np.isnan(np.delete(seen.gains, elbow, axis=1)).all()


def test_errors_that_grow_or_leave_bounds_are_unstable():
    time = np.linspace(0.0, 1.0, 400)[:, None]
    wave = 0.01 * np.sin(40.0 * time)
    assert is_stable(wave)
    assert not is_stable(wave * np.exp(6.0 * time))
    assert not is_stable(wave + 0.6)


def test_a_law_works_on_its_joints_in_deviations():
    joints, pose = DeviationController(law(pole=0.5, gain=0.0, inside=1.0), channels("nominal")), np.arange(7.0)
    moved = np.where([name in CONTROLLED for name in JOINTS], 0.1, 0.5)
    for _ in range(2):
        joints.restart(pose)
        np.testing.assert_allclose(joints.command(pose + moved, pose + 2.0 * moved, pose), [0.5, 1, 2, 3, 4, 5, 6])
        # The state is request 0.1 + measurement 0.2 + what was applied, 0.05.
        np.testing.assert_allclose(joints.command(pose, pose, pose + 0.5 * moved), [0, *np.arange(1.35, 7.0)])


def test_reach_needs_free_space():
    reach = scenarios.load("reach")
    assert scenarios.Scenario.from_toml(reach.to_toml()) == reach
    with pytest.raises(scenarios.files.errors.ScenarioError, match="task 'reach' expects worksite = false"):
        replace(reach, worksite=True)
