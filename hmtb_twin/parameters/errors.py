"""The laboratory's error and warning."""


class TwinError(ValueError):
    """Bad input to the laboratory; the message says what was given, what was expected and what is available."""


class OverloadError(TwinError):
    """The drives cannot hold the arm at a pose, as the supply pressure is."""


class TwinWarning(UserWarning):
    """Something about the physics that a user should know, such as an experiment that ran into a limit."""
