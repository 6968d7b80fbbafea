"""The table of baselines: a row for each, with the command that makes it again."""

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from shlex import join
from typing import Any

from scenarios.datasets.baselines import Baseline, BaselineData, baseline
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.layout import BASELINES, INDEX, baseline_file
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec_tables import BaselineSpec, Method
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.provenance import versions
from sysid import SysidError

SOFTWARE = ("hmtb-twin", "numpy", "scipy")
"""Packages that a baseline depends on."""

CLOSE = 1e-9
"""Relative difference of scores up to which a row counts as reproduced."""

TABLE = "table"
"""The last piece of the stage, that gathers the rows."""


@dataclass(frozen=True)
class BaselineStage:
    """Makes the baselines that a spec asks for, a file for each, and the table of them.

    Attributes:
        name: What it makes.
    """

    name: str = field(default="baselines", init=False)

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """The methods as they are written in the spec, then the table; nothing where the spec asks for none."""
        methods = tuple(map(str, plan.spec.baselines.methods))
        return (*methods, TABLE) if methods else ()

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, bytes]:
        """Make one baseline, or gather them.

        Args:
            plan: The experiments.
            folder: Where the data set stands.
            piece: A method, or `TABLE`.
        """
        if piece != TABLE:
            bench = _bench(folder, file_hash(folder / INDEX), plan.spec.baselines)
            return {str(baseline_file(piece)): _json(report(bench, Method.parsed(piece)))}
        _bench.cache_clear()
        made = (folder / baseline_file(str(method)) for method in plan.spec.baselines.methods)
        rows = [json.loads(path.read_bytes())["row"] for path in made]
        return {BASELINES: table(rows)}


@lru_cache(maxsize=1)
def _bench(folder: Path, hash: str, asked: BaselineSpec) -> BaselineData:
    """The records, read once for all baselines; the hash tells a folder that was built anew."""
    return BaselineData(open_data_set(folder), asked)


def report(bench: BaselineData, method: Method) -> dict[str, Any]:
    """A baseline as it is written: its row, and the score of every record and output; or why there is none.

    Args:
        bench: The data set.
        method: The method.
    """
    try:
        found = baseline(bench, method)
    except (ScenarioError, SysidError) as error:
        return {"row": {**_facts(bench, method), "failed": str(error)}, "test": [], "validation": []}
    parts = {"test": found.test, "validation": found.validation}
    return {
        "row": row(bench, found),
        **{
            part: [[one.experiment, one.joint, written(one.value)] for one in (scores.scores if scores else ())]
            for part, scores in parts.items()
        },
        "trained_on": list(found.trained),
    }


def row(bench: BaselineData, found: Baseline) -> dict[str, str]:
    """The line of a baseline, by column.

    Args:
        bench: The data set.
        found: The baseline.
    """
    of_joint = found.test.by_joint
    facts = _facts(bench, found.method)
    blocks = dict.fromkeys(one.block for one in bench.train if one.name in set(found.trained))
    return {
        **facts,
        "trained_on": f"{' and '.join(blocks)} ({len(found.trained)})" if found.trained else "",
        "twins": " ".join(map(str, found.twins)),
        "validation": "" if found.validation is None else written(found.validation.mean),
        "test": written(found.test.mean),
        **{name: written(of_joint[joint]) for name in facts if (joint := name.removeprefix("test_")) in of_joint},
        "records_scored": str(len({score.experiment for score in found.test.scores})),
    }


def _facts(bench: BaselineData, method: Method) -> dict[str, str]:
    """All columns, those that only the work fills in left empty."""
    spec = bench.spec
    options = ["--method", method.name]
    options += ["--orders", *map(str, method.orders)] if method.orders else []
    for name in ("twins", "records"):
        if getattr(bench.asked, name) != getattr(spec.baselines, name):
            options += [f"--{name}", str(getattr(bench.asked, name))]
    joints = dict.fromkeys(joint for one in bench.data_set.index if one.part == "test" for joint in one.joints)
    return {
        "method": method.name,
        "orders": " ".join(map(str, method.orders)),
        "metric": spec.scoring.metric,
        "unit": spec.scoring.unit,
        "steps": str(spec.scoring.steps),
        "test": "",
        **{f"test_{joint}": "" for joint in joints},
        "validation": "",
        "records_scored": "",
        "trained_on": "",
        "twins": "",
        "failed": "",
        "software": software(),
        "command": join(["hmtb", "dataset", "baselines", spec.label, *options]),
    }


@cache
def software() -> str:
    """Versions of what a baseline depends on."""
    found = versions()
    return ", ".join(f"{name} {found[name]}" for name in SOFTWARE)


def table(rows: Iterable[Mapping[str, str]]) -> bytes:
    """The table as CSV (RFC 4180, but for line feeds alone)."""
    rows = list(rows)
    if not rows:
        return b""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def read_table(path: Path) -> tuple[dict[str, str], ...]:
    """Read the table of baselines.

    Raises:
        ScenarioError: There is none, or it is damaged.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = tuple(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read the baselines {path}: {error}") from error
    if any(None in one or None in one.values() for one in rows):
        raise ScenarioError(f"{path} is damaged: a row has more or fewer columns than the first")
    return rows


def differences(made: Mapping[str, str], kept: Mapping[str, str]) -> tuple[str, ...]:
    """In which scores a row differs from the one of the same method that was published, in words.

    Args:
        made: The row as it comes out now.
        kept: As it stands in the table.
    """
    found = []
    for name in made:
        if name in ("test", "validation") or name.startswith("test_"):
            now, then = made[name], kept.get(name, "")
            if (not now or not then) and now != then:
                found.append(f"{name} = {now or 'none'}, published {then or 'none'}")
            elif now and not math.isclose(float(now), float(then), rel_tol=CLOSE):
                found.append(f"{name} = {now}, published {then}")
    return tuple(found)


def written(value: float) -> str:
    """A score as text: eleven digits, so that rounding is no difference."""
    return f"{value:.11g}"


def _json(content: object) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
