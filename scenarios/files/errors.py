"""The errors that scenarios raise, with the nearest known name where a name is unknown."""

import difflib
from collections.abc import Iterable

from hmtb_twin.files.errors import abridged, shown

DAMAGE = (OSError, ValueError, LookupError, TypeError, ArithmeticError, AttributeError, RecursionError)
"""Errors that reading a damaged file raises."""


LISTED = 3
"""Most items or differences that a message lists; it counts the others."""

MOST_NAMES = 24
"""Names that a message lists; more fill several lines of a terminal."""


class ScenarioError(ValueError):
    """Wrong input to the study; the message says on half a screen what was given, expected and available."""

    def __init__(self, message: object = "") -> None:
        super().__init__(abridged(str(message)))


class MissingRecordError(ScenarioError):
    """A result needs a record that is missing."""


def unknown(what: str, given: object, available: Iterable[str], *, listing: str | None = None) -> str:
    """Compose the one line for an unknown name.

    Args:
        what: The kind of thing that was looked for, e.g. ``"joint"``.
        given: The name that was given.
        available: The names that exist.
        listing: Command that lists them, where they are too many for the line.

    Returns:
        ``unknown joint 'elbow': did you mean 'elbow_pitch'? There are: ...``, or without a near name
        ``unknown joint 'hip'; there are: ...``
    """
    names = list(available)
    # Of names too many for the line, three near ones help more than the nearest.
    count = 3 if listing else 1
    close = difflib.get_close_matches(str(given), names, n=count, cutoff=0.5)
    if listing is not None:
        there_are = f"there are {len(names)}, listed by: {listing}"
    else:
        there_are = f"there are: {', '.join(names[:MOST_NAMES])}"
        if len(names) > MOST_NAMES:
            there_are += f", ... ({len(names)} in all)"
    if not close:
        return f"unknown {what} {shown(given)}; {there_are}"
    meant = " or ".join(map(repr, close))
    return f"unknown {what} {shown(given)}: did you mean {meant}? {there_are[0].upper()}{there_are[1:]}"
