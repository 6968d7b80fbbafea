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
from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_netcdf
from scenarios.datasets.build import build as build_data_set
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.index import hash_of_all, read_index, seal
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import BASELINES, BUILD, INDEX, PRIVATE, SPEC, SUMS, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.tables import read_table, read_text, table_text
from scenarios.datasets.variables import GIVEN, PROVENANCE, WINDOW
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
    spec_of_person: dict[str, DataSetSpec] = {}
    for person in persons or ("",):
        name = f"{spec.name}-{person}" if person else spec.name
        spec_of_person[person] = replace(spec, name=name)
    labels = {person: personal.label for person, personal in spec_of_person.items()}
    hidden = withheld.resolve()
    for label in labels.values():
        if hidden == out.resolve() or (out / label).resolve() in (hidden, *hidden.parents):
            raise ScenarioError(f"{withheld} given as withheld folder, expected one outside of what is published")
    _make_private(withheld)
    seeds = _seeds(withheld, labels, seed)
    paths: list[Path] = []
    failed: dict[str, str] = {}
    for person, personal in spec_of_person.items():
        # A waveform whose seed is written in the spec would be no secret.
        blocks = tuple(replace(block, draw_waveforms=True) for block in personal.records)
        complete = replace(personal, seed=seeds[person], records=blocks)
        folder = withheld / complete.label
        if not folder.is_dir():
            build(complete, withheld)
        elif (folder / SPEC).read_text(encoding="utf-8") != complete.to_toml():
            raise ScenarioError(f"{folder} was built from another spec; expected a new withheld folder for this one")
        for name, reason in open_data_set(folder).failed.items():
            failed[f"{complete.label}: {name}"] = reason
        paths.append(_publish(folder, replace(complete, seed=0, withheld=True), out))
    return tuple(paths), failed


def _make_private(withheld: Path) -> None:
    """Make the withheld folder if it is missing; refuse one that others may open."""
    withheld.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = withheld.stat()
    if status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise ScenarioError(
            f"{withheld} belongs to another user, or others may open it (mode {status.st_mode & 0o777:o}); expected a "
            "folder of your own with mode 700: it holds secret seeds"
        )


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
    for planned in DataSetPlan(spec).of_twin():
        depends_on_outputs = planned.experiment.operator() is not None or bool(planned.experiment.shutdown)
        if planned.part == "test" and depends_on_outputs:
            raise ScenarioError(
                f"{planned.name}: an operator or an emergency shutdown makes its commands depend on the withheld "
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
    for line_number, name in enumerate(names, start=1):
        if len(name) > 40 or not NAME.fullmatch(name):
            raise ScenarioError(
                f"{path}, line {line_number}: {name[:100]!r} given, expected a name of 1 to 40 letters, digits, '.', "
                "'_', '-' or '+', the first a letter or digit, because folders are named after it"
            )
        if name.casefold() in seen:
            raise ScenarioError(f"{path}, line {line_number}: {name!r} is there twice")
        seen.add(name.casefold())
    return tuple(names)


def read_persons(withheld: Path) -> dict[str, tuple[str, int]]:
    """Read label and seed of the data set of each person; of one data set for all the person is ``""``.

    Raises:
        ScenarioError: The folder is not one that a build with --withhold made.
    """
    try:
        table = json.loads((withheld / PERSONS).read_text(encoding="utf-8"))
        return {person: (str(row["data_set"]), int(row["seed"])) for person, row in table.items()}
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
    attributes: dict[str, Attribute] = {}
    for key, value in contents.attributes.items():
        if key != "seed" and not key.startswith(PROVENANCE):
            attributes[key] = value
    if part != "test":
        return Contents(contents.variables, attributes)
    window = min(window, len(contents.variables["u"].values))
    variables = dict(contents.variables)
    for name, variable in contents.variables.items():
        if variable.dims[:1] == ("sample",) and name not in GIVEN:
            cut = np.ascontiguousarray(variable.values[:window])
            variables[name] = Variable((WINDOW, *variable.dims[1:]), cut, variable.attributes)
    index = {**contents.variables["sample"].attributes, "long_name": "sample number within the initialisation window"}
    variables[WINDOW] = Variable((WINDOW,), np.arange(window, dtype=np.int64), index)
    return Contents(variables, {**attributes, "withheld": f"what was measured from sample {window} on"})


def _seeds(withheld: Path, labels: Mapping[str, str], seed: int | None) -> dict[str, int]:
    """Draw the seed of each person and keep it before anything is simulated, or read those of an interrupted build."""
    if (withheld / PERSONS).is_file():
        persons = read_persons(withheld)
        if {person: label for person, (label, _) in persons.items()} != labels:
            raise ScenarioError(f"{withheld} is of other persons or of another spec; expected a new folder")
        return {person: seed_of_person for person, (_, seed_of_person) in persons.items()}
    check_seed(seed or 0)
    seeds: dict[str, int] = {}
    for person in labels:
        # TOML and NetCDF hold no more than 63 bits, and nobody tries so many.
        if seed is None:
            seeds[person] = secrets.randbits(63)
        else:
            state = np.random.SeedSequence([seed, *person.encode()]).generate_state(1, np.uint64)
            seeds[person] = int(state[0]) >> 1
    table = {person: {"data_set": labels[person], "seed": seeds[person]} for person in labels}
    write_whole(withheld / PERSONS, json.dumps(table, indent=1) + "\n", durable=True)
    return seeds


def _publish(complete: Path, public: DataSetSpec, out: Path) -> Path:
    """Write the public folder of a complete data set; if it is there with the same bytes, it stays."""
    final = out / public.label
    # Made whole and then renamed: nobody downloads half of it.
    with working_folder(out) as scratch:
        folder = scratch / public.label
        folder.mkdir()
        experiments = [
            _publish_experiment(listed, complete, folder, public) for listed in read_index(complete)["experiments"]
        ]
        hash_of_arrays = hash_of_all(listed["arrays"] for listed in experiments)
        index = {"data_set": public.label, "experiments": experiments, "hash": hash_of_arrays}
        (folder / SPEC).write_text(public.to_toml(), encoding="utf-8")
        shutil.copyfile(complete / BUILD, folder / BUILD)
        (folder / INDEX).write_text(json.dumps(index, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        if rows := read_table(complete / BASELINES):
            (folder / BASELINES).write_text(_public_baselines(rows), encoding="utf-8")
        for name, content in metadata_files(folder, public, index).items():
            (folder / name).write_bytes(content)
        seal(folder)
        if not final.exists():
            folder.rename(final)
        elif not (final / SUMS).is_file() or (final / SUMS).read_bytes() != (folder / SUMS).read_bytes():
            raise ScenarioError(f"{final} is already there and is another data set; build in another folder")
    return final


def _publish_experiment(listed: Mapping[str, Any], complete: Path, folder: Path, public: DataSetSpec) -> dict[str, Any]:
    """Write the public record of an experiment, and return what the public index states of it."""
    facts: dict[str, Any] = {key: value for key, value in listed.items() if key not in PRIVATE}
    facts["arrays"] = {}  # those of the truth are not published
    if "missing" in listed:
        facts["missing"] = dict.fromkeys(listed["missing"], "the reason is withheld")
    if listed["failed"]:
        # The reason of a failure may name drawn values.
        facts["failed"] = "it could not be run; the reason is withheld"
        return facts
    contents = public_contents(read_netcdf(complete / listed["file"]), listed["part"], public.window)
    path = folder / listed["file"]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(contents.to_bytes())
    facts["arrays"] = {listed["file"]: contents.array_hashes()}
    return facts


def _public_baselines(rows: Sequence[Mapping[str, str]]) -> str:
    """The table of baselines for those who do not have the truth.

    The row of the truth would give it away, and only who has the truth can repeat the others.
    """
    columns = [name for name in rows[0] if name not in ("command", "failed")]
    return table_text(columns, (row for row in rows if row["method"] != "truth" and not row["failed"]))
