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
    by_kind: dict[str, dict[str, Mapping[str, float]]] = {DIAGONAL: {}, COUPLED: {}, NOISELESS: {}}
    for record in records:
        for kind, fits in _fits_of_record(campaign, record, pulses).items():
            by_kind[kind][record] = fits
    return by_kind


def best_linear_fits(
    campaign: Campaign, record: str, truth: StateSpace, best: Mapping[str, FrequencyResponse]
) -> dict[str, float]:
    """Fits of `BEST_LINEAR` to a record, by joint; see `reference_fits`.

    The response is that of the small-signal truth times the ratio of the two on the lines on which the best linear one
    (`best`, by joint) is measured; below and above them the ratio is held.
    """
    data, commands = _data_and_commands(campaign, record)
    # Twice the length: the product of spectra is a circular convolution, whose wrapped end must not reach the record.
    size = 2 * len(commands)
    f, pulses = np.fft.rfftfreq(size, data.dt), impulse_response(truth)
    responses = []
    for channel, joint in enumerate(STUDIED_JOINTS):
        lines = best[joint].frequencies
        # The ratio of two responses of one arm varies slowly: unlike either response it can be interpolated.
        ratio = best[joint].response[:, 0, 0] / truth.frequency_response(lines)[:, channel, channel]
        spectrum = np.fft.rfft(commands[:, channel], size) * np.fft.rfft(pulses[:, channel, channel], size)
        interpolated = np.interp(f, lines, ratio.real) + 1j * np.interp(f, lines, ratio.imag)
        response = np.fft.irfft(spectrum * interpolated, size)
        responses.append(response[len(commands) - len(data) : len(commands)])
    return _fits(data.y, np.stack(responses, axis=1))


def impulse_response(truth: StateSpace) -> np.ndarray:
    """Response (K, ny, nu) of a stable model to a pulse of each input until it has died away."""
    slowest = float(np.abs(truth.poles()).max())
    # The delays come before the decay: no more of them than there are states.
    return truth.markov(2 + int(np.ceil(np.log(SETTLED) / np.log(slowest))) + truth.order)


def _data_and_commands(campaign: Campaign, name: str) -> tuple[IOData, np.ndarray]:
    """A record, and its commands from the start of the log: at rest, so there is no initial state to estimate."""
    log = campaign.log(name).iodata(STUDIED_JOINTS)
    return campaign.several(name), log.u - log.u[0]


def _fits_of_record(campaign: Campaign, name: str, pulses: np.ndarray) -> dict[str, dict[str, float]]:
    """Fits of each kind of truth to one record, by joint."""
    data, commands = _data_and_commands(campaign, name)
    # Response of each joint to each command (N, outputs, inputs). The record is the end of the log: the responses
    # before it are those to the start of the waveform.
    responses = fftconvolve(commands[:, None, :], pulses, axes=0)[len(commands) - len(data) : len(commands)]
    true_angles = delayed(campaign.log(name).true_angles, campaign.condition.arm().delays)[:, COLUMNS]
    return {
        DIAGONAL: _fits(data.y, np.diagonal(responses, axis1=1, axis2=2)),
        COUPLED: _fits(data.y, responses.sum(axis=2)),
        NOISELESS: _fits(data.y, true_angles[len(true_angles) - len(data) :]),
    }


def _fits(y: np.ndarray, response: np.ndarray) -> dict[str, float]:
    """Fits of a simulated response without its mean to a record, by joint, percent."""
    # Records have lost their mean: so must what is compared with them.
    fits = sysid.validation.fit_percent(y, response - response.mean(axis=0))
    return dict(zip(STUDIED_JOINTS, map(float, fits), strict=True))
