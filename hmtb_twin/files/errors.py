"""Errors and warnings of the laboratory."""

import os


class TwinError(ValueError):
    """Invalid input to the laboratory; the message names the given, expected and available values."""


class OverloadError(TwinError):
    """The drives cannot hold the arm at a pose under the present supply pressure."""


class TwinWarning(UserWarning):
    """A physical condition that affects the result, such as an experiment that reached a limit."""


def system_reason(error: OSError) -> str:
    """Return the system's reason for an error; libraries such as HDF5 put their own trace into the error's text."""
    return os.strerror(error.errno) if error.errno else "the file system refuses"
