"""Settled part of a log without its means, the share of it at the velocity limit, and words for its status."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmtb_twin import JointLog, Status
from scenarios.files.errors import ScenarioError
from sysid import IOData

SETTLING = 4.0
"""Length cut off at the start, s: every waveform file repeats in it, and the arm settles to its periodic response.

Detrending a record with its start removes different constants from input and output, because the output lags; a
constant of a hundredth of a milliradian is enough to make an output-error model of high order invent a pole at 0.002
Hz. The thesis too let each excitation reach steady state [Morris1996, sec. II.2B].
"""

RATE_LIMITED = (
    "The velocity limit acts before the recorded command: it does not distort a model from recorded command to angle."
)

WORDS = {
    Status.VELOCITY_LIMITED: "velocity limit",
    Status.JOINT_LIMITED: "end of a joint's range",
    Status.SINGULAR: "near singular",
    Status.CONVERTER_SATURATED: "converter saturated",
    Status.SHUT_DOWN: "SHUT DOWN",
    Status.UNIT_HELD: "unit held",
}
"""Words for the status of a tick."""


def settled(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Return commanded and measured angles of joints without the start of the log; the means stay.

    Returns:
        Record in rad, named after the experiment.

    Raises:
        ScenarioError: The log is so short that no more would be left than is cut off.
    """
    data = log.iodata(joints)
    start = round(SETTLING / data.dt)
    if len(data) <= 2 * start:
        raise ScenarioError(
            f"{log.name}: a log of {len(data) * data.dt:g} s given, expected more than {2 * SETTLING:g} s: the arm "
            f"settles for {SETTLING:g} s, which are cut off"
        )
    return replace(data[start:], name=log.name)


def prepared(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Return the `settled` part of a log without its means, which is what estimators get."""
    return settled(log, joints).detrend()


def velocity_limited_share(log: JointLog) -> float:
    """Return the fraction of samples at which a joint's command moves at its velocity limit."""
    return float(np.mean((log.status & Status.VELOCITY_LIMITED) != 0))


def swing(log: JointLog, joint: str) -> float:
    """Return half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)


def status_words(status: int) -> list[str]:
    """Words for the flags of a tick."""
    return [word for flag, word in WORDS.items() if status & flag]
