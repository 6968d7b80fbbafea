"""Verdicts follow from numbers."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import scenarios.thesis.findings
from scenarios.thesis.finding import CLAIMS, Verdict, verdict
from scenarios.thesis.findings import findings
from scenarios.thesis.outcome import numbers
from scenarios.thesis.results import answer, finding_stands, headline, results
from scenarios.thesis.tally import p_value
from scenarios.truth.published import EQUATIONS
from sysid import FrequencyResponse, StateSpace, SysidError
from sysid.models.bandwidth import gain_crossing, half_power_hz
from tests.scenarios.thesis.altered import without_log


def test_verdict_counts_parts():
    assert [verdict(passed, 3) for passed in range(4)] == ["not reproduced", "partly", "partly", "reproduced"]


def test_every_finding_has_a_verdict_a_number_and_a_reason(study):
    for entry in findings(study):
        assert entry.verdict in get_args(Verdict)
        assert np.isfinite(list(numbers(entry).values())).all(), entry
        assert entry.why
        assert entry.thesis
        assert entry.unit


def test_what_the_twin_is_known_to_do(study):
    by_name = {entry.key: entry for entry in findings(study)}
    assert by_name["F3"].value == {name: float(entry.truth.delay_samples) for name, entry in study.joints.items()}, (
        "the delay seen in the data is the true one"
    )
    assert by_name["F13"].verdict == "reproduced"
    ratio = numbers(by_name["F7"])
    for name in study.joints:
        assert ratio[f"{name}, all that is not linear"] < 1.0, "friction exceeds resolver noise on this arm"


def test_what_an_estimator_refuses_cannot_be_told_and_a_fault_stays_one(monkeypatch):
    def refused(study):
        raise SysidError("6 samples given, expected 20 or more")

    def broken(study):
        raise ZeroDivisionError

    monkeypatch.setattr(scenarios.thesis.findings, "FINDINGS", dict.fromkeys(CLAIMS, refused))
    outcome = findings(None)
    assert {entry.verdict for entry in outcome} == {"cannot be told"}
    assert outcome[0].why == "an estimator refuses its record: 6 samples given, expected 20 or more"
    monkeypatch.setattr(scenarios.thesis.findings, "FINDINGS", {"F1": broken})
    with pytest.raises(ZeroDivisionError):
        findings(None)


def test_crossing_interpolates_between_lines():
    f = np.arange(1, 50) * 0.5
    response = FrequencyResponse(f, (1.0 / f)[:, None, None].astype(complex), 0.02, "etfe")
    assert gain_crossing(response, 0.8) == pytest.approx(1.25)
    assert np.isnan(gain_crossing(response, 3.0))
    assert np.isnan(gain_crossing(response, 1e-3))


def test_results_have_the_promised_keys(study, tmp_path):
    record = results(study, findings(study), Path("report.html"))
    assert set(record) >= {"report", "bandwidth", "findings", "cost"}
    bandwidth = record["bandwidth"]
    yaw = bandwidth["shoulder_yaw"]
    assert set(yaw) >= {"true_hz", "recovered", "published"}
    assert set(yaw["recovered"]["oe"]) >= {"hz", "ci95", "covers"}
    assert yaw["published"]["OKID (5.8)"] == pytest.approx(0.13, abs=0.006)
    assert set(record["findings"]["F1"]) >= {"verdict", "value", "thesis", "why"}
    assert set(record["cost"]) >= {"physics_s", "total_s"}


def test_answer_says_whether_1_hz_stands(study):
    whole = replace(study, campaigns=(replace(study.campaign, duration=None), *study.campaigns[1:]))
    text = answer(whole)
    assert ("the finding stands on the twin" in text) == finding_stands(study)
    assert "the yaw models have bandwidths of 0.12 to 0.47 Hz, and only OE (4.8) reaches 0.707 at 0.94 Hz" in text
    held = sum(model.covers for entry in study.joints.values() for model in entry.models.values())
    assert f"{held} of 12 intervals at 95 % hold the small-signal truth" in text
    assert headline(whole).endswith(f"Interval holds the truth: {held} of 12")


def test_short_records_give_no_verdict_on_1_hz(study):
    assert study.duration == 24.0
    for text in (answer(study), headline(study)):
        assert "a look, not a result" in text
        assert "stands" not in text


def test_all_26_findings_are_there_and_one_without_its_record_says_so(study):
    assert [entry.key for entry in findings(study)] == [f"F{number}" for number in range(1, 27)]
    poor = without_log(study, "siso-7-elbow_pitch", "the physics diverged")
    by_name = {entry.key: entry for entry in findings(poor)}
    assert by_name["F5"].verdict == "cannot be told"
    assert "siso-7-elbow_pitch: the physics diverged" in by_name["F5"].why
    assert by_name["F6"].verdict != "cannot be told"


def test_findings_that_were_put_in_say_so(study):
    by_name = {entry.key: entry.why for entry in findings(study)}
    assert all("by construction" in by_name[key] for key in ("F1", "F3", "F22"))


def test_outliers_move_okid_more_than_the_prediction_error_models(study):
    value = {entry.key: numbers(entry) for entry in findings(study)}["F25"]
    assert value["outliers: OKID"] > 2 * value["outliers: SysID"]


def test_half_power_does_not_depend_on_the_gain_at_0_hz():
    assert EQUATIONS["4.8"].bandwidth_hz == pytest.approx(0.470, abs=1e-3)
    assert half_power_hz(EQUATIONS["4.8"].model) == pytest.approx(0.9365, abs=1e-3)
    one_pole = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02)
    assert half_power_hz(one_pole) == pytest.approx(one_pole.bandwidth()[0, 0], rel=1e-5)
    assert np.isnan(half_power_hz(StateSpace([[0.9]], [[0.05]], [[1.0]], [[0.0]], None, 0.02)))


def test_a_probability_that_underflows_is_not_printed_as_zero():
    assert p_value(0.0) == "p < 1e-300"
    assert p_value(0.0312) == "p = 0.031"
