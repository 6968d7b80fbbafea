"""A check finds every byte that is wrong, tells what of it matters, and takes no harm from strangers."""

import json
import os
import random
import shutil
import signal
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from scenarios.commands.cli import main
from scenarios.datasets import regeneration
from scenarios.datasets.check import DataSetCheck, examine, record_problems
from scenarios.datasets.folder_check import folder_files
from scenarios.datasets.index import array_line, read_index
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf import read_netcdf
from scenarios.files.netcdf_reader import NetcdfReader, describe

RECORD = "data/test/noise.nc"


@pytest.fixture
def copy(tiny: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(tiny, tmp_path / tiny.name))


def reseal(folder: Path, *, without: tuple[str, ...] = ()) -> None:
    """Write checksums anew, as somebody does who wants no change to be seen."""
    places = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    kept = [place for place in places if place not in ("SHA256SUMS", *without)]
    text = "".join(f"{file_hash(folder / place)}  {place}\n" for place in kept)
    (folder / "SHA256SUMS").write_text(text, encoding="utf-8")


def change(folder: Path, place: str, edit: Callable[[h5py.File], None]) -> None:
    with h5py.File(folder / place, "a") as file:
        edit(file)


def forge(folder: Path, by: float) -> None:
    """Change the outputs of every record, and every hash that would tell."""
    index = json.loads((folder / "experiments.json").read_text(encoding="utf-8"))
    digest = sha256()
    for entry in index["experiments"]:

        def shift(file: h5py.File) -> None:
            file["y"][...] = file["y"][...] + by

        change(folder, entry["file"], shift)
        entry["arrays"][entry["file"]] = read_netcdf(folder / entry["file"]).array_hashes()
        for file, hashes in sorted(entry["arrays"].items()):
            for name, value in sorted(hashes.items()):
                digest.update(array_line(file, name, value))
    index["hash"] = digest.hexdigest()
    (folder / "experiments.json").write_text(json.dumps(index), encoding="utf-8")
    reseal(folder)


def check(folder: Path, *, regenerate: int = 3, workers: int | None = None) -> tuple[str, ...]:
    return examine(folder, regenerate=regenerate, workers=workers).problems


def test_what_has_been_built_passes_and_is_simulated_again_to_the_bit(tiny: Path) -> None:
    assert examine(tiny, regenerate=2, seed=3, workers=1) == DataSetCheck(
        (),
        (
            "3 of 3 experiments have a record",
            "2 experiments simulated again with the same software: the same bits",
        ),
    )


def test_a_flipped_byte_is_found_in_every_file(copy: Path) -> None:
    generator = random.Random(1)
    places = [p.relative_to(copy).as_posix() for p in copy.rglob("*") if p.is_file() and p.name != "SHA256SUMS"]
    for place in places:
        content = bytearray((copy / place).read_bytes())
        content[generator.randrange(len(content))] ^= 1 << generator.randrange(8)
        (copy / place).write_bytes(content)
    problems = check(copy, regenerate=0)
    for place in places:
        assert any(problem.startswith(f"{place}: its hash is not that of") for problem in problems), place


def test_every_flipped_byte_of_the_checksums_is_found(copy: Path) -> None:
    path = copy / "SHA256SUMS"
    content = path.read_bytes()
    good = folder_files(copy)
    assert not good.problems
    generator = random.Random(2)
    # Every byte of two lines, and others anywhere.
    for position in (*range(200), *(generator.randrange(len(content)) for _ in range(100))):
        damaged = bytearray(content)
        damaged[position] ^= 1 << generator.randrange(8)
        path.write_bytes(damaged)
        found = folder_files(copy)
        # Either the line is none, or a file is missing and another unknown, or a file has not this hash.
        assert found.problems or found.sums != good.sums, position


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.99])
def test_checksums_cut_off_anywhere_are_found(copy: Path, kept: float) -> None:
    path = copy / "SHA256SUMS"
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    assert folder_files(copy).problems


def test_a_record_packed_anew_by_another_tool_has_its_arrays_still(copy: Path) -> None:
    with xr.open_dataset(copy / RECORD, engine="h5netcdf") as record:
        loaded = record.load()
    loaded.to_netcdf(copy / RECORD, engine="h5netcdf")
    said = "its arrays are those of the index: the file was written anew, or only its description changed"
    assert check(copy, regenerate=0) == (
        f"{RECORD}: its hash is not that of SHA256SUMS",
        f"{RECORD}: {said}",
    )


def test_files_missing_and_files_beside_are_found(copy: Path) -> None:
    (copy / RECORD).unlink()
    (copy / "data" / "train" / ".hidden").write_text("x")
    assert check(copy, regenerate=0) == (
        f"{RECORD} is missing",
        "data/train/.hidden is not listed in SHA256SUMS",
    )
    (copy / "SHA256SUMS").unlink()
    assert "SHA256SUMS is missing: no file can be checked against it" in check(copy, regenerate=0)


def _attribute(name: str, value: object, variable: str = "") -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        (file[variable] if variable else file).attrs[name] = value

    return edit


def _sample(file: h5py.File) -> None:
    file["sample"][3] = 4


def _no_output(file: h5py.File) -> None:
    del file["y"]


METADATA = [
    (_sample, "sample does not count 0, 1, 2, ... in whole numbers"),
    (_no_output, "y or the names of its channels, output, are missing"),
    (_attribute("part", "train"), "attribute part is 'train', expected 'test'"),
    (_attribute("sampling_time_denominator", 49), "attribute sampling_time_denominator is 49, expected 50"),
    (_attribute("initialisation_window", 0), "attribute initialisation_window is 0, expected 20"),
    (_attribute("units", "deg", "y"), "y has units and role {'units': 'deg', 'role': 'output'}"),
    (_attribute("units", "", "force"), "force has no unit"),
    (_attribute("role", "truth", "torque"), "torque is truth, which belongs into files of its own"),
]


@pytest.mark.parametrize(("edit", "said"), METADATA, ids=[said[:30] for _, said in METADATA])
def test_wrong_metadata_is_found(
    copy: Path, tiny_spec: DataSetSpec, edit: Callable[[h5py.File], None], said: str
) -> None:
    entry = read_index(copy)["experiments"][2]
    assert list(record_problems(describe(copy / RECORD), entry, tiny_spec, 200)) == []
    assert list(record_problems(describe(copy / RECORD), entry, tiny_spec, 199)) != []
    change(copy, RECORD, edit)
    (problem,) = record_problems(describe(copy / RECORD), entry, tiny_spec, 200)
    assert problem.startswith(said)


def test_wrong_numbers_and_metadata_are_found_under_right_checksums(copy: Path) -> None:
    def edit(file: h5py.File) -> None:
        file["y"][7, 0] += 1e-15
        file.attrs["arm"] = "another"

    change(copy, RECORD, edit)
    reseal(copy)
    assert check(copy, regenerate=0) == (
        f"{RECORD}: array y differs from the index",
        f"{RECORD}: attribute arm is 'another', expected 'arm-0'",
    )


def test_an_index_that_does_not_give_its_own_hash_or_the_spec_is_found(copy: Path) -> None:
    path = copy / "experiments.json"
    index = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**index, "hash": "0" * 64}), encoding="utf-8")
    reseal(copy)
    assert any("its hash is '000" in problem for problem in check(copy, regenerate=0))
    index["experiments"][0]["part"] = "test"
    path.write_text(json.dumps(index), encoding="utf-8")
    reseal(copy)
    said = "experiments.json: binary-shoulder_yaw has part = 'test', spec.toml asks for 'train'"
    assert said in check(copy, regenerate=0)
    path.write_text(json.dumps({**index, "experiments": index["experiments"][1:]}), encoding="utf-8")
    reseal(copy)
    assert "experiments.json has 2 experiments, spec.toml asks for 3" in check(copy, regenerate=0)


def test_a_forgery_with_right_hashes_is_found_by_simulation_alone(copy: Path) -> None:
    forge(copy, 1e-6)
    assert check(copy, regenerate=0) == ()
    problems = check(copy, regenerate=1, workers=1)
    assert [
        problem.partition(" differs by up to 1e-06 from what the same software")[1] != "" for problem in problems
    ] == [True]


@pytest.mark.parametrize(("by", "passes"), [(1e-12, True), (1e-3, False)])
def test_other_versions_may_differ_within_the_tolerance(
    copy: Path, monkeypatch: pytest.MonkeyPatch, by: float, passes: bool
) -> None:
    forge(copy, by)
    monkeypatch.setattr(regeneration, "same_software", lambda folder: False)
    found = examine(copy, regenerate=1, workers=1)
    assert found.passed is passes
    assert [("within 1e-09 of the largest magnitude" in note) for note in found.notes][1:] == [True] * passes


def test_software_is_the_same_only_with_the_same_source_and_versions(copy: Path) -> None:
    assert regeneration.same_software(copy)
    record = json.loads((copy / "build.json").read_text(encoding="utf-8"))
    for wrong in ({"source": "0"}, {"versions": {**record["versions"], "mujoco": "1.0"}}, {"versions": None}):
        (copy / "build.json").write_text(json.dumps({**record, **wrong}), encoding="utf-8")
        assert not regeneration.same_software(copy)


def test_truth_and_spec_kept_apart_are_no_fault_but_are_told(copy: Path) -> None:
    shutil.rmtree(copy / "truth")
    (copy / "spec.toml").unlink()
    reseal(copy)
    found = examine(copy)
    assert found.problems == ()
    assert any(note.startswith("spec.toml is not in this copy") for note in found.notes)
    assert any(note.startswith("the truth in 4 files is not in this copy") for note in found.notes)
    assert "no experiment was simulated again: there is no spec to do it from" in found.notes


def test_no_path_leads_out_of_the_folder(copy: Path) -> None:
    # Whoever opens this file waits for ever.
    os.mkfifo(copy.parent / "outside")
    os.mkfifo(copy / "inside")
    (copy / "link").symlink_to(copy.parent / "outside")
    (copy / "folder").symlink_to(copy.parent)
    with (copy / "SHA256SUMS").open("a", encoding="utf-8") as stream:
        for place in ("../outside", "/etc/passwd", "data/../../outside", "link", "inside", "folder/outside"):
            stream.write(f"{'0' * 64}  {place}\n")
    problems = check(copy, regenerate=0)
    assert sum("leads out of the folder" in problem for problem in problems) == 3
    assert {"'link' is a link; expected files alone", "'folder' is a link; expected files alone"} <= set(problems)
    assert {"'inside' is no ordinary file; expected files alone", "folder/outside is missing"} <= set(problems)


def test_a_record_that_links_to_another_file_is_refused(copy: Path) -> None:
    def edit(file: h5py.File) -> None:
        del file["status"]
        file["status"] = h5py.ExternalLink("/etc/passwd", "x")

    change(copy, RECORD, edit)
    with pytest.raises(ScenarioError, match="'status' is a link; expected arrays"):
        describe(copy / RECORD)


def test_a_record_that_claims_to_fill_the_memory_is_refused(copy: Path) -> None:
    def edit(file: h5py.File) -> None:
        file.create_dataset("vast", shape=(2**40,), dtype=np.float64, chunks=(2**16,), compression="gzip")

    change(copy, RECORD, edit)
    reseal(copy)
    (problem,) = check(copy, regenerate=0)
    assert problem.startswith(f"{RECORD}: cannot be read: arrays of 8796093")
    assert problem.endswith("bytes given, expected at most 2147483648")


@pytest.mark.parametrize(
    ("place", "content"),
    [
        ("experiments.json", "[" * 100_000),
        ("experiments.json", "[]"),
        ("experiments.json", '{"data_set": 1, "hash": 1, "experiments": [{"arrays": {"a": {"b": "\\u001b[31m"}}}]}'),
        ("experiments.json", '{"data_set": "x", "hash": "x", "experiments": [1' + "0" * 10_000 + "]}"),
        ("spec.toml", "x = " + "[" * 100_000),
        ("spec.toml", "\x00"),
    ],
    ids=str,
)
def test_absurd_papers_are_problems_and_nothing_else(copy: Path, place: str, content: str) -> None:
    (copy / place).write_text(content, encoding="utf-8")
    reseal(copy)
    problems = check(copy, regenerate=1)
    assert any(problem.startswith(place) for problem in problems)
    assert all(problem.isprintable() and len(problem) < 700 for problem in problems)


def test_names_that_harm_a_terminal_and_files_beyond_measure_are_refused(copy: Path) -> None:
    (copy / "a\x1b[2Jb").write_text("x")
    with (copy / "vast.nc").open("wb") as stream:
        stream.truncate(2**36 + 1)
    problems = folder_files(copy).problems
    assert [problem[:12] for problem in problems] == ["'a\\x1b[2Jb':", "'vast.nc' ha"]


def test_a_data_set_without_any_record_does_not_pass(copy: Path) -> None:
    index = read_index(copy)
    for entry in index["experiments"]:
        entry |= {"failed": "it could not be run", "arrays": {}}
    index["hash"] = sha256().hexdigest()
    (copy / "experiments.json").write_text(json.dumps(index), encoding="utf-8")
    shutil.rmtree(copy / "data")
    shutil.rmtree(copy / "truth")
    reseal(copy)
    found = examine(copy)
    assert "no experiment has a record" in found.problems
    assert "0 of 3 experiments have a record" in found.notes


def test_a_reader_that_hangs_or_crashes_is_replaced(tiny: Path) -> None:
    with NetcdfReader(patience=10.0) as reader:
        assert "y" in reader.describe(tiny / RECORD)["arrays"]
        for number, says in ((signal.SIGSTOP, "did not end within 0.2 s"), (signal.SIGKILL, "crashed")):
            assert reader._process is not None and reader._process.pid is not None
            os.kill(reader._process.pid, number)
            reader._patience = 0.2
            with pytest.raises(ScenarioError, match=says):
                reader.describe(tiny / RECORD)
            reader._patience = 10.0
            assert "y" in reader.describe(tiny / RECORD)["arrays"]


def test_the_command_says_what_it_found(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dataset", "check", str(copy), "--regenerate", "0"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"{copy}: passed"
    (copy / "README.md").unlink()
    assert main(["dataset", "check", str(copy), "--regenerate", "0", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert (said["passed"], said["problems"]) == (False, ["README.md is missing"])
    assert main(["dataset", "check", str(copy / "nothing")]) == 2
    assert "expected that of a data set" in capsys.readouterr().err
