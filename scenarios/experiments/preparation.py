"""From a log to what an estimator gets: the settled part, without its mean."""

from collections.abc import Sequence
from dataclasses import replace

from hmtb_twin import JointLog
from scenarios.files.errors import ScenarioError
from sysid import IOData

SETTLING = 4.0
"""What is cut off at the start, s: every waveform file repeats in it, and the arm has settled into its periodic answer.

Detrending a record with its start takes different constants off input and output, because the output lags; a constant
of a hundredth of a milliradian is enough to make an output-error model of high order invent a pole at 0.002 Hz. The
thesis too let each excitation reach steady state [Morris1996, sec. II.2B].
"""


def settled(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Cut off the start; the means stay.

    Args:
        log: The log of an experiment.
        joints: The joint to look at, or several.

    Returns:
        Commanded and measured angle of each joint, rad, named after the experiment.

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
    """Cut off the start, then remove the means.

    Args:
        log: The log of an experiment.
        joints: The joint to look at, or several.

    Returns:
        Commanded and measured angle of each joint, rad, named after the experiment.

    Raises:
        ScenarioError: The log is so short that no more would be left than is cut off.
    """
    return settled(log, joints).detrend()
