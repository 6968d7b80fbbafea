"""Data sets for classes: a public one for each person, the complete ones and their seeds in a withheld folder."""

import csv
import io
import json
import secrets
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.datasets.baselines import read_table
from scenarios.datasets.build import build
from scenarios.datasets.chunk import MOST_ROWS, about
from scenarios.datasets.data_set import GIVEN, WINDOW, open_data_set
from scenarios.datasets.export import working_folder, write_checksums
from scenarios.datasets.index import array_line, read_index
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import BASELINES, BUILD, INDEX, SPEC, SUMS, DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.scenario import NAME
from scenarios.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Contents, Variable, read_netcdf
from scenarios.jobs.executor import Executor
from scenarios.jobs.progress import Report

PERSONS = "persons.json"
"""In the withheld folder: label and seed of the data set of each person."""

SECRET_BITS = 63
"""Of a seed from the operating system's randomness: TOML and NetCDF hold no more, and nobody tries so many."""

PRIVATE = ("seed", "process_noise")
"""What the index says of an experiment and a public one does not: drawn values."""

FAILED = "it could not be run; the reason is withheld"
"""Published instead of the reason of a failure, which may name drawn values."""


@dataclass(frozen=True)
class WithheldBuild:
    """Data sets of a class.

    Attributes:
        paths: The public folders, in the order of the persons.
        withheld: Folder of the complete data sets and their seeds.
        failed: Why experiments have no record, by label and name.
    """

    paths: tuple[Path, ...]
    withheld: Path
    failed: Mapping[str, str]


def build_withheld(
    spec: DataSetSpec,
    out: Path,
    withheld: Path,
    *,
    persons: Sequence[str] = (),
    seed: int | None = None,
    workers: int | None = None,
    rows: int = MOST_ROWS,
    executor: Executor[Any] | None = None,
    progress: Report | None = None,
) -> WithheldBuild:
    """Build a data set for each person and publish it without its truth; an interrupted build resumes.

    Args:
        spec: The spec; its seed is not used, and every random waveform is drawn anew.
        out: Folder in which the public folders are made.
        withheld: Folder for the complete data sets; made if missing, readable by its owner alone.
        persons: A data set for each; none: one data set for all.
        seed: Seeds follow from it and the persons; None: from the operating system's randomness.
        workers: Threads for the physics.
        rows: Experiments that run side by side at most.
        executor: Runs the experiments instead of this process.
        progress: Called with the progress of each build.

    Raises:
        ScenarioError: The truth of such a spec cannot be withheld; the folder is of another class or would be
            published; or what `build` raises.
    """
    check_withholdable(spec)
    specs = {one: replace(spec, name=f"{spec.name}-{one}") if one else spec for one in persons or ("",)}
    hidden = withheld.resolve()
    for one in specs.values():
        if hidden == out.resolve() or (out / one.label).resolve() in (hidden, *hidden.parents):
            raise ScenarioError(f"{withheld} given as withheld folder, expected one outside of what is published")
    withheld.mkdir(mode=0o700, parents=True, exist_ok=True)
    seeds = _seeds(withheld, {person: one.label for person, one in specs.items()}, seed)
    paths: list[Path] = []
    failed: dict[str, str] = {}
    for person, one in specs.items():
        # A waveform whose seed is written in the spec would be no secret.
        blocks = tuple(replace(block, draw_waveforms=True) for block in one.records)
        complete = replace(one, seed=seeds[person], records=blocks)
        folder = withheld / complete.label
        if not folder.is_dir():
            build(complete, withheld, workers=workers, rows=rows, executor=executor, progress=progress)
        elif (folder / SPEC).read_text(encoding="utf-8") != complete.to_toml():
            raise ScenarioError(f"{folder} was built from another spec; expected a new withheld folder for this one")
        failed |= {f"{complete.label}: {name}": why for name, why in open_data_set(folder).failed.items()}
        paths.append(_publish(folder, replace(complete, seed=0, withheld=True), out))
    return WithheldBuild(tuple(paths), withheld, failed)


def check_withholdable(spec: DataSetSpec) -> None:
    """Refuse a spec whose truth anyone could compute from what is published.

    Raises:
        ScenarioError: Arms, scores or commands of the spec reveal what is to be withheld.
    """
    if spec.withheld:
        raise ScenarioError(f"{spec.label}: the spec of a public data set given, expected the one it was built from")
    if spec.twins is None or all(d.kind == "fixed" for d in spec.twins.distributions.stated.values()):
        raise ScenarioError(
            f"{spec.label}: its arms come with the software, so anyone can compute their truth; expected a table "
            "[twins] with count = 1 or more and distributions such as kp = { kind = 'lognormal', spread = 0.1 }"
        )
    if spec.scoring.steps:
        raise ScenarioError(
            f"{spec.label}: scores {spec.scoring.steps} samples ahead need the withheld outputs; expected [scoring] "
            "steps = 0"
        )
    plan = DataSetPlan(spec)
    for entry in plan[: len(plan) // plan.twins]:
        follows = entry.experiment.operator() is not None or bool(entry.experiment.shutdown)
        if entry.part == "test" and follows:
            raise ScenarioError(
                f"{entry.name}: an operator or an emergency shutdown makes its commands depend on the withheld "
                "outputs; expected commands that depend on the excitation alone"
            )


def read_roster(path: Path) -> tuple[str, ...]:
    """Read the names of persons, one per line.

    Raises:
        ScenarioError: The file cannot be read, or a line is empty, there twice or no name for a folder.
    """
    try:
        names = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"cannot read the roster {path}: {error}") from error
    if not names:
        raise ScenarioError(f"{path}: no lines given, expected a name on each")
    # Many disks take upper and lower case for the same.
    seen = set[str]()
    for number, name in enumerate(names, start=1):
        if len(name) > 40 or not NAME.fullmatch(name):
            raise ScenarioError(
                f"{path}, line {number}: {name[:100]!r} given, expected a name of 1 to 40 letters, digits, '.', '_', "
                "'-' or '+', the first a letter or digit, because folders are named after it"
            )
        if name.casefold() in seen:
            raise ScenarioError(f"{path}, line {number}: {name!r} is there twice")
        seen.add(name.casefold())
    return tuple(names)


def read_persons(withheld: Path) -> dict[str, tuple[str, int]]:
    """Read label and seed of the data set of each person; of one data set for all the person is ``""``.

    Raises:
        ScenarioError: The folder is not one that a build with --withhold made.
    """
    try:
        table = json.loads((withheld / PERSONS).read_text(encoding="utf-8"))
        return {person: (str(one["data_set"]), int(one["seed"])) for person, one in table.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise ScenarioError(
            f"cannot read {withheld / PERSONS} ({error}); expected a folder that hmtb dataset build --withhold made"
        ) from error


def public_facts(entry: PlannedExperiment) -> dict[str, Any]:
    """What the index of a public data set says of an experiment, without its hashes."""
    return {key: value for key, value in about(entry).items() if key not in PRIVATE}


def public_contents(contents: Contents, part: str, window: int) -> Contents:
    """Cut a record for publication without its truth.

    Seed and provenance go, which would tell how to simulate it again; of a scored record also everything that was
    measured behind the initialisation window. Force, torque and the other joints are measured too: they show how the
    arm moved, better than the commands do.

    Args:
        contents: The complete record.
        part: Part of the data set that it belongs to.
        window: Samples of the initialisation window.
    """
    attributes = {
        key: value for key, value in contents.attributes.items() if key != "seed" and not key.startswith("provenance_")
    }
    if part != "test":
        return Contents(contents.variables, attributes)
    window = min(window, len(contents.variables["u"].values))
    index = {**contents.variables["sample"].attributes, "long_name": "sample number within the initialisation window"}
    variables: dict[str, Variable] = {}
    for name, variable in contents.variables.items():
        if variable.dims[:1] != ("sample",) or name in GIVEN:
            variables[name] = variable
            continue
        cut = np.ascontiguousarray(variable.values[:window])
        variables[name] = Variable((WINDOW, *variable.dims[1:]), cut, variable.attributes)
    variables[WINDOW] = Variable((WINDOW,), np.arange(window, dtype=np.int64), index)
    return Contents(variables, {**attributes, "withheld": f"what was measured from sample {window} on"})


def _seeds(withheld: Path, labels: Mapping[str, str], seed: int | None) -> dict[str, int]:
    """Draw the seed of each person and keep it before anything is simulated, or read those of an interrupted build."""
    if (withheld / PERSONS).is_file():
        persons = read_persons(withheld)
        if {person: label for person, (label, _) in persons.items()} != labels:
            raise ScenarioError(f"{withheld} is of other persons or of another spec; expected a new folder")
        return {person: one for person, (_, one) in persons.items()}
    seeds = {person: _drawn_seed(seed, person) for person in labels}
    table = {person: {"data_set": labels[person], "seed": one} for person, one in seeds.items()}
    write_whole(withheld / PERSONS, json.dumps(table, indent=1) + "\n", durable=True)
    return seeds


def _drawn_seed(seed: int | None, person: str) -> int:
    if seed is None:
        return secrets.randbits(SECRET_BITS)
    drawn = np.random.SeedSequence([seed, *person.encode()]).generate_state(1, np.uint64)
    return int(drawn[0]) >> (64 - SECRET_BITS)


def _publish(complete: Path, public: DataSetSpec, out: Path) -> Path:
    """Write the public folder of a complete data set; if it is there with the same bytes, it stays."""
    final = out / public.label
    with working_folder(out) as place:
        folder = place / public.label
        folder.mkdir()
        (folder / SPEC).write_text(public.to_toml(), encoding="utf-8")
        shutil.copyfile(complete / BUILD, folder / BUILD)
        index = _public_index(complete, public, folder)
        (folder / INDEX).write_text(json.dumps(index, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        if table := _public_baselines(complete / BASELINES):
            (folder / BASELINES).write_text(table, encoding="utf-8")
        for path, content in metadata_files(folder, public, index).items():
            (folder / path).write_bytes(content)
        write_checksums(folder)
        if not final.exists():
            folder.rename(final)
        elif not (final / SUMS).is_file() or (final / SUMS).read_bytes() != (folder / SUMS).read_bytes():
            raise ScenarioError(f"{final} is already there and is another data set; build in another folder")
    return final


def _public_index(complete: Path, public: DataSetSpec, place: Path) -> dict[str, Any]:
    """Write the public records into a folder, and return their index."""
    digest = sha256()
    entries = []
    for entry in read_index(complete)["experiments"]:
        facts = {key: value for key, value in entry.items() if key not in PRIVATE} | {"arrays": {}}
        if entry["failed"]:
            entries.append({**facts, "failed": FAILED})
            continue
        contents = public_contents(read_netcdf(complete / entry["file"]), entry["part"], public.window)
        path = place / entry["file"]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(contents.to_bytes())
        hashes = contents.array_hashes()
        for name in sorted(hashes):
            digest.update(array_line(entry["file"], name, hashes[name]))
        entries.append({**facts, "arrays": {entry["file"]: hashes}})
    return {"data_set": public.label, "experiments": entries, "hash": digest.hexdigest()}


def _public_baselines(path: Path) -> str:
    """The table of baselines without the row of the truth, and without the columns that need it."""
    rows = list(read_table(path)) if path.is_file() and path.stat().st_size else []
    columns = [name for name in (rows[0] if rows else {}) if name not in ("command", "failed")]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(row for row in rows if row["method"] != "truth" and not row["failed"])
    return stream.getvalue() if rows else ""
