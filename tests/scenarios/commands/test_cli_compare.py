"""`hmtb compare`: printed models, the truth and estimates on logs and on anyone's tables."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import JointLog, linearize, load_arm, simulate
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.commands.cli import main
from scenarios.experiments.registry import load
from scenarios.files.data_file import read_parts, write_log
from scenarios.identification.named_models import parse_model_name
from scenarios.truth.published import published_model
from tests.scenarios.commands.conftest import table


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Ten seconds of two single-joint tests and of one of several joints, all of large motions."""
    folder = tmp_path_factory.mktemp("logs")
    names = ("siso-5-elbow_pitch", "siso-8-elbow_pitch", "mimo-7-independent")
    stick = replace(LARGE_MOTION, compensation=0.95)
    batch = simulate([replace(load(name), duration=12.0, hand_controller=stick) for name in names])
    return {log.name: log.save(folder / f"{log.name}.nc") for log in batch.logs}


@pytest.mark.slow
def test_without_words_the_truth_and_all_prints_of_the_joint(result, logs):
    output = result("compare", logs["siso-5-elbow_pitch"], "--skip", 4)
    assert [entry["model"] for entry in output["models"]] == [
        "truth",
        "published ARMAX (4.12)",
        "published OKID (5.10)",
    ]
    true, armax, okid = output["models"]
    assert true["bandwidth_hz"] == pytest.approx(linearize(load_arm()).joint("elbow_pitch").bandwidth_hz, rel=1e-6)
    assert armax["bandwidth_hz"] == pytest.approx(1.20, abs=0.006)
    assert okid["half_power_hz"] == pytest.approx(0.87, abs=0.006)
    assert okid["dc_gain"] == pytest.approx(0.99, abs=0.006)
    assert true["fit"]["simulation"][0] > max(entry["fit"]["simulation"][0] for entry in (armax, okid))
    assert okid["fit"]["one_step"][0] > okid["fit"]["simulation"][0]
    assert all(entry["stable"] for entry in output["models"])
    assert "(4.13)" in armax["remarks"][0]
    assert output["estimation"] is None
    assert output["warnings"] == []


@pytest.mark.slow
def test_estimates_come_from_the_other_record_or_say_that_they_do_not(result, logs):
    chirp, prbs = logs["siso-8-elbow_pitch"], logs["siso-5-elbow_pitch"]
    words = (chirp, "--models", "oe:2/2/2", "truth", "--skip", 4)
    held_out, own = result("compare", *words, "--estimation", prbs), result("compare", *words)
    assert held_out["estimation"] == str(prbs)
    assert held_out["warnings"] == []
    assert own["estimation"] == str(chirp)
    assert "no validation" in own["warnings"][0]
    # A model fits the record that it comes from better; the truth does not depend on it.
    fits = [outcome["models"][0]["fit"]["simulation"][0] for outcome in (held_out, own)]
    assert fits[0] < fits[1]
    assert held_out["models"][1]["fit"] == own["models"][1]["fit"]
    low, high = held_out["models"][0]["ci95"]
    assert low < held_out["models"][0]["bandwidth_hz"] < high


def test_the_same_record_under_another_name_is_no_validation(result, logs, csv, tmp_path):
    prbs = logs["siso-5-elbow_pitch"]
    (tmp_path / "copy.nc").write_bytes(prbs.read_bytes())
    (tmp_path / "link.nc").symlink_to(prbs)
    for path in (prbs, tmp_path / "copy.nc", tmp_path / "link.nc"):
        (output,) = result("compare", prbs, "--models", "arx:2/2", "--estimation", path)["warnings"]
        assert (
            f"arx:2/2: identified from {path.name}, which holds the same record, so that the fit is no valid" in output
        )
    lines = csv.read_text(encoding="utf-8").splitlines()
    start = csv.with_name("start.csv")
    start.write_text("\n".join(lines[:800]), encoding="utf-8")
    assert "no validation" in result("compare", csv, "--models", "arx:1/1", "--estimation", start)["warnings"][0]
    end = csv.with_name("end.csv")
    end.write_text("\n".join([lines[0], *lines[400:]]), encoding="utf-8")
    held_out = csv.with_name("held-out.csv")
    held_out.write_text("\n".join(lines[:400]), encoding="utf-8")
    assert result("compare", held_out, "--models", "arx:1/1", "--estimation", end)["warnings"] == []


def test_a_model_file_on_its_own_record_is_no_validation(result, csv, tmp_path):
    model = tmp_path / "servo.json"
    result("identify", csv, "--method", "oe", "--orders", 2, 2, 1, "--save", model)
    remarks = result("compare", csv, "--models", model)["warnings"]
    expected = "servo: estimated from this record, or from its beginning, so that the fit is no validation"
    assert sum(expected in remark for remark in remarks) == 1


def test_the_fits_are_those_of_identify(result, csv):
    (entry,) = result("compare", csv, "--models", "arx:1/1", "--steps", "3")["models"]
    same = result("identify", csv, "--method", "arx", "--orders", "1", "1", "--steps", "3")
    assert entry["fit"] == same["fit"]
    assert entry["bandwidth_hz"] == pytest.approx(same["bandwidth_hz"])
    assert entry["poles"] == [pytest.approx(pole) for pole in same["poles"]]


def test_a_model_of_other_channels_names_the_options(result, complaint, csv, tmp_path):
    model = tmp_path / "model.json"
    result("identify", csv, "--method", "arx", "--orders", "1", "1", "--save", model)
    other = tmp_path / "other.csv"
    other.write_text(csv.read_text(encoding="utf-8").replace("u", "command", 1), encoding="utf-8")
    text = complaint("compare", other, "--input", "command", "--models", model)
    assert "by --input and --output" in text and "dataclasses" not in text


def test_three_joints_at_once(result, logs):
    joints = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    words = ("--models", "published:okid", "truth", "--joint", *joints, "--skip", 4)
    printed, true = result("compare", logs["mimo-7-independent"], *words)["models"]
    hz = [printed["bandwidth_hz"][k][k] for k in range(3)]
    assert hz == pytest.approx([0.13, 1.40, 0.89], abs=0.006)
    assert len(true["fit"]["simulation"]) == 3
    assert min(true["fit"]["simulation"]) > 80.0
    # On one joint a printed model of three is its part for that joint.
    (part,) = result("compare", logs["siso-5-elbow_pitch"], "--models", "published:okid")["models"]
    assert part["model"] == "published OKID model (5.11), OKID (5.10)"
    assert part["bandwidth_hz"] == pytest.approx(published_model("5.10").model.bandwidth()[0, 0])


def test_each_model_is_judged_about_its_own_operating_point(result, tmp_path):
    """A constant between input and output costs no fit unless it is asked to."""
    model = published_model("4.10").model
    u = np.repeat(np.random.default_rng(1).choice([-0.05, 0.05], 400), 3)
    from sysid import simulate as simulated

    y = simulated(model, u)[:, 0] + 0.4
    words = (table(tmp_path / "offset.csv", {"u": u, "y": y}), "--dt", 0.02, "--models", "published:4.10")
    assert result("compare", *words)["models"][0]["fit"]["simulation"][0] == pytest.approx(100.0, abs=1e-6)
    assert result("compare", *words, "--keep-mean")["models"][0]["fit"]["simulation"][0] < 0.0


@pytest.mark.slow
def test_the_table_and_the_figure(printed, logs, tmp_path):
    out = tmp_path / "outputs.svg"
    words = (logs["siso-5-elbow_pitch"], "--models", "truth", "published", "arx:2/2/2", "armax:2/2/2/2", "--out", out)
    shown = printed("compare", *words, "--piece", "4", "2")
    texts = ("truth", "published OKID (5.10)", "ARMAX 2/2/2/2", "simulation %", "note: OKID (5.10)", "no validation")
    assert all(text in shown for text in texts)
    assert out.read_text(encoding="utf-8").startswith("<?xml")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--models", "oe"], "oe takes the orders nb nf [nk]; given nothing"),
        (["--models", "oe:2/x"], "expected whole orders apart by slashes"),
        (["--models", "oe:²/2/1"], "expected whole orders apart by slashes"),
        (["--models", "oe:٢/2/1"], "expected whole orders apart by slashes"),
        (["--models", f"oe:{'9' * 5000}/2"], "of 9 digits at most"),
        (["--models", "truth:x"], "model 'truth:x': the truth has no name or orders"),
        (["--models", "okd:2"], "did you mean 'okid'?"),
        (["--models", "5.10"], "did you mean 'published:5.10'?"),
        (["--models", "published:5.11"], "did you mean '5.10'"),
        (["--models", "published:5.8"], "published:5.8 is of shoulder_yaw; siso-5-elbow_pitch.nc was read for elbow_p"),
        (["--models", "truth", "--estimation", "x.nc"], "no model that is identified"),
        (["--piece", "0", "1"], "--piece given without --out"),
        (["--out", "figure.gif"], "expected a figure: .svg, .png, .pdf"),
        (["--joint", "elbow_pitch", "elbow_pitch"], "expected each joint once"),
    ],
)
def test_complaints(complaint, logs, words, said):
    assert said in complaint("compare", logs["siso-5-elbow_pitch"], *words)


def test_what_a_foreign_table_cannot_be_laid_beside(complaint, csv, logs):
    assert (
        "tells of no arm; the truth is known of logs of hmtb simulate only (.nc); name models: --models arx:2/2/1"
        in complaint("compare", csv)
    )
    assert "name one, as published:4.7" in complaint("compare", csv, "--models", "published")
    assert "takes 3 input(s), robot.csv was read with 1" in complaint("compare", csv, "--models", "published:okid")
    slow = csv.with_name("slow.csv")
    slow.write_text("\n".join(line.partition(",")[2] for line in csv.read_text(encoding="utf-8").splitlines()))
    words = (slow, "--dt", 0.01, "--models", "published:4.7")
    assert "sampled every 0.01 s; the printed models hold at 0.02 s" in complaint("compare", *words)
    assert "'published' takes all printed models of one" in complaint(
        "compare", logs["mimo-7-independent"], "--models", "published", "--joint", "shoulder_yaw", "elbow_pitch"
    )
    assert "the thesis prints no model of wrist_yaw" in complaint(
        "compare", logs["mimo-7-independent"], "--models", "published", "--joint", "wrist_yaw"
    )


def test_names_are_understood():
    assert parse_model_name("armax:5,3,5/2").orders == (5, 3, 5, 2)
    assert parse_model_name("procest:P1D").orders == ("P1D",)
    assert parse_model_name("published:4.7+4.9").name == "4.7+4.9"
    assert parse_model_name("truth").kind == "truth"


def test_joints_of_logs_and_records_are_read_together(logs, tmp_path):
    log, joints = JointLog.load(logs["mimo-7-independent"]), ("elbow_pitch", "shoulder_yaw")
    same = log.iodata(joints)
    for path in (logs["mimo-7-independent"], write_log(log, tmp_path / "bus.mat")):
        (record,) = read_parts(path, joint=joints)
        np.testing.assert_array_equal(record.y, same.y)
        assert (record.input_names, record.output_names, record.dt) == (same.input_names, same.output_names, same.dt)


def test_a_table_of_another_robot_is_not_followed_by_the_truth_of_the_arm(printed, csv, tmp_path):
    shown = printed("compare", csv, "--models", "arx:1/1", "--out", tmp_path / "own.png")
    assert "figure: " in shown and "next:" not in shown


def test_a_slow_plant_has_its_digits_and_an_integrator_no_gain(capsys, tmp_path):
    """A heater of 300 s, and the position of a motor."""
    rng = np.random.default_rng(8)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 20)
    pole = np.exp(-5.0 / 300.0)
    for name, y in (
        ("heater", lfilter([0.0, 0.8 * (1.0 - pole)], [1.0, -pole], u)),
        ("motor", np.cumsum(lfilter([0.0, 0.02], [1.0, -0.9], u))),
    ):
        path = tmp_path / f"{name}.csv"
        columns = np.column_stack((5.0 * np.arange(len(u)), u, y + 1e-4 * rng.standard_normal(len(u))))
        np.savetxt(path, columns, delimiter=",", header="t,u,y", comments="", fmt="%.8g")
        assert main(["compare", str(path), "--models", "oe:1/1" if name == "heater" else "oe:2/2/1"]) == 0
        table = capsys.readouterr().out
        row = next(line for line in table.splitlines() if line.strip().startswith("OE"))
        # 1 / (2 pi 300 s) = 0.000531 Hz
        assert "0.00053" in row if name == "heater" else row.count("—") >= 2


def drifting(rng, samples, noise):
    """A held command of two levels, and the outputs of a lag and of a motor, which has that lag for its speed."""
    u = np.repeat(rng.choice([-0.5, 0.5], samples // 20), 20)
    speed = lfilter([0.0, 0.2], [1.0, -0.8], u)
    outputs = []
    for clean in (1.5 * speed + 0.005 * np.arange(samples), 0.1 * np.cumsum(speed) + 0.7):
        outputs.append(clean + noise * clean.std() * rng.standard_normal(samples))
    return u, *outputs


def logged(path, u, y):
    """The table of a command and an output every 0.02 s."""
    return table(path, {"t": 0.02 * np.arange(len(u)), "u": u, "y": y})


def test_a_model_beside_a_line_is_judged_beside_one(result, printed, tmp_path):
    """The command that `hmtb identify --trend` prints showed 30 % for a model of 97 %."""
    u, y, _ = drifting(np.random.default_rng(1), 1200, 0.02)
    path, model = logged(tmp_path / "drift.csv", u, y), tmp_path / "drift.json"
    words = printed("identify", path, "--method", "oe", "--orders", 1, 1, 1, "--trend", "--save", model)
    assert f"next: hmtb compare {path} --models {model} --trend" in words
    compared = result("compare", path, "--models", model, "oe:1/1/1")["models"]
    beside_line, without = (entry["fit"]["simulation"][0] for entry in compared)
    assert beside_line > 93.0
    assert without < 70.0
    assert "judged beside a straight line in the output, as it was identified" in compared[0]["remarks"]
    with_option = result("compare", path, "--models", model, "oe:1/1/1", "--trend")["models"]
    assert with_option[1]["fit"]["simulation"][0] == pytest.approx(beside_line, abs=1e-6)
    assert with_option[0]["fit"]["simulation"][0] == pytest.approx(beside_line, abs=1e-6)


def test_an_integrator_has_no_operating_point_of_its_input(result, tmp_path):
    """The mean of the input, removed, put a ramp into the output: 60 % for a model of 99.9 %."""
    u, _, y = drifting(np.random.default_rng(2), 1200, 0.001)
    path, model = logged(tmp_path / "motor.csv", u + 0.05, y + 0.005 * np.arange(1200)), tmp_path / "motor.json"
    identified = result("identify", path, "--method", "procest", "--orders", "P1DI", "--save", model)
    compared = result("compare", path, "--models", model)
    # the same errors, relative to the output without its line
    assert compared["models"][0]["fit"]["simulation"][0] == pytest.approx(identified["fit"]["simulation"][0], abs=0.2)
    assert any("it integrates" in remark for remark in compared["models"][0]["remarks"])
    assert any("estimated from this record" in warning for warning in compared["warnings"])


def test_a_line_and_values_as_they_are_exclude_each_other(complaint, tmp_path):
    u, y, _ = drifting(np.random.default_rng(3), 400, 0.02)
    path = logged(tmp_path / "drift.csv", u, y)
    words = ("compare", path, "--models", "oe:1/1/1", "--keep-mean", "--trend")
    assert "--keep-mean and --trend given" in complaint(*words)
    assert "n4sid has no trend" in complaint("compare", path, "--models", "n4sid:2", "--trend")


def test_a_model_beside_a_constant_is_not_judged_beside_a_line(result, printed, tmp_path):
    """A model with --offset had 93.6 % on a drifting record, the same one without it 21 %."""
    rng = np.random.default_rng(6)
    u, drifting_output, _ = drifting(rng, 1200, 0.02)
    steady = logged(tmp_path / "steady.csv", u, drifting_output - 0.005 * np.arange(1200))
    path, fits = logged(tmp_path / "drift.csv", u, drifting_output), []
    for words in ((), ("--offset",)):
        model = tmp_path / f"{len(words)}.json"
        printed("identify", steady, "--method", "oe", "--orders", 1, 1, 1, "--save", model, *words)
        compared = result("compare", path, "--models", model)
        fits.append(compared["models"][0]["fit"]["simulation"][0])
        assert any("--trend judges all models beside one" in warning for warning in compared["warnings"])
    assert fits[0] == pytest.approx(fits[1], abs=0.5)


def test_a_line_that_the_mean_of_the_input_makes_enlarges_no_fit(printed, tmp_path):
    """Equal integrators had 99.9 and 98.8 %: without the line the output was far larger than it is."""
    u, _, y = drifting(np.random.default_rng(7), 1200, 0.02)
    path = logged(tmp_path / "motor.csv", u + 0.3, y)
    noise = 0.02 * y.std()
    shown = printed("compare", path, "--models", "oe:1/2/1", "--trend")
    row = next(line for line in shown.splitlines() if line.strip().startswith("OE")).split()
    assert row[-1] == "integrates"
    assert 97.0 < float(row[2]) <= 100.0 * (1.0 - 0.9 * noise / y.std())
