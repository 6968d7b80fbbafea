"""The command line `hmtb`: parse the words, call the study, print the result; a file for each command."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.commands.cli import COMMANDS, main, parse
    from scenarios.commands.output import print_json, print_table

__all__ = ["COMMANDS", "main", "parse", "print_json", "print_table"]

__getattr__ = lazy_names(__name__, __file__)
