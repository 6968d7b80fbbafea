"""The errors that the study raises."""


class ScenarioError(ValueError):
    """Something given to the study is wrong; the message says what was given, expected and available."""


class MissingRecordError(ScenarioError):
    """What is asked for needs a record that is not there."""
