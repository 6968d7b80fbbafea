"""`hmtb dataset`: its commands, their help, and one clear line for everything that a user can get wrong."""

import json
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions
from scenarios.commands.cli import PROGRAMS
from scenarios.datasets import open_data_set
from scenarios.datasets.chunk import BuiltExperiment, run_chunk
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec, Twins, load_spec, shipped


@pytest.mark.parametrize("words", [["dataset"], ["dataset", "--help"]])
def test_help_names_every_command(printed, words):
    out = printed(*words)
    assert all(f"  {name} " in out for name in PROGRAMS["hmtb dataset"]["commands"])
    assert "  dataset " in printed("--help")


def test_data_sets_are_listed_and_shown(printed, result):
    listed = result("dataset", "list")["data_sets"]
    assert [entry["label"] for entry in listed] == list(shipped())
    spec = load_spec("hmtb-siso-v1")
    assert DataSetSpec.from_toml(printed("dataset", "show", "hmtb-siso-v1")) == spec
    assert result("dataset", "show", "hmtb-siso-v1") == tomllib.loads(spec.to_toml())


@pytest.fixture
def least(tmp_path, tiny_spec, monkeypatch):
    """A spec whose records alone are built; what is made of them has tests of its own."""
    monkeypatch.setattr("scenarios.datasets.build.STAGES", ())
    monkeypatch.setattr("scenarios.datasets.build.metadata_files", lambda folder, spec, index: {})
    monkeypatch.setattr("scenarios.datasets.chunk.arm_files", lambda plan, entry: {})
    path = tmp_path / "least.toml"
    records = tuple(replace(block, duration=1.0) for block in tiny_spec.records)
    path.write_text(replace(tiny_spec, name="least", records=records).to_toml())
    return path


def test_build_says_what_was_built_and_the_same_build_again_says_it_too(result, complaint, least, tmp_path):
    words = ("dataset", "build", least, "--out", tmp_path / "deep" / "out", "--workers", "1")
    output = result(*words)
    assert output == {
        "path": str(tmp_path / "deep" / "out" / "least-v1"),
        "experiments": 3,
        "failed": {},
        "hash": json.loads((Path(output["path"]) / "experiments.json").read_text())["hash"],
        "records": open_data_set(Path(output["path"])).records_hash,
    }
    # Reading a file may change its time of access.
    sums = Path(output["path"]) / "SHA256SUMS"
    before = sums.stat().st_ino, sums.stat().st_mtime_ns
    assert result(*words) == output, "a build that is killed after its last step would never be done"
    assert (sums.stat().st_ino, sums.stat().st_mtime_ns) == before
    (Path(output["path"]) / "experiments.json").open("a").write(" ")
    assert "already there, and is not what this build would make: a version is never over" in complaint(*words)


def test_an_interrupted_build_says_how_to_go_on_and_goes_on(run, printed, least, tmp_path, monkeypatch):
    words = ("dataset", "build", str(least), "--out", str(tmp_path), "--rows", "1")
    with monkeypatch.context() as patch:
        calls = iter((run_chunk,))

        def interrupted(plan: DataSetPlan, numbers: Sequence[int], **values: object) -> Iterator[BuiltExperiment]:
            for one in calls:
                return one(plan, numbers)
            raise KeyboardInterrupt

        patch.setattr("scenarios.datasets.build.run_chunk", interrupted)
        code, out, err = run(*words)
    assert (code, out) == (130, "")
    kept = f"1 of 3 experiments kept in {tmp_path / 'least-v1.unfinished'}"
    assert err == f"hmtb: interrupted; {kept}; run the command again to resume: hmtb {' '.join(words)}\n"
    assert printed(*words).startswith(f"{tmp_path / 'least-v1'}: 3 experiments, 0 failed, records ")


def test_failures_are_told_and_the_exit_code_is_one(result, printed, least, tmp_path):
    # Drives of which some hold the arm and others do not.
    weak = Twins(3, TwinDistributions(supply_pressure=Distribution("uniform", 2.5, 5.5)))
    least.write_text(replace(DataSetSpec.from_toml(least.read_text()), twins=weak).to_toml())
    words = ("dataset", "build", least, "--out", tmp_path)
    output = result(*words, code=1)
    assert output["experiments"] == 3
    names = ("binary-shoulder_yaw", "binary-elbow_pitch", "noise")
    assert list(output["failed"]) == [f"twin-{number}-{name}" for number in (0, 1) for name in names]
    assert all("the drives cannot hold the arm" in why for why in output["failed"].values())
    (tmp_path / "least-v1").rename(tmp_path / "elsewhere")
    out = printed(*words, code=1)
    # A reason that many share is said once.
    assert out.startswith("failed: twin-0-binary-shoulder_yaw and 2 more: ") and out.count("failed: ") == 2
    assert "3 experiments, 6 failed" in out
