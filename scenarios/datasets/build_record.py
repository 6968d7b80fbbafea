"""What a build was begun with: a build is gone on with only by the same software, on the same spec."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.layout import BUILD, LOCK, SPEC
from scenarios.datasets.lock import unlock_file
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions

SHOWN = 3
"""Differences that an error names."""


def begin(folder: Path, spec: DataSetSpec) -> None:
    """Note in a folder with what a data set is built, or make sure that what is there was begun with the same.

    Args:
        folder: The folder of the build, locked.
        spec: The spec.

    Raises:
        ScenarioError: Something else is in the folder: a build of another spec or by other software, or foreign files.
        OSError: The folder cannot be written.
    """
    record = {"data_set": spec.label, "source": fingerprint(), "versions": versions()}
    if (folder / BUILD).exists():
        differences = [*_differences(_read(folder), record), *_spec_differences(folder, spec)]
        if differences:
            more = f"; {len(differences) - SHOWN} more" if len(differences) > SHOWN else ""
            raise ScenarioError(
                f"{folder} holds a build that was begun otherwise: {'; '.join(differences[:SHOWN])}{more}. Go on with "
                "what it was begun with, or remove the folder to begin anew"
            )
        return
    foreign = sorted(path.name for path in folder.iterdir() if path.name not in (LOCK, SPEC))
    if foreign:
        unlock_file(folder)
        raise ScenarioError(
            f"{folder} holds no build but {', '.join(foreign[:SHOWN])}: expected an empty folder or none"
        )
    # The spec first: where the record is, everything else that a build begins with is.
    write_whole(folder / SPEC, spec.to_toml(), durable=True)
    write_whole(folder / BUILD, json.dumps(record, indent=1, sort_keys=True) + "\n", durable=True)


def _read(folder: Path) -> Mapping[str, Any]:
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        return {"data_set": record["data_set"], "source": record["source"], "versions": dict(record["versions"])}
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ScenarioError(f"{folder / BUILD} is damaged: {error!r}; remove the folder to begin anew") from error


def _differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    if before["data_set"] != now["data_set"]:
        yield f"data set {before['data_set']} then, {now['data_set']} now"
    for name in sorted({*before["versions"], *now["versions"]}):
        then, given = before["versions"].get(name, "none"), now["versions"].get(name, "none")
        if then != given:
            yield f"{name} {then} then, {given} now"
    if before["source"] != now["source"]:
        yield f"source of this software {before['source'][:12]} then, {now['source'][:12]} now"


def _spec_differences(folder: Path, spec: DataSetSpec) -> Iterator[str]:
    try:
        text = (folder / SPEC).read_text(encoding="utf-8") if (folder / SPEC).is_file() else ""
        before = tomllib.loads(text)
    except (ValueError, RecursionError):
        text, before = "", {}
    if text == spec.to_toml():
        return
    now = tomllib.loads(spec.to_toml())
    changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    for key in changed:
        then, given = before.get(key), now.get(key)
        short = all(
            isinstance(value, bool | int | float | str | None) and len(str(value)) < 40 for value in (then, given)
        )
        yield f"{key} = {then!r} then, {given!r} now" if short else f"another {key} in the spec"
