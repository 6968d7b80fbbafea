"""Tables from TOML: every TOML text is read here."""

import re
import tomllib
from collections.abc import Iterable
from itertools import chain
from typing import Any

from hmtb_twin.files.errors import TwinError

MOST_LEVELS = 32
"""Deepest nesting of tables and lists that is read: Python's recursion has a limit."""

_DEEP_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*"|'[^'\n]*')[ \t]*+\.[ \t]*+){{{MOST_LEVELS}}}""")
"""A dotted key of more levels: `tomllib` takes quadratic time for it, minutes for a file of 200 kB."""

MOST_BITS = 63
"""Bits of a whole number without its sign, as TOML requires; Python reads more, but does not print them."""


def toml_table(text: str, source: str) -> dict[str, Any]:
    """Parse TOML.

    Raises:
        TwinError: It is no TOML, nested too deeply, or has whole numbers of more than 63 bits.
    """
    too_deep = f"{source}: values nested too deeply, expected at most {MOST_LEVELS} levels"
    if _DEEP_KEY.search(text):
        raise TwinError(too_deep)
    try:
        table = tomllib.loads(text)
    except RecursionError as error:
        raise TwinError(too_deep) from error
    except ValueError as error:  # also decimal numbers of thousands of digits
        raise TwinError(f"{source}: not a TOML file ({error})") from error
    values: list[Any] = [table]
    for _ in range(MOST_LEVELS):
        for value in values:
            if isinstance(value, int) and value.bit_length() > MOST_BITS:
                raise TwinError(f"{source}: a whole number of {value.bit_length()} bits, expected at most {MOST_BITS}")
        values = list(chain.from_iterable(map(_inside, values)))
    if values:
        raise TwinError(too_deep)
    return table


def _inside(value: Any) -> Iterable[Any]:
    """Values one level below a table or a list."""
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list) else ()
