"""Registered scenarios by name: the experiments of the thesis and others that come with the package.

Their tables are plain data: a list of them needs no laboratory, which takes more than a second to load.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import package_table

if TYPE_CHECKING:
    from scenarios.experiments.scenario import Scenario

VARIANT_NAMES = ("nominal", "published", "flight", "released")
"""Arms of the test bed, whose tests are registered: a list of names needs no laboratory."""

Table = dict[str, Any]
"""A scenario as its TOML file holds it; each has a name, axes, a duration, a description and tags."""


def single_joint_tests() -> list[Table]:
    """The 24 single-joint tests of the thesis [Morris1996, table 1], then the same on the joints that it left alone."""
    source = package_table("table1.toml")
    tables = _tests_of_joints(source, source["joints"], source["tags"], first_position=0)
    # Every test has noise of its own: the joints that were added later are counted on from those of the thesis.
    added_from = len(source["joints"])
    return tables + _tests_of_joints(source, source["other_joints"], source["other_tags"], first_position=added_from)


def _tests_of_joints(source: Table, joints: Sequence[str], tags: Sequence[str], *, first_position: int) -> list[Table]:
    """Every test of Table 1 on each of the joints."""
    tables = []
    for test in source["test"]:
        number, excitation = test["number"], test["excitation"]
        for position, joint in enumerate(joints, start=first_position):
            table = {
                "name": f"siso-{number}-{joint}",
                "axes": [joint],
                "duration": source["duration"],
                "seed": 100 * number + position,
                "description": f"{_in_words(joint)}: {test['description']}",
                "tags": [*tags, joint, excitation["kind"]],
                "excitation": excitation,
            }
            tables.append(table)
    return tables


def _in_words(joint: str) -> str:
    return joint.replace("_", " ")


def table2() -> list[Table]:
    """The 13 tests of several joints of the thesis [Morris1996, table 2]."""
    source = package_table("table2.toml")
    tables = []
    for test in source["test"]:
        number, excitation = test["number"], test["excitation"]
        table = {
            "name": f"mimo-{number}",
            "axes": source["axes"],
            "mode": source["mode"],
            "duration": source["duration"],
            # The tables have seeds a thousand apart: no two tests share their noise.
            "seed": 2000 + number,
            "description": f"tool along x, y and z: {test['description']}",
            "tags": [*source["tags"], excitation["kind"]],
            "hand_controller": {"compensation": source["compensation"]},
            "excitation": excitation,
        }
        tables.append(table)
    return tables


def independent() -> list[Table]:
    """Tests of Table 2 with a waveform of its own on every axis."""
    source = package_table("table2.toml")["independent"]
    common_waveform_tests = {table["name"]: table for table in table2()}
    tables = []
    for number in source["tests"]:
        test = common_waveform_tests[f"mimo-{number}"]
        excitation = test["excitation"]
        changes = {
            "name": f"mimo-{number}-independent",
            "seed": 3000 + number,
            "description": f"{test['description']}, another one on every axis",
            "tags": [*source["tags"], excitation["kind"]],
            "independent_channels": True,
            "excitation": [{**excitation, "seed": seed} for seed in source["seeds"]],
        }
        tables.append({**test, **changes})
    return tables


def exchange() -> list[Table]:
    """Tasks of an operator: the exchange of the replacement unit [Morris1996, sec. I.3 and VI.4], and free motion."""
    source = package_table("rpcm.toml")
    every_test = {
        "axes": source["axes"],
        "mode": source["mode"],
        "worksite": True,
        "payload": "none",
        "tags": source["tags"],
    }
    hand_controller = {"compensation": package_table("table2.toml")["compensation"]}
    return [{**every_test, **test, "hand_controller": hand_controller} for test in source["test"]]


def tracking() -> list[Table]:
    """Tests of one joint whose payload is exchanged during the run."""
    source = package_table("track.toml")
    every_test = source["every"]
    tables = []
    for position, joint in enumerate(source["joints"]):
        table = {
            **every_test,
            "name": f"track-{joint}",
            "axes": [joint],
            "seed": 5000 + position,
            "description": f"{_in_words(joint)}: {source['description']}",
            "tags": [*source["tags"], joint, every_test["excitation"]["kind"]],
        }
        tables.append(table)
    return tables


def every_joint() -> list[Table]:
    """All seven joints at once, each with a multisine of its own: what the thesis left to future work [Morris1996]."""
    source = package_table("every_joint.toml")
    multisine = source["excitation"]
    return [{**source, "excitation": [{**multisine, "seed": seed} for seed in range(len(source["axes"]))]}]


@cache
def registered() -> Mapping[str, Table]:
    """The tables of all registered scenarios by name."""
    tables = [*single_joint_tests(), *table2(), *independent(), *exchange(), *tracking(), *every_joint()]
    return {table["name"]: table for table in tables}


def names(tag: str | None = None) -> tuple[str, ...]:
    """Names of the registered scenarios in order of registration, all or those with a tag.

    Raises:
        ScenarioError: No scenario has the tag.
    """
    if tag is not None and tag not in tags():
        raise ScenarioError(unknown("tag", tag, tags()))
    if tag is None:
        return tuple(registered())
    return tuple(name for name, table in registered().items() if tag in table["tags"])


def tags() -> tuple[str, ...]:
    """Every tag of the registered scenarios."""
    return tuple(dict.fromkeys(chain.from_iterable(table["tags"] for table in registered().values())))


def tests_of(arm: str) -> Mapping[str, Table]:
    """The tests of an arm, by name or from its files, by their names.

    Raises:
        ScenarioError: There is no such arm, or its files are wrong.
    """
    # Here, because they load the laboratory.
    from scenarios.experiments.arm_tests import arm_tests
    from scenarios.experiments.scenario import known_arm

    return {table["name"]: table for table in arm_tests(known_arm(arm))}


def selected(
    words: Sequence[str], *, duration: float | None = None, seed: int | None = None, arm: str | None = None
) -> "list[Scenario]":
    """Scenarios by words: registered names, tags, TOML files.

    Args:
        words: The words.
        duration: Length instead of their own, s.
        seed: Draws other noise.
        arm: The arm instead of their own; its own tests are known by name too.

    Raises:
        ScenarioError: There is no word, a word names nothing, or a file is wrong.
    """
    found_names: list[str] = []
    of_arm = {} if arm is None else tests_of(arm)
    for word in words:
        tagged = [name for name, table in of_arm.items() if word in table["tags"]]
        if tagged:
            found_names += tagged
        elif word in tags() and not of_arm:
            found_names += names(word)
        else:
            found_names.append(word)
    if not found_names:
        raise ScenarioError(
            f"no scenario named; there are {len(names())}, listed by: hmtb scenarios list; tags: {', '.join(tags())}"
        )
    return [load(name, duration=duration, seed=seed, arm=arm) for name in found_names]


def load(
    name: str | Path, *, duration: float | None = None, seed: int | None = None, arm: str | None = None
) -> "Scenario":
    """A registered scenario by name, or one from a TOML file.

    Args:
        name: A registered name, a test of the arm, or a path that ends in `.toml`.
        duration: Length instead of its own, s.
        seed: Draws other noise.
        arm: The arm instead of its own: a variant of the test bed, the name of another arm, or a path of its files.

    Raises:
        ScenarioError: There is no such scenario or file, or the file is wrong.
    """
    # Here, because it loads the laboratory; a list of names does without.
    from scenarios.experiments.scenario import Scenario

    # A registered name has no ending: what ends so is a file, even if it is missing.
    of_arm = {} if arm is None else tests_of(arm)
    if str(name).endswith(".toml"):
        scenario = Scenario.read(name)
        if arm is not None:
            scenario = on_arm(scenario, arm)
    elif str(name) in of_arm:
        scenario = Scenario.from_table(of_arm[str(name)])
    elif arm is not None and arm not in VARIANT_NAMES:
        raise ScenarioError(unknown(f"test of the arm {arm}", name, of_arm, listing=f"hmtb scenarios --arm {arm}"))
    elif str(name) in registered():
        scenario = Scenario.from_table(registered()[str(name)])
        if arm is not None:
            scenario = replace(scenario, variant=arm)
    else:
        raise ScenarioError(unknown("scenario", name, registered(), listing="hmtb scenarios list"))
    if duration is not None:
        scenario = replace(scenario, duration=duration)
    if seed is not None:
        scenario = scenario.reseeded(seed)
    return scenario


def on_arm(scenario: "Scenario", arm: str) -> "Scenario":
    """Return an experiment on another arm, with that arm's payload and pose where it has none of the same name.

    Raises:
        ScenarioError: There is no such arm, or it has no such axes.
    """
    from hmtb_twin.parameters.payloads import OWN
    from scenarios.experiments.scenario import known_arm

    description = known_arm(arm)
    has_payload = scenario.payload in description.payloads or scenario.payload.startswith(OWN)
    payload = scenario.payload if has_payload else description.tuned_payload
    pose = scenario.pose if scenario.pose in description.poses else description.operating_pose
    return replace(scenario, variant=arm, payload=payload, pose=pose)
