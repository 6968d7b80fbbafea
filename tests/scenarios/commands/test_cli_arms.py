"""From the name or the folder of an arm to a verdict: whatever takes an arm or its record, on five of them."""

import av
import mujoco
import numpy as np
import pytest

import sysid
from hmtb_twin import load_arm, render
from hmtb_twin.arm_files.known_arms import arm_named
from scenarios.datasets import open_data_set
from scenarios.experiments.arm_tests import command_gain
from scenarios.problems.registry import problem
from tests.user_arm import write_arm

JOINTS = {"panda": "panda_joint4", "ur10": "elbow_joint", "xarm7": "joint4", "kinova": "j2s6s200_joint_2"}
"""One joint of each arm that comes with a package."""

OWN = {"mine": "lift"}
"""One of an MJCF in a folder of its user."""

FRICTIONLESS = """
name = "swept"
arm = "{arm}"
axes = ["{joint}"]
duration = 60.0
hand_controller = {{ gain = {gain}, noise = 0.01, hold = 1, bias = 0.0 }}
chain = {{ friction = false }}
excitation = {{ kind = "multisine", f_min = 0.5, f_max = 10.0 }}
"""
"""A record whose truth is linear: dry friction would cost some of the bandwidth."""

DATA_SET = """
name = "mine"
version = 1
title = "records of one arm"
seed = 3

[truth]
floors = 0

[baselines]
models = ["gain", "oe:3/3", "truth"]

[[records]]
name = "steps"
part = "train"
arm = "{arm}"
scenarios = ["prbs-{joint}"]
duration = 10.0

[[records]]
name = "swept"
part = "test"
arm = "{arm}"
axes = ["{joint}"]
multisines = {{ rms = 0.01, f_min = 0.2, f_max = 4.0, period = 5.0, realisations = 2, periods = 2, settling = 1 }}
"""


@pytest.fixture(params=JOINTS | OWN)
def named(request, tmp_path, monkeypatch):
    """Name and joint of an arm, in a folder that holds what its user brings."""
    monkeypatch.chdir(tmp_path)
    write_arm(tmp_path)
    return request.param, (JOINTS | OWN)[request.param]


@pytest.mark.slow
def test_from_an_arm_to_a_verdict(named, tmp_path, result, printed):
    arm, joint = named
    truth = result("truth", "--arm", arm)["joints"][joint]
    gain = command_gain(arm_named(arm), joint)
    (tmp_path / "swept.toml").write_text(FRICTIONLESS.format(arm=arm, joint=joint, gain=gain))
    printed("preview", "swept.toml")
    result("simulate", "swept.toml", "--out", "runs")
    # as a newcomer types it: estimator, orders and delay are chosen from the record
    model = result("identify", "runs/swept.nc", "--save", "model.json", "--out", "report")
    assert model["orders"]["nk"] == truth["delay_samples"]
    assert model["bandwidth_hz"] == pytest.approx(truth["bandwidth_hz"], rel=0.005)
    # the truth and the model explain all but the noise
    fits = result("compare", "runs/swept.nc", "--models", "truth", "model.json")["models"]
    true, identified = (fit["fit"]["simulation"][0] for fit in fits)
    assert min(true, identified) > 90.0
    assert identified == pytest.approx(true, abs=1.0)
    assert (tmp_path / "report" / "report.html").is_file()


@pytest.mark.slow
def test_a_film_of_any_arm(named, result):
    arm, joint = named
    try:
        render(load_arm(), "overview", 16, 16)
    except mujoco.FatalError as error:
        pytest.skip(str(error))
    result("simulate", f"prbs-{joint}", "--arm", arm, "--duration", 2, "--out", "runs")
    film = result("video", f"runs/prbs-{joint}.nc", "--fps", 5, "--width", 160, "--height", 120, "--out", "film.mp4")
    assert film["frames"] == 10
    with av.open("film.mp4") as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(pictures) == 10
    # the arm is in the picture, or a plane of one colour would be all
    assert np.ptp(pictures[0]) > 100


@pytest.mark.slow
def test_problems_of_any_arm(named):
    arm, joint = named
    one = problem(f"twin-{arm}-{joint}-multisine-10mrad-w1")
    task, record = one.task("oe"), one.draw(2)
    order = task.orders["nf"]
    model = sysid.oe(record, task.orders["nb"], order, task.orders["nk"])
    # friction changes the response at this size: the record's own response is what a model can follow
    errors = np.abs(model.model.frequency_response(one.frequencies) - one.nonparametric(record))
    assert np.median(errors) < 0.05


@pytest.mark.slow
def test_a_data_set_of_any_arm(named, tmp_path, result, printed):
    arm, joint = named
    (tmp_path / "mine.toml").write_text(DATA_SET.format(arm=arm, joint=joint))
    result("dataset", "build", "mine.toml", "--progress", "none")
    result("dataset", "check", "mine-v1")
    data = open_data_set("mine-v1")
    assert [record.name for record in data.records()] == [
        f"steps-prbs-{joint}",
        *(f"swept-{number:02d}" for number in (1, 2)),
    ]
    assert {record.joints for record in data.records()} == {(joint,)}
    datasheet = (tmp_path / "mine-v1" / "README.md").read_text()
    assert "is **assumed** by rules" in datasheet
    assert "seven-joint" not in datasheet
    # a model of the true arm predicts best, or as well as one that also knows its friction at this size
    scores = {row["method"]: row["test"] for row in result("dataset", "baselines", "mine-v1")["rows"]}
    assert float(scores["truth"]) < 0.5 * float(scores["gain"])
