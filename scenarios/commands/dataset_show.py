"""`hmtb dataset show`: the spec of a data set, to start one's own from."""

import tomllib
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, say


def show(spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")], /, *, json: bool = False) -> int:
    """Show the spec of a data set as TOML, all defaults written out, to start your own from.

    hmtb dataset show hmtb-siso-v1 > mine.toml, edit it and give it another name, then hmtb dataset build mine.toml.

    Args:
        spec: One that comes with the package (hmtb dataset list) or a TOML file.
        json: Print JSON.
    """
    from scenarios.datasets.spec import load_spec

    text = load_spec(spec).to_toml()
    if json:
        print_json(tomllib.loads(text))
    else:
        say(text.rstrip())
    return 0
