"""`hmtb control`: what it prints and writes, and what it refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JointLog, Plant, Specimen, load_arm, simulate
from scenarios import load
from scenarios.commands.control import _file_names
from scenarios.control.campaign import CONTROLLED, EXCITATION, identification_experiment, identify_pair
from scenarios.control.design import METHODS, read_law, write_law, wrong_model
from scenarios.control.study import CONDITIONS, WRONG
from sysid import Controller
from tests.refusals import refused
from tests.scenarios.control.test_campaign import model


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A short record of the ground arm, and a reference."""
    folder = tmp_path_factory.mktemp("control")
    short = replace(identification_experiment(), multisines=replace(EXCITATION, period=20.0, periods=2))
    record = simulate([short])[0].save(folder / "ground.nc")
    return ("--record", record, "--reference", sysid.write_model(model(), folder / "reference.json"))


@pytest.mark.slow
def test_results_designs_logs_and_figures(result, files, tmp_path):
    out = tmp_path / "out"
    done = result("control", "reach", *files, "--duration", 6, "--with-stress", "--out", out)
    (run,) = done["runs"]
    assert {"scenario", "seed", "rmse_without", "rmse_with", "saturated_percent", "stable"} <= set(run)
    assert (run["scenario"], run["stable"], set(run["joints"])) == ("reach", True, set(CONTROLLED))
    assert run["rmse_with"] < 0.5 * run["rmse_without"]
    assert [one["condition"] for one in done["stress"]] == [*CONDITIONS, *WRONG]
    assert {one.rsplit(".", 1)[1] for one in done["files"]} == {"json", "nc", "png", "svg"}
    assert json.loads((out / "control.json").read_text())["runs"] == done["runs"]
    assert JointLog.load(out / "reach-0-following.nc").requested is not None
    pair = identify_pair(record=files[1], reference=files[3])
    np.testing.assert_array_equal(read_law(out / "following.json").A, METHODS["following"](pair).A)
    np.testing.assert_array_equal(sysid.read_model(out / "model-reference.json").A, 0.9 * np.eye(6))
    ground = sysid.read_model(out / "model-ground.json")
    assert (ground.order, ground.nu, ground.ny, ground.D.any()) == (18, 6, 6, False)
    # Every joint follows its own command slowly.
    np.testing.assert_allclose(np.diag(ground.dc_gain()), 1.0, atol=0.1)
    # Whatever a run writes is announced, and replaced only if asked.
    ground, figures = (_file_names([load("reach")], ["following"], with_stress=stress) for stress in (False, True))
    assert {path.name for path in out.iterdir()} <= set(figures) and set(ground) < set(figures)
    again = result("control", "reach", *files, "--duration", 6, "--method", out / "following.json")
    assert again["runs"] == done["runs"]


@pytest.mark.parametrize("name", ["model-ground.json", "errors.png", "reach-run.svg", "reach-0-without.nc"])
def test_no_file_of_any_kind_is_replaced_unasked(complaint, files, tmp_path, name):
    (tmp_path / name).write_text("mine")
    assert "exists: --overwrite" in complaint("control", "reach", *files, "--out", tmp_path)
    assert (tmp_path / name).read_text() == "mine"


@pytest.mark.slow
def test_a_file_runs_on_its_own_arm_in_its_own_conditions(result, files, tmp_path):
    conditions = {"plant": Plant(oil_temperature=60.0), "specimen": Specimen(payload_mass=1.1)}
    mine = replace(load("reach", duration=4.0), payload="mdm", **conditions)
    (tmp_path / "mine.toml").write_text(mine.to_toml())
    result("control", tmp_path / "mine.toml", *files, "--out", tmp_path / "out")
    log = JointLog.load(tmp_path / "out" / "reach-0-following.nc")
    (alone,) = simulate([mine])
    without = JointLog.load(tmp_path / "out" / "reach-0-without.nc")
    np.testing.assert_array_equal(without.true_angles, alone.true_angles)
    for name, value in {"payload": "mdm", "plant_oil_temperature": "60.0", "specimen_payload_mass": "1.1"}.items():
        assert log.provenance[name] == without.provenance[name] == value


@pytest.mark.thorough
def test_designs_of_files_stay_as_they_are(result, files, tmp_path):
    result("control", "reach", *files, "--duration", 6, "--out", tmp_path)
    law = tmp_path / "following.json"
    again = result("control", "reach", *files, "--duration", 6, "--with-stress", "--method", law)
    # No law is designed anew from a wrong model.
    assert [entry["condition"] for entry in again["stress"]] == [*CONDITIONS]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("reach", "--reference", "fligth"), "did you mean 'flight'"),
        (("raech",), "did you mean 'reach'"),
        (("reach", "--method", "follow"), "unknown method 'follow'"),
        (("reach", "--method", "vrft", "vrft"), "expected names of their own"),
        (("reach", "--method"), "--method: none given"),
        (("reach", "--method", "{two}"), "2 loops"),
        (("reach", "--method", "{taken}"), "none of a file of --out"),
        (("rpcm", "--with-stress"), "expected one, as reach"),
        (("reach", "reach"), "two scenarios with the name reach and the seed"),
        (("reach", "--duration", 0.06), "reach: a duration of 0.06 s given, expected 1 s or more"),
        (("reach", "--with-stress", "--friction-level", 20), "'worn seals': plant: friction_level = 160.0 given"),
        (("reach", "track-elbow_pitch"), "payload = rpcm and track-elbow_pitch with none given, expected one arm"),
        (("track-elbow_pitch", "--payload", "rpcm"), "rpcm follows itself"),
        (("every-joint",), "axes with shoulder_roll given"),
        (("reach", "--method", "none.json"), "expected a law of hmtb control --out: cannot read"),
        (("reach", "--method", "{reference}"), "expected a law of hmtb control --out (Controller, Adaptive"),
    ],
)
def test_what_is_refused(complaint, files, words, message, tmp_path):
    given = {"{reference}": files[3], "{two}": tmp_path / "two.json", "{taken}": tmp_path / "model-ground.json"}
    none = np.zeros((2, 2))
    write_law(Controller(none, none, none, none, none, np.eye(2), none, 0.02), given["{two}"])
    write_law(Controller(*(np.zeros((6, 6)),) * 5, np.eye(6), np.zeros((6, 6)), 0.02), given["{taken}"])
    assert message in complaint("control", *files, *(given.get(word, word) for word in words))


def test_a_wrong_model_answers_wrongly(files):
    pair = identify_pair(record=files[1], reference=files[3])
    wrong = wrong_model(pair, gain=0.8, delay=2)
    late = np.exp(-2j * np.pi * 1.0 * 0.04)
    np.testing.assert_allclose(
        wrong.ground.frequency_response([1.0]), 0.8 * late * pair.ground.frequency_response([1.0]), rtol=1e-9
    )
    np.testing.assert_allclose(wrong.record.u, pair.record.u[2:] / 0.8)


SWEPT = """
name = "swept"
arm = "ur10"
axes = ["elbow_joint"]
duration = 10.0
hand_controller = { gain = 0.02, noise = 0.01, hold = 1, bias = 0.0 }
excitation = { kind = "multisine", f_min = 0.5, f_max = 3.0 }
"""

SLOW = """
model = "example-robot-data:ur_description/urdf/ur10_robot.urdf"
operating_pose = "ready"
[poses]
ready = [0.0, -1.2, 1.6, -1.97, -1.57, 0.0]
[every_joint]
bandwidth = 1.0
coulomb = 0.0
"""


@pytest.mark.slow
def test_another_arm_answers_like_one_of_its_joints(tmp_path, monkeypatch, result, complaint):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swept.toml").write_text(SWEPT)
    assert "expected an arm with those of ur10" in complaint("control", "swept.toml")
    (tmp_path / "slow").mkdir()
    (tmp_path / "slow" / "arm.toml").write_text(SLOW.replace("every_joint", "each_joint"))
    assert "each_joint" in complaint("control", "swept.toml", "--reference", "slow")
    (tmp_path / "slow" / "arm.toml").write_text(SLOW)
    done = result("control", "swept.toml", "--reference", "slow", "--with-stress", "--out", "out")
    (run,) = done["runs"]
    joints = load_arm("ur10").joints
    assert tuple(run["joints"]) == joints
    elbow = run["joints"]["elbow_joint"]
    assert elbow["rmse_with"] < 0.5 * elbow["rmse_without"]
    # the arm of the file has no payloads of the test bed
    assert {one["condition"] for one in done["stress"]} == {"worn seals", *WRONG}
    again = read_law(tmp_path / "out" / "following.json", joints)
    assert again.loops == len(joints)
    refused("expected \\['shoulder_yaw'", read_law, tmp_path / "out" / "following.json")
