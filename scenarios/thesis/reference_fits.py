"""Fits of the truth to a record: the best that a model without coupling, or any linear model, can reach."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import fftconvolve

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog
from scenarios.thesis.campaign import Campaign
from sysid import StateSpace

SETTLED = 1e-6
"""The impulse response is cut off where the slowest pole has fallen below this part."""

READS_LATE = 3
"""Most samples that a bus may read an angle late."""


References = Mapping[str, Mapping[str, Mapping[str, float]]]
"""By kind of reference, record and joint: 100 (1 - |y - yhat| / |y - mean y|), simulated, percent."""

DIAGONAL, COUPLED, NOISELESS = "truth without coupling", "truth with coupling", "true angles"
"""References: linear truth driven by its own command, by all three commands, and true angles without sensor noise."""


def reference_fits(campaign: Campaign, records: Sequence[str], truth: StateSpace) -> References:
    """Compute the fits of the truth to records.

    Args:
        campaign: The records.
        records: Names of those wanted.
        truth: The true coupled response of the three joints; it has no noise model, so that it simulates.

    Returns:
        The linear truth without and with coupling, and the true angles.

    Raises:
        MissingRecordError: One of the records is missing.
    """
    pulses = impulse_response(truth)
    responses = {name: _fits_of_record(campaign, name, pulses) for name in records}
    return {kind: {name: fits[kind] for name, fits in responses.items()} for kind in (DIAGONAL, COUPLED, NOISELESS)}


def impulse_response(truth: StateSpace) -> np.ndarray:
    """Response to a pulse of each input until it has died away.

    Args:
        truth: A stable model.

    Returns:
        Samples (K, ny, nu).
    """
    slowest = float(np.abs(truth.poles()).max())
    return truth.markov(2 + int(np.ceil(np.log(SETTLED) / np.log(slowest))) + truth.order)


def _fits_of_record(campaign: Campaign, name: str, pulses: np.ndarray) -> dict[str, dict[str, float]]:
    """Fits of one record, simulated from the start of the log: at rest, so there is no initial state to estimate."""
    log, data = campaign.log(name), campaign.several(name)
    whole = log.iodata(STUDIED_JOINTS)
    moved = whole.u - whole.u[0]
    answers = fftconvolve(moved[:, None, :], pulses, axes=0)[len(moved) - len(data) : len(moved)]
    return {
        DIAGONAL: _fits(data.y, np.diagonal(answers, axis1=1, axis2=2)),
        COUPLED: _fits(data.y, answers.sum(axis=2)),
        NOISELESS: _noiseless(log, data.y),
    }


def _noiseless(log: JointLog, y: np.ndarray) -> dict[str, float]:
    """Fit of the true angles, each delayed by the number of samples that fits best: the bus delays some joints."""
    true = log.true_angles[:, [JOINTS.index(joint) for joint in STUDIED_JOINTS]]
    late = [_fits(y, true[len(true) - len(y) - n : len(true) - n]) for n in range(READS_LATE + 1)]
    return {joint: max(fits[joint] for fits in late) for joint in STUDIED_JOINTS}


def _fits(y: np.ndarray, response: np.ndarray) -> dict[str, float]:
    fits = sysid.validation.fit_percent(y, response - response.mean(axis=0))
    return dict(zip(STUDIED_JOINTS, map(float, fits), strict=True))
