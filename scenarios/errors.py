"""The one error that the study raises on bad input."""


class ScenarioError(ValueError):
    """Something given to the study is wrong; the message says what was given, expected and available."""
