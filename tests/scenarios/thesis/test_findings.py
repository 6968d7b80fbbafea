"""Verdicts follow from numbers."""

from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import scenarios.thesis.findings
from scenarios.thesis.finding import CLAIMS, Verdict, decided_finding, finding_by_reading
from scenarios.thesis.findings import FINDINGS, findings
from scenarios.thesis.results import results
from scenarios.truth.published import EQUATIONS
from sysid import FrequencyResponse, StateSpace, SysidError
from sysid.models.bandwidth import gain_crossing, half_power_hz
from tests.scenarios.thesis.altered import without_log


@pytest.fixture(autouse=True)
def so(monkeypatch, request):
    """Without a study every reason is "so", and every cause a field."""
    if "study" not in request.fixturenames:
        short = {key: replace(claim, why="so", cause="{tried}") for key, claim in CLAIMS.items()}
        monkeypatch.setattr("scenarios.thesis.finding.CLAIMS", short)


def decided(key, *holds):
    return read_one_way(key, {f"part {number}": one for number, one in enumerate(holds)})


def read_one_way(key, parts, tried=""):
    return decided_finding(key, parts, {"a": 1.0, "b": np.nan}, {"tried": tried})


def test_verdict_follows_from_the_parts_and_names_those_that_differ():
    assert [decided("F9", *holds).verdict for holds in ((True, True), (True, False), (False, False))] == [
        "reproduced",
        "partly",
        "not reproduced",
    ]
    assert "Partly (holds: part 0; fails: part 1). So" in decided("F9", True, False).why
    joints = {"white on shoulder yaw": True, "white on elbow pitch": True, "small": False}
    assert "(holds: white on shoulder yaw and elbow pitch; fails: small)" in read_one_way("F9", joints).why


def test_a_success_of_what_was_put_in_is_one_by_construction():
    assert {key for key, claim in CLAIMS.items() if claim.by_construction} >= {"F1", "F13", "F14", "F17", "F24"}
    for key, claim in CLAIMS.items():
        success, failure = decided(key, True), decided(key, False)
        whole = claim.by_construction and not claim.constructed
        assert success.verdict == ("reproduced by construction" if whole else "reproduced")
        assert (claim.by_construction in success.why) == bool(whole) or not claim.by_construction
        assert failure.verdict == "not reproduced"


def test_parts_that_hold_by_construction_do_not_count():
    """F51's construction is of the parts "with p = 5", on any joint."""
    built, tested = "with p = 5 on elbow_pitch", "with p = 50 on elbow_pitch"
    success, failure = (read_one_way("F51", {built: True, tested: holds}) for holds in (True, False))
    assert success.verdict == "reproduced"
    assert failure.verdict == "not reproduced", "the part by construction is no half of a success"
    for entry in (success, failure):
        assert "By construction, and not counted: with p = 5 on elbow pitch, because p = 5 cuts" in entry.why
        assert entry.parts["with p = 5 on elbow pitch (by construction)"]
    alone = read_one_way("F51", {built: True})
    assert alone.verdict == "reproduced by construction", "nothing else was tested"
    surprise = read_one_way("F51", {built: False, tested: True})
    assert surprise.verdict == "partly", "what was to hold by construction and fails is a result"
    assert surprise.parts == {"with p = 5 on elbow pitch": False, "with p = 50 on elbow pitch": True}


def test_names_of_constructed_parts_are_those_of_the_findings(study):
    for entry in findings(study):
        for name in entry.about.constructed:
            assert any(part.startswith(name) for part in entry.parts), (
                entry.key,
                name,
            )


def test_readings_that_differ_make_the_verdict_depend_on_them():
    def read(one, other):
        return finding_by_reading("F9", {"one way": one, "another way": other}, {}, {"tried": ""})

    both = read({"a": True}, {"a": False})
    assert both.verdict == "depends on the reading"
    assert both.why.startswith("Reproduced one way; not reproduced another way. So")
    assert both.parts == {"a one way": True, "a another way": False}
    assert read({"a": True}, {"a": True}).verdict == "reproduced"
    assert read({"a": True, "b": False}, {"a": False, "b": True}).verdict == "partly"


def test_a_cause_rests_on_an_experiment_or_was_not_tried():
    assert decided("F9", False).why == "So. Cause: not tried"
    tried = read_one_way("F9", {"a": False}, "without friction it holds")
    assert tried.why == "So. Cause: without friction it holds"
    assert tried.value == {"a": 1.0}, "a number that is none is left out"


def test_several_numbers_are_listed_or_a_range(monkeypatch):
    claim = replace(CLAIMS["F9"], why="{few:.1f}, from {few:to.0f}, {one:to.0f}, {none:g}", cause="")
    monkeypatch.setattr("scenarios.thesis.finding.CLAIMS", {"F9": claim})
    facts = {"few": [-1.25, 3.0], "one": (2.0, 2.2), "none": np.nan}
    assert decided_finding("F9", {"a": True}, {}, facts).why == "−1.2, 3.0, from −1 to 3, 2, nothing"


def test_every_criterion_has_a_date_and_a_history():
    assert list(CLAIMS) == [f"F{number}" for number in range(1, len(CLAIMS) + 1)] == list(FINDINGS)
    for claim in CLAIMS.values():
        assert type(claim.date) is date, claim.key
        assert claim.criterion and "{" not in claim.criterion
        days = [claim.date, *(change.date for change in claim.changes)]
        assert days == sorted(days)
        assert all(change.what and change.why for change in claim.changes)
    changed = {key for key, claim in CLAIMS.items() if claim.changed_after_results}
    assert changed >= {"F1", "F2", "F7", "F12", "F18", "F21", "F22", "F24", "F26"}
    later = [claim for claim in CLAIMS.values() if int(claim.key[1:]) > 26]
    assert {claim.date for claim in later} == {date(2026, 11, 30)}
    assert all(claim.by_construction for claim in CLAIMS.values() if claim.constructed)


def test_every_finding_has_a_verdict_a_number_and_a_reason(study):
    for entry in findings(study):
        assert entry.verdict in get_args(Verdict)
        assert np.isfinite(list(entry.value.values())).all(), entry
        assert entry.why
        assert entry.about.thesis and entry.about.unit and "{" not in entry.why
        assert (entry.verdict == "cannot be told") == (not entry.parts)
        told = entry.verdict in ("reproduced", "reproduced by construction", "cannot be told")
        assert ("Cause: " in entry.why) != told, "what holds needs no cause"


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


def test_all_findings_are_there_and_one_without_its_record_says_so(study):
    assert [entry.key for entry in findings(study)] == list(CLAIMS)
    poor = without_log(study, "siso-7-elbow_pitch", "the physics diverged")
    by_name = {entry.key: entry for entry in findings(poor)}
    assert by_name["F5"].verdict == "cannot be told"
    assert "siso-7-elbow_pitch: the physics diverged" in by_name["F5"].why
    assert by_name["F6"].verdict != "cannot be told"


def test_half_power_does_not_depend_on_the_gain_at_0_hz():
    assert EQUATIONS["4.8"].bandwidth_hz == pytest.approx(0.470, abs=1e-3)
    assert half_power_hz(EQUATIONS["4.8"].model) == pytest.approx(0.9365, abs=1e-3)
    one_pole = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02)
    assert half_power_hz(one_pole) == pytest.approx(one_pole.bandwidth()[0, 0], rel=1e-5)
    assert np.isnan(half_power_hz(StateSpace([[0.9]], [[0.05]], [[1.0]], [[0.0]], None, 0.02)))
