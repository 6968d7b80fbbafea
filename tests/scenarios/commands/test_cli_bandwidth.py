"""`hmtb bandwidth`: rows, answer, table and figure, and what it refuses."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, Chain, linearize, load_arm, simulate
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.experiments.registry import load

FAST = ("--duration", "16", "--joints", "elbow_pitch", "--no-bla")
REFUSED = ("bandwidth", "--no-bla", "--methods", "arx", "--data")


def prbs(duration, joint="elbow_pitch", **changes):
    """The beginning of a joint's PRBS test with large motions."""
    scenario = replace(load(f"siso-5-{joint}"), duration=duration, hand_controller=LARGE_MOTION, **changes)
    return simulate([scenario])[0]


@pytest.fixture(scope="module")
def log():
    return prbs(16.0)


@pytest.mark.slow
def test_rows_of_every_method_and_seed(result, tmp_path, log):
    output = result("bandwidth", *FAST, "--methods", "oe", "spa", "--seeds", 2, "--out", tmp_path / "made")
    rows = output["rows"]
    assert [(row["seed"], row["method"]) for row in rows] == [(1, "oe"), (1, "spa"), (2, "oe"), (2, "spa")]
    assert {"joint", "method", "scenario", "seed", "hz", "ci95", "true_hz", "bla_hz", "published_hz"} <= set(rows[0])
    assert rows[0]["scenario"] == "siso-5-elbow_pitch"
    assert rows[0]["true_hz"] == linearize(load_arm(), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert 0.7 < rows[0]["hz"] < rows[0]["true_hz"]  # friction takes some of it at milliradians
    assert rows[0]["ci95"][0] < rows[0]["hz"] < rows[0]["ci95"][1]
    assert rows[0]["hz"] != rows[2]["hz"]  # another sequence, other noise
    assert rows[0]["bla_hz"] is None
    assert (rows[1]["hz"], rows[1]["refused"]) == (None, True)
    (line,) = result("bandwidth", "--data", log.save(tmp_path / "a.nc"), "--no-bla", "--methods", "spa")["rows"]
    assert line["hz"] is None and "every 0.5 Hz" in line["reason"]
    assert output["published"]["elbow_pitch"]["ARMAX (4.12)"] == pytest.approx(1.198, abs=0.001)
    assert output["answer"].startswith("This is a look, not a result")
    assert "2 of 4 bandwidths are about 1 Hz" in output["answer"]
    with (tmp_path / "made" / "bandwidth.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(line["true_hz"]) for line in table] == [row["true_hz"] for row in rows]
    assert table[0]["orders"] == "nb=2 nf=2 nk=2"
    assert (tmp_path / "made" / "bandwidth.png").stat().st_size > 10_000
    assert "<svg" in (tmp_path / "made" / "bandwidth.svg").read_text()


@pytest.mark.slow
def test_records_that_are_there_give_the_same(result, tmp_path):
    ours = result("bandwidth", *FAST, "--methods", "armax")
    (log,) = simulate([load("siso-5-elbow_pitch", duration=16.0)])
    theirs = result("bandwidth", "--data", log.save(tmp_path / "a.nc"), "--methods", "armax", "--no-bla")
    assert theirs["rows"][0]["hz"] == ours["rows"][0]["hz"]
    assert theirs["rows"][0]["test"] == "5"
    assert theirs["condition"] == ours["condition"] == "nominal, with friction"


@pytest.mark.slow
def test_the_table_says_what_is_not_claimed(printed, tmp_path):
    log = prbs(16.0, "shoulder_yaw", variant="published", chain=Chain(friction=False))
    text = printed("bandwidth", "--data", log.save(tmp_path / "a.nc"), "--no-bla", "--methods", "oe")
    assert "shoulder_yaw, published, without friction" in text
    assert "not claimed (model: 0.1" in text
    assert "excites nothing below 0.5 Hz" in text
    assert "does not stand for the arm itself, 0.16 Hz (shoulder yaw)" in text


@pytest.mark.slow
def test_a_log_of_several_axes_or_of_two_arms_is_refused(complaint, tmp_path, log):
    changes = {"mimo-1": {}, "siso-5-elbow_pitch": {"variant": "published"}}
    others = simulate([replace(load(name), duration=10.0, **change) for name, change in changes.items()])
    several, published = (one.save(tmp_path / f"{one.name}.nc") for one in others)
    sentence = "mimo-1 excites x, y, z; expected a log that excites one joint"
    assert sentence in complaint(*REFUSED, several)
    assert "the logs are of 2 arms" in complaint(*REFUSED, log.save(tmp_path / "a.nc"), published)


@pytest.mark.slow
def test_a_record_counts_once(complaint, tmp_path, log):
    path = log.save(tmp_path / "a.nc")
    cut = prbs(12.0).save(tmp_path / "b.nc")
    named = replace(log, name="another", seed=log.seed + 1).save(tmp_path / "c.nc")
    for other in (path, cut):
        sentence = f"the log of siso-5-elbow_pitch, seed {log.seed}, is given twice; expected every record once"
        assert sentence in complaint(*REFUSED, path, other)
    assert "is given twice, also as siso-5-elbow_pitch" in complaint(*REFUSED, path, named)


def test_identify_finds_the_same_where_it_leaves_out_the_same(result, tmp_path, log):
    path = log.save(tmp_path / "a.nc")
    ours = result("bandwidth", "--data", path, "--methods", "okid", "--no-bla")["rows"][0]["hz"]
    identify = ("identify", path, "--method", "okid", "--orders", "2", "5")
    assert result(*identify, "--skip", "4")["bandwidth_hz"] == pytest.approx(ours, rel=1e-5)
    assert result(*identify)["bandwidth_hz"] != pytest.approx(ours, rel=1e-4)


def test_a_log_that_is_too_short_to_settle_is_refused(complaint, tmp_path):
    path = prbs(0.4).save(tmp_path / "short.nc")
    assert "a log of 0.4 s given, expected 10 s or more: the arm settles for 4 s" in complaint(*REFUSED, path)


def test_a_log_with_something_missing_is_told_by_its_file(complaint, run, tmp_path, log):
    measured = log.measured.copy()
    measured[500:510, JOINTS.index("elbow_pitch")] = np.nan
    path = replace(log, measured=measured).save(tmp_path / "nanlog.nc")
    sentence = (
        "nanlog.nc: 10 measured angles are no numbers, the first that of elbow_pitch at sample 500; expected a log"
    )
    assert sentence in complaint(*REFUSED, path)
    identify = ("identify", path, "--method", "arx", "--orders", "2", "2")
    assert sentence in complaint(*identify)
    assert sentence in complaint(*identify, "--missing")
    # What is missing of another joint is no matter here.
    assert "no numbers" not in run(*identify, "--joint", "shoulder_yaw")[2]
