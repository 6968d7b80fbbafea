"""A build loses nothing: wherever it is interrupted, the next one resumes, and the bytes are the same."""

import errno
import json
import os
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

import pytest

from hmtb_twin import Plant
from hmtb_twin.files import atomic_write
from scenarios.datasets import build as build_module
from scenarios.datasets import chunk
from scenarios.datasets.build import build
from scenarios.datasets.chunk import BuiltExperiment, run_chunk
from scenarios.datasets.index import read_index
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import Executor
from scenarios.jobs.journal import Journal, read_fingerprint
from scenarios.jobs.progress import Progress
from tests.refusals import refused


class Words:
    """A stage that counts how often a piece is made."""

    name, bad, stopped = "words", "", False

    def __init__(self):
        self.made = []

    def pieces(self, plan):
        return ("one", "two", "three")

    def make(self, plan, folder, piece):
        assert read_index(folder)["data_set"] == plan.spec.label
        if self.stopped and piece == "three":
            raise KeyboardInterrupt
        self.made.append(piece)
        if piece == self.bad:
            raise ScenarioError(f"{piece} is no word")
        return {f"words/{piece}.txt": piece.encode()}


@pytest.fixture(scope="module", autouse=True)
def stage():
    """The stages of these tests: what is made beside the records has tests of its own."""
    stage = Words()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_module, "STAGES", (stage,))
        patch.setattr(build_module, "metadata_files", lambda folder, spec, index: {"README.md": index["hash"].encode()})
        patch.setattr(chunk, "arm_files", lambda plan, entry: {})
        yield stage


@pytest.fixture
def words(stage, monkeypatch):
    """The stage, nothing made yet."""
    monkeypatch.setattr(stage, "made", [])
    return stage


class Recorded(Executor[None]):
    """Returns experiments that were built before, and may be interrupted on the way."""

    def __init__(self, records, *, most=99, error=KeyboardInterrupt, backwards=False):
        super().__init__()
        self.records, self.most, self.error, self.backwards, self.asked = records, most, error, backwards, []

    def run(self, task, shared, batches, *, name=str, items="items"):
        numbers = [number for batch in batches for number in batch]
        for number in reversed(numbers) if self.backwards else numbers:
            if len(self.asked) == self.most:
                raise self.error
            self.asked.append(number)
            yield self.records[number]

    _room = _submit = _finished = _results = None

    def _close(self):
        pass


@dataclass(frozen=True)
class Case:
    """A spec, its experiments, built once for all tests, and every file of an undisturbed build by its path."""

    spec: DataSetSpec
    records: Mapping[int, BuiltExperiment]
    files: Mapping[str, bytes]

    def build(self, out, **options):
        return build(self.spec, out, **{"executor": Recorded(self.records), **options})

    def begin(self, out, most=2):
        """The folder of a build that was interrupted."""
        with pytest.raises(KeyboardInterrupt):
            self.build(out, executor=Recorded(self.records, most=most))
        return out / f"{self.spec.label}.unfinished"

    def resume(self, out):
        """Experiments that a build runs which ends with all files as they should be."""
        executor = Recorded(self.records)
        assert files(self.build(out, executor=executor).folder) == self.files
        return executor.asked


@pytest.fixture(scope="module")
def case(stage, tiny_spec, tmp_path_factory):
    plan = DataSetPlan(tiny_spec)
    records = {one.number: one for one in run_chunk(plan, range(len(plan)), threads=1)}
    out = tmp_path_factory.mktemp("undisturbed")
    return Case(tiny_spec, records, files(build(tiny_spec, out, executor=Recorded(records)).folder))


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_bytes_do_not_depend_on_threads_and_chunks(case, tmp_path):
    seen = []
    built = case.build(tmp_path, workers=2, rows=1, progress=seen.append)
    assert (len(built.records()), built.incomplete) == (3, {})
    assert files(built.folder) == case.files
    assert "journal.sqlite" not in case.files
    of_records = [one for one in seen if one.step == "records"]
    assert of_records[0].done == 0 and of_records[-1].done == of_records[-1].total == 3
    assert of_records[-1].seconds == of_records[-1].seconds_total == 12.0
    assert [one.seconds for one in of_records] == sorted(one.seconds for one in of_records)
    assert seen[-1] == Progress("finish", 1, 1)


def test_experiments_come_in_any_order_and_are_kept_when_a_build_ends_early(case, tmp_path):
    backwards = Recorded(case.records, backwards=True)
    assert files(case.build(tmp_path / "a", executor=backwards).folder) == case.files
    case.begin(tmp_path / "b")
    assert case.resume(tmp_path / "b") == [2]
    assert os.listdir(tmp_path / "b") == ["tiny-v1"]
    lost = Recorded(case.records, most=1, error=ScenarioError("no scheduler"))
    refused("no scheduler", case.build, tmp_path / "c", executor=lost)
    assert case.resume(tmp_path / "c") == [1, 2]


def damage(folder):
    path = folder / "data/train/binary-shoulder_yaw.nc"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def add_unknown_and_partial(folder):
    (folder / "data/test").mkdir()
    (folder / "data/test/noise.nc").write_bytes(b"another")
    (folder / "data/train/binary-elbow_pitch.nc.partial").write_bytes(b"half")
    (folder / "experiments.json.partial").write_bytes(b"half")


def keep_only_the_spec(folder):
    for path in folder.iterdir():
        if path.name != "spec.toml":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.mark.parametrize(
    ("harm", "again"),
    [
        (damage, [0, 2]),
        (lambda folder: (folder / "truth/signals/binary-shoulder_yaw.nc").unlink(), [0, 2]),
        (add_unknown_and_partial, [2]),
        (lambda folder: (folder / "journal.sqlite").unlink(), [0, 1, 2]),
        (keep_only_the_spec, [0, 1, 2]),
    ],
)
def test_what_a_crash_leaves_is_mended(case, tmp_path, harm, again):
    harm(case.begin(tmp_path))
    assert case.resume(tmp_path) == again


@pytest.mark.parametrize("name", ["write_index", "_write_checksums", "read_index", "sync"])
def test_an_end_that_is_cut_short_is_gone_through_again(case, tmp_path, monkeypatch, name):
    with monkeypatch.context() as patch:
        patch.setattr(build_module, name, lambda *_: sys.exit())
        with pytest.raises(SystemExit):
            case.build(tmp_path)
    rest = Recorded(case.records)
    built = case.build(tmp_path, executor=rest)
    assert rest.asked == []
    assert (built.folder, built.hash) == (tmp_path / "tiny-v1", read_index(built.folder)["hash"])
    assert files(built.folder) == case.files
    # Killed between the last two steps: renaming the folder and removing the journal.
    (built.folder / "journal.sqlite").touch()
    assert case.build(tmp_path).hash == built.hash
    assert files(built.folder) == case.files


def test_a_piece_of_a_stage_is_made_once(case, tmp_path, words, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(words, "stopped", True)
        with pytest.raises(KeyboardInterrupt):
            case.build(tmp_path)
    # The disk has spoilt one meanwhile; it is noted last then, which the manifest must not show at the end.
    (tmp_path / "tiny-v1.unfinished" / "words" / "one.txt").write_bytes(b"One")
    case.resume(tmp_path)
    assert words.made == ["one", "two", "one", "three"]


def test_what_fails_is_noted_and_does_not_stop_the_rest(case, tmp_path, words, monkeypatch):
    monkeypatch.setattr(words, "bad", "two")
    broken = {**case.records, 1: BuiltExperiment(1, case.records[1].about, failed="the drives are too weak")}
    with pytest.raises(KeyboardInterrupt):
        case.build(tmp_path, executor=Recorded(broken, most=2))
    rest = Recorded(broken)
    built = case.build(tmp_path, executor=rest)
    assert rest.asked == [2]
    name = DataSetPlan(case.spec)[1].name
    assert built.incomplete == {name: "the drives are too weak", "words: two": "two is no word"}
    assert len(built.records()) == 2
    entry = read_index(built.folder)["experiments"][1]
    assert (entry["name"], entry["failed"], entry["arrays"]) == (name, "the drives are too weak", {})
    assert not (built.folder / entry["file"]).exists()


def test_an_experiment_or_a_truth_that_cannot_be_computed_is_noted(case, monkeypatch):
    def unknown_truth(plan, entry):
        raise ScenarioError(f"nothing is true of {entry.arm}")

    short = tuple(replace(block, duration=0.2) for block in case.spec.records)
    plan = DataSetPlan(replace(case.spec, window=0, records=short))
    entries = list(plan)
    entries[2] = replace(entries[2], experiment=replace(entries[2].experiment, plant=Plant(supply_pressure=5.0)))
    monkeypatch.setattr(DataSetPlan, "__getitem__", lambda _, number: entries[number])
    monkeypatch.setattr(chunk, "arm_files", unknown_truth)
    results = list(run_chunk(plan, range(3), threads=1))
    assert [bool(one.failed) for one in results] == [False, False, True]
    assert "the drives cannot hold the arm" in results[2].failed
    assert [one.missing for one in results] == [{"truth/arms/arm-0.nc": "nothing is true of arm-0"}, {}, {}]
    assert [len(one.files) for one in results] == [2, 2, 0]


@pytest.mark.parametrize("call", (0, 1, 4, 9, 14, 21))
def test_a_full_disk_is_one_line_and_costs_nothing(case, tmp_path, monkeypatch, call):
    calls = iter(range(1000))

    def full(descriptor):
        if next(calls) >= call:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(atomic_write.os, "fsync", full)
        refused(f"{tmp_path}.*: {os.strerror(errno.ENOSPC)}", case.build, tmp_path)
    assert not (tmp_path / "tiny-v1").exists()
    assert not list(tmp_path.rglob("*.partial"))
    case.resume(tmp_path)


def test_two_builders_do_not_share_a_folder(case, tmp_path):
    path = case.begin(tmp_path) / "journal.sqlite"
    with Journal(path, read_fingerprint(path)):
        refused("another process is at work here", case.build, tmp_path)
    case.resume(tmp_path)


def test_a_build_begun_with_other_spec_or_software_is_refused(case, tmp_path, monkeypatch):
    folder = case.begin(tmp_path)
    before = files(folder)
    for spec, says in (
        (replace(case.spec, seed=8), "seed 7 then, 8 now"),
        (replace(case.spec, records=case.spec.records[::-1]), "records differs"),
    ):
        refused(says, build, spec, tmp_path, executor=Recorded(case.records))
    with monkeypatch.context() as patch:
        patch.setattr(build_module, "versions", lambda: {**json.loads(before["build.json"])["versions"], "numpy": "1"})
        patch.setattr(build_module, "fingerprint", lambda: "0" * 64)
        refused(r"numpy \S+ then, 1 now; source \w+ then, 0000", case.build, tmp_path)
    assert {**files(folder), "journal.sqlite": b""} == {**before, "journal.sqlite": b""}
    (folder / "journal.sqlite").write_bytes(b"SQLite format 3" + bytes(1000))
    refused(r"journal\.sqlite", case.build, tmp_path)


@pytest.mark.parametrize(
    ("place", "out", "says"),
    [
        ("tiny-v1", "", "already there"),
        ("tiny-v1/SHA256SUMS", "", "not what this build would make: a version is never overwritten"),
        ("tiny-v1.unfinished", "", r"tiny-v1\.unfinished: a file of that name is there"),
        ("tiny-v1.unfinished/letter.txt", "", r"holds no build but letter\.txt"),
        ("tiny-v1", "tiny-v1", "tiny-v1: a file of that name is there"),
    ],
)
def test_nothing_that_is_there_is_overwritten(case, tmp_path, place, out, says):
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).write_text("mine")
    refused(says, case.build, tmp_path / out)
    assert files(tmp_path) == {place: b"mine"}


def test_a_folder_that_cannot_be_written_is_one_line(case, tmp_path):
    tmp_path.chmod(0o500)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # nobody; root writes everywhere
    try:
        refused(r"^cannot write or read \S+: Permission denied$", case.build, tmp_path)
    finally:
        os.seteuid(user)
        tmp_path.chmod(0o700)


def test_a_set_without_any_record_is_not_published_and_can_be_tried_again(case, tmp_path):
    broken = {
        n: BuiltExperiment(n, made.about, failed=f"{made.about['name']}: too weak") for n, made in case.records.items()
    }
    for _ in range(2):
        executor = Recorded(broken)
        refused("none of 3 experiments has a record, .*; 3 of them: too weak", case.build, tmp_path, executor=executor)
    assert os.listdir(tmp_path) == ["tiny-v1.unfinished"]
    case.resume(tmp_path)


def test_wrong_options_are_refused_before_anything_is_made(case, tmp_path):
    refused("workers = 1025 given, expected 1 to 1024", case.build, tmp_path, workers=1025)
    refused("rows = 0 given", case.build, tmp_path, rows=0)
    assert not list(tmp_path.iterdir())


def test_what_stands_in_the_way_and_files_of_others_are_named(case, tmp_path):
    folder = case.begin(tmp_path)
    in_the_way = folder / "data/test/noise.nc"
    in_the_way.mkdir(parents=True)
    refused(r"cannot write \S+/data/test/noise\.nc: it is a folder", case.build, tmp_path)
    in_the_way.rmdir()
    strays = [folder / "letter.txt", folder / "data/train/solution.nc"]
    for stray in strays:
        stray.write_text("mine")
    refused(r"'data/train/solution\.nc', 'letter\.txt', which no part of the build", case.build, tmp_path)
    for stray in strays:
        stray.unlink()
    case.resume(tmp_path)


def test_an_executor_that_leaves_experiments_out_is_refused(case, tmp_path, monkeypatch):
    monkeypatch.setattr(Recorded, "run", lambda *_, **__: iter(()))
    refused("the executor returned 0 of 3 experiments", case.build, tmp_path)
