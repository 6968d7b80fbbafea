"""Trivial model of a servo: every output follows its command, with gain one, after some samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LONGEST = 20_000  # samples of the records of the fit from which the delay is taken
MOST = 200  # samples of delay, at most
SHARE = 10  # of a record, a delay is at most one part in so many


@dataclass(frozen=True, eq=False)
class CommandBaseline:
    """How well commands, delayed, describe the outputs.

    Attributes:
        fit: Fit of each output, % (ny,), as that of a simulation.
        delays: Samples by which each command is delayed, the best ones on the records of the fit.
    """

    fit: FloatArray
    delays: tuple[int, ...]


def command_baseline(records: Sequence[IOData], checked: Sequence[IOData]) -> CommandBaseline | None:
    """Fit of the commands themselves, y_i(t) = u_i(t - d_i), to records about their operating points.

    Args:
        records: Records of the fit, from which the delays are taken.
        checked: Records that judge, behind their windows.

    Returns:
        The fits; None where inputs and outputs differ in number or units.
    """
    first = records[0]
    if first.nu != first.ny or not first.nu or first.input_units != first.output_units:
        return None
    longest = max(records, key=len)[:LONGEST]
    limit = min(MOST, len(longest) // SHARE)
    delays, fits = [], []
    for i in range(first.ny):
        sums = [_mean_square(_errors(longest, i, delay)[limit:]) for delay in range(limit + 1)]
        delay = int(np.argmin(sums))
        errors, deviations = [], []
        for record in checked:
            y = record.y[record.window :, i]
            errors.append(_errors(record, i, delay)[record.window :])
            deviations.append(y - np.nanmean(y))
        ratio = _mean_square(np.concatenate(errors)) / _mean_square(np.concatenate(deviations))
        delays.append(delay)
        fits.append(100.0 * (1.0 - np.sqrt(ratio)))
    return CommandBaseline(np.array(fits), tuple(delays))


def _errors(record: IOData, i: int, delay: int) -> FloatArray:
    """Output i less its command of so many samples before (N,); before the record it stands still."""
    u = record.u[:, i]
    delayed = np.concatenate((np.full(delay, u[0]), u))[: len(u)]
    return np.asarray(record.y[:, i] - delayed)


def _mean_square(errors: FloatArray) -> float:
    """Mean square of the known values, the least positive number if all are zero."""
    return max(float(np.nanmean(errors**2)), float(np.finfo(float).tiny))
