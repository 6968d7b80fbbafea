"""A build loses nothing: wherever it is interrupted, the next one resumes, and the bytes are the same."""

import errno
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from hmtb_twin import Plant, TwinError
from hmtb_twin.hydraulics import valve_equations
from scenarios.datasets import build as build_module
from scenarios.datasets import chunk, finish
from scenarios.datasets.build import BuiltDataSet, build
from scenarios.datasets.chunk import BuiltExperiment, run_chunk
from scenarios.datasets.index import read_index
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.files import atomic_write
from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import Executor
from scenarios.jobs.journal import Journal, read_fingerprint
from scenarios.jobs.progress import Progress


class Words:
    """A stage that counts how often a piece is made."""

    name = "words"

    def __init__(self, spoilt: str = "") -> None:
        self.made: list[str] = []
        self.spoilt = spoilt

    def pieces(self, plan: DataSetPlan) -> tuple[str, ...]:
        return ("one", "two", "three")

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        assert read_index(folder)["data_set"] == plan.spec.label
        self.made.append(piece)
        if piece == self.spoilt:
            raise ScenarioError(f"{piece} is no word")
        return {f"words/{piece}.txt": piece.encode()}


@pytest.fixture(scope="module", autouse=True)
def stage() -> Iterator[Words]:
    """The stages of these tests: what is made beside the records has tests of its own."""
    stage = Words()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(finish, "STAGES", (stage,))
        patch.setattr(finish, "METADATA", (lambda folder, spec, index: {"README.md": index["hash"].encode()},))
        patch.setattr(chunk, "ARM_TRUTH", ())
        yield stage


@pytest.fixture
def words(stage: Words, monkeypatch: pytest.MonkeyPatch) -> Words:
    """The stage, nothing made yet."""
    monkeypatch.setattr(stage, "made", [])
    return stage


class Recorded(Executor[None]):
    """Returns experiments that were built before, and may be interrupted on the way."""

    def __init__(
        self,
        records: Mapping[int, BuiltExperiment],
        *,
        most: int = 99,
        error: BaseException | None = None,
        backwards: bool = False,
    ) -> None:
        super().__init__()
        self.records, self.most, self.error, self.backwards = records, most, error, backwards
        self.asked: list[int] = []

    def run(self, task, shared, batches, *, name=str, items="items") -> Iterator[BuiltExperiment]:  # type: ignore[no-untyped-def]
        numbers = [number for batch in batches for number in batch]
        for number in reversed(numbers) if self.backwards else numbers:
            if len(self.asked) == self.most:
                raise self.error or KeyboardInterrupt
            self.asked.append(number)
            yield self.records[number]

    _room = _submit = _finished = _results = None  # type: ignore[assignment]

    def _close(self) -> None:
        pass


@dataclass(frozen=True)
class Case:
    """A spec, its experiments, built once for all tests, and every file of an undisturbed build by its path."""

    spec: DataSetSpec
    records: Mapping[int, BuiltExperiment]
    files: Mapping[str, bytes]

    def build(self, out: Path, **options: Any) -> BuiltDataSet:
        return build(self.spec, out, **{"executor": Recorded(self.records), **options})

    def begin(self, out: Path, most: int = 2) -> Path:
        """The folder of a build that was interrupted."""
        with pytest.raises(KeyboardInterrupt):
            self.build(out, executor=Recorded(self.records, most=most))
        return out / f"{self.spec.label}.unfinished"

    def resume(self, out: Path) -> list[int]:
        """Experiments that a build runs which ends with all files as they should be."""
        executor = Recorded(self.records)
        assert files(self.build(out, executor=executor).path) == self.files
        return executor.asked


@pytest.fixture(scope="module")
def case(stage: Words, tiny_spec: DataSetSpec, tmp_path_factory: pytest.TempPathFactory) -> Case:
    plan = DataSetPlan(tiny_spec)
    records = {one.number: one for one in run_chunk(plan, range(len(plan)), threads=1)}
    out = tmp_path_factory.mktemp("undisturbed")
    return Case(tiny_spec, records, files(build(tiny_spec, out, executor=Recorded(records)).path))


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_bytes_do_not_depend_on_threads_and_chunks(case: Case, tmp_path: Path) -> None:
    seen: list[Progress] = []
    built = case.build(tmp_path, workers=2, rows=1, progress=seen.append)
    assert (built.experiments, built.failed) == (3, {})
    assert files(built.path) == case.files
    assert not {"journal.sqlite"} & set(case.files)
    of_records = [one for one in seen if one.step == "records"]
    assert of_records[0].done == 0
    assert of_records[-1].done == of_records[-1].total == 3
    assert of_records[-1].seconds == of_records[-1].seconds_total == 12.0
    assert [one.seconds for one in of_records] == sorted(one.seconds for one in of_records)
    assert seen[-1] == Progress("finish", 1, 1)


def test_the_index_and_the_checksums_hold_every_file(case: Case) -> None:
    sums = dict(line.split("  ")[::-1] for line in case.files["SHA256SUMS"].decode().splitlines())
    assert set(sums) == set(case.files) - {"SHA256SUMS"}
    index = json.loads(case.files["experiments.json"])
    assert [entry["name"] for entry in index["experiments"]] == [entry.name for entry in DataSetPlan(case.spec)]
    for number, entry in enumerate(index["experiments"]):
        assert entry["arrays"] == case.records[number].arrays
        assert entry["file"] in case.files


def test_experiments_may_come_in_any_order(case: Case, tmp_path: Path) -> None:
    backwards = Recorded(case.records, backwards=True)
    assert files(case.build(tmp_path, executor=backwards).path) == case.files


def test_what_is_done_when_interrupted_is_not_done_again(case: Case, tmp_path: Path) -> None:
    case.begin(tmp_path)
    assert case.resume(tmp_path) == [2]
    assert os.listdir(tmp_path) == ["tiny-v1"]


def test_what_is_done_when_an_executor_fails_is_kept(case: Case, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no scheduler"):
        case.build(tmp_path, executor=Recorded(case.records, most=1, error=ScenarioError("no scheduler")))
    assert case.resume(tmp_path) == [1, 2]


def damaged(folder: Path) -> None:
    path = folder / "data" / "train" / "binary-shoulder_yaw.nc"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def missing(folder: Path) -> None:
    (folder / "truth" / "signals" / "binary-shoulder_yaw.nc").unlink()


def unnoted(folder: Path) -> None:
    (folder / "data" / "test").mkdir()
    (folder / "data" / "test" / "noise.nc").write_bytes(b"another")


def partial(folder: Path) -> None:
    (folder / "data" / "train" / "binary-elbow_pitch.nc.partial").write_bytes(b"half")
    (folder / "experiments.json.partial").write_bytes(b"half")


def no_journal(folder: Path) -> None:
    (folder / "journal.sqlite").unlink()


def only_the_spec(folder: Path) -> None:
    for path in folder.iterdir():
        if path.name != "spec.toml":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.mark.parametrize(
    ("harm", "again"),
    [
        (damaged, [0, 2]),
        (missing, [0, 2]),
        (unnoted, [2]),
        (partial, [2]),
        (no_journal, [0, 1, 2]),
        (only_the_spec, [0, 1, 2]),
    ],
)
def test_what_a_crash_leaves_is_mended(
    case: Case, tmp_path: Path, harm: Callable[[Path], None], again: list[int]
) -> None:
    harm(case.begin(tmp_path))
    assert case.resume(tmp_path) == again


@pytest.mark.parametrize("name", ["write_index", "_write_checksums", "read_index", "sync_folder"])
def test_an_end_that_is_cut_short_is_gone_through_again(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def killed(*_: object) -> None:
        raise SystemExit

    with monkeypatch.context() as patch:
        patch.setattr(finish, name, killed)
        with pytest.raises(SystemExit):
            case.build(tmp_path)
    rest = Recorded(case.records)
    built = case.build(tmp_path, executor=rest)
    assert rest.asked == []
    assert built == BuiltDataSet(tmp_path / "tiny-v1", 3, {}, read_index(built.path)["hash"])
    assert files(built.path) == case.files


def test_a_piece_of_a_stage_is_made_once(
    case: Case, tmp_path: Path, words: Words, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = words.make

    def stopped(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        if piece == "three":
            raise KeyboardInterrupt
        return make(plan, folder, piece)

    with monkeypatch.context() as patch:
        patch.setattr(words, "make", stopped)
        with pytest.raises(KeyboardInterrupt):
            case.build(tmp_path)
    # The disk has spoilt one meanwhile; it is noted last then, which the manifest must not show at the end.
    (tmp_path / "tiny-v1.unfinished" / "words" / "one.txt").write_bytes(b"One")
    case.resume(tmp_path)
    assert words.made == ["one", "two", "one", "three"]


def test_what_fails_is_noted_and_does_not_stop_the_rest(
    case: Case, tmp_path: Path, words: Words, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(words, "spoilt", "two")
    broken = {**case.records, 1: BuiltExperiment(1, case.records[1].about, failed="the drives are too weak")}
    with pytest.raises(KeyboardInterrupt):
        case.build(tmp_path, executor=Recorded(broken, most=2))
    rest = Recorded(broken)
    built = case.build(tmp_path, executor=rest)
    assert rest.asked == [2]
    name = DataSetPlan(case.spec)[1].name
    assert built.failed == {name: "the drives are too weak", "words: two": "two is no word"}
    assert built.experiments == 2
    entry = read_index(built.path)["experiments"][1]
    assert (entry["name"], entry["failed"], entry["arrays"]) == (name, "the drives are too weak", {})
    assert not (built.path / entry["file"]).exists()


def test_an_experiment_that_cannot_be_run_and_a_truth_that_cannot_be_told_are_noted(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    def untold(plan: DataSetPlan, entry: PlannedExperiment) -> Mapping[str, object]:
        raise ScenarioError(f"nothing is true of {entry.arm}")

    short = tuple(replace(block, duration=0.2) for block in case.spec.records)
    plan = DataSetPlan(replace(case.spec, window=0, records=short))
    entries = list(plan)
    weak = replace(entries[2].experiment, plant=Plant(supply_pressure=6.0))
    entries[2] = replace(entries[2], experiment=weak)
    monkeypatch.setattr(DataSetPlan, "__getitem__", lambda _, number: entries[number])
    monkeypatch.setattr(chunk, "ARM_TRUTH", (untold,))
    found = list(run_chunk(plan, range(3), threads=1))
    assert [bool(made.failed) for made in found] == [False, False, True]
    assert "the drives cannot hold the arm" in found[2].failed
    assert [made.missing for made in found] == [{"truth/arms/arm-0.nc": "nothing is true of arm-0"}, {}, {}]
    assert [len(made.files) for made in found] == [2, 2, 0]


@pytest.mark.parametrize("call", (0, 1, 4, 9, 14, 21))
def test_a_full_disk_is_one_line_and_costs_nothing(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int
) -> None:
    calls = iter(range(1000))

    def full(descriptor: int) -> None:
        if next(calls) >= call:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(atomic_write.os, "fsync", full)
        with pytest.raises(ScenarioError, match=f"{tmp_path}.*: {os.strerror(errno.ENOSPC)}"):
            case.build(tmp_path)
    assert not (tmp_path / "tiny-v1").exists()
    assert not list(tmp_path.rglob("*.partial"))
    case.resume(tmp_path)


def test_a_build_killed_before_it_removed_its_journal_is_done(case: Case, tmp_path: Path) -> None:
    built = case.build(tmp_path)
    (built.path / "journal.sqlite").touch()
    assert case.build(tmp_path) == built
    assert files(built.path) == case.files


def test_two_builders_do_not_share_a_folder(case: Case, tmp_path: Path) -> None:
    path = case.begin(tmp_path) / "journal.sqlite"
    fingerprint = read_fingerprint(path)
    assert fingerprint is not None
    with Journal(path, fingerprint), pytest.raises(ScenarioError, match="another process is at work here"):
        case.build(tmp_path)
    case.resume(tmp_path)


def test_a_build_begun_with_other_spec_or_software_is_refused(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = case.begin(tmp_path)
    before = files(folder)
    for spec, says in (
        (replace(case.spec, seed=8), "seed 7 then, 8 now"),
        (replace(case.spec, records=case.spec.records[::-1]), "records differs"),
    ):
        with pytest.raises(ScenarioError, match=says):
            build(spec, tmp_path, executor=Recorded(case.records))
    with monkeypatch.context() as patch:
        patch.setattr(build_module, "versions", lambda: {**json.loads(before["build.json"])["versions"], "numpy": "1"})
        patch.setattr(build_module, "fingerprint", lambda: "0" * 64)
        with pytest.raises(ScenarioError, match=r"numpy \S+ then, 1 now; source \w+ then, 0000"):
            case.build(tmp_path)
    assert {**files(folder), "journal.sqlite": b""} == {**before, "journal.sqlite": b""}
    (folder / "journal.sqlite").write_bytes(b"SQLite format 3" + bytes(1000))
    with pytest.raises(ScenarioError, match=r"journal\.sqlite"):
        case.build(tmp_path)


def test_nothing_that_is_there_is_overwritten(case: Case, tmp_path: Path) -> None:
    def refused(out: Path, says: str) -> None:
        before = files(tmp_path)
        with pytest.raises(ScenarioError, match=says):
            case.build(out)
        assert files(tmp_path) == before

    done = case.build(tmp_path / "a")
    refused(done.path.parent, "already there: a version is never overwritten")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "tiny-v1").write_text("mine")
    refused(tmp_path / "b", "already there")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "tiny-v1.unfinished").write_text("mine")
    refused(tmp_path / "c", r"tiny-v1\.unfinished: a file of that name is there")
    (tmp_path / "d" / "tiny-v1.unfinished").mkdir(parents=True)
    (tmp_path / "d" / "tiny-v1.unfinished" / "letter.txt").write_text("mine")
    refused(tmp_path / "d", r"holds no build but letter\.txt")
    refused(tmp_path / "b" / "tiny-v1", "tiny-v1: a file of that name is there")


def test_a_folder_that_cannot_be_written_is_one_line(case: Case, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)  # nobody; root writes everywhere
    try:
        with pytest.raises(ScenarioError, match=r"^cannot write or read \S+: Permission denied$"):
            case.build(tmp_path)
    finally:
        os.seteuid(user)
        tmp_path.chmod(0o700)


def test_a_set_without_any_record_is_not_published_and_can_be_tried_again(case: Case, tmp_path: Path) -> None:
    broken = {
        n: BuiltExperiment(n, made.about, failed=f"{made.about['name']}: too weak") for n, made in case.records.items()
    }
    for _ in range(2):
        with pytest.raises(
            ScenarioError, match=r"none of 3 experiments has a record, .*; 3 of them: too weak\. The same"
        ):
            case.build(tmp_path, executor=Recorded(broken))
    assert os.listdir(tmp_path) == ["tiny-v1.unfinished"]
    case.resume(tmp_path)


def test_what_a_spec_needs_is_looked_for_before_anything_is_made(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(valve_equations, "COMPILER", False)
    first, *others = case.spec.records
    with pytest.raises(TwinError, match="Numba, which compiles its equations"):
        build(replace(case.spec, records=(replace(first, actuators=("linear", "orifice")), *others)), tmp_path)
    with pytest.raises(ScenarioError, match="workers = 1025 given, expected 1 to 1024"):
        case.build(tmp_path, workers=1025)
    assert not list(tmp_path.iterdir())


def test_a_folder_where_a_file_should_be_is_named(case: Case, tmp_path: Path) -> None:
    in_the_way = case.begin(tmp_path) / "data" / "test" / "noise.nc"
    in_the_way.mkdir(parents=True)
    with pytest.raises(
        ScenarioError, match=r"cannot write \S+/data/test/noise\.nc: it is a folder; expected a file or nothing there"
    ):
        case.build(tmp_path)
    in_the_way.rmdir()
    case.resume(tmp_path)


def test_files_of_nobody_are_not_published(case: Case, tmp_path: Path) -> None:
    folder = case.begin(tmp_path)
    strays = [folder / "letter.txt", folder / "data" / "train" / "solution.nc"]
    for stray in strays:
        stray.write_text("mine")
    with pytest.raises(ScenarioError, match=r"'data/train/solution\.nc', 'letter\.txt', which no part of the build"):
        case.build(tmp_path)
    for stray in strays:
        stray.unlink()
    case.resume(tmp_path)


def test_an_executor_that_leaves_experiments_out_is_found_out(case: Case, tmp_path: Path) -> None:
    idle = Recorded(case.records)
    idle.run = lambda *_, **__: iter(())  # type: ignore[method-assign]
    with pytest.raises(ScenarioError, match="the executor returned 0 of 3 experiments"):
        case.build(tmp_path, executor=idle)
    with pytest.raises(ScenarioError, match="rows = 0 given"):
        case.build(tmp_path, rows=0)
