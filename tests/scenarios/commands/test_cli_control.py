"""`hmtb control`: what it prints and writes, and what it refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JointLog, simulate
from scenarios.control.campaign import CONTROLLED, identification_experiment
from scenarios.control.design import WrongModel, design, read_law
from scenarios.control.study import CONDITIONS, WRONG
from tests.refusals import refused
from tests.scenarios.control.test_campaign import SHORT, identify_pair, model


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A short record of the ground arm, and a reference."""
    folder = tmp_path_factory.mktemp("control")
    record = simulate([replace(identification_experiment(), multisines=SHORT)])[0].save(folder / "ground.nc")
    return ("--record", record, "--reference", sysid.write_model(model(), folder / "reference.json"))


def test_results_designs_logs_and_figures(result, printed, files, tmp_path):
    out = tmp_path / "out"
    done = result("control", "reach", *files, "--duration", 6, "--with-stress", "--out", out)
    (run,) = done["runs"]
    assert {"scenario", "seed", "rmse_without", "rmse_with", "saturated_percent", "stable"} <= set(run)
    assert (run["scenario"], run["stable"], set(run["joints"])) == ("reach", True, set(CONTROLLED))
    assert run["rmse_with"] < 0.5 * run["rmse_without"]
    assert [one["condition"] for one in done["stress"]] == [*CONDITIONS, *WRONG]
    assert {one.rsplit(".", 1)[1] for one in done["files"]} == {"json", "nc", "png", "svg"}
    assert json.loads((out / "control.json").read_text())["runs"] == done["runs"]
    assert JointLog.load(out / "reach-0-following.nc").requested is not None
    law = read_law(out / "following.json")
    np.testing.assert_array_equal(law.A, design("following", identify_pair(ground=files[1], reference=files[3])).A)
    text = printed("control", "reach", *files, "--duration", 6, "--method", out / "following.json")
    assert f"{1e3 * run['rmse_with']:.3g}" in text


def test_what_is_refused(complaint, files, tmp_path):
    assert "did you mean 'flight'" in complaint("control", "--reference", "fligth")
    assert "did you mean 'reach'" in complaint("control", "raech", *files)
    assert "unknown method 'follow'" in complaint("control", "reach", *files, "--method", "follow")
    assert "expected one, as reach" in complaint("control", "rpcm", *files, "--with-stress")
    other = tmp_path / "other.json"
    other.write_text("{}")
    assert "expected a law of hmtb control --out" in complaint("control", "reach", *files, "--method", other)
    refused("expected a law of hmtb control --out", read_law, tmp_path / "none.json")


def test_a_wrong_model_answers_wrongly(files):
    pair = identify_pair(ground=files[1], reference=files[3])
    wrong = WrongModel(gain=0.8, delay=2).applied(pair)
    late = np.exp(-2j * np.pi * 1.0 * 0.04)
    np.testing.assert_allclose(
        wrong.ground.frequency_response([1.0]), 0.8 * late * pair.ground.frequency_response([1.0]), rtol=1e-9
    )
    np.testing.assert_allclose(wrong.record.u[:-2], pair.record.u[2:-2] / 0.8)
