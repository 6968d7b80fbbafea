"""Data sets for classes: a public one for each person, the complete ones and their seeds in a withheld folder."""

import json
import os
import secrets
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin.files.atomic_write import working_folder, write_whole
from hmtb_twin.files.netcdf import Contents, Variable, read_netcdf
from scenarios.datasets.build import build as build_data_set
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.index import hash_of_all, read_index, seal
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import BASELINES, BUILD, INDEX, PRIVATE, SPEC, SUMS, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.tables import read_table, read_text, table_text
from scenarios.datasets.variables import GIVEN, WINDOW
from scenarios.experiments.scenario import NAME
from scenarios.experiments.waveform import check_seed
from scenarios.files.errors import DAMAGE, ScenarioError

PERSONS = "persons.json"
"""In the withheld folder: label and seed of the data set of each person."""


def build_withheld(
    spec: DataSetSpec,
    out: Path,
    withheld: Path,
    *,
    persons: Sequence[str] = (),
    seed: int | None = None,
    build: Callable[[DataSetSpec, Path], object] = build_data_set,
) -> tuple[tuple[Path, ...], dict[str, str]]:
    """Build a data set for each person and publish it without its truth; an interrupted build resumes.

    Args:
        spec: The spec; its seed is not used, and every random waveform is drawn anew.
        out: Folder in which the public folders are made.
        withheld: Folder for the complete data sets; made if missing, readable by its owner alone.
        persons: A data set for each; none: one data set for all.
        seed: Seeds follow from it and the persons; None: from the operating system's randomness.
        build: Builds the complete data sets.

    Returns:
        The public folders, in the order of the persons; and why experiments have no record, by label and name.

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
    status = withheld.stat()
    if status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise ScenarioError(
            f"{withheld} belongs to another user, or others may open it (mode {status.st_mode & 0o777:o}); expected a "
            "folder of your own with mode 700: it holds secret seeds"
        )
    seeds = _seeds(withheld, {person: one.label for person, one in specs.items()}, seed)
    paths: list[Path] = []
    failed: dict[str, str] = {}
    for person, one in specs.items():
        # A waveform whose seed is written in the spec would be no secret.
        blocks = tuple(replace(block, draw_waveforms=True) for block in one.records)
        complete = replace(one, seed=seeds[person], records=blocks)
        folder = withheld / complete.label
        if not folder.is_dir():
            build(complete, withheld)
        elif (folder / SPEC).read_text(encoding="utf-8") != complete.to_toml():
            raise ScenarioError(f"{folder} was built from another spec; expected a new withheld folder for this one")
        failed |= {f"{complete.label}: {name}": why for name, why in open_data_set(folder).failed.items()}
        paths.append(_publish(folder, replace(complete, seed=0, withheld=True), out))
    return tuple(paths), failed


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
    for entry in DataSetPlan(spec).of_twin():
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
    names = read_text(path, "roster").splitlines()
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
    except DAMAGE as error:
        raise ScenarioError(
            f"cannot read {withheld / PERSONS} ({error}); expected a folder that hmtb dataset build --withhold made"
        ) from error


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
    variables = dict(contents.variables)
    for name, one in contents.variables.items():
        if one.dims[:1] == ("sample",) and name not in GIVEN:
            cut = np.ascontiguousarray(one.values[:window])
            variables[name] = Variable((WINDOW, *one.dims[1:]), cut, one.attributes)
    index = {**contents.variables["sample"].attributes, "long_name": "sample number within the initialisation window"}
    variables[WINDOW] = Variable((WINDOW,), np.arange(window, dtype=np.int64), index)
    return Contents(variables, {**attributes, "withheld": f"what was measured from sample {window} on"})


def _seeds(withheld: Path, labels: Mapping[str, str], seed: int | None) -> dict[str, int]:
    """Draw the seed of each person and keep it before anything is simulated, or read those of an interrupted build."""
    if (withheld / PERSONS).is_file():
        persons = read_persons(withheld)
        if {person: label for person, (label, _) in persons.items()} != labels:
            raise ScenarioError(f"{withheld} is of other persons or of another spec; expected a new folder")
        return {person: one for person, (_, one) in persons.items()}
    check_seed(seed or 0)
    # TOML and NetCDF hold no more than 63 bits, and nobody tries so many.
    seeds = {person: secrets.randbits(63) for person in labels}
    if seed is not None:
        states = {one: np.random.SeedSequence([seed, *one.encode()]).generate_state(1, np.uint64) for one in labels}
        seeds = {person: int(state[0]) >> 1 for person, state in states.items()}
    table = {person: {"data_set": labels[person], "seed": one} for person, one in seeds.items()}
    write_whole(withheld / PERSONS, json.dumps(table, indent=1) + "\n", durable=True)
    return seeds


def _publish(complete: Path, public: DataSetSpec, out: Path) -> Path:
    """Write the public folder of a complete data set; if it is there with the same bytes, it stays."""
    final, entries = out / public.label, list[dict[str, Any]]()
    with working_folder(out) as place:
        folder = place / public.label
        folder.mkdir()
        for entry in read_index(complete)["experiments"]:
            facts = {key: value for key, value in entry.items() if key not in PRIVATE} | {"arrays": {}}
            if entry["failed"]:
                # The reason of a failure may name drawn values.
                facts["failed"] = "it could not be run; the reason is withheld"
            if "missing" in entry:
                facts["missing"] = dict.fromkeys(entry["missing"], "the reason is withheld")
            if not entry["failed"]:
                contents = public_contents(read_netcdf(complete / entry["file"]), entry["part"], public.window)
                path = folder / entry["file"]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(contents.to_bytes())
                facts["arrays"] = {entry["file"]: contents.array_hashes()}
            entries.append(facts)
        whole = hash_of_all(facts["arrays"] for facts in entries)
        index = {"data_set": public.label, "experiments": entries, "hash": whole}
        (folder / SPEC).write_text(public.to_toml(), encoding="utf-8")
        shutil.copyfile(complete / BUILD, folder / BUILD)
        (folder / INDEX).write_text(json.dumps(index, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        # The row of the truth would give it away, and only who has the truth can repeat the others.
        if rows := read_table(complete / BASELINES):
            columns = [name for name in rows[0] if name not in ("command", "failed")]
            known = (row for row in rows if row["method"] != "truth" and not row["failed"])
            (folder / BASELINES).write_text(table_text(columns, known), encoding="utf-8")
        for name, content in metadata_files(folder, public, index).items():
            (folder / name).write_bytes(content)
        seal(folder)
        if not final.exists():
            folder.rename(final)
        elif not (final / SUMS).is_file() or (final / SUMS).read_bytes() != (folder / SUMS).read_bytes():
            raise ScenarioError(f"{final} is already there and is another data set; build in another folder")
    return final
