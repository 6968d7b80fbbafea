"""The command line: what it prints, and one clear line for everything that a user can get wrong."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import lfilter

from scenarios.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return code, out, err


def result(capsys: pytest.CaptureFixture[str], *words: object) -> dict:
    """Run with --json; stdout is one object and stderr is empty."""
    code, out, err = run(capsys, *words, "--json")
    assert (code, err) == (0, ""), err
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def complaint(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """Run what must be refused: exit 2, nothing on stdout, one line on stderr, no traceback."""
    code, out, err = run(capsys, *words)
    assert code == 2
    assert out == ""
    assert err.startswith("hmtb: ")
    assert err.count("\n") == 1
    return err


@pytest.fixture
def record() -> tuple[np.ndarray, np.ndarray]:
    """A known first-order lag with a bandwidth of 0.807 Hz, with a little noise."""
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], 500), 4)
    y = lfilter([0.0, 0.1], [1.0, -0.9], u) + 1e-3 * rng.standard_normal(len(u))
    return u, y


@pytest.fixture
def csv(tmp_path: Path, record: tuple[np.ndarray, np.ndarray]) -> Path:
    path = tmp_path / "robot.csv"
    u, y = record
    table = np.column_stack([0.02 * np.arange(len(u)), u, y])
    np.savetxt(path, table, delimiter=",", header="time,u,y", comments="", fmt="%.12g")
    return path


OE = ("--method", "oe", "--orders", "1", "1", "1")


def test_help_and_usage_errors(capsys: pytest.CaptureFixture[str]) -> None:
    for words in ([], ["--help"], ["identify", "--help"], ["thesis", "--help"]):
        code, out, _ = run(capsys, *words)
        assert code == 0
        assert "usage" in out.lower()
    for words in (["nonsense"], ["simulate"], ["identify"], ["truth", "--payloads", "rpcm"]):
        code, out, err = run(capsys, *words)
        assert code == 2, words
        assert out == ""
        assert err
        assert "Traceback" not in err


def test_scenarios_are_listed_by_tag_and_shown(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    listed = result(capsys, "scenarios", "list", "--tag", "prbs")["scenarios"]
    assert listed[0]["name"] == "siso-5-shoulder_yaw"
    assert len(listed) == 6
    code, out, _ = run(capsys, "scenarios")
    assert code == 0
    assert out.count("siso-") == 24
    code, out, _ = run(capsys, "scenarios", "show", "siso-7-elbow_pitch")
    assert code == 0
    mine = tmp_path / "mine.toml"
    mine.write_text(out.replace("siso-7-elbow_pitch", "mine").replace("240.0", "2.0"))
    done = result(capsys, "simulate", mine, "--out", tmp_path)
    assert done["logs"] == [str(tmp_path / "mine.nc")]
    assert done["failed"] == {}


def test_simulate_writes_what_identify_reads(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ("simulate", "siso-5-elbow_pitch", "--duration", "20", "--format", "nc,csv", "--out", tmp_path)
    logs = result(capsys, *words)["logs"]
    assert [Path(path).suffix for path in logs] == [".nc", ".csv"]
    by_nc = result(capsys, "identify", logs[0], "--method", "oe", "--orders", "2", "2", "1", "--skip", "4")
    by_csv = result(
        capsys, "identify", logs[1], "--joint", "elbow_pitch", "--method", "oe", "--orders", "2", "2", "--skip", "4"
    )
    assert by_nc["bandwidth_hz"] == pytest.approx(by_csv["bandwidth_hz"], rel=1e-6)
    assert 0.9 < by_nc["bandwidth_hz"] < 1.2
    assert by_nc["fit"]["simulation"][0] > 95


def test_seed_changes_the_noise_and_nothing_else_does(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from hmtb_twin import JointLog

    measured = []
    for number, seed in enumerate(("1", "1", "2")):
        folder = tmp_path / str(number)
        words = ("simulate", "siso-5-elbow_pitch", "--duration", "2", "--seed", seed, "--out", folder)
        (path,) = result(capsys, *words)["logs"]
        measured.append(JointLog.load(path).measured)
    np.testing.assert_array_equal(measured[0], measured[1])
    assert not np.array_equal(measured[0], measured[2])


def test_identify_reads_any_robots_data(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, csv: Path, record: tuple[np.ndarray, np.ndarray]
) -> None:
    u, y = record
    mat, bare = tmp_path / "robot.mat", tmp_path / "bare.csv"
    savemat(mat, {"u": u, "y": y[:, None], "dt": 0.02})
    np.savetxt(bare, np.column_stack([u, y]), delimiter=",")
    true_hz = np.arccos((1 + 0.81 - 2 * 0.01) / (2 * 0.9)) / (2 * np.pi * 0.02)
    for path, words in ((csv, ()), (mat, ()), (bare, ("--dt", "0.02"))):
        found = result(capsys, "identify", path, *OE, *words)
        assert set(found) >= {"method", "orders", "fit", "bandwidth_hz", "ci95", "poles", "warnings"}
        assert found["orders"] == {"nb": 1, "nf": 1, "nk": 1}
        assert found["bandwidth_hz"] == pytest.approx(true_hz, rel=2e-3)
        assert found["ci95"][0] < found["bandwidth_hz"] < found["ci95"][1]
        assert found["poles"][0] == pytest.approx([0.9, 0.0], abs=1e-3)
    code, out, _ = run(capsys, "identify", csv, *OE, "--validate", csv)
    assert code == 0
    assert "bandwidth" in out


@pytest.mark.parametrize("header", ["t", "Time", "TIME (s)", "time_s", "Time [ms]", "t / ms", "Ts", "dt"])
def test_every_usual_name_of_time_is_read(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, record: tuple[np.ndarray, np.ndarray], header: str
) -> None:
    u, y = record
    scale = 1000.0 if "ms" in header else 1.0
    times = scale * 0.05 * (np.ones(len(u)) if header in ("Ts", "dt") else np.arange(len(u)))
    path = tmp_path / "robot.csv"
    np.savetxt(path, np.column_stack([times, u, y]), delimiter=",", header=f"{header},u,y", comments="", fmt="%.12g")
    assert result(capsys, "identify", path, *OE)["dt"] == pytest.approx(0.05)
    said = complaint(capsys, "identify", path, *OE, "--dt", "0.02")
    assert "--dt says a sampling interval of 0.02 s" in said
    assert f"{header!r} of 0.05 s" in said
    mat = tmp_path / "robot.mat"
    savemat(mat, {"u": u, "y": y, "Ts": 0.05})
    assert result(capsys, "identify", mat, *OE)["dt"] == 0.05
    savemat(mat, {"u": u, "y": y})
    assert "no sampling interval" in complaint(capsys, "identify", mat, *OE)


@pytest.mark.parametrize("method", [("arx", "1", "1"), ("armax", "1", "1", "1"), ("oe", "1", "1"), ("okid", "1", "3")])
def test_every_method_runs(capsys: pytest.CaptureFixture[str], csv: Path, method: tuple[str, ...]) -> None:
    found = result(capsys, "identify", csv, "--method", method[0], "--orders", *method[1:])
    assert found["poles"][0][0] == pytest.approx(0.9, abs=0.02)


def test_truth_has_the_promised_keys(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(capsys, "truth")
    assert found["dt"] == 0.02
    assert (found["variant"], found["payload"]) == ("nominal", "rpcm")
    assert set(found["joints"]) >= {"shoulder_yaw", "shoulder_pitch", "elbow_pitch", "wrist_roll"}
    for name in ("shoulder_yaw", "shoulder_pitch", "elbow_pitch"):
        entry = found["joints"][name]
        assert set(entry) >= {"bandwidth_hz", "dc_gain", "poles", "zeros", "delay_samples"}
        assert 0.9 <= entry["bandwidth_hz"] <= 1.3
        assert all(len(pole) == 2 for pole in entry["poles"])
    errors = {float(key): value for key, value in found["small_signal_error"].items()}
    assert sorted(errors.values()) == [errors[key] for key in sorted(errors)]


def test_waveform_writes_the_file_and_the_plot(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    found = result(capsys, "waveform", "two_sines", "--frequency", "2.5", "--out", tmp_path)
    assert found["order_of_excitation"] == 4
    points = np.loadtxt(found["points"])
    assert points.shape == (100,)
    assert Path(found["plot"]).read_bytes().startswith(b"\x89PNG")


def test_unknown_names_suggest_the_near_one(capsys: pytest.CaptureFixture[str], tmp_path: Path, csv: Path) -> None:
    assert "did you mean 'siso-5-elbow_pitch'" in complaint(capsys, "simulate", "siso-5-elbow_pich", "--out", tmp_path)
    assert "did you mean 'elbow_pitch'" in complaint(capsys, "identify", csv, *OE, "--joint", "elbow")
    assert "did you mean 'armax'" in complaint(capsys, "identify", csv, "--method", "armx", "--orders", "1", "1", "1")
    assert "nominal" in complaint(capsys, "truth", "--variant", "nominl")
    assert "rpcm" in complaint(capsys, "truth", "--payload", "box")
    assert "did you mean 'prbs'" in complaint(capsys, "waveform", "prb", "--out", tmp_path)
    assert "frequency" in complaint(capsys, "waveform", "sine", "--out", tmp_path)
    assert "did you mean 'y'" not in complaint(capsys, "identify", csv, *OE, "--output", "angle")
    assert "there are: nc, csv" in complaint(
        capsys, "simulate", "siso-1-elbow_pitch", "--format", "xls", "--out", tmp_path
    )


def test_wrong_orders(capsys: pytest.CaptureFixture[str], csv: Path) -> None:
    identify = ("identify", csv, "--method", "oe", "--orders")
    assert "takes the orders nb nf [nk]; given 2" in complaint(capsys, *identify, "2")
    assert "0 or more, given -1 2" in complaint(capsys, *identify, "-1", "2")
    assert "data" in complaint(capsys, *identify, "4000", "4000", "1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("dt,u,y\n" + "0.1,1,2\n" * 50, "constant"),
        ("dt,u,y\n" + "1,1,2\n1,-1,3\n" * 50 + "1,nan,1\n", "NaN"),
        ("dt,u,y\n" + "1,1,2\n1,-1,3\n" * 50 + "1,1,\n", "NaN"),
        ("u,y\n" + "1,2\n-1,3\n" * 50 + "1\n", "1 values, expected 2"),
        ("u,y\n1,two\n", "expected numbers"),
        ("u,y\n", "no data"),
        ("", "empty"),
        ("1,2,3\n4,5,6\n", "3 columns without a header"),
        ("a,b\n1,2\n", "unknown column 'u'"),
        ("time,u,y\n0,1,2\n1,2,3\n5,1,2\n", "not uniform"),
        ("Time (min),u,y\n0,1,2\n1,2,3\n2,1,2\n", "expected a time in s, ms or us"),
        ("u,y\n" + "1,2\n-1,3\n" * 50, "no sampling interval; expected a column of times"),
        ("1,2\n-1,3\n" * 50, "or --dt SECONDS"),
    ],
)
def test_wrong_csv(capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    assert says in complaint(capsys, "identify", path, *OE)


def test_wrong_files(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "no data file" in complaint(capsys, "identify", tmp_path / "missing.csv", *OE)
    for ending in ("nc", "mat", "csv", "xyz"):
        path = tmp_path / f"foreign.{ending}"
        path.write_bytes(bytes(range(256)) * 8)
        assert "foreign" in complaint(capsys, "identify", path, *OE)
    short = tmp_path / "short.mat"
    savemat(short, {"dt": 0.02, "u": np.arange(50.0) % 3, "y": np.arange(40.0)})
    said = complaint(capsys, "identify", short, *OE)
    assert "50" in said
    assert "40" in said


def test_what_cannot_be_written_or_asked_for(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    for command in (("thesis", "--quick"), ("simulate", "siso-1-elbow_pitch"), ("waveform", "prbs")):
        assert "cannot write to folder" in complaint(capsys, *command, "--out", blocker / "inside")
    simulate = ("simulate", "siso-1-elbow_pitch", "--out", tmp_path)
    assert "duration" in complaint(capsys, *simulate, "--duration", "-1")
    assert "seed" in complaint(capsys, *simulate, "--seed", "-1")
    assert "threads" in complaint(capsys, *simulate, "--threads", "0")
    assert "named twice" in complaint(capsys, "simulate", "siso-1-elbow_pitch", *simulate[1:])
    assert "cannot read scenario file" in complaint(capsys, "simulate", tmp_path / "missing.toml", "--out", tmp_path)


def test_interrupt_is_130(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hmtb_twin.linearize", interrupted)
    code, out, err = run(capsys, "truth")
    assert (code, out) == (130, "")
    assert err == "hmtb: interrupted\n"


def test_a_fault_of_ours_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ValueError("not the user's doing")

    monkeypatch.setattr("hmtb_twin.linearize", broken)
    with pytest.raises(ValueError, match="not the user's doing"):
        main(["truth"])
