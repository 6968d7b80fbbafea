"""From a log to what an estimator gets: the settled part, without its mean."""

from collections.abc import Sequence
from dataclasses import replace

from hmtb_twin import JointLog
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
    """
    data = log.iodata(joints)
    start = round(SETTLING / data.dt)
    return replace(data[start:] if len(data) > 2 * start else data, name=log.name)


def prepared(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Cut off the start, then remove the means.

    Args:
        log: The log of an experiment.
        joints: The joint to look at, or several.

    Returns:
        Commanded and measured angle of each joint, rad, named after the experiment.
    """
    return settled(log, joints).detrend()
