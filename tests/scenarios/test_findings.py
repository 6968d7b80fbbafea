"""Verdicts follow from numbers."""

import numpy as np
import pytest

from scenarios.comparison import Comparison
from scenarios.finding import verdict
from scenarios.findings import findings
from scenarios.findings_data import apparent_delay, crossing
from scenarios.results import answer, results, stands
from sysid import FrequencyResponse, IOData, simulate

VERDICTS = {"reproduced", "partly", "not reproduced", "cannot be told"}


def test_verdict_counts_parts() -> None:
    assert [verdict(passed, 3) for passed in range(4)] == ["not reproduced", "partly", "partly", "reproduced"]


def test_every_finding_has_a_verdict_a_number_and_a_reason(study: Comparison) -> None:
    found = findings(study)
    keys = [entry.key for entry in found]
    assert keys == sorted(set(keys), key=lambda key: int(key[1:]))
    assert {"F1", "F3", "F7", "F11", "F12", "F13", "F14", "F16", "F22", "F24", "F26"} <= set(keys)
    for entry in found:
        values = entry.value.values() if not isinstance(entry.value, float) else [entry.value]
        assert entry.verdict in VERDICTS
        assert np.isfinite(list(values)).all(), entry
        assert entry.why
        assert entry.thesis
        assert entry.unit


def test_what_the_twin_is_known_to_do(study: Comparison) -> None:
    found = {entry.key: entry for entry in findings(study)}
    assert found["F3"].value == {name: float(entry.truth.delay_samples) for name, entry in study.joints.items()}, (
        "the delay seen in the data is the true one"
    )
    assert found["F13"].verdict == "reproduced"
    assert found["F7"].verdict == "not reproduced", "friction exceeds resolver noise on this arm"
    cutoff = found["F1"].value
    assert isinstance(cutoff, dict)
    for name, entry in study.joints.items():
        assert cutoff[name] == pytest.approx(2 * np.pi * entry.truth.bandwidth_hz, rel=0.15)


def test_crossing_interpolates_between_lines() -> None:
    f = np.arange(1, 50) * 0.5
    response = FrequencyResponse(f, (1.0 / f)[:, None, None].astype(complex), 0.02, "etfe")
    assert crossing(response, 0.8) == pytest.approx(1.25)
    assert np.isnan(crossing(response, 3.0))
    assert np.isnan(crossing(response, 1e-3))


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_apparent_delay(delay: int) -> None:
    from sysid import StateSpace

    A = np.eye(delay, k=1)
    A[0, 0] = 0.8
    A = np.zeros((delay, delay))
    A[0, 0] = 0.8
    A[1:, :-1] += np.eye(delay - 1)
    model = StateSpace(A, np.eye(delay, 1), np.eye(delay)[[-1]], np.zeros((1, 1)), None, 0.02)
    u = np.random.default_rng(1).standard_normal(2000)
    y = simulate(model, u)[:, 0] + 1e-3 * np.random.default_rng(2).standard_normal(2000)
    assert apparent_delay(IOData(u, y, 0.02)) == delay


def test_results_have_the_promised_keys(study: Comparison, tmp_path: object) -> None:
    from pathlib import Path

    record = results(study, findings(study), Path("report.html"))
    assert set(record) >= {"report", "bandwidth", "findings", "cost"}
    bandwidth = record["bandwidth"]
    assert isinstance(bandwidth, dict)
    yaw = bandwidth["shoulder_yaw"]
    assert set(yaw) == {"true_hz", "recovered", "published"}
    assert set(yaw["recovered"]["oe"]) == {"hz", "ci95", "covers"}
    assert yaw["published"]["OKID (5.8)"] == pytest.approx(0.13, abs=0.006)
    assert set(record["findings"]["F1"]) >= {"verdict", "value", "thesis", "why"}  # type: ignore[index]
    assert set(record["cost"]) >= {"physics_s", "total_s"}  # type: ignore[arg-type]


def test_answer_says_whether_1_hz_stands(study: Comparison) -> None:
    text = answer(study)
    assert ("stands on the twin" in text) == stands(study)
    assert "but not for the yaw joint" in text
