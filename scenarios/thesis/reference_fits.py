"""Fits of the truth to a record: of linear truths without and with coupling, and of the true angles."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import fftconvolve

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from hmtb_twin.bus.recorder import delayed
from scenarios.thesis.campaign import Campaign
from sysid import FrequencyResponse, IOData, StateSpace

SETTLED = 1e-6
"""The impulse response is cut off where the slowest pole has fallen below this part."""
COLUMNS = [JOINTS.index(joint) for joint in STUDIED_JOINTS]

References = Mapping[str, Mapping[str, Mapping[str, float]]]
"""By kind of reference, record and joint: 100 (1 - |y - yhat| / |y - mean y|), simulated, percent."""

DIAGONAL, COUPLED, NOISELESS = "truth without coupling", "truth with coupling", "true angles"
"""References: the small-signal truth, which has no friction, driven by its own command and by all three; true angles,
as late as the bus reads them, without sensor noise."""

BEST_LINEAR = "best linear truth"
"""Reference: the best linear truth of each joint under the PRBS of the estimation test, driven by its own command."""

LINEAR = (BEST_LINEAR, DIAGONAL, COUPLED)


def reference_fits(campaign: Campaign, records: Sequence[str], truth: StateSpace) -> References:
    """Compute the fits of the small-signal truth, without and with coupling, and of the true angles to records.

    `truth` is the true coupled response of the three joints; it has no noise model, so that it simulates.

    Raises:
        MissingRecordError: One of the records is missing.
    """
    pulses = impulse_response(truth)
    responses = {name: _fits_of_record(campaign, name, pulses) for name in records}
    return {kind: {name: fits[kind] for name, fits in responses.items()} for kind in (DIAGONAL, COUPLED, NOISELESS)}


def best_linear_fits(
    campaign: Campaign, record: str, truth: StateSpace, best: Mapping[str, FrequencyResponse]
) -> dict[str, float]:
    """Fits of `BEST_LINEAR` to a record, by joint; see `reference_fits`.

    The response is that of the small-signal truth times the ratio of the two on the lines on which the best linear one
    (`best`, by joint) is measured; below and above them the ratio is held.
    """
    data, moved = _data_and_commands(campaign, record)
    size = 2 * len(moved)
    f, pulses = np.fft.rfftfreq(size, data.dt), impulse_response(truth)
    answers = []
    for i, joint in enumerate(STUDIED_JOINTS):
        lines = best[joint].frequencies
        ratio = best[joint].response[:, 0, 0] / truth.frequency_response(lines)[:, i, i]
        spectrum = np.fft.rfft(moved[:, i], size) * np.fft.rfft(pulses[:, i, i], size)
        held = np.interp(f, lines, ratio.real) + 1j * np.interp(f, lines, ratio.imag)
        answers.append(np.fft.irfft(spectrum * held, size)[len(moved) - len(data) : len(moved)])
    return _fits(data.y, np.stack(answers, axis=1))


def impulse_response(truth: StateSpace) -> np.ndarray:
    """Response (K, ny, nu) of a stable model to a pulse of each input until it has died away."""
    slowest = float(np.abs(truth.poles()).max())
    return truth.markov(2 + int(np.ceil(np.log(SETTLED) / np.log(slowest))) + truth.order)


def _data_and_commands(campaign: Campaign, name: str) -> tuple[IOData, np.ndarray]:
    """A record, and its commands from the start of the log: at rest, so there is no initial state to estimate."""
    whole = campaign.log(name).iodata(STUDIED_JOINTS)
    return campaign.several(name), whole.u - whole.u[0]


def _fits_of_record(campaign: Campaign, name: str, pulses: np.ndarray) -> dict[str, dict[str, float]]:
    data, moved = _data_and_commands(campaign, name)
    answers = fftconvolve(moved[:, None, :], pulses, axes=0)[len(moved) - len(data) : len(moved)]
    read = delayed(campaign.log(name).true_angles, campaign.condition.arm().delays)[:, COLUMNS]
    return {
        DIAGONAL: _fits(data.y, np.diagonal(answers, axis1=1, axis2=2)),
        COUPLED: _fits(data.y, answers.sum(axis=2)),
        NOISELESS: _fits(data.y, read[len(read) - len(data) :]),
    }


def _fits(y: np.ndarray, response: np.ndarray) -> dict[str, float]:
    fits = sysid.validation.fit_percent(y, response - response.mean(axis=0))
    return dict(zip(STUDIED_JOINTS, map(float, fits), strict=True))
