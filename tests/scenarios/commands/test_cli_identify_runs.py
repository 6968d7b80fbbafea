"""`hmtb identify` of several runs: those that agree give one model, one that differs is named."""

import numpy as np
import pytest
from scipy.signal import lfilter


def write_runs(folder, gains, seed=0, samples=400):
    """Files of runs, y = gain * 0.15 / (1 - 1.6 q^-1 + 0.73 q^-2) and white noise, each about a level of its own."""
    rng, files = np.random.default_rng(seed), []
    for k, gain in enumerate(gains):
        u = np.repeat(rng.choice([-1.0, 1.0], samples), 4)[:samples]
        y = lfilter([0.0, 0.1, 0.05], [1.0, -1.6, 0.73], gain * u) + 0.05 * rng.standard_normal(samples) + k
        files.append(folder / f"run-{k}.csv")
        columns = np.column_stack((0.02 * np.arange(samples), u, y))
        np.savetxt(files[-1], columns, delimiter=",", header="t,u,y", comments="")
    return files


def test_a_run_of_another_gain_is_named_and_no_model_is_sufficient(result, printed, tmp_path):
    files = write_runs(tmp_path, (1.0, 1.0, 1.3, 1.0))
    found = result("identify", *files, "--method", "oe", "--orders", "2", "2")["agreement"]
    assert not found["agree"]
    assert found["p"] < 1e-6
    assert found["deviating"] == ["run-2"]
    gains = [found["runs"][f"run-{k}"]["dc_gain"][0][0] for k in range(4)]
    assert gains == pytest.approx([0.15 / 0.13, 0.15 / 0.13, 1.3 * 0.15 / 0.13, 0.15 / 0.13], rel=0.03)
    output = " ".join(printed("identify", *files, "--method", "oe", "--orders", "2", "2").split())
    assert "not sufficient: the runs do not have one response to the input (p = " in output
    assert "without run-2, which has 1.3" in output


def test_runs_that_agree_are_one_model(result, printed, tmp_path):
    files = write_runs(tmp_path, (1.0, 1.0, 1.0), seed=1)
    found = result("identify", *files, "--method", "oe", "--orders", "2", "2")
    assert found["agreement"]["agree"]
    assert found["dc_gain"] == pytest.approx(0.15 / 0.13, rel=0.02)
    assert "verdict sufficient" in " ".join(printed("identify", *files, "--method", "oe", "--orders", "2", "2").split())


def test_differences_too_small_to_matter_are_none(result, tmp_path):
    """A gain 2 % larger is significant beside little noise."""
    files = write_runs(tmp_path, (1.0, 1.0, 1.0), seed=2, samples=2000)
    columns = np.loadtxt(files[0], delimiter=",", skiprows=1)
    columns[:, 2] = 1.02 * columns[:, 2]
    np.savetxt(files[0], columns, delimiter=",", header="t,u,y", comments="")
    found = result("identify", *files, "--method", "oe", "--orders", "2", "2")["agreement"]
    assert found["agree"]
    assert found["p"] < 0.01


def test_files_of_one_name_in_two_folders_are_two_runs(result, tmp_path):
    files = []
    for k, name in enumerate(("monday", "tuesday")):
        (tmp_path / name).mkdir()
        (written,) = write_runs(tmp_path / name, (1.0,), seed=k)
        files.append(written)
    found = result("identify", *files, "--method", "oe", "--orders", "2", "2")
    assert list(found["agreement"]["runs"]) == [str(file.with_suffix("")) for file in files]


def test_one_run_has_none_to_agree_with(result, tmp_path):
    (file,) = write_runs(tmp_path, (1.0,))
    assert result("identify", file, "--method", "oe", "--orders", "2", "2")["agreement"] is None
