"""Scores of a run against its reference: errors, response that the operator sees, effort, limits, forces, stability."""

import warnings
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

import sysid
from hmtb_twin import JointLog, Status
from scenarios.control.campaign import channels
from scenarios.experiments.scenario import known_arm
from sysid import FrequencyResponse, IOData, StateSpace, SysidError, SysidWarning
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from sysid.records.arrays import ComplexArray, FloatArray, Locked

FREQUENCIES = (0.5, 1.0, 2.0)
"""Frequencies at which phase and gain are read, Hz."""

LAG = 200
"""Lag window of the spectral estimate, samples: a resolution of 0.25 Hz."""

GRID = np.arange(0.1, 5.01, 0.05)
"""Frequencies of the spectral estimate, Hz."""

UNCERTAIN = 0.1
"""Largest standard deviation of a gain that is read, as a part of it."""

WEAK = 0.01
"""Power of a request relative to its peak below which leakage of the lag window may exceed it."""

MOVES = 1e-4
"""Range of a request that is more than noise, rad."""

GROWTH = 2.0
"""A run is unstable if its error in the last quarter exceeds that of every earlier quarter this many times."""

BOUND = 0.5
"""Largest error of a bounded run, rad."""


@dataclass(frozen=True, eq=False)
class SeenResponse(Locked):
    """Response from request to angle as an operator sees it, estimated from one run.

    Attributes:
        gains: At `FREQUENCIES`, of every joint (3, m); NaN where the record does not determine them.
        phases: Likewise, rad.
        bandwidth_hz: Where the gain falls below 0.707 (m,), Hz; NaN where the record does not show it.
    """

    gains: FloatArray
    phases: FloatArray
    bandwidth_hz: FloatArray


@dataclass(frozen=True, eq=False)
class Score(Locked):
    """Scores of one run, the controlled joints in the order of the arm.

    Attributes:
        rmse: Root mean square error against the reference model's output for the run's own requests (m,), rad.
        rmse_arm: The same against the simulated reference arm (m,), rad; None where there is none.
        response: Response that the operator sees.
        reference_response: The same estimate from the reference model's output.
        effort: Root mean square of the rate of the command (m,), rad/s.
        limited: Share of the ticks at a velocity limit or an end of a joint's range.
        force: Largest contact force, N; NaN in free space.
        force_99: Contact force that 99 % of the ticks with contact stay below, N; NaN in free space.
        stable: Whether the error is bounded and does not grow.
    """

    rmse: FloatArray
    rmse_arm: FloatArray | None
    response: SeenResponse
    reference_response: SeenResponse
    effort: FloatArray
    limited: float
    force: float
    force_99: float
    stable: bool

    @property
    def total(self) -> float:
        """Root mean square error over all joints against the reference model, rad."""
        return float(_rms(self.rmse))

    @property
    def total_arm(self) -> float:
        """Root mean square error against the simulated reference arm, rad; NaN without one."""
        return float("nan") if self.rmse_arm is None else float(_rms(self.rmse_arm))


def request_of(log: JointLog) -> FloatArray:
    """Return what the operator requested of the controlled joints (N, m), rad, less the pose at the start."""
    # Without a controller the log has no request of its own: what was sent is the request.
    requested = _sent(log) if log.requested is None else log.requested
    return np.asarray((requested - _pose(log))[:, _columns(log)])


def answer_of(log: JointLog) -> FloatArray:
    """Return the measured angles of the controlled joints (N, m), rad, less the pose at the start."""
    return np.asarray((log.measured - _pose(log))[:, _columns(log)])


def score(log: JointLog, reference: StateSpace, arm: JointLog | None = None) -> Score:
    """Score a run.

    Args:
        log: The run.
        reference: Reference model of the controlled joints.
        arm: Run of the reference arm with the same requests; None in contact with the worksite.
    """
    request, answer = request_of(log), answer_of(log)
    reference_answer = np.asarray(sysid.simulate(reference, request))
    error = answer - reference_answer
    rmse_arm = None if arm is None else _rms(answer - answer_of(arm))
    force = np.array([np.nan]) if log.contact_force is None else log.contact_force
    force_in_contact = force[force > 0.0]
    force_99 = float(np.quantile(force_in_contact, 0.99)) if len(force_in_contact) else float("nan")
    command_rate = np.diff(_sent(log)[:, _columns(log)], axis=0) / log.dt
    at_limit = (log.status & (Status.VELOCITY_LIMITED | Status.JOINT_LIMITED)) != 0
    return Score(
        rmse=_rms(error),
        rmse_arm=rmse_arm,
        response=_seen(request, answer, log.dt),
        reference_response=_seen(request, reference_answer, log.dt),
        effort=_rms(command_rate),
        limited=float(np.mean(at_limit)),
        force=float(force.max()),
        force_99=force_99,
        stable=is_stable(error),
    )


def is_stable(error: FloatArray) -> bool:
    """Return whether an error (N, m), rad, is bounded and does not grow from quarter to quarter."""
    quarters = [float(_rms(quarter.ravel())) for quarter in np.array_split(error, 4)]
    return bool(np.abs(error).max() < BOUND and quarters[-1] <= GROWTH * max(quarters[:-1]))


def _sent(log: JointLog) -> FloatArray:
    """Return the commands that the arm felt (N, n), rad."""
    return log.commanded if log.sent is None else log.sent


def _pose(log: JointLog) -> FloatArray:
    """Return the pose at rest (n,), rad; the first request differs from it by the bias of the hand controller."""
    return np.array(known_arm(log.provenance["variant"]).poses[log.provenance["pose"]])


def _columns(log: JointLog) -> list[int]:
    """Return the columns of the controlled joints."""
    return channels(log.provenance["variant"])


def _rms(values: FloatArray) -> FloatArray:
    """Root mean square over the first axis."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _seen(request: FloatArray, answer: FloatArray, dt: float) -> SeenResponse:
    """Read gain, phase and bandwidth off `seen_responses`."""
    responses = seen_responses(request, answer, dt)
    # Rounding must not push a frequency of the grid to the next.
    values = responses[np.searchsorted(GRID, np.array(FREQUENCIES) - 1e-9)]
    bandwidths = np.full(request.shape[1], np.nan)
    for joint, response in enumerate(responses.T):
        # The first stretch alone: beyond it a crossing may be noise.
        end = int(np.argmax(np.isnan([*response, np.nan])))
        # A crossing lies between two values.
        if end >= 2:
            stretch = FrequencyResponse(GRID[:end], response[:end, None, None], dt, "spa")
            bandwidths[joint] = gain_crossing(stretch, HALF_POWER)
    return SeenResponse(np.abs(values), np.angle(values), bandwidths)


def seen_responses(request: FloatArray, answer: FloatArray, dt: float) -> ComplexArray:
    """Estimate the responses from the requests to the angles (N, m), each joint's to its own request.

    The start, in which the bias of the hand controller arrives, is left out. All requests are inputs at once: those of
    an operator depend on each other.

    Returns:
        Responses at `GRID` (n_f, m), NaN where the standard deviation exceeds `UNCERTAIN` or the request is weak.
    """
    responses = np.full((len(GRID), request.shape[1]), np.nan + 0j)
    moved = np.flatnonzero(np.ptp(request, axis=0) > MOVES)
    # One lag window is cut off at the start, and the estimate needs more samples than another one.
    if not len(moved) or len(request) <= 2 * LAG:
        return responses
    data = IOData(request[:, moved], answer[:, moved], dt)[LAG:].detrend(1)
    # Requests too poor for any response leave it unknown.
    with warnings.catch_warnings(), suppress(SysidError):
        # Of poor excitation at some frequencies: below, each frequency is judged by its own standard deviation.
        warnings.simplefilter("ignore", SysidWarning)
        spectra = sysid.spa(data, lag=LAG, window=np.bartlett, frequencies=GRID)
        matrices = (spectra.response, spectra.magnitude_deviation(), np.asarray(spectra.input_spectrum).real)
        # The diagonal: each joint's response to its own request.
        diagonal, deviation, power = (np.einsum("fii->fi", matrix) for matrix in matrices)
        reliable = (deviation < UNCERTAIN * np.abs(diagonal)) & (power > WEAK * power.max(axis=0))
        responses[:, moved] = np.where(reliable, diagonal, np.nan)
    return responses
