"""All maps together: what they say, their figures, tables and page."""

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS, Plant, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.files.errors import ScenarioError
from scenarios.truth.amplitude_maps import LEVEL_AMPLITUDE, LargeSignal, LargeSignals
from scenarios.truth.map_figures import map_figures
from scenarios.truth.map_findings import findings, linear_range
from scenarios.truth.map_page import write_maps
from scenarios.truth.map_tables import map_tables
from scenarios.truth.maps import Density, Maps, maps

COARSE = Density(plane=(3, 3), cut=3, sample=12, condition=3, amplitudes=())


def point(joint: str, amplitude: float, level: float, hz: float) -> LargeSignal:
    return LargeSignal(joint, amplitude, level, hz, (0.9 * hz, 1.1 * hz), hz, 0.5, 12.0, 0.25)


@pytest.fixture(scope="module")
def found() -> Maps:
    """Coarse maps, with large signals made up: measuring them is another test's business."""
    made = maps(load_arm(), OPERATING_POSE, COARSE)
    over_amplitude = [point(j, a, 1.0, hz) for j in STUDIED_JOINTS for a, hz in ((1e-3, 0.3), (1e-2, 1.0), (0.1, 1.05))]
    over_level = [
        point(j, LEVEL_AMPLITUDE, level, hz) for j in STUDIED_JOINTS for level, hz in ((0.0, 1.03), (8.0, np.nan))
    ]
    return replace(made, large=LargeSignals(tuple(over_amplitude), tuple(over_level)))


def test_sentences_hold_computed_numbers(found: Maps) -> None:
    said = findings(found)
    text = "\n".join(said)
    assert "nan" not in text
    assert len(said) == 5 + len(found.conditions) + 2
    lowest = min(float(part.damping[:, :3].min()) for part in (found.plane.dynamics, found.anywhere.dynamics))
    assert f"damping ratios go down to {lowest:.2f}" in text or "stay real" in text
    assert "At 7 MPa the drives cannot hold the arm." in text
    assert "shoulder yaw from 0.01 to 0.1 rad" in text
    assert "1.03 Hz (0.93 to 1.13) at 0, no bandwidth that shows at 8" in text
    hz = float(found.here.of("shoulder_yaw")[0])
    assert f"of its {hz:.3f} Hz" in text


def test_a_joint_that_is_not_studied_is_told_apart(found: Maps) -> None:
    (payload,) = (text for text in findings(found) if text.startswith("Payload"))
    assert "; of the other joints the wrist yaw's changes most" in payload


def test_sentences_tell_a_quiet_neighbourhood(found: Maps) -> None:
    still = replace(found.near, dynamics=replace(found.near.dynamics, bandwidth=np.repeat(found.here.bandwidth, 12, 0)))
    assert "no studied bandwidth differs by more than 10 %" in findings(replace(found, near=still))[0]


def test_poses_that_the_drives_cannot_hold_are_gaps(tmp_path: Path) -> None:
    weak = load_arm(plant=Plant(supply_pressure=9.0))
    found = maps(weak, OPERATING_POSE, COARSE)
    assert not found.plane.dynamics.stable.all()
    assert found.anywhere.dynamics.stable.any()
    text = "\n".join(findings(found))
    parts = [found.here, found.plane.dynamics, found.anywhere.dynamics, found.near.dynamics]
    parts += [cut.dynamics for cut in found.cuts]
    heavy, count = sum(int((~part.held).sum()) for part in parts), sum(map(len, parts))
    assert f"At {heavy} of all {count} poses ({100 * heavy / count:.1f} %) the drives cannot hold the arm" in text
    assert "at the others the arm is stable" in text
    lost = 100 * np.mean(~found.anywhere.dynamics.held)
    assert f"; at {lost:.1f} % of poses the drives cannot hold the arm." in text
    assert np.isnan(found.plane.dynamics.bandwidth[~found.plane.dynamics.held]).all()
    assert "nan" not in text
    assert write_maps(found, tmp_path)


def test_what_is_unstable_is_not_called_too_heavy(found: Maps) -> None:
    _, pressures, _ = found.conditions
    stable = pressures.dynamics.stable & [True, True, False]
    unstable = replace(pressures, dynamics=replace(pressures.dynamics, stable=stable))
    text = "\n".join(findings(replace(found, conditions=(unstable,))))
    assert "At 7 MPa the drives cannot hold the arm. At 35 MPa a joint has no stable bandwidth." in text


def test_linear_range_is_the_longest_run() -> None:
    points = [point("elbow_pitch", a, 1.0, hz) for a, hz in ((1e-3, 1.0), (2e-3, 0.5), (3e-3, 0.95), (4e-3, 1.0))]
    assert linear_range(points, 1.0) == (3e-3, 4e-3)
    assert linear_range([point("elbow_pitch", 1e-3, 1.0, np.nan)], 1.0) is None


def test_one_amplitude_is_no_range(found: Maps) -> None:
    assert found.large is not None
    only = tuple(one for one in found.large.over_amplitude if one.amplitude != 1e-2)
    text = "\n".join(findings(replace(found, large=replace(found.large, over_amplitude=only))))
    assert "elbow pitch at 0.1 rad alone" in text


def test_tables_are_complete(found: Maps) -> None:
    tables = {name: list(csv.DictReader(io.StringIO(text))) for name, text in map_tables(found).items()}
    assert {name: len(rows) for name, rows in tables.items()} == {
        "workspace": 9,
        "cuts": 18,
        "random": 24,
        "coupling": 30,
        "conditions": len(found.conditions[0].values) + 6,
        "amplitude": 15,
    }
    first = tables["workspace"][0]
    assert float(first["shoulder_pitch_deg"]) == pytest.approx(-89.0)
    assert float(first["elbow_pitch_bandwidth_hz"]) == pytest.approx(
        found.plane.dynamics.of("elbow_pitch")[0], rel=1e-5
    )
    weak = next(row for row in tables["conditions"] if row["condition"] == "supply pressure")
    assert weak["shoulder_yaw_bandwidth_hz"] == ""


def test_page_needs_nothing_else(found: Maps, tmp_path: Path) -> None:
    files = write_maps(found, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in files}
    page = files[0].read_text(encoding="utf-8")
    assert page.count("<svg") == len(map_figures(found)) == 6
    assert page.count("<li>") == len(findings(found))
    assert "<script" not in page
    assert 'src="' not in page


def test_without_large_signals_their_figure_is_left_out(found: Maps) -> None:
    bare = replace(found, large=None)
    assert "amplitude" not in map_figures(bare)
    assert "amplitude" not in map_tables(bare)
    assert len(findings(bare)) == 5 + len(found.conditions)


def test_density() -> None:
    fine, rough = Density.scaled(4.0), Density.scaled(0.1)
    assert fine.plane == (38, 32)
    assert fine.sample == 4 * Density().sample
    assert len(rough.amplitudes) < len(fine.amplitudes)
    with pytest.raises(ScenarioError, match=r"density of the maps: 0.01 given, expected 0.05 to 20"):
        Density.scaled(0.01)
    with pytest.raises(ScenarioError, match=r"cut = 2 given"):
        Density(cut=2)


def test_large_signals_need_a_named_pose() -> None:
    with pytest.raises(ScenarioError, match="expected its name, given angles"):
        maps(load_arm(), np.zeros(7))
