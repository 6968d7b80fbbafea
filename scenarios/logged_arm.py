"""The arm that a log was recorded from, from what the log tells of itself."""

from dataclasses import fields
from typing import Any, get_type_hints

from hmtb_twin import Arm, JointLog, Plant, load_arm
from scenarios.errors import ScenarioError

NEEDED = ("variant", "payload", "pose", "friction")


def logged_arm(log: JointLog) -> Arm:
    """Return the arm in free space, under the conditions of the record.

    Args:
        log: A log of the twin, of this version or an older one: what an older one does not tell is nominal.

    Raises:
        ScenarioError: The log does not tell, or holds an emergency shutdown or work in contact.
        TwinError: It tells of something that the laboratory does not have.
    """
    missing = [key for key in NEEDED if key not in log.provenance]
    if missing:
        raise ScenarioError(
            f"{log.name}: its provenance lacks {', '.join(missing)}; expected a log of the twin, which knows the "
            "truth about its own arm only"
        )
    return load_arm(
        log.provenance["variant"],
        log.provenance["payload"],
        plant=logged_plant(log),
        friction=log.provenance["friction"] == "true",
    )


def logged_plant(log: JointLog) -> Plant:
    """Return the conditions of the record.

    Raises:
        ScenarioError: A condition is no number where one is expected.
    """
    hints = get_type_hints(Plant)
    values: dict[str, Any] = {}
    for entry in fields(Plant):
        text = log.provenance.get(f"plant_{entry.name}")
        if text is None:
            continue
        try:
            values[entry.name] = text == "True" if hints[entry.name] is bool else hints[entry.name](text)
        except ValueError as error:
            raise ScenarioError(
                f"{log.name}: plant_{entry.name} = {text!r} in its provenance, expected a number"
            ) from error
    return Plant(**values)
