"""Errors and warnings of the laboratory."""


class TwinError(ValueError):
    """Invalid input to the laboratory; the message names the given, expected and available values."""


class OverloadError(TwinError):
    """The drives cannot hold the arm at a pose under the present supply pressure."""


class TwinWarning(UserWarning):
    """A physical condition that affects the result, such as an experiment that reached a limit."""
