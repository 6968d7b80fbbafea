"""Errors and warnings of the laboratory."""

import os
from numbers import Real

MOST_CHARACTERS = 1000
"""Longest message of an error, half a screen: names and values of strangers' files in it have any length."""


def abridged(text: str) -> str:
    """Leave out the middle of a message longer than half a screen; the end says what was expected."""
    if len(text) <= MOST_CHARACTERS:
        return text
    beginning, end = text[: 2 * MOST_CHARACTERS // 3], text[-MOST_CHARACTERS // 4 :]
    return f"{beginning} ... ({len(text) - len(beginning) - len(end)} characters left out) ... {end}"


class TwinError(ValueError):
    """Invalid input to the laboratory; the message names the given, expected and available values, on half a screen."""

    def __init__(self, message: object = "") -> None:
        super().__init__(abridged(str(message)))


class OverloadError(TwinError):
    """The drives cannot hold the arm at a pose under the present supply pressure."""


class TwinWarning(UserWarning):
    """A physical condition that affects the result, such as an experiment that reached a limit."""


LONGEST = 60
"""Longest quotation of a wrong value, in characters."""


def shown(value: object) -> str:
    """Quote a wrong value in an error: on one line, cut where it is long, numbers of NumPy as plain ones."""
    # `repr` of a number of NumPy names its type.
    written = str if isinstance(value, Real) else repr
    try:
        text = " ".join(written(value).split())
    except (ValueError, RecursionError):
        # Python prints neither whole numbers of thousands of digits nor lists in lists without end.
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def system_reason(error: OSError) -> str:
    """Return the system's reason for an error; libraries such as HDF5 put their own trace into the error's text."""
    return os.strerror(error.errno) if error.errno else "the file system refuses"
