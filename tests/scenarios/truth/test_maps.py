import csv
import io
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import (
    JOINTS,
    NOMINAL_PLANT,
    PAYLOADS,
    STUDIED_JOINTS,
    Plant,
    Specimen,
    linearize,
    load_arm,
)
from hmtb_twin.parameters.variants import MOTIONS, OPERATING_POSE, POSES
from scenarios.experiments.multisines import Multisines
from scenarios.truth.map_figures import map_figures, write_maps
from scenarios.truth.map_findings import findings, turns_within
from scenarios.truth.map_table import COLUMNS, MOVING, M, linear_row, stacked, table_row
from scenarios.truth.maps import PLANE, REACH, Density, conditions, maps
from tests.refusals import refused

HERE = np.array(POSES[OPERATING_POSE])
STRETCHED = np.radians([0.0, 10.0, -60.0, 10.0, 20.0, 30.0, 40.0])
COARSE = Density(plane=(3, 4), cut=3, sample=12, condition=3, amplitudes=())
SHORT = Multisines(realisations=2, period=5.12, f_min=0.15)


def large_signal(varied, value, hz):
    """A row of best linear approximations, the same for all studied joints."""
    columns = {name: np.full(M, np.nan) for name in ("bandwidth", "gain", "stick_bandwidth", "distortion", "slewing")}
    for name, number in zip(columns, (hz, 0.5, hz, 12.0, 0.25), strict=True):
        columns[name][[MOVING.index(joint) for joint in STUDIED_JOINTS]] = number
    interval = np.array([0.9, 1.1]) * columns["bandwidth"][:, None]
    return table_row(varied, value, HERE, True, interval=interval, **columns)


def changed(found, varied, **columns):
    """The same maps with other columns where something varies."""
    others = found.table.rows(*set(found.table.varied.tolist()) - {varied})
    return replace(found, table=stacked([others, replace(found.table.rows(varied), **columns)]))


@pytest.fixture(scope="module")
def small():
    return maps(load_arm(), OPERATING_POSE, COARSE)


@pytest.fixture(scope="module")
def found(small):
    """Coarse maps with large signals made up: measuring them is another test's business."""
    rows = [large_signal("amplitude", a, hz) for a, hz in ((1e-3, 0.3), (1e-2, 1.0), (0.1, 1.05))]
    rows += [large_signal("friction", level, hz) for level, hz in ((0.0, 1.03), (8.0, np.nan))]
    return replace(small, table=stacked([small.table, *rows]))


@pytest.mark.parametrize("pose", [HERE, STRETCHED], ids=["operating pose", "stretched"])
def test_a_row_is_the_truth_of_its_pose(pose):
    row, truth = linear_row("near", 0.0, load_arm(), pose), linearize(load_arm(), pose, amplitudes=())
    for column, name in enumerate(MOVING):
        entry = truth.joint(name)
        assert row.of(name)[0] == pytest.approx(entry.bandwidth_hz, rel=1e-7)
        assert row.gain[0, column] == pytest.approx(entry.dc_gain, abs=1e-7)
        poles = entry.dominant_poles
        slow = poles[np.abs(poles) < 62.8]
        assert row.damping[0, column] == pytest.approx(min((-slow.real / np.abs(slow)).tolist()), abs=1e-4)
    assert row.stable.all()
    # The oil swings beside the slow poles, wherever the arm stands.
    assert 0.4 < row.damping[0, : len(STUDIED_JOINTS)].min() < 1.0
    response = np.abs(truth.model.frequency_response(np.linspace(0.0, 5.0, 501)))[:, COLUMNS[:, None], COLUMNS]
    largest = response.max(axis=0) / np.diagonal(response[0])[:, None]
    off = ~np.eye(M, dtype=bool)
    # The table looks at fewer frequencies, so it may miss a little of a peak.
    assert row.cross[0][off] == pytest.approx(largest[off], rel=0.02, abs=1e-6)
    assert (np.diagonal(row.cross[0]) == 0.0).all()
    i = MOVING.index("shoulder_pitch")
    g = truth.model.frequency_response([row.bandwidth[0, i]])[0][COLUMNS[:, None], COLUMNS]
    # Commands that move this joint by one and no other.
    commands = np.linalg.solve(g, np.eye(M)[i])
    assert row.relative_gain[0, i] == pytest.approx(g[i, i] * commands[i])
    assert row.interaction[0, i] == pytest.approx(abs(g[i, i] * commands[i] - 1.0))


def test_an_arm_that_cannot_hold_itself_has_no_bandwidth():
    weak = load_arm(plant=replace(NOMINAL_PLANT, supply_pressure=5.0))
    refused(r"at 5 MPa the drives cannot hold", linearize, weak, amplitudes=())
    hanging = np.radians([0.0, 0.0, -89.0, 1.0, 0.0, 0.0, 0.0])
    rows = stacked([linear_row("near", 0.0, weak, HERE), linear_row("near", 0.0, weak, hanging)])
    assert rows.stable.tolist() == rows.held.tolist() == [False, True]
    assert np.array_equal(rows.angles, [HERE, hanging])
    for name in ("bandwidth", "gain", "damping", "cross", "relative_gain"):
        assert np.isnan(vars(rows)[name][0]).all()
        assert np.isfinite(vars(rows)[name][1]).all()
    with pytest.raises(ValueError, match="read-only"):
        rows.bandwidth[0, 0] = 1.0
    refused("expected a name or 7 finite", linear_row, "near", 0.0, weak, np.full(7, np.nan))


@pytest.mark.slow
def test_workspace_varies_shoulder_and_elbow_pitch_alone(small):
    rows = small.table.rows("workspace")
    angles = rows.angles.reshape(3, 4, 7)
    first, second = (JOINTS.index(name) for name in PLANE)
    assert (np.ptp(angles[:, :, first], axis=1) == 0.0).all()
    assert (np.ptp(angles[:, :, second], axis=0) == 0.0).all()
    assert np.degrees(angles[0, 0, first]) == pytest.approx(-89.0)
    assert (angles[..., [k for k in range(7) if k not in (first, second)]] == np.delete(HERE, [first, second])).all()
    one = linearize(load_arm(), angles[2, 1], amplitudes=()).joint("shoulder_pitch").bandwidth_hz
    assert rows.of("shoulder_pitch")[2 * 4 + 1] == pytest.approx(one, rel=1e-7)


@pytest.mark.slow
def test_turning_about_the_vertical_changes_nothing(small):
    # But for the pin of the shoulder roll, which gives a little when the arm pulls sideways.
    assert np.abs(small.change(small.table.rows("shoulder_yaw"))).max() < 1e-3
    assert np.abs(small.change(small.table.rows("elbow_pitch"))).max() > 0.05
    assert turns_within(small, "shoulder_yaw") == (np.inf, np.inf)


@pytest.mark.slow
def test_the_range_of_a_joint_is_interpolated_between_poses(small):
    start = np.degrees(HERE[JOINTS.index("elbow_pitch")])
    factor = 1.0 + np.array([0.16, 0.04, 0.0, 0.0, 0.05, 0.25])
    turns = np.array([-20.0, -10.0, 0.0, 10.0, 20.0, 30.0])
    rows = [
        table_row("elbow_pitch", start + turn, HERE, True, bandwidth=small.here.bandwidth[0] * by)
        for turn, by in zip(turns, factor, strict=True)
    ]
    others = small.table.rows("operating pose")
    assert turns_within(replace(small, table=stacked([others, *rows])), "elbow_pitch") == pytest.approx((15.0, 22.5))
    # A pose without a bandwidth ends the range at the pose before it.
    rows[4] = table_row("elbow_pitch", start + 20.0, HERE, False)
    assert turns_within(replace(small, table=stacked([others, *rows])), "elbow_pitch")[1] == pytest.approx(10.0)


@pytest.mark.slow
def test_random_poses_stay_in_range_and_repeat(small):
    low, high = np.array([(MOTIONS[name].lower, MOTIONS[name].upper) for name in MOVING]).T
    near, anywhere = small.table.rows("near"), small.table.rows("anywhere")
    for rows in (near, anywhere):
        turns = rows.angles[:, COLUMNS]
        assert ((turns > low) & (turns < high)).all()
        distance = np.degrees(np.abs(turns - HERE[COLUMNS]).max(axis=1))
        assert rows.value.astype(float) == pytest.approx(distance)
        assert (rows.angles[:, 0] == HERE[0]).all()
    assert near.value.astype(float) == pytest.approx(np.linspace(5.0, np.degrees(REACH), 12))
    again, other = (maps(load_arm(), OPERATING_POSE, replace(COARSE, sample=3), seed=seed) for seed in (0, 1))
    assert np.array_equal(again.table.rows("anywhere").angles, anywhere.angles[:3])
    assert not np.array_equal(other.table.rows("anywhere").angles, anywhere.angles[:3])


@pytest.mark.slow
def test_every_condition_is_varied_alone(small):
    loads, pressures, oil = (small.table.rows(name) for name in ("payload", "supply pressure", "oil temperature"))
    assert set(loads.value) == set(PAYLOADS)
    assert loads.value[0] == "none"
    bare = linearize(load_arm(payload="none"), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert loads.of("elbow_pitch")[0] == pytest.approx(bare, rel=1e-7)
    assert pressures.value.tolist() == [5.0, 20.0, 35.0]
    assert np.isnan(pressures.bandwidth[0]).all(), "at 5 MPa the drives cannot hold the arm"
    assert np.isfinite(pressures.bandwidth[1:]).all()
    # Thick oil drags most where drive and inertia are small; a flow servo feels little of it.
    roll = oil.of("wrist_roll")
    assert (np.diff(roll) > 0.0).all()
    assert 0.9 < roll[0] / roll[-1] < 0.97


def test_servo_valves_have_the_same_gap_at_low_pressure_and_electric_drives_no_oil():
    assert {point[0] for point in conditions(load_arm("flight"), HERE, 3)} == {"payload"}
    points = conditions(load_arm(plant=Plant(actuator="orifice")), HERE, 3)
    pressures = stacked(linear_row(*point) for point in points if point[0] == "supply pressure" and point[1] < 30.0)
    assert pressures.stable.tolist() == [False, True]
    assert np.isnan(pressures.bandwidth[0]).all()
    assert np.isfinite(pressures.bandwidth[1]).all()


@pytest.mark.slow
def test_a_specimen_stays_itself_under_all_conditions():
    arm = load_arm(specimen=Specimen(mass=(1.1,) * 8, payload_mass=1.3))
    table = stacked(linear_row(*point) for point in conditions(arm, HERE, 3))

    def elbow(**others):
        other = load_arm(specimen=arm.specimen, **others)
        return linearize(other, amplitudes=()).joint("elbow_pitch").bandwidth_hz

    assert table.rows("payload").of("elbow_pitch")[0] == pytest.approx(elbow(payload="none"), rel=1e-7)
    strong = elbow(plant=Plant(supply_pressure=35.0))
    assert table.rows("supply pressure").of("elbow_pitch")[-1] == pytest.approx(strong, rel=1e-7)


def measured(arm, **density):
    steps = []

    @contextmanager
    def stage(label):
        yield lambda done, total: steps.append((done, total))

    whole = replace(COARSE, plane=(3, 3), sample=3, measurement=SHORT, **density)
    return maps(arm, OPERATING_POSE, whole, stage=stage).table, steps


@pytest.mark.thorough
def test_without_dry_friction_the_arm_is_linear_up_to_its_velocity_limit():
    arm = load_arm(plant=replace(NOMINAL_PLANT, friction="viscous"))
    table, steps = measured(arm, amplitudes=(2e-3, 0.1))
    assert not len(table.rows("friction"))
    rows, truth = table.rows("amplitude"), linearize(arm, amplitudes=())
    for joint in STUDIED_JOINTS:
        true = truth.joint(joint).bandwidth_hz
        # The lines are 0.2 Hz apart, and neighbours answer between them: see `response_bandwidth`.
        assert rows.of(joint)[0] == pytest.approx(true, rel=6e-3)
        assert rows.of(joint, "gain")[0] == pytest.approx(1.0, abs=2e-3)
        assert rows.of(joint, "distortion")[0] < 0.1
        assert rows.of(joint, "slewing")[0] == 0.0
        # The limit comes before what the record holds: the servo stays linear, the way from the stick does not.
        assert rows.of(joint)[1] == pytest.approx(true, rel=0.02)
        assert rows.of(joint, "stick_bandwidth")[1] < 0.8 * true
        assert rows.of(joint, "slewing")[1] > 0.5
    assert steps[-1] == (2, 2)


@pytest.mark.thorough
def test_friction_ends_linearity_at_small_amplitudes_and_high_levels():
    table, _ = measured(load_arm(), amplitudes=(3e-4, 3e-2), levels=(0.0, 20.0))
    amplitudes, levels, truth = table.rows("amplitude"), table.rows("friction"), linearize(load_arm(), amplitudes=())
    assert levels.value.tolist() == [0.0, 20.0]
    for joint in STUDIED_JOINTS:
        true = truth.joint(joint).bandwidth_hz
        stuck, free = amplitudes.of(joint, "gain")
        assert stuck < 0.9 < free
        assert amplitudes.of(joint)[1] == pytest.approx(true, rel=0.15)
        assert levels.of(joint)[0] == pytest.approx(true, rel=6e-3)
        none, much = levels.of(joint, "distortion")
        assert none < 0.1
        assert much > 5.0


@pytest.mark.slow
def test_sentences_hold_computed_numbers(small, found):
    assert "amplitude" not in map_figures(small)
    assert len(findings(small)) == 5 + 3
    texts = findings(found)
    text = "\n".join(texts)
    assert "nan" not in text
    assert len(texts) == 5 + 3 + 2
    lowest = float(found.table.rows("workspace", "anywhere").damping[:, :3].min())
    assert f"damping ratios go down to {lowest:.2f}" in text or "stay real" in text
    assert "At 5 MPa the drives cannot hold the arm." in text
    assert "shoulder yaw from 0.01 to 0.1 rad" in text
    assert "1.03 Hz (0.93 to 1.13) at 0, not visible at 8" in text
    assert f"of its {found.here.of('shoulder_yaw')[0]:.3f} Hz" in text
    assert "of all joints the wrist yaw's changes most" in next(one for one in texts if one.startswith("Payload"))
    still = changed(found, "near", bandwidth=np.repeat(found.here.bandwidth, 12, 0))
    assert "no studied bandwidth differs by more than 10 %" in findings(still)[0]


def test_what_is_unstable_is_not_called_too_heavy(found):
    pressures = found.table.rows("supply pressure")
    bandwidth = pressures.bandwidth.copy()
    bandwidth[2] = np.nan
    unstable = changed(found, "supply pressure", stable=pressures.stable & [True, True, False], bandwidth=bandwidth)
    text = "\n".join(findings(unstable))
    assert "At 5 MPa the drives cannot hold the arm. At 35 MPa the arm is unstable." in text


@pytest.mark.thorough
def test_poses_that_the_drives_cannot_hold_are_gaps():
    found = maps(load_arm(plant=Plant(supply_pressure=6.0)), OPERATING_POSE, COARSE)
    poses = found.table.rows("operating pose", "workspace", "near", "anywhere", *MOVING)
    text = "\n".join(findings(found))
    heavy, count = int((~poses.held).sum()), len(poses)
    assert 0 < heavy < count
    assert f"At {heavy} of all {count} poses ({100 * heavy / count:.1f} %) the drives cannot hold the arm" in text
    assert "at the others the arm is stable" in text
    lost = 100 * np.mean(~found.table.rows("anywhere").held)
    assert f"; at {lost:.1f} % of poses the drives cannot hold the arm." in text
    assert "nan" not in text
    for figure in map_figures(found).values():
        figure.draw_without_rendering()


@pytest.mark.slow
def test_page_and_table_are_complete(found, tmp_path):
    files = write_maps(found, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in files}
    page = files[0].read_text(encoding="utf-8")
    assert page.count("<svg") == sum(path.suffix == ".svg" for path in files) == 6
    assert page.count("<li>") == len(findings(found))
    assert "<script" not in page
    assert 'src="' not in page
    rows = list(csv.DictReader(io.StringIO((tmp_path / "maps.csv").read_text(encoding="utf-8"))))
    assert len(rows) == M * len(found.table) == M * (1 + 12 + 18 + 24 + len(PAYLOADS) + 6 + 5)
    yaw = [row for row in rows if row["joint"] == "shoulder_yaw"]
    weak = next(row for row in yaw if row["varied"] == "supply pressure")
    assert (weak["value"], weak["unit"], weak["stable"], weak["bandwidth_hz"]) == ("5", "MPa", "0", "")
    elbow = next(row for row in rows if row["varied"] == "workspace" and row["joint"] == "elbow_pitch")
    assert float(elbow["shoulder_pitch_deg"]) == pytest.approx(-89.0)
    assert float(elbow["bandwidth_hz"]) == pytest.approx(found.table.rows("workspace").of("elbow_pitch")[0], rel=1e-5)


def test_density():
    fine, rough = Density.scaled(4.0), Density.scaled(0.1)
    assert fine.plane == (38, 32)
    assert fine.sample == 4 * Density().sample
    assert len(rough.amplitudes) < len(fine.amplitudes)
    refused(r"density of the maps: 0.01 given, expected 0.05 to 20", Density.scaled, 0.01)
    refused(r"cut = 2 given", Density, cut=2)


def test_poses_that_have_no_maps_are_refused():
    refused("expected its name, given angles", maps, load_arm(), np.zeros(7))
    stopped = HERE.copy()
    stopped[JOINTS.index("elbow_pitch")] = np.radians(0.5)
    refused("end of a joint's range", maps, load_arm(), stopped, COARSE)
