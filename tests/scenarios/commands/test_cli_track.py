"""`hmtb track`: a log with its truth, a table without, and refusals."""

import numpy as np
import pytest

from hmtb_twin.files.netcdf import read_netcdf
from scenarios.files.data_file import write_log
from tests.scenarios.commands.conftest import table


@pytest.fixture(scope="module")
def files(exchange_log, tmp_path_factory):
    """The log of a payload change, and the same as a table."""
    folder, data = tmp_path_factory.mktemp("track"), exchange_log.iodata()
    columns = {"t": data.time, "command": data.u[:, 0], "angle": data.y[:, 0]}
    return write_log(exchange_log, folder / "track.nc"), table(folder / "arm.csv", columns)


@pytest.mark.slow
def test_a_log_stands_beside_its_truth_and_a_table_gives_the_same_estimates(run, files, tmp_path):
    log, arm = files
    code, out, _ = run("track", log, "--calibration", 15, "--no-bla", "--out", tmp_path)
    assert code == 0
    assert "change at 20 s to payload mdm: alarm after" in out
    assert "0.937" in out
    assert sorted(one.name for one in tmp_path.iterdir()) == ["track.csv", "track.nc", "track.png", "track.svg"]
    estimates = np.genfromtxt(tmp_path / "track.csv", delimiter=",", names=True)
    kept = read_netcdf(tmp_path / "track.nc").variables
    np.testing.assert_array_equal(kept["bandwidth_hz"].values, estimates["bandwidth_hz"])
    words = ("--input", "command", "--output", "angle", "--time", "t", "--calibration", 15)
    code, out, _ = run("track", arm, *words, "--out", tmp_path / "table")
    assert code == 0
    assert "alarm at 20" in out
    assert "truth" not in out
    # a table has no joints
    assert "next: hmtb identify" in out
    assert "--joint" not in out


@pytest.mark.slow
def test_json_has_the_estimates_once_a_second(result, files):
    output = result("track", files[0], "--calibration", 15, "--no-bla")
    assert [one["payload"] for one in output["stretches"]] == ["none", "mdm"]
    assert output["false_alarms"] == []
    assert output["estimates"]["time_s"] == pytest.approx(np.arange(40.0))
    assert output["estimates"]["bandwidth_hz"][:15] == [None] * 15
    assert output["true_changes"][0]["detected"] == output["changes"][0]["detected"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("track-ebow_pitch",), "did you mean 'track-elbow_pitch'"),
        (("track-elbow_pitch", "--duration", 90), "payload_changes at 60, 120 s given, expected ascending times"),
        (("none.nc",), "no file none.nc"),
        (("{log}", "--seed", 1), "--duration and --seed are for scenarios"),
        (("{log}", "--calibration", 50), "calibration"),
        (("mimo-7-independent", "--duration", 4), "name the joint"),
    ],
)
def test_what_cannot_be_followed_is_refused(complaint, files, words, message):
    assert message in complaint("track", *(files[0] if word == "{log}" else word for word in words))


def test_a_gap_is_refused_with_its_remedy(run, tmp_path, recwarn):
    u = np.tile([1.0, -1.0, -1.0], 100)
    path = table(tmp_path / "gap.csv", {"t": np.delete(0.02 * np.arange(400), np.s_[120:220]), "u": u, "y": u})
    code, out, err = run("track", path)
    assert (code, out, len(recwarn)) == (2, "", 0)
    assert "keep the rows of one part in the file, the longest 4.4 to 7.98 s after the first row" in err
