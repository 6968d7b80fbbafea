"""The motion campaign: settings as stated, scores by hand, the same bits on any number of workers, and its files."""

import csv
import json
from dataclasses import fields, replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS, load_arm
from scenarios import load
from scenarios.jobs.executor import LocalProcesses
from scenarios.thesis.motion import (
    MotionCampaign,
    Recorded,
    Setting,
    model_numbers,
    records_of,
    run_campaign,
    run_settings,
)
from scenarios.thesis.motion_answer import motion_record, motion_texts
from scenarios.thesis.motion_score import EXPLAINS, FARTHEST, TOLERANCES, arms, cells, items, profile
from scenarios.thesis.motion_section import read_motion
from scenarios.truth.published import BREAK_FREQUENCY, PERCENT_DESCRIBED, published

SMALL = MotionCampaign(
    servos=("flow",),
    gains=(4e-3,),
    frictions=(0.002,),
    presliding=(1e-3,),
    holds=(3,),
    noises=(0.1,),
    slopes=(1.0,),
    logged=(0.0, 1.0),
    drifts=(0.0,),
    volts=(1.0,),
    seeds=2,
    duration=16.0,
    sines=1,
    sines_duration=16.0,
    multisines=1,
)
YAW = Setting("flow", 1.0, 4e-3, 0.006, 1e-3, 3, 0.1, "shoulder_yaw")


@pytest.mark.parametrize("joint", STUDIED_JOINTS)
def test_a_setting_is_what_it_says(joint):
    setting = Setting("torque", 0.33, 1.17e-3, 0.02, 1e-4, 1, 0.0, joint)
    scenario = setting.applied(load(f"siso-5-{joint}"))
    interface = scenario.hand_controller
    assert (interface.gain, interface.hold, interface.noise, scenario.plant.servo) == (1.17e-3, 1, 0.0, "torque")
    assert scenario.plant.load_flow_slope == 0.33
    drive = load_arm(plant=scenario.plant).drives[joint]
    assert drive.coulomb_torque == pytest.approx(0.02 * drive.rated_torque)
    assert drive.friction.presliding == 1e-4


def test_multisines_are_as_strong_as_binary_sequences():
    multisine = Recorded("multisine", 2.0, 1).experiment(MotionCampaign(), YAW)
    volts = multisine.volts()
    assert volts.std() == pytest.approx(2.0, rel=1e-3)
    power = np.abs(np.fft.rfft(multisine.offsets()[:1020, 0])) ** 2
    excited = np.flatnonzero(power > 1e-6 * power.max()) / 20.4
    assert (excited[0], excited[-1]) == (pytest.approx(0.05, abs=2e-3), pytest.approx(5.0, abs=0.06))
    assert multisine.multisines.samples % 3 == 0


def printed_row(joint):
    """Numbers that are what the thesis prints, of each method the last model."""
    row = {"excitation": "prbs", "volts": 1.0, "seed": 1, "logged": 0.0, "drift": 0.0, "peak_lag": 3}
    for model in published(joint):
        row |= {f"{model.method}_{key}": value for key, value in model_numbers(model.model).items()}
    row |= {"armax_white": True, "armax_independent": True, "oe_white": False, "oe_independent": True}
    row |= {"armax_correlation": 0.1, "oe_correlation": 0.2, "okid_tail_percent": 100.0 - PERCENT_DESCRIBED[joint]}
    orders = 2.0 if joint == "shoulder_yaw" else 1.0
    return row | {"break_rad_s": BREAK_FREQUENCY[joint], "disturbance_orders": orders}


def distances(joint, **changes):
    """By item; the row is a binary test and one of two sines at once."""
    setting = replace(YAW, joint=joint)
    row = printed_row(joint) | changes
    (cell,) = cells({setting: [row, row | {"excitation": "sines"}]})
    assert cell.score == pytest.approx(np.mean(cell.distances))
    assert cell.within == sum(value <= 1.0 for value in cell.distances)
    return dict(zip(items(joint), cell.distances, strict=True))


@pytest.mark.parametrize("joint", STUDIED_JOINTS)
def test_the_thesis_to_the_letter_scores_zero(joint):
    twice = "ARMAX (4.7), "  # printed again as (4.9), whose digits the row has
    zero = {name: value for name, value in distances(joint).items() if not name.startswith(twice)}
    assert max(zero.values()) < 1e-12
    assert len(zero) == len(items(joint)) - 5 * (joint == "shoulder_yaw")


def test_distances_are_in_tolerances():
    joint = "elbow_pitch"
    numbers = model_numbers(published(joint)[0].model)
    for key, (name, tolerance) in TOLERANCES.items():
        for sign in (-1, 1):
            off = distances(joint, **{f"armax_{key}": numbers[key] * np.exp(2 * sign * tolerance)})
            assert off[f"ARMAX (4.12), {name}"] == pytest.approx(2.0)
            assert sum(off.values()) == pytest.approx(2.0)
    off = distances(joint, peak_lag=7, disturbance_orders=0.5, armax_correlation=0.3, okid_tail_percent=100.0)
    assert (off["delay"], off["disturbance"]) == (2.0, 1.0)
    assert off["residuals of ARMAX whiter than of OE"] == off["tail of OKID"] == FARTHEST
    assert distances(joint, peak_lag=1)["delay"] == 1.0


@pytest.mark.parametrize("value", [None, 0.0, -1.0, 1e9])
def test_what_is_missing_or_absurd_counts_as_farthest(value):
    off = distances("shoulder_pitch", oe_half_power=value, break_rad_s=value)
    assert off["OE (4.10), gain 0.707 at"] == off["break of the spectrum"] == FARTHEST


def test_levels_that_are_tried():
    campaign = MotionCampaign()
    settings = campaign.settings()
    assert {setting.slope for setting in settings if setting.servo == "torque"} == {1.0}
    # A third of the slope takes three times the friction, on the yaw alone.
    assert {setting.friction for setting in settings if setting.slope == 0.33 and setting.gain == 4e-3} == {
        *(0.0007, 0.002, 0.006, 0.02),
        0.06,
    }
    assert {setting.joint for setting in settings if setting.friction > 0.02} == {"shoulder_yaw"}
    both = replace(campaign, logged=(0.0, 1.0), drifts=(0.0, 0.3)).disturbances()
    assert both == ((0.0, 0.0), (1.0, 0.0), (0.0, 0.3))


def test_a_drift_takes_a_slow_pole_and_raises_the_gain_at_0_hz():
    """It is added to the record: spread and other facts stay, and the same record without drift is there, too."""
    campaign = replace(SMALL, logged=(0.0,), drifts=(0.0, 1.0), seeds=1, multisines=0)
    ((_, rows),) = run_settings(campaign, (YAW,))
    still, drifting = [row for row in rows if row["excitation"] == "prbs"]
    assert (still["drift"], drifting["drift"]) == (0.0, 1.0)
    assert still["command_rms"] == drifting["command_rms"]
    assert drifting["armax_slow_pole"] < 0.5 * still["armax_slow_pole"]
    assert [cell.drift for cell in cells({YAW: rows})] == [0.0, 1.0]


def test_joints_of_an_arm_share_all_but_their_friction():
    """Two servos; under each the yaw is best with much friction, the pitches with little."""
    results = {}
    for servo, friction, joint in product(("flow", "torque"), (0.001, 0.01), STUDIED_JOINTS):
        row = printed_row(joint)
        wrong = (friction == 0.001) == (joint == "shoulder_yaw")
        row["break_rad_s"] *= 2.0 if wrong else 1.05 if servo == "torque" else 1.0
        results[replace(YAW, servo=servo, friction=friction, joint=joint)] = [row, row | {"excitation": "sines"}]
    best, other = arms(cells(results))
    for arm, servo in ((best, "flow"), (other, "torque")):
        assert [(cell.setting.servo, cell.setting.friction) for cell in arm.cells] == [
            (servo, 0.01),
            (servo, 0.001),
            (servo, 0.001),
        ]
    assert best.score < other.score < EXPLAINS
    assert best.explains == STUDIED_JOINTS
    assert profile((best, other))["servo"] == {"flow": best.score, "torque": other.score}
    record = motion_record(replace(SMALL, frictions=(0.001, 0.01)), cells(results))
    texts = motion_texts(record)
    assert (
        texts[0].startswith("2 of 2 arms")
        and "It has servo flow, load-flow slope 1 of the straight line’s, gain 4 mrad/V" in texts[0]
    )
    assert texts[1].startswith("Shoulder yaw: 4 of 4 combinations explain it")
    assert [joint["friction"] for joint in record["nominal"]["joints"].values()] == [0.01, 0.001, 0.001]
    assert {row["model"]: row["distance"] for row in record["printed"] if row["model"] != "ARMAX (4.7)"} == {
        model.label: pytest.approx(0.0, abs=1e-12)
        for joint in STUDIED_JOINTS
        for model in published(joint)
        if model.label != "ARMAX (4.7)"
    }


@pytest.mark.thorough
def test_noise_on_the_logged_command_takes_gain_away_and_needs_no_other_record():
    ((_, rows),) = run_settings(SMALL, (YAW,))
    assert len(rows) == 2 * len(records_of(SMALL))
    kinds = {kind: [row for row in rows if row["excitation"] == kind] for kind in ("prbs", "sines", "multisine")}
    for clean, noisy in zip(kinds["prbs"][::2], kinds["prbs"][1::2], strict=True):
        assert (clean["logged"], noisy["logged"]) == (0.0, 1.0)
        assert clean["output_rms"] == noisy["output_rms"]
        assert noisy["okid_gain_half_hz"] < 0.8 * clean["okid_gain_half_hz"]
    assert kinds["prbs"][0]["armax_dc_gain"] != kinds["prbs"][2]["armax_dc_gain"]
    assert kinds["sines"][0]["disturbance_orders"] > 0.0
    assert kinds["multisine"][0]["command_rms"] == pytest.approx(4e-3, rel=0.05)


@pytest.mark.reliability
def test_the_command_writes_what_any_number_of_workers_gives_and_resumes(run, result, tmp_path, monkeypatch):
    campaign, seen = replace(SMALL, seeds=1, multisines=0), []
    monkeypatch.setattr(MotionCampaign, "quick", classmethod(lambda _: campaign))
    # on a busy machine there is progress on stderr
    code, text, _ = run("motion", "--quick", "--out", tmp_path / "made", "--workers", 1)
    assert code == 0 and "Shoulder yaw: none of" in text
    assert text.startswith("A coarse look at few arms, which decides nothing")
    record = json.loads((tmp_path / "made" / "motion.json").read_text())
    assert record["arms"]["number"] == 2 and set(record["joints"]) == set(STUDIED_JOINTS)
    with (tmp_path / "made" / "motion.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["joint"] for row in rows] == [joint for joint in STUDIED_JOINTS for _ in range(2)]
    assert (tmp_path / "made" / "motion.png").stat().st_size > 10_000
    assert result("motion", "--quick", "--out", tmp_path / "made")["arms"] == record["arms"]
    with LocalProcesses(2) as executor:
        one, two = (
            run_campaign(campaign, executor, tmp_path / folder, lambda *now: seen.append(now))
            for folder in ("made", "two")
        )
    assert one == two
    assert seen == [(3, 3), (0, 3), (1, 3), (2, 3), (3, 3)]


def test_the_record_of_the_whole_campaign_is_of_its_factors_and_items():
    record, campaign = read_motion(), MotionCampaign()
    assert record["campaign"] == json.loads(json.dumps(vars(campaign)))
    assert len(campaign.settings()) == record["settings"]
    assert record["failed"] == []
    page = (Path(__file__).parents[3] / "docs/measured/motion-campaign.md").read_text(encoding="utf-8")
    assert [text for text in motion_texts(record) if f"- {text}\n" not in page] == []
    assert {joint: list(one["best"]["distances"]) for joint, one in record["joints"].items()} == {
        joint: list(items(joint)) for joint in STUDIED_JOINTS
    }
    # Flow with three load-flow slopes, torque with one; gains, holds, amplitudes.
    assert record["arms"]["number"] == (3 + 1) * 3 * 2 * 2


@pytest.mark.thorough
def test_the_record_of_the_whole_campaign_is_of_this_arm():
    """One setting of the map again, which any change of the physics moves."""
    recorded = next(cell for cell in read_motion()["map"] if cell["joint"] == "elbow_pitch")
    setting = Setting(**{field.name: recorded[field.name] for field in fields(Setting)})
    campaign = replace(MotionCampaign(), multisines=0, volts=(recorded["volts"],), drifts=(recorded["drift"],))
    ((_, rows),) = run_settings(campaign, (setting,))
    (cell,) = cells({setting: rows})
    again = {name: value for name, value in cell.record().items() if isinstance(value, float) and np.isfinite(value)}
    assert {name: recorded[name] for name in again} == pytest.approx(again, rel=1e-3)
