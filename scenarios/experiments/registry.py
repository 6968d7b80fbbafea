"""Registered scenarios by name: the experiments of the thesis and others that come with the package.

Their tables are plain data: a list of them needs no laboratory, which takes more than a second to load.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import package_table

if TYPE_CHECKING:
    from scenarios.experiments.scenario import Scenario

Table = dict[str, Any]
"""A scenario as its TOML file holds it; each has a name, axes, a duration, a description and tags."""


def single_joint_tests() -> list[Table]:
    """The 24 single-joint tests of the thesis [Morris1996, table 1], then the same on the joints that it left alone."""
    source = package_table("table1.toml")
    groups = (
        (source["joints"], source["tags"], 0),
        (source["other_joints"], source["other_tags"], len(source["joints"])),
    )
    return [
        {
            "name": f"siso-{test['number']}-{joint}",
            "axes": [joint],
            "duration": source["duration"],
            # Every test has noise of its own, whichever joints are added later.
            "seed": 100 * test["number"] + position,
            "description": f"{joint.replace('_', ' ')}: {test['description']}",
            "tags": [*tags, joint, test["excitation"]["kind"]],
            "excitation": test["excitation"],
        }
        for joints, tags, first in groups
        for test in source["test"]
        for position, joint in enumerate(joints, start=first)
    ]


def table2() -> list[Table]:
    """The 13 tests of several joints of the thesis [Morris1996, table 2]."""
    source = package_table("table2.toml")
    return [
        {
            "name": f"mimo-{test['number']}",
            "axes": source["axes"],
            "mode": source["mode"],
            "duration": source["duration"],
            "seed": 2000 + test["number"],
            "description": f"tool along x, y and z: {test['description']}",
            "tags": [*source["tags"], test["excitation"]["kind"]],
            "hand_controller": {"compensation": source["compensation"]},
            "excitation": test["excitation"],
        }
        for test in source["test"]
    ]


def independent() -> list[Table]:
    """Tests of Table 2 with a waveform of its own on every axis."""
    extra = package_table("table2.toml")["independent"]
    shared = {table["seed"] - 2000: table for table in table2()}
    return [
        {
            **shared[number],
            "name": f"mimo-{number}-independent",
            "seed": 3000 + number,
            "description": f"{shared[number]['description']}, another one on every axis",
            "tags": [*extra["tags"], shared[number]["excitation"]["kind"]],
            "independent_channels": True,
            "excitation": [{**shared[number]["excitation"], "seed": seed} for seed in extra["seeds"]],
        }
        for number in extra["tests"]
    ]


def exchange() -> list[Table]:
    """Tasks of an operator: the exchange of the replacement unit [Morris1996, sec. I.3 and VI.4], and free motion."""
    source = package_table("rpcm.toml")
    compensation = package_table("table2.toml")["compensation"]
    return [
        {
            "axes": source["axes"],
            "mode": source["mode"],
            "worksite": True,
            "payload": "none",
            "tags": source["tags"],
            **test,
            "hand_controller": {"compensation": compensation},
        }
        for test in source["test"]
    ]


def tracking() -> list[Table]:
    """Tests of one joint whose payload is exchanged during the run."""
    source = package_table("track.toml")
    return [
        {
            **source["every"],
            "name": f"track-{joint}",
            "axes": [joint],
            "seed": 5000 + number,
            "description": f"{joint.replace('_', ' ')}: {source['description']}",
            "tags": [*source["tags"], joint, source["every"]["excitation"]["kind"]],
        }
        for number, joint in enumerate(source["joints"])
    ]


def every_joint() -> list[Table]:
    """All seven joints at once, each with a multisine of its own: what the thesis left to future work [Morris1996]."""
    source = package_table("every_joint.toml")
    return [{**source, "excitation": [{**source["excitation"], "seed": seed} for seed in range(len(source["axes"]))]}]


@cache
def registered() -> Mapping[str, Table]:
    """The tables of all registered scenarios by name."""
    makers = (single_joint_tests, table2, independent, exchange, tracking, every_joint)
    tables = (table for maker in makers for table in maker())
    return {table["name"]: table for table in tables}


def names(tag: str | None = None) -> tuple[str, ...]:
    """Names of the registered scenarios in order of registration, all or those with a tag.

    Raises:
        ScenarioError: No scenario has the tag.
    """
    if tag is not None and tag not in tags():
        raise ScenarioError(unknown("tag", tag, tags()))
    return tuple(name for name, table in registered().items() if tag is None or tag in table["tags"])


def tags() -> tuple[str, ...]:
    """Every tag of the registered scenarios."""
    return tuple(dict.fromkeys(tag for table in registered().values() for tag in table["tags"]))


def selected(words: Sequence[str], *, duration: float | None = None, seed: int | None = None) -> "list[Scenario]":
    """Scenarios by words: registered names, tags, TOML files.

    Args:
        words: The words.
        duration: Length instead of their own, s.
        seed: Draws other noise.

    Raises:
        ScenarioError: There is no word, a word names nothing, or a file is wrong.
    """
    known = [name for word in words for name in (names(word) if word in tags() else (word,))]
    if not known:
        raise ScenarioError(
            f"no scenario named; there are {len(names())}, listed by: hmtb scenarios list; tags: {', '.join(tags())}"
        )
    return [load(name, duration=duration, seed=seed) for name in known]


def load(name: str | Path, *, duration: float | None = None, seed: int | None = None) -> "Scenario":
    """A registered scenario by name, or one from a TOML file.

    Args:
        name: A registered name, or a path that ends in `.toml`.
        duration: Length instead of its own, s.
        seed: Draws other noise.

    Raises:
        ScenarioError: There is no such scenario or file, or the file is wrong.
    """
    from scenarios.experiments.scenario import Scenario

    if str(name).endswith(".toml"):
        scenario = Scenario.read(name)
    elif str(name) in registered():
        scenario = Scenario.from_table(registered()[str(name)])
    else:
        raise ScenarioError(unknown("scenario", name, registered(), listing="hmtb scenarios list"))
    scenario = scenario if duration is None else replace(scenario, duration=duration)
    return scenario if seed is None else scenario.reseeded(seed)
