"""Scenarios by name."""

import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path

from scenarios.errors import ScenarioError
from scenarios.scenario import Scenario
from scenarios.suggest import unknown


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
    table = tomllib.loads((files("scenarios") / "data" / "table1.toml").read_text(encoding="utf-8"))
    return tuple(
        Scenario.from_table(
            {
                "name": f"siso-{test['number']}-{joint}",
                "axes": [joint],
                "duration": table["duration"],
                "seed": 100 * test["number"] + position,
                "description": f"{joint.replace('_', ' ')}: {test['description']}",
                "tags": [*table["tags"], joint, test["excitation"]["kind"]],
                "excitation": test["excitation"],
            }
        )
        for test in table["test"]
        for position, joint in enumerate(table["joints"])
    )


@cache
def registered() -> Registry:
    """All scenarios that come with the package."""
    registry = Registry()
    for scenario in table1():
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
