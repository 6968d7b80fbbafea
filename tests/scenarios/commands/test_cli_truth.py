"""`hmtb truth`: every kind of truth, its figure, the maps, and one line for what is wrong."""

import functools
import re
from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import NOMINAL_PLANT, STUDIED_JOINTS, Plant, linearize, load_arm, simulate
from hmtb_twin.truth import linearization
from hmtb_twin.truth.linearization import small_signal_error
from scenarios import load
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.truth import truth_summary
from scenarios.truth.best_linear import best_linear, cautions, measured_best_linear
from scenarios.truth.map_figures import map_figures
from scenarios.truth.maps import Density
from scenarios.truth.truth_figure import truth_figure


@pytest.fixture(scope="module", autouse=True)
def errors_simulated_once():
    """The error of the same linear model at the same amplitude, which most commands here print."""
    known = {}

    def once(arm, model, angles, amplitude):
        key = arm, angles.tobytes(), amplitude
        if key not in known:
            known[key] = small_signal_error(arm, model, angles, amplitude)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(linearization, "small_signal_error", once)
        yield


@pytest.mark.slow
def test_table_tells_resonance_and_errors(printed):
    out = printed("truth")
    assert "hydraulic resonance" in out
    assert "Relative error of the linear model" in out
    (row,) = (line for line in out.splitlines() if line.startswith(" elbow_pitch"))
    assert "-4.9, -5.3±6.2j (ζ 0.65)" in row
    (row,) = (line for line in out.splitlines() if line.split()[:1] == ["shoulder_roll"])
    assert "locked" in row
    assert "zeros" in out


@pytest.mark.slow
def test_json_tells_all_of_the_small_signal_truth(result):
    output = result("truth")
    assert output["plant"] == vars(NOMINAL_PLANT)
    assert (output["variant"], output["payload"], output["dt"]) == ("nominal", "rpcm", 0.02)
    errors = {float(key): value for key, value in output["small_signal_error"].items()}
    assert sorted(errors.values()) == [errors[key] for key in sorted(errors)]
    joints = output["joints"]
    assert "wrist_roll" in joints
    assert joints["shoulder_roll"]["bandwidth_hz"] is None
    assert "locked" in joints["shoulder_roll"]["note"]
    assert all(entry["note"] is None for name, entry in joints.items() if name != "shoulder_roll")
    truth = linearize(load_arm(), amplitudes=())
    for name in STUDIED_JOINTS:
        entry, true = joints[name], truth.joint(name)
        assert set(entry) >= {"dc_gain", "poles", "zeros", "delay_samples"}
        assert 0.9 <= entry["bandwidth_hz"] <= 1.3
        assert all(len(pole) == 2 for pole in entry["poles"])
        assert entry["bandwidth_hz"] == pytest.approx(true.bandwidth_hz)
        assert [pole["re"] for pole in entry["dominant"]] == pytest.approx(true.dominant_poles.real)
        assert all(0.0 < pole["damping_ratio"] <= 1.0 for pole in entry["dominant"])
        oil, drive = entry["hydraulics"], load_arm().actuators[name]
        stiffness = 4 * 700 * drive.displacement**2 / drive.trapped_volume
        assert oil["resonance_hz"] == pytest.approx(np.sqrt(stiffness / oil["inertia_kgm2"]) / (2 * np.pi))
    assert "noise" not in output
    assert output["files"] == []


@pytest.mark.slow
def test_conditions_are_those_asked_for(result):
    output = result(
        "truth", "--oil-temperature", 5, "--supply-pressure", 15, "--friction-level", 2, "--payload", "none"
    )
    plant = Plant(oil_temperature=5.0, supply_pressure=15.0, friction_level=2.0)
    assert output["plant"] == vars(plant)
    true = linearize(load_arm(payload="none", plant=plant), amplitudes=()).joint("wrist_roll")
    assert output["joints"]["wrist_roll"]["bandwidth_hz"] == pytest.approx(true.bandwidth_hz)


@pytest.mark.slow
def test_process_noise_brings_the_noise_model(printed, result):
    output = result("truth", "--process-noise", 0.001)
    truth = linearize(load_arm(plant=Plant(process_noise=0.001)), amplitudes=())
    assert np.array(output["noise"]["K"]) == pytest.approx(truth.model.gain)
    assert output["joints"]["elbow_pitch"]["innovation_sd_rad"] == pytest.approx(
        float(np.sqrt(truth.joint("elbow_pitch").model.innovation_covariance[0, 0]))
    )
    assert "Standard deviation of each joint's innovations" in printed("truth", "--process-noise", 0.001)


@pytest.mark.slow
def test_pose_by_angles(printed, result):
    degrees = (0, 20, 50, 30, -50, 0, 0)
    output = result("truth", "--pose", ",".join(map(str, degrees)))
    true = linearize(load_arm(), np.radians(degrees), amplitudes=()).joint("shoulder_yaw")
    assert output["joints"]["shoulder_yaw"]["bandwidth_hz"] == pytest.approx(true.bandwidth_hz)
    assert output["angles_rad"] == pytest.approx(np.radians(degrees))
    assert "0,20,50,30,-50,0,0 deg" in printed("truth", "--pose", ",".join(map(str, degrees)))


@pytest.mark.slow
def test_electric_drives_have_no_oil(printed, result):
    out = printed("truth", "--variant", "flight")
    assert "hydraulic" not in out
    assert "oil" not in out
    assert "hydraulics" not in result("truth", "--variant", "flight")["joints"]["elbow_pitch"]


@pytest.mark.parametrize("columns", ["60", "100"])
def test_help_is_wrapped_and_its_examples_keep_their_lines(printed, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    out = printed("truth", "--help")
    prose = re.split(r"\n\W*options\b", out)[0]
    assert all(len(line) <= int(columns) for line in prose.splitlines())
    assert "\n\n\n" not in prose.rstrip("\n")
    for example in ("--out truth.svg", "--pose 0,20,50,30,-50,0,0 --oil-temperature 15", "--maps --out maps"):
        assert f"  hmtb truth {example}" in prose.splitlines()
    assert "need a pose by name" in " ".join(prose.split())
    monkeypatch.setenv("COLUMNS", "200")
    assert "or the seven joint angles in degrees, separated by commas." in printed("truth", "--help")


@pytest.mark.slow
def test_dry_friction_is_said_to_be_left_out(printed):
    assert "Dry friction is not in these numbers; see --bla" in printed("truth")
    assert "Dry friction" not in printed("truth", "--friction", "none")


@pytest.mark.slow
def test_cautions_tell_where_a_bandwidth_says_little():
    """While the bristles bend a joint is another one, between stick and slip no linear one; sliding it is fine."""
    arm = load_arm()
    truth = linearize(arm, amplitudes=())
    cautions_at = {}
    for rms in (4e-4, 3e-3, 3e-2):
        setting = MultisineExperiment("yaw", ("shoulder_yaw",))
        cautions_at[rms] = " ".join(cautions(best_linear(setting, Multisines(rms=rms, realisations=2)), truth))
    assert "% of a slow command" in cautions_at[4e-4]
    assert "distortion is" in cautions_at[3e-3]
    assert cautions_at[3e-2] == ""


@pytest.mark.slow
def test_title_tells_conditions_that_are_not_nominal():
    def title(**changes: object) -> str:
        arm = load_arm(plant=Plant(**changes))
        return truth_figure(truth_summary.truth_summary(arm, linearize(arm))).get_suptitle()

    assert title().endswith("nominal conditions")
    heading = title(servo="torque", oil_temperature=15.0, supply_pressure=18.0, friction_level=2.0, process_noise=0.001)
    for part in ("servo torque", "oil at 15 °C", "supply pressure 18 MPa", "friction 2 times", "process noise 0.001"):
        assert part.lower() in heading.lower()
    assert "nominal conditions" not in heading


@pytest.mark.slow
def test_measured_bandwidths_bear_their_intervals():
    arm = load_arm()
    approximation = best_linear(MultisineExperiment("elbow", ("elbow_pitch",)), Multisines(rms=0.02, realisations=2))
    summary = replace(truth_summary.truth_summary(arm, linearize(arm)), best_linear={"elbow_pitch": approximation})
    (bars,) = truth_figure(summary).axes[0].containers
    (segment,) = bars.lines[2][0].get_segments()
    low, high = (float(end[0, 0]) for end in approximation.bandwidth.ci95)
    assert segment[:, 0] == pytest.approx((low, high))


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_figure(printed, tmp_path, ending):
    path = tmp_path / "deep" / f"truth.{ending}"
    assert f"figure: {path}" in printed("truth", "--out", path)
    start = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[ending]
    assert path.read_bytes().startswith(start)


@pytest.mark.slow
def test_best_linear_columns(printed, result, monkeypatch, tmp_path):
    monkeypatch.setattr("scenarios.truth.best_linear.REALISATIONS", 2)
    # Measured once for both ways of printing.
    measure = functools.cache(measured_best_linear)
    once = "scenarios.truth.best_linear.measured_best_linear"
    monkeypatch.setattr(once, lambda *values, progress, **rest: measure(*values, **rest))
    words = ("--bla", 0.02, "--out", tmp_path / "truth.png")
    output = result("truth", *words)["best_linear"]
    assert set(output) == set(STUDIED_JOINTS)
    for name, entry in output.items():
        low, high = entry["ci95"]
        assert low < entry["bandwidth_hz"] < high
        true = linearize(load_arm(), amplitudes=()).joint(name).bandwidth_hz
        assert 0.5 * true < entry["bandwidth_hz"] < true, "dry friction lowers it"
        assert entry["distortion_percent"] > 0.5
    out = printed("truth", *words, "--overwrite")
    assert "best linear" in out
    assert "0.02 rad rms" in out
    assert "Dry friction is not in these numbers but for the best linear ones" in out


@pytest.mark.slow
def test_attainable_on_a_log(printed, result, complaint, monkeypatch, tmp_path):
    attainable_on, floors_by_log = truth_summary.attainable_on, {}

    def computed_once(log, truth):
        if log.name not in floors_by_log:
            floors_by_log[log.name] = attainable_on(log, truth)
        return floors_by_log[log.name]

    monkeypatch.setattr(truth_summary, "attainable_on", computed_once)
    (log,) = result("simulate", "siso-5-elbow_pitch", "--duration", "12", "--out", tmp_path)["logs"]
    output = result("truth", "--data", log)["attainable"]["elbow_pitch"]
    floors = output["simulation"]
    assert floors["any_model"]["fit"] >= floors["best_linear"]["fit"] >= floors["small_signal"]["fit"] > 50.0
    out = printed("truth", "--data", log, "--out", tmp_path / "floors.svg")
    assert "Attainable on siso-5-elbow_pitch" in out
    assert "Chance: on 600 samples" in out
    printed("truth", "--out", tmp_path / "plain.svg")
    with_floors, without = ((tmp_path / f"{name}.svg").read_text(encoding="utf-8") for name in ("floors", "plain"))
    assert "attainable on siso-5-elbow_pitch" in with_floors
    assert "attainable" not in without
    assert "leave out options" in complaint("truth", "--data", log, "--payload", "none")
    for option, value, logged in (
        ("variant", "flight", "nominal"),
        ("friction-level", "2.0", "1.0"),
        ("pose", "home", "rpcm_holster_out_approach"),
    ):
        message = complaint("truth", "--data", log, f"--{option}", value)
        assert f"--{option} {value} given, the log has {option.replace('-', '_')} = {logged}" in message
    printed("truth", "--data", log, "--variant", "nominal", "--supply-pressure", "20.7")
    assert "expected a log" in complaint("truth", "--data", tmp_path / "log.csv")
    assert "missing.nc" in complaint("truth", "--data", tmp_path / "missing.nc")


@pytest.mark.slow
def test_the_nominal_default_does_not_pass_for_an_option(result, complaint, tmp_path):
    """A log of another arm needs no option; naming the nominal arm contradicts it."""
    log = tmp_path / "published.nc"
    experiment = replace(load("siso-5-elbow_pitch"), name="published", variant="published", duration=30.0)
    simulate([experiment])[0].save(log)
    assert result("truth", "--data", log)["variant"] == "published"
    message = complaint("truth", "--data", log, "--variant", "nominal")
    assert "--variant nominal given, the log has variant = published" in message


@pytest.mark.slow
def test_maps_by_one_command(printed, complaint, monkeypatch, tmp_path):
    coarse = Density(plane=(3, 3), cut=3, sample=3, condition=3, amplitudes=())
    monkeypatch.setattr(Density, "scaled", classmethod(lambda cls, factor: coarse))
    # Drawing takes longest, and tests of the maps draw every figure.
    monkeypatch.setattr(
        "scenarios.truth.map_figures.map_figures", lambda maps: {"workspace": map_figures(maps)["workspace"]}
    )
    assert "expected a folder" in complaint("truth", "--maps", "--out", tmp_path / "here.svg")
    out = printed("truth", "--maps", "--out", tmp_path / "here")
    assert f"maps: {tmp_path / 'here' / 'maps.html'}" in out
    files = {path.name for path in (tmp_path / "here").iterdir()}
    assert files >= {"maps.html", "maps.csv", "workspace.svg", "truth.svg"}
