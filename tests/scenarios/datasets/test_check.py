"""A check finds every wrong byte, reports which of them matter, and withstands hostile files."""

import json
import os
import random
import re
import shutil
from hashlib import sha256

import h5py
import numpy as np
import pytest
import xarray as xr

from hmtb_twin.files.netcdf import read_netcdf
from scenarios.datasets import check as check_module
from scenarios.datasets.check import examine, same_software
from scenarios.datasets.experiment_file import record_attributes
from scenarios.datasets.folder_check import list_files
from scenarios.datasets.index import hash_of_all, read_index, seal
from scenarios.datasets.record_check import record_problems

RECORD = "data/test/noise.nc"


def change(folder, place, edit):
    with h5py.File(folder / place, "a") as file:
        edit(file)


def write_index(folder, index):
    (folder / "experiments.json").write_text(json.dumps(index), encoding="utf-8")
    seal(folder)


def forge(folder, by):
    """Change the outputs of every record, and every hash that would tell."""
    index = read_index(folder)
    for entry in index["experiments"]:
        change(folder, entry["file"], lambda file: file["y"].write_direct(file["y"][...] + by))
        entry["arrays"][entry["file"]] = read_netcdf(folder / entry["file"]).array_hashes()
    write_index(folder, index | {"hash": hash_of_all(entry["arrays"] for entry in index["experiments"])})


def check(folder, *, regenerate=0):
    return examine(folder, regenerate=regenerate, workers=1).problems


@pytest.mark.slow
def test_what_has_been_built_passes_and_is_simulated_again_to_the_bit(tiny):
    result = examine(tiny, regenerate=2, seed=3, workers=1)
    notes = ("3 of 3 experiments have a record", "2 experiments simulated again with the same software: the same bits")
    assert (result.problems, result.notes) == ((), notes)


@pytest.mark.slow
def test_a_flipped_byte_is_found_in_every_file(copy):
    generator = random.Random(1)
    places = [p.relative_to(copy).as_posix() for p in copy.rglob("*") if p.is_file() and p.name != "SHA256SUMS"]
    for place in places:
        content = bytearray((copy / place).read_bytes())
        content[generator.randrange(len(content))] ^= 1 << generator.randrange(8)
        (copy / place).write_bytes(content)
    problems = check(copy)
    for place in places:
        assert any(problem.startswith(f"{place}: its hash is not that of") for problem in problems), place


def test_every_flipped_byte_of_the_checksums_and_every_cut_is_found(copy):
    path = copy / "SHA256SUMS"
    content = path.read_bytes()
    good = list_files(copy)
    assert not good.problems
    generator = random.Random(2)
    # Every byte of two lines, and others anywhere.
    for position in (*range(200), *(generator.randrange(len(content)) for _ in range(100))):
        damaged = bytearray(content)
        damaged[position] ^= 1 << generator.randrange(8)
        path.write_bytes(damaged)
        listed = list_files(copy)
        # Either the line is none, or a file is missing and another unknown, or a file has not this hash.
        assert listed.problems or listed.sums != good.sums, position
    for kept in (0.0, 0.3, 0.99):
        path.write_bytes(content[: int(kept * len(content))])
        assert list_files(copy).problems


@pytest.mark.slow
def test_a_record_packed_anew_by_another_tool_has_its_arrays_still(copy):
    with xr.open_dataset(copy / RECORD, engine="h5netcdf") as record:
        loaded = record.load()
    loaded.to_netcdf(copy / RECORD, engine="h5netcdf")
    by_hash, by_array = check(copy)
    assert by_hash == f"{RECORD}: its hash is not that of SHA256SUMS"
    assert by_array.startswith(f"{RECORD}: its arrays are those of the index: the file was written anew")


def test_files_missing_and_files_beside_are_found(copy):
    (copy / RECORD).unlink()
    (copy / "data" / "train" / ".hidden").write_text("x")
    assert check(copy) == (f"{RECORD} is missing", "data/train/.hidden is not listed in SHA256SUMS")
    (copy / "SHA256SUMS").unlink()
    assert "SHA256SUMS is missing: no file can be checked against it" in check(copy)


def attribute(name, value, variable="/"):
    return lambda file: file[variable].attrs.__setitem__(name, value)


METADATA = [
    (lambda file: file["sample"].__setitem__(3, 4), "sample does not count 0, 1, 2, ... in whole numbers"),
    (lambda file: file.__delitem__("y"), "y has the dims none, expected ['sample', 'output']"),
    (attribute("part", "train"), "attribute part is 'train', expected 'test'"),
    (attribute("sampling_time_denominator", 49), "attribute sampling_time_denominator is 49, expected 50"),
    (attribute("units", "deg", "y"), "y has the units deg, expected rad"),
    (attribute("units", "", "force"), "force has no unit"),
    (attribute("role", "truth", "torque"), "torque is truth, which belongs into files of its own"),
]


@pytest.mark.parametrize(("edit", "message"), METADATA)
def test_wrong_metadata_is_found(copy, tiny_spec, edit, message):
    attributes = record_attributes(tiny_spec, read_index(copy)["experiments"][2])
    for samples, count in ((200, 0), (199, 1)):
        problems = record_problems(read_netcdf(copy / RECORD), attributes, ["elbow_pitch"], samples, None)
        assert len(list(problems)) == count
    change(copy, RECORD, edit)
    (problem,) = record_problems(read_netcdf(copy / RECORD), attributes, ["elbow_pitch"], 200, None)
    assert problem.startswith(message)


def test_wrong_numbers_and_metadata_are_found_under_right_checksums(copy):
    change(copy, RECORD, lambda file: file["y"].write_direct(np.nextafter(file["y"][...], 9.0)))
    change(copy, RECORD, attribute("arm", "another"))
    seal(copy)
    wrong = (f"{RECORD}: array y differs from the index", f"{RECORD}: attribute arm is 'another', expected 'arm-0'")
    assert check(copy) == wrong


@pytest.mark.slow
def test_the_truth_is_compared_without_the_coordinates_of_its_state(tiny):
    arm = next((tiny / "truth/arms").iterdir())
    known = {name: one.values for name, one in read_netcdf(arm).variables.items()}
    turned, T = dict(known), np.random.default_rng(5).standard_normal(known["A"].shape)
    turned |= {"A": T @ known["A"] @ np.linalg.inv(T), "C": known["C"] @ np.linalg.inv(T)}
    turned |= {name: T @ known[name] for name in ("B", "K", "drive_noise") if name in known}
    before, after = check_module._with_responses(known), check_module._with_responses(turned)
    responses = [name for name in before if name.startswith("response to ") and "_" not in name]
    assert "response to B" in responses
    for name in responses:
        assert np.allclose(before[name], after[name], rtol=0.0, atol=1e-9 * np.abs(before[name]).max())
    other = check_module._with_responses({**known, "B": 1.001 * known["B"]})
    assert check_module._compare("B", "response to B", before["response to B"], other["response to B"], same=False)


@pytest.mark.slow
def test_an_index_that_does_not_give_its_own_hash_or_the_spec_is_found(copy):
    index = read_index(copy)
    write_index(copy, {**index, "hash": "0" * 64})
    assert any("its hash is '000" in problem for problem in check(copy))
    index["experiments"][0]["part"] = "test"
    write_index(copy, index)
    assert "experiments.json: binary-shoulder_yaw has part = 'test', spec.toml asks for 'train'" in check(copy)
    write_index(copy, {**index, "experiments": index["experiments"][1:]})
    assert "experiments.json has 2 experiments, spec.toml asks for 3" in check(copy)


@pytest.mark.slow
def test_a_forgery_with_right_hashes_is_found_by_simulation_alone(copy):
    forge(copy, 1e-6)
    assert check(copy) == ()
    (problem,) = check(copy, regenerate=1)
    assert " differs by up to 1e-06 from what the same software" in problem


@pytest.mark.slow
@pytest.mark.parametrize(("by", "passes"), [(1e-12, True), (1e-3, False)])
def test_other_versions_may_differ_within_the_tolerance(copy, monkeypatch, by, passes):
    forge(copy, by)
    monkeypatch.setattr(check_module, "same_software", lambda folder: False)
    result = examine(copy, regenerate=1, workers=1)
    assert result.passed is passes
    assert [("within 1e-09 of the largest magnitude" in note) for note in result.notes][1:] == [True] * passes


def test_software_is_the_same_only_with_the_same_source_and_versions(copy):
    assert same_software(copy)
    record = json.loads((copy / "build.json").read_text(encoding="utf-8"))
    for wrong in ({"source": "0"}, {"versions": {**record["versions"], "mujoco": "1.0"}}, {"versions": None}):
        (copy / "build.json").write_text(json.dumps({**record, **wrong}), encoding="utf-8")
        assert not same_software(copy)


def test_truth_and_spec_kept_apart_are_no_fault_but_are_noted(copy):
    shutil.rmtree(copy / "truth")
    (copy / "spec.toml").unlink()
    seal(copy)
    result = examine(copy)
    assert result.problems == ()
    assert any(note.startswith("spec.toml is not in this copy") for note in result.notes)
    assert any(note.startswith("the truth in 4 files is not in this copy") for note in result.notes)
    assert "no experiment was simulated again: there is no spec to do it from" in result.notes


def test_no_path_leads_out_of_the_folder(copy):
    # Whoever opens this file waits for ever.
    os.mkfifo(copy.parent / "outside")
    os.mkfifo(copy / "inside")
    (copy / "link").symlink_to(copy.parent / "outside")
    (copy / "folder").symlink_to(copy.parent)
    with (copy / "SHA256SUMS").open("a", encoding="utf-8") as stream:
        for place in ("../outside", "/etc/passwd", "data/../../outside", "link", "inside", "folder/outside"):
            stream.write(f"{'0' * 64}  {place}\n")
    problems = check(copy)
    assert sum("leads out of the folder" in problem for problem in problems) == 3
    assert {"'link' is a link; expected files alone", "'folder' is a link; expected files alone"} <= set(problems)
    assert {"'inside' is no ordinary file; expected files alone", "folder/outside is missing"} <= set(problems)


@pytest.mark.slow
def test_a_record_that_links_to_another_file_or_claims_to_fill_the_memory_is_refused(copy):
    def link(file):
        del file["status"]
        file["status"] = h5py.ExternalLink("/etc/passwd", "x")

    def fill(file):
        del file["status"]
        file.create_dataset("vast", shape=(2**40,), dtype=np.float64, chunks=(2**16,), compression="gzip")

    for edit, says in (
        (link, "'status' is a link; expected arrays that stand in the file itself"),
        (fill, r"arrays of 8796093\d+ bytes given, expected at most 2147483648"),
    ):
        change(copy, RECORD, edit)
        seal(copy)
        (problem,) = check(copy)
        assert re.fullmatch(f"{RECORD}: cannot be read: {says}", problem)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "content"),
    [
        ("experiments.json", "[" * 100_000),
        ("experiments.json", "[]"),
        ("experiments.json", '{"data_set": 1, "hash": 1, "experiments": [{"arrays": {"a": {"b": "\\u001b[31m"}}}]}'),
        ("spec.toml", "x = " + "[" * 100_000),
        ("spec.toml", "\x00"),
    ],
    ids=str,
)
def test_absurd_index_and_spec_are_problems_and_nothing_else(copy, place, content):
    (copy / place).write_text(content, encoding="utf-8")
    seal(copy)
    problems = check(copy, regenerate=1)
    assert any(problem.startswith(place) for problem in problems)
    assert all(problem.isprintable() and len(problem) < 700 for problem in problems)


def test_names_that_harm_a_terminal_and_files_beyond_measure_are_refused(copy):
    (copy / "a\x1b[2Jb").write_text("x")
    with (copy / "vast.nc").open("wb") as stream:
        stream.truncate(2**36 + 1)
    problems = list_files(copy).problems
    assert [problem[:12] for problem in problems] == ["'a\\x1b[2Jb':", "'vast.nc' ha"]


def test_a_data_set_without_any_record_does_not_pass(copy):
    index = read_index(copy)
    for entry in index["experiments"]:
        entry |= {"failed": "it could not be run", "arrays": {}}
    shutil.rmtree(copy / "data")
    shutil.rmtree(copy / "truth")
    write_index(copy, index | {"hash": sha256().hexdigest()})
    result = examine(copy)
    assert "no experiment has a record" in result.problems
    assert "0 of 3 experiments have a record" in result.notes


@pytest.mark.slow
def test_the_command_prints_the_problems(copy, printed, result, complaint):
    assert printed("dataset", "check", copy, "--regenerate", "0").splitlines()[-1] == f"{copy}: passed"
    (copy / "README.md").unlink()
    checked = result("dataset", "check", copy, "--regenerate", "0", code=1)
    assert (checked["passed"], checked["problems"]) == (False, ["README.md is missing"])
    assert "expected that of a data set" in complaint("dataset", "check", copy / "nothing")
