"""`hmtb scenarios`: the list of experiments, and one as TOML."""

from itertools import chain
from typing import Annotated, Literal

import tyro

from scenarios.commands.output import print_json, print_table, say
from scenarios.experiments.registry import load, names, registered, tags, tests_of
from scenarios.files.errors import ScenarioError
from scenarios.files.toml_file import read_toml


def scenarios(
    action: Annotated[Literal["list", "show"], tyro.conf.Positional] = "list",
    name: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO]")] = None,
    *,
    tag: str | None = None,
    arm: str | None = None,
    json: bool = False,
) -> int:
    """List the experiments that exist, or show one as TOML.

    An experiment of your own starts from one that exists: write it to a file, edit it, and simulate it:

      hmtb scenarios show siso-5-elbow_pitch > mine.toml
      hmtb simulate mine.toml

    Args:
        action: list them all, or show one as TOML.
        name: With show: which one, a registered name or a TOML file. list takes none.
        tag: With list: only those with this tag.
        arm: The tests of an arm instead: a variant of the test bed, another arm by name (panda), or the path of an
            MJCF, a URDF or a folder.
        json: Print JSON.
    """
    if action == "show":
        if name is None:
            raise ScenarioError(
                f"hmtb scenarios show needs a name; there are {len(names())}, listed by: hmtb scenarios list"
            )
        scenario = load(name, arm=arm)
        if json:
            # With their defaults, which the TOML leaves out.
            complete = {table: vars(getattr(scenario, table)) for table in ("chain", "hand_controller")}
            print_json({"excitation": [], **read_toml(scenario.to_toml(), name), **complete})
        else:
            say(scenario.to_toml().rstrip())
        return 0
    if name is not None:
        raise ScenarioError(
            f"hmtb scenarios list takes no name, given {name!r}; did you mean: hmtb scenarios show {name}"
        )
    if arm is None:
        tables = [registered()[scenario] for scenario in names(tag)]
    else:
        tables = [table for table in tests_of(arm).values() if tag is None or tag in table["tags"]]
    if json:
        keys = ("name", "description", "duration", "axes", "tags")
        print_json({"scenarios": [{key: table[key] for key in keys} for table in tables]})
        return 0
    rows = [(table["name"], f"{table['duration']:g} s", table["description"]) for table in tables]
    known_tags = tags() if arm is None else dict.fromkeys(chain.from_iterable(table["tags"] for table in tables))
    print_table(f"{len(rows)} scenarios; tags: {', '.join(known_tags)}", ("name", "length", "what it does"), rows)
    return 0
