"""The first screen: the comparator moves as strongly as the test, and the sentences say what came out."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.thesis.answer import FREQUENCIES, METHODS, answer_chart, answer_texts, drawn_models
from scenarios.thesis.answer_intervals import best_linear_gain
from scenarios.thesis.motion_section import read_motion
from sysid import IOData
from sysid.models.bandwidth import HALF_POWER


def test_the_comparator_moves_as_strongly_as_the_test_with_friction(answer, study):
    for one in answer.joints:
        truth = one.best_linear
        assert truth.wanted_rms == pytest.approx(float(np.std(study.joints[one.joint].data[5].u)), rel=0.1)
        # The converter may clip a multisine, whose peaks are higher than those of a binary sequence.
        assert 0.5 * truth.wanted_rms < truth.command_rms < 1.05 * truth.wanted_rms
        assert truth.half_power_hz < one.small_signal_hz, (
            "dry friction takes from the gain of a joint that moves little"
        )


def test_every_method_gives_a_model_from_every_seed(answer):
    for one in answer.joints:
        assert set(one.gains) == set(one.levels) == set(METHODS)
        for method in METHODS:
            assert one.gains[method].shape == (len(answer.seeds), len(FREQUENCIES))
            for gain, level in zip(one.gains[method], one.levels[method], strict=True):
                if np.isfinite(level) and level > FREQUENCIES[0]:
                    drawn = np.interp(np.log(level), np.log(FREQUENCIES), np.log(gain))
                    assert np.exp(drawn) == pytest.approx(HALF_POWER, rel=0.02)
                else:
                    assert gain[0] < HALF_POWER or gain.min() > HALF_POWER


def test_the_picture_has_truth_methods_prints_and_the_thesis_breaks(answer):
    ((_, panels),) = answer_chart(answer).views.items()
    assert [panel.title for panel in panels] == ["shoulder yaw", "shoulder pitch", "elbow pitch"]
    for panel, one, radians in zip(panels, answer.joints, (6.0, 7.0, 7.0), strict=True):
        labels = [series.label for series in panel.series]
        assert labels[:2] == ["best linear truth (95 %)", "put in: without friction"]
        assert labels[2:4] == [f"best linear truth, load-flow slope {slope} in place of 1" for slope in ("0.33", "0.1")]
        printed = [method for method in METHODS if method in drawn_models(one.joint)]
        assert [label for label in labels if "1996" in label] == [f"{name.upper()} printed in 1996" for name in printed]
        assert ("x", pytest.approx(radians / (2 * np.pi)), f"thesis: {radians:g} rad/s") in panel.marks
        assert ("y", HALF_POWER, "0.707") in panel.marks


def changed(answer, factor):
    joints = tuple(
        replace(
            one,
            levels={
                name: tuple(factor * one.best_linear.half_power_hz for _ in levels)
                for name, levels in one.levels.items()
            },
        )
        for one in answer.joints
    )
    return replace(answer, joints=joints)


def said(answer, motion=None):
    return answer_texts(answer, motion or read_motion())


def test_sentences_follow_the_outcome(answer):
    put_in, recovered, _, meaning, _ = said(changed(answer, 1.05))
    for one in answer.joints:
        assert f"{one.best_linear.half_power_hz:.2f} Hz ({one.joint.replace('_', ' ')})" in put_in
    assert recovered.endswith(
        "9 of 9 cases (3 of 3 on the shoulder yaw, 3 of 3 on the shoulder pitch and 3 of 3 on the elbow pitch)."
    )
    assert "shoulder yaw OE (4.8), shoulder pitch OE (4.10) and elbow pitch ARMAX (4.12)" in meaning
    assert "about 1 Hz was put in" in meaning

    first = changed(answer, 0.2).joints[0]
    lost = replace(answer.joints[1], levels={name: (np.nan,) for name in METHODS})
    recovered = said(replace(answer, joints=(first, lost, changed(answer, 1.0).joints[2])))[1]
    assert "in 3 of 9 cases (0 of 3 on the shoulder yaw, 0 of 3 on the shoulder pitch and 3 of 3" in recovered
    assert recovered.endswith("of the others 3 miss it by −80, −80 and −80 % and 3 have no such frequency.")

    motion = read_motion()
    joints = {joint: {**one, "explained": int(joint == "elbow_pitch")} for joint, one in motion["joints"].items()}
    for explained, text in ((0, "none of 9 simulated arms"), (1, "1 of 9 simulated arms")):
        arms = {**motion["arms"], "number": 9, "explain_all": explained}
        meaning = said(answer, {**motion, "joints": joints, "arms": arms})[3]
        assert text in meaning and ("(the elbow pitch alone can be)" in meaning) is not bool(explained)


def test_intervals_are_counted_and_said(answer):
    """Counted by hand from one model: it holds the gain of its own record with distortion, noise alone is narrow."""
    text = said(answer)[2]
    held = [one.held for one in answer.joints]
    assert all(one.models == len(METHODS) * len(answer.seeds) for one in held)
    assert f"in {sum(one.by_noise for one in held) or 'none'} of {sum(one.models for one in held)} models" in text
    assert text.startswith("Intervals: ") and text.count(". ") == 2
    for one in answer.joints:
        assert one.held.by_noise <= one.held.with_error
    # The flatter the line, the less friction takes of the yaw, which rubs most.
    yaw = answer.joints[0]
    assert yaw.best_linear.half_power_hz < yaw.flatter[0.33].half_power_hz < yaw.flatter[0.1].half_power_hz
    hz = answer.joints[0].flatter[0.1].half_power_hz
    assert "with 0.1 times the slope" in text and f"{hz:.2f} Hz (shoulder yaw)" in text


def test_the_best_linear_gain_is_that_of_mean_periods():
    """A static gain with a cubic, which answers each sequence in its own way: the gain by Bussgang's integral."""
    rng = np.random.default_rng(3)
    records = []
    for k in range(400):
        period = rng.standard_normal(100)
        u = np.tile(period, 4)
        records.append(IOData(u, 0.5 * u + 0.1 * u**3 + 0.1 * rng.standard_normal(400), 0.02, name=str(k)))
    # E(u^4) / E(u^2) = 3 for normal u.
    assert best_linear_gain(records) == pytest.approx(0.5 + 0.1 * 3.0, rel=0.03)
    with pytest.raises(ScenarioError, match="two periods of its command or more expected"):
        best_linear_gain([records[0][:150]])


def test_few_records_show_no_more_than_the_binomial_limit(answer):
    seeds = len(answer.seeds)
    text = said(changed(answer, 1.0))[4]
    # The share of which that many successes in a row still have a chance of 5 %.
    assert "in 9 of 9 cases" in text and f"more than {100 * 0.05 ** (1 / seeds):.0f} % of such" in text
    assert "they differ" not in text
    first = changed(answer, 1.0).joints[0]
    level = first.best_linear.half_power_hz
    split = replace(first, levels={name: (np.nan, *[level] * (seeds - 1)) for name in first.levels})
    text = said(replace(answer, joints=(split, *changed(answer, 1.0).joints[1:])))[4]
    assert "in 6 of 9 cases" in text and f"in the other 3 some agree, and {seeds} records cannot tell" in text


def test_what_the_truth_leaves_open_counts_as_agreement(answer):
    one = next(one for one in answer.joints if np.isfinite(one.best_linear_range).all())
    low, high = one.best_linear_range
    assert low < one.best_linear.half_power_hz < high
    assert replace(one, levels={"oe": (low + 0.01 * (high - low),)}).agrees("oe")
    assert not replace(one, levels={"oe": (min(low, 0.89 * one.best_linear.half_power_hz) - 1e-3,)}).agrees("oe")


def test_a_method_without_a_crossing_on_most_seeds_has_no_frequency(answer):
    one = replace(answer.joints[0], levels={"oe": (1.0, np.nan, np.nan)})
    assert np.isnan(one.recovered_hz("oe")) and not one.agrees("oe")
    assert replace(one, levels={"oe": (1.0, 1.2, np.nan)}).recovered_hz("oe") == pytest.approx(1.1)


def test_numbers_of_the_answer_are_in_the_record(answer):
    levels = answer.record()["half_power_hz"]
    assert {len(entry["okid"]) for entry in levels.values()} == {len(answer.seeds)}
    assert levels["elbow_pitch"]["best_linear"] == answer.joints[2].best_linear.half_power_hz
