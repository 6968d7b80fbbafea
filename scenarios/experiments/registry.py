"""Scenarios by name."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError, unknown


class Registry:
    """Scenarios by name; a name can be taken once."""

    def __init__(self) -> None:
        self._entries: dict[str, Scenario] = {}

    def add(self, scenario: Scenario) -> None:
        """Register a scenario.

        Raises:
            ScenarioError: The name is taken.
        """
        if scenario.name in self._entries:
            raise ScenarioError(f"scenario {scenario.name!r} is already registered; choose another name")
        self._entries[scenario.name] = scenario

    def names(self, tag: str | None = None) -> tuple[str, ...]:
        """Names in order of registration, all or those with a tag.

        Raises:
            ScenarioError: No scenario has the tag.
        """
        if tag is not None and tag not in self.tags():
            raise ScenarioError(unknown("tag", tag, self.tags()))
        return tuple(name for name, entry in self._entries.items() if tag is None or tag in entry.tags)

    def tags(self) -> tuple[str, ...]:
        """Every tag in use."""
        return tuple(dict.fromkeys(tag for entry in self._entries.values() for tag in entry.tags))

    def get(self, name: str) -> Scenario:
        """The scenario of that name.

        Raises:
            ScenarioError: There is none.
        """
        if name not in self._entries:
            raise ScenarioError(unknown("scenario", name, self._entries, listing="hmtb scenarios list"))
        return self._entries[name]


def table1() -> tuple[Scenario, ...]:
    """The 24 single-joint tests of the thesis [Morris1996, table 1]."""
    table = _table("table1.toml")
    return _single_joint_tests(table, table["joints"], table["tags"], 0)


def other_joints() -> tuple[Scenario, ...]:
    """The tests of Table 1 on the joints that the thesis left alone."""
    table = _table("table1.toml")
    return _single_joint_tests(table, table["other_joints"], table["other_tags"], len(table["joints"]))


def _single_joint_tests(
    table: Mapping[str, Any], joints: Sequence[str], tags: Sequence[str], first: int
) -> tuple[Scenario, ...]:
    return tuple(
        Scenario.from_table(
            {
                "name": f"siso-{test['number']}-{joint}",
                "axes": [joint],
                "duration": table["duration"],
                "seed": 100 * test["number"] + position,
                "description": f"{joint.replace('_', ' ')}: {test['description']}",
                "tags": [*tags, joint, test["excitation"]["kind"]],
                "excitation": test["excitation"],
            }
        )
        for test in table["test"]
        for position, joint in enumerate(joints, start=first)
    )


def table2() -> tuple[Scenario, ...]:
    """The 13 tests of several joints of the thesis [Morris1996, table 2]."""
    table = _table("table2.toml")
    return tuple(_tool_test(table, test) for test in table["test"])


def independent() -> tuple[Scenario, ...]:
    """Tests of Table 2 with a waveform of its own on every axis."""
    table = _table("table2.toml")
    extra = table["independent"]
    shared = {test["number"]: test for test in table["test"]}
    return tuple(
        replace(
            _tool_test(table, shared[number]),
            name=f"mimo-{number}-independent",
            seed=3000 + number,
            description=f"tool along x, y and z: {shared[number]['description']}, another one on every axis",
            tags=(*extra["tags"], shared[number]["excitation"]["kind"]),
            independent_channels=True,
            excitation=tuple(
                Excitation.from_table({**shared[number]["excitation"], "seed": seed}) for seed in extra["seeds"]
            ),
        )
        for number in extra["tests"]
    )


def exchange() -> tuple[Scenario, ...]:
    """The exchange of the replacement unit [Morris1996, sec. I.3 and VI.4]."""
    table = _table("rpcm.toml")
    return tuple(
        Scenario.from_table(
            {
                **test,
                "axes": table["axes"],
                "mode": table["mode"],
                "worksite": True,
                "payload": "none",
                "tags": table["tags"],
                "hand_controller": {"compensation": _table("table2.toml")["compensation"]},
            }
        )
        for test in table["test"]
    )


def _tool_test(table: Mapping[str, Any], test: Mapping[str, Any]) -> Scenario:
    return Scenario.from_table(
        {
            "name": f"mimo-{test['number']}",
            "axes": table["axes"],
            "mode": table["mode"],
            "duration": table["duration"],
            "seed": 2000 + test["number"],
            "description": f"tool along x, y and z: {test['description']}",
            "tags": [*table["tags"], test["excitation"]["kind"]],
            "hand_controller": {"compensation": table["compensation"]},
            "excitation": test["excitation"],
        }
    )


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((files("scenarios") / "data" / name).read_text(encoding="utf-8"))


@cache
def registered() -> Registry:
    """All scenarios that come with the package."""
    registry = Registry()
    for scenario in (*table1(), *other_joints(), *table2(), *independent(), *exchange()):
        registry.add(scenario)
    return registry


def names(tag: str | None = None) -> tuple[str, ...]:
    """Names of the registered scenarios, all or those with a tag; see `Registry.names`."""
    return registered().names(tag)


def load(name: str | Path) -> Scenario:
    """A registered scenario by name, or one from a TOML file.

    Args:
        name: A registered name, or a path that ends in `.toml`.

    Returns:
        The scenario.

    Raises:
        ScenarioError: There is no such scenario or file, or the file is wrong.
    """
    if str(name).endswith(".toml"):
        return Scenario.read(name)
    return registered().get(str(name))
