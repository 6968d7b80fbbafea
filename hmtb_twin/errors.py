"""The laboratory's error and warning."""


class TwinError(ValueError):
    """Bad input to the laboratory; the message says what was given, what was expected and what is available."""


class TwinWarning(UserWarning):
    """Something about the physics that a user should know, such as an experiment that ran into a limit."""
