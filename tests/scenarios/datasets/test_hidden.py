"""Data sets whose truth is hidden: nothing that is published tells of it, and the key holds all of it."""

import json
import shutil
import stat
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions
from scenarios.commands.cli import main
from scenarios.datasets import challenge_build as hidden_build
from scenarios.datasets import open_data_set
from scenarios.datasets.build import build
from scenarios.datasets.build_progress import Progress
from scenarios.datasets.challenge_build import build_again, build_hidden, private_folder
from scenarios.datasets.challenge_key import begin_key, read_key, unpack
from scenarios.datasets.challenge_key_check import examine_with_key
from scenarios.datasets.challenge_publish import publish
from scenarios.datasets.challenge_secret import secret_spec, student_spec
from scenarios.datasets.check import examine
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.score import ModelPredictor, score_model
from scenarios.datasets.spec_tables import RecordBlock
from scenarios.experiments.registry import load, names
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf import read_netcdf
from sysid import arx
from tests.scenarios.conftest import Class

RUN = 6
"""So many withheld samples in a row are no chance: one alone is a count of the resolver, and stands in every record."""


@pytest.fixture(scope="module")
def whole(hidden: Class, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All that the key keeps of ann's data set."""
    return unpack(read_key(hidden.key), "class-v1-ann", tmp_path_factory.mktemp("whole"))


def numbers(folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Every array and every attribute of numbers in every NetCDF file, as h5py reads them, nothing left out."""
    for path in sorted(folder.rglob("*.nc")):
        found: list[tuple[str, np.ndarray]] = []

        def visit(name: str, entry: object, found: list[tuple[str, np.ndarray]] = found) -> None:
            found.extend((f"{name}@{key}", np.asarray(value)) for key, value in entry.attrs.items())  # type: ignore[attr-defined]
            if isinstance(entry, h5py.Dataset):
                found.append((name, np.asarray(entry[...])))

        with h5py.File(path) as file:
            visit("", file)
            file.visititems(visit)
        yield from ((f"{path.name}:{name}", values) for name, values in found)


def published_bytes(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Every file as it is, and everything in NetCDF files as it is without compression."""
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        yield path.name, path.name.encode() + b"\n" + path.read_bytes()
    for name, values in numbers(folder):
        if values.dtype.kind in "biufc":
            yield name, np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
        else:
            texts = (v if isinstance(v, bytes) else str(v).encode() for v in values.ravel().tolist())
            yield name, b"\n".join(texts)


def secrets_of(key_path: Path, label: str) -> dict[str, set[bytes]]:
    """Whatever would give the truth away, as text and as bytes."""
    key = read_key(key_path)
    spec = key.spec_of(label)
    found: dict[str, set[bytes]] = {}
    for name, digits in (("root seed", key.spec.secret_seed), ("seed", spec.secret_seed), ("salt", key.salt)):
        raw = bytes.fromhex(digits)
        words = {digits, digits.upper(), str(int(digits, 16)), digits.lstrip("0")}
        found[name] = {raw, raw[::-1], *(word.encode() for word in words)}
    for entry in DataSetPlan(spec):
        one = entry.experiment
        seeds = [one.seed, *(e.parameters["seed"] for e in one.excitation if "seed" in e.parameters)]  # type: ignore[union-attr]
        for seed in seeds:
            forms = {str(seed).encode(), f"{seed:x}".encode()}
            found[f"seed of {entry.name}"] = forms | {struct.pack(f"{end}Q", seed) for end in "<>"}
        drawn = [one.plant.supply_pressure, one.plant.process_noise, *one.specimen.kp, *one.specimen.mass]
        for value in drawn:
            texts = {repr(float(value)).encode(), f"{value:.9g}".encode()}
            found[f"drawn {value}"] = texts | {struct.pack(f"{end}d", value) for end in "<>"}
    return found


def test_no_byte_that_is_published_tells_a_secret(hidden: Class, whole: Path) -> None:
    secrets = secrets_of(hidden.key, "class-v1-ann")
    assert len(secrets) > 12
    drawn = [name for name in secrets if name.startswith("drawn")]
    assert len(drawn) >= 10
    for where, content in published_bytes(hidden.ann):
        for what, forms in secrets.items():
            assert not any(form in content for form in forms), f"{what} in {where}"
    # The search finds them where they are.
    everything = b"\n".join(content for _, content in published_bytes(whole))
    assert all(
        any(form in everything for form in forms)
        for what, forms in secrets.items()
        if what not in ("salt", "root seed")
    )


def test_nothing_withheld_of_a_scored_record_is_published(hidden: Class, whole: Path) -> None:
    place = "data/test/ann-twin-0-noise.nc"
    kept, shown = read_netcdf(whole / place).variables, read_netcdf(hidden.ann / place).variables
    given = {name for name, variable in shown.items() if "sample" in variable.dims}
    assert given == {"sample", "u", "joint_commanded"}
    assert shown["y"].dims == ("window_sample", "output") and shown["y"].values.shape == (20, 1)
    assert np.array_equal(shown["y"].values, kept["y"].values[:20])
    assert np.array_equal(shown["u"].values, kept["u"].values)
    assert np.isfinite(shown["y"].values).all()
    content = b"\n".join(content for _, content in published_bytes(hidden.ann))
    for name in ("y", "joint_measured", "force", "torque"):
        for column in kept[name].values.T:
            for begin in range(20, len(column) - RUN):
                run = column[begin : begin + RUN]
                if len(np.unique(run)) == RUN:  # a joint that stands still is no secret
                    assert run.tobytes() not in content, f"{name} from sample {begin} on"
    # It is there to be found in the whole.
    assert kept["y"].values[30:36, 0].tobytes() in b"\n".join(content for _, content in published_bytes(whole))


def test_only_what_cannot_be_foretold_from_the_commands_is_withheld_for_a_reason(hidden: Class) -> None:
    """Force and torque say more of the outputs than the commands do: why it is withheld, as are the other joints."""
    record = read_netcdf(hidden.ann / "data/train/ann-twin-0-binary-elbow_pitch.nc").variables
    y, u = record["y"].values[10:, 0], record["u"].values[:, 0]
    past = np.column_stack([np.ones(len(y)), *(u[10 - k : len(u) - k] for k in range(11))])
    beside = np.column_stack([past, *(record[name].values[10:] for name in ("force", "torque", "joint_measured"))])

    def left(columns: np.ndarray) -> float:
        half = len(y) // 2
        solution, *_ = np.linalg.lstsq(columns[:half], y[:half], rcond=1e-10)
        return float(np.std(y[half:] - columns[half:] @ solution))

    assert left(beside) < 0.5 * left(past)


def test_what_is_published_names_no_seed_no_run_and_no_truth(hidden: Class) -> None:
    assert not (hidden.ann / "truth").exists() and not (hidden.ann / "baselines").exists()
    for path in hidden.ann.rglob("*.nc"):
        names = read_netcdf(path).attributes
        assert not [name for name in names if "seed" in name or name.startswith("provenance")]
    index = json.loads((hidden.ann / "experiments.json").read_text())
    assert all("seed" not in entry and "process_noise" not in entry for entry in index["experiments"])
    spec = open_data_set(hidden.ann).spec
    assert spec.seed is None and spec.secret_seed == "" and index["commitment"] == spec.commitment
    assert spec.records[1].excitation[0].parameters["seed"] == 0  # the one that was written, 5, is of no record
    assert "truth" not in (hidden.ann / "baselines.csv").read_text()
    with pytest.raises(ScenarioError, match="is kept apart"):
        build(spec, hidden.out)


def test_students_have_data_of_their_own(hidden: Class) -> None:
    ann, bob = (open_data_set(folder) for folder in (hidden.ann, hidden.bob))
    assert ann.label == "class-v1-ann" and ann.hash != bob.hash
    for one, other in zip(ann.records(), bob.records(), strict=True):
        assert one.name.removeprefix("ann-") == other.name.removeprefix("bob-")
        assert not np.array_equal(one.u, other.u)
    key = read_key(hidden.key)
    kp = {next(iter(DataSetPlan(spec))).experiment.specimen.kp for spec in key.specs}
    assert len(kp) == 2
    assert key.specs[0].secret_seed not in (key.spec.secret_seed, student_spec(key.spec, "Ann").secret_seed)


def test_predictions_of_withheld_records_are_those_of_whole_ones(hidden: Class, whole: Path) -> None:
    shown, kept = (open_data_set(folder).test[0] for folder in (hidden.ann, whole))
    assert shown.y.shape == (20,) and len(shown) == len(shown.u) == 200
    assert shown[5:100].y.shape == (15,) and shown[30:100].y.shape == (0,)
    data = shown.iodata()
    assert data.missing and np.isnan(data.y).sum() == 180 and data.window == 20
    train = open_data_set(hidden.ann).select(joint="elbow_pitch").train[0].iodata()
    model = arx(train.subtract(u=train.u[0], y=train.y[0]), 2, 2).model
    predictor = ModelPredictor(model, train.u[0], train.y[0])
    with pytest.raises(ScenarioError, match="are withheld: whoever has the key scores it"):
        score_model(predictor, hidden.ann)
    assert predictor.predicted(data, 0) == pytest.approx(predictor.predicted(kept.iodata(), 0), rel=1e-12)


def test_a_check_says_what_it_cannot_and_with_the_key_can(hidden: Class) -> None:
    without = examine(hidden.ann)
    assert without.passed and any("the seed is kept apart" in note for note in without.notes)
    found = examine_with_key(hidden.ann, hidden.key, regenerate=1, workers=1)
    assert found.passed and any("simulated again" in note and "same bits" in note for note in found.notes)
    assert main(["dataset", "check", str(hidden.bob), "--key", str(hidden.key), "--regenerate", "0"]) == 0


def test_a_folder_that_was_exchanged_is_found_with_the_key(hidden: Class, tmp_path: Path) -> None:
    folder = shutil.copytree(hidden.ann, tmp_path / "changed")
    readme, sums = folder / "README.md", folder / "SHA256SUMS"
    before = file_hash(readme)
    readme.write_text(readme.read_text() + "!")
    assert "hash is not that of" in examine_with_key(folder, hidden.key).problems[0]
    # Whoever mends the checksums deceives every check but that with the key.
    sums.write_text(sums.read_text().replace(before, file_hash(readme)))
    assert examine(folder, regenerate=0).passed
    assert "something was exchanged" in examine_with_key(folder, hidden.key).problems[0]


def test_a_build_that_ends_before_its_end_is_gone_on_with_and_built_again(hidden: Class, tmp_path: Path) -> None:
    class Killed(BaseException):
        pass

    steps = 0

    def killing(at: int) -> object:
        def told(_: Progress) -> None:
            nonlocal steps
            steps += 1
            if steps == at:
                raise Killed

        return told

    key, out = tmp_path / "key", tmp_path / "out"
    spec = replace(hidden.spec, baselines=replace(hidden.spec.baselines, models=("hold",)))
    seeds = set()
    for at in (1, 4, 12):
        steps = 0
        with pytest.raises(Killed):
            build_hidden(spec, out, key, students=("ann", "bob"), workers=1, rows=1, progress=killing(at))  # type: ignore[arg-type]
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        seeds.add(read_key(key).spec.secret_seed)
        with pytest.raises(ScenarioError, match="not built to their end"):
            read_key(key).complete()
    with pytest.raises(ScenarioError, match="another spec or other students"):
        build_hidden(spec, out, key, students=("ann",), workers=1)
    made = build_hidden(spec, out, key, students=("ann", "bob"), workers=1)
    seeds.add(read_key(key).spec.secret_seed)
    assert len(seeds) == 1 and [path.name for path in made.paths] == ["class-v1-ann", "class-v1-bob"]
    with pytest.raises(ScenarioError, match="is complete"):
        build_hidden(spec, out, key, students=("ann", "bob"), workers=1)
    again = build_again(key, tmp_path / "again", workers=1)
    for one, other in zip(made.paths, again.paths, strict=True):
        assert (one / "SHA256SUMS").read_bytes() == (other / "SHA256SUMS").read_bytes()


def test_what_another_key_keeps_apart_is_no_build_to_go_on_with(
    hidden: Class, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, out = tmp_path / "key", tmp_path / "out"
    private, spec = (
        private_folder(key),
        replace(hidden.spec, baselines=replace(hidden.spec.baselines, models=("hold",))),
    )

    def again() -> None:
        build_hidden(spec, out, key, workers=1)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(hidden_build, "complete_key", killed)
        with pytest.raises(KeyboardInterrupt):
            again()
    assert (private / "class-v1" / "SHA256SUMS").is_file()
    key.rename(tmp_path / "first")
    with pytest.raises(ScenarioError, match="holds what was built for a key key that is not there any more"):
        again()
    assert not key.exists()
    begin_key(key, secret_spec(spec), ())
    with pytest.raises(ScenarioError, match="is of another key or another spec"):
        again()
    key.unlink()
    (tmp_path / "first").rename(key)
    # Killed in the midst of removing what tells the truth: the next start ends it, whatever else it says.
    with monkeypatch.context() as patch:
        patch.setattr(hidden_build.shutil, "rmtree", killed)
        with pytest.raises(KeyboardInterrupt):
            again()
    assert read_key(key).sets and not private.exists()
    left = tmp_path / "key.private.done"
    assert (left / "class-v1" / "truth").is_dir()
    with pytest.raises(ScenarioError, match="is complete"):
        again()
    assert not left.exists()
    # Killed just before: the truth is still there, which is said, and how it goes.
    private.mkdir()
    with pytest.raises(
        ScenarioError, match=r"dataset build --key .* removes \S+key\.private, which still tells the truth"
    ):
        again()
    build_again(key, out, workers=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["key", "out"]


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("out/class-v1/key", "is published"),
        ("out/class-v1.unfinished/key", "is published"),
        ("out/class-v1", "is published"),
        ("absent/key", "no folder"),
        ("folder", "is a folder"),
    ],
)
def test_a_key_where_it_cannot_be_is_refused(hidden: Class, tmp_path: Path, place: str, says: str) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(ScenarioError, match=says):
        build_hidden(hidden.spec, tmp_path / "out", tmp_path / place)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder"]


def test_a_key_that_cannot_be_written_is_refused_before_the_work(hidden: Class, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="cannot write the key"):
        build_hidden(hidden.spec, tmp_path / "out", tmp_path / ("k" * 300))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"twins": None}, "whose truth anyone can compute"),
        ({"window": 200}, "expected 10 or more behind it to score"),
        ({"seed": None, "secret_seed": "0" * 31 + "7"}, "128 bits drawn at random"),
    ],
)
def test_a_truth_that_cannot_be_hidden_is_refused(
    hidden: Class, tmp_path: Path, change: dict[str, object], says: str
) -> None:
    with pytest.raises(ScenarioError, match=says):
        build_hidden(replace(hidden.spec, **change), tmp_path, tmp_path / "key")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_what_no_build_can_be_done_with_is_refused_before_a_key_is_begun(hidden: Class, tmp_path: Path) -> None:
    for workers, rows in ((0, 1), (10**6, 1), (1, 0)):
        with pytest.raises(ScenarioError, match="given, expected 1 "):
            build_hidden(hidden.spec, tmp_path / "out", tmp_path / "key", workers=workers, rows=rows)
    assert not list(tmp_path.iterdir())


def test_a_folder_of_another_build_is_left_alone(hidden: Class, whole: Path, tmp_path: Path) -> None:
    public = open_data_set(hidden.ann).spec
    begun = tmp_path / "class-v1-ann.unfinished"
    begun.mkdir()
    (begun / "spec.toml").write_text("another")
    with pytest.raises(ScenarioError, match=r"holds something else, spec\.toml"):
        publish(whole, public, tmp_path)
    # What somebody put beside a publication that was begun is not published with it.
    (begun / "spec.toml").write_text(public.to_toml())
    (begun / "truth.nc").write_text("x")
    full = shutil.copytree(whole, tmp_path / "full")
    shutil.copytree(hidden.ann / "data" / "train", full / "data" / "train")
    with pytest.raises(ScenarioError, match=r"holds 'truth\.nc', which no part of the build made"):
        publish(full, public, tmp_path)
    shutil.rmtree(begun)
    shutil.copytree(hidden.bob, tmp_path / "class-v1-ann")
    with pytest.raises(ScenarioError, match="never overwritten"):
        publish(whole, public, tmp_path)


def test_why_an_experiment_failed_is_kept_apart(hidden: Class, tmp_path: Path) -> None:
    twins = replace(hidden.spec.twins, distributions=TwinDistributions(payload_mass=Distribution("uniform", 1.0, 90.0)))  # type: ignore[type-var]
    heavy = replace(hidden.spec, twins=twins)
    with pytest.raises(ScenarioError, match="none of 3 experiments has a record"):
        build_hidden(heavy, tmp_path / "none", tmp_path / "none.key", workers=1)
    assert not (tmp_path / "none").exists()
    light = (*heavy.records[:1], replace(heavy.records[1], payloads=("rpcm", "none")))
    made = build_hidden(replace(heavy, records=light), tmp_path / "out", tmp_path / "key", workers=1)
    assert all("cannot hold the arm" in why for name, why in made.failed.items() if "rpcm" in name)
    entries = json.loads((made.paths[0] / "experiments.json").read_text())["experiments"]
    assert [entry["failed"] for entry in entries] == [*3 * ["it could not be run; the reason is kept apart"], None]
    assert not any(b"cannot hold" in content for _, content in published_bytes(made.paths[0]))


def test_commands_that_would_tell_of_the_outputs_are_refused(hidden: Class, tmp_path: Path) -> None:
    """An operator sees the arm, so what he commands says where it was."""
    (name,) = [name for name in names("operator") if load(name).task][:1]
    exchange = RecordBlock("exchange", "test", scenarios=(name,))
    spec = replace(hidden.spec, records=(hidden.spec.records[0], exchange))
    with pytest.raises(ScenarioError, match="its commands follow the arm"):
        build_hidden(spec, tmp_path, tmp_path / "key")
    assert not list(tmp_path.iterdir())


def test_scores_that_need_withheld_outputs_are_refused(hidden: Class, tmp_path: Path) -> None:
    spec = replace(hidden.spec, scoring=replace(hidden.spec.scoring, steps=5))
    with pytest.raises(ScenarioError, match="need the outputs that are withheld"):
        build_hidden(spec, tmp_path, tmp_path / "key")
