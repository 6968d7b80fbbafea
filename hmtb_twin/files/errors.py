"""Errors and warnings of the laboratory."""

import os
from numbers import Real


class TwinError(ValueError):
    """Invalid input to the laboratory; the message names the given, expected and available values."""


class OverloadError(TwinError):
    """The drives cannot hold the arm at a pose under the present supply pressure."""


class TwinWarning(UserWarning):
    """A physical condition that affects the result, such as an experiment that reached a limit."""


LONGEST = 60
"""Longest quotation of a wrong value, in characters."""


def shown(value: object) -> str:
    """Quote a wrong value in an error: on one line, cut where it is long, numbers of NumPy as plain ones."""
    try:
        text = " ".join((str if isinstance(value, Real) else repr)(value).split())
    except ValueError:
        # Python does not print whole numbers of thousands of digits.
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def system_reason(error: OSError) -> str:
    """Return the system's reason for an error; libraries such as HDF5 put their own trace into the error's text."""
    return os.strerror(error.errno) if error.errno else "the file system refuses"
