"""The command line `hmtb`: parse the words, call the study, print the result; a file for each command."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.commands.cli import COMMANDS, main, parse
    from scenarios.commands.output import print_json, print_table

__all__ = ["COMMANDS", "main", "parse", "print_json", "print_table"]

_MODULES = {"COMMANDS": "cli", "main": "cli", "parse": "cli", "print_json": "output", "print_table": "output"}


def __getattr__(name: str) -> object:
    # The parser takes a tenth of a second to load: Ctrl-C must find its handler installed before.
    if name not in _MODULES:
        raise AttributeError(f"module 'scenarios.commands' has no attribute {name!r}")
    return getattr(import_module(f"scenarios.commands.{_MODULES[name]}"), name)
