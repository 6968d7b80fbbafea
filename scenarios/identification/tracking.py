"""Bandwidth and delay tracked through a record sample by sample, beside the truth of each payload where known."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hmtb_twin import JointLog, JointTruth, Status, TwinError, linearize
from hmtb_twin.truth.logged_arm import logged_arm, logged_payloads
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.result_table import ResultTable
from scenarios.truth.bla_of_test import best_linear_of_test
from sysid import FrequencyResponse
from sysid.models.bandwidth import HALF_POWER, WIDEST
from sysid.recursive import Change, Track


@dataclass(frozen=True)
class Stretch:
    """Part of a record in which the arm stays the same, with its truth; NaN where that is not known.

    Attributes:
        begin: First time, s.
        end: Last time, s.
        payload: Payload of the end effector; empty for records from elsewhere.
        small_signal_hz: Bandwidth of the linearised arm, Hz.
        small_signal_delay: Its phase delay at the bandwidth, s.
        best_linear_hz: Bandwidth of the best linear approximation under a multisine like the command, Hz.
        best_linear_ci95: Its 95 % interval, Hz.
        best_linear_delay: Its phase delay at the bandwidth, s.
    """

    begin: float
    end: float
    payload: str = ""
    small_signal_hz: float = np.nan
    small_signal_delay: float = np.nan
    best_linear_hz: float = np.nan
    best_linear_ci95: tuple[float, float] = (np.nan, np.nan)
    best_linear_delay: float = np.nan


@dataclass(frozen=True, eq=False)
class Tracking:
    """Estimates that followed a record, and the truth about it.

    Attributes:
        name: Name of the record.
        track: The estimates.
        truth: Parts of the record with one payload each; none where the truth is not known.
    """

    name: str
    track: Track
    truth: tuple[Stretch, ...] = ()

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """The parts with one payload each; where they are not known, those between the detected changes."""
        times = self.track.times
        # The last sample lasts one interval more; its sum has rounding that a table would show.
        end = round(float(2.0 * times[-1] - times[-2]), 9)
        ends = [float(times[0]), *(change.time for change in self.track.changes), end]
        return self.truth or tuple(Stretch(begin, end) for begin, end in pairwise(ends))

    def alarm(self, stretch: Stretch) -> Change | None:
        """Return the first alarm in a part, which belongs to the change at its begin; None if that was missed."""
        alarms = (change for change in self.track.changes if stretch.begin <= change.detected < stretch.end)
        return next(alarms, None)

    @property
    def false_alarms(self) -> tuple[Change, ...]:
        """The alarms that belong to no true change; none where the truth is not known."""
        if not self.truth:
            return ()
        true_alarms = [self.alarm(stretch) for stretch in self.truth[1:]]
        return tuple(change for change in self.track.changes if change not in true_alarms)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the estimates at every sample as columns (N,) by name with unit."""
        track = self.track
        columns = {"time_s": track.times, "settled": track.settled.astype(int)}
        for name, unit in (("bandwidth", "hz"), ("delay", "s")):
            low, high = getattr(track, f"{name}_ci95").T
            columns[f"{name}_{unit}"] = getattr(track, name)
            columns[f"{name}_low_{unit}"], columns[f"{name}_high_{unit}"] = low, high
        for k, name in enumerate(track.parameter_names):
            columns[name], columns[f"{name}_deviation"] = track.parameters[:, k], track.deviations[:, k]
        return columns

    def rows(self) -> Iterator[tuple[Stretch, dict[str, Any]]]:
        """Yield each part with the last estimate in it: time, bandwidth, delay, intervals; NaN without any."""
        track, names = self.track, ("bandwidth", "bandwidth_ci95", "delay", "delay_ci95")
        for stretch in self.stretches:
            inside = (track.times >= stretch.begin) & (track.times < stretch.end) & np.isfinite(track.bandwidth)
            # The first sample is of the calibration, which has no estimates.
            last = np.flatnonzero(inside)[-1] if inside.any() else 0
            time = track.times[last] if inside.any() else np.nan
            yield stretch, {"time": time, **{name: getattr(track, name)[last] for name in names}}

    def record(self) -> dict[str, object]:
        """Return what `hmtb track --json` prints; the estimates once a second."""
        second = max(1, round(1.0 / (self.track.times[1] - self.track.times[0])))
        true_changes = []
        for stretch in self.truth[1:]:
            alarm = self.alarm(stretch)
            detected = alarm.detected if alarm else None
            true_changes.append({"time": stretch.begin, "payload": stretch.payload, "detected": detected})
        return {
            "name": self.name,
            "memory_s": self.track.memory,
            "changes": [vars(change) for change in self.track.changes],
            "true_changes": true_changes,
            "false_alarms": [change.detected for change in self.false_alarms] if self.truth else None,
            "stretches": [{**vars(stretch), **estimate} for stretch, estimate in self.rows()],
            "estimates": {name: values[::second] for name, values in self.columns().items()},
        }

    def table(self) -> ResultTable:
        """Return the last estimate of each part as a table, beside the truth where it is known."""
        columns = ["from / s", "to / s", "bandwidth\n/ Hz", "95 % interval\n/ Hz", "delay\n/ ms", "95 % interval\n/ ms"]
        if self.truth:
            columns += ["payload", "small-signal\ntruth / Hz", "best linear\ntruth / Hz"]
            columns.append("true delays: small-signal,\nbest linear / ms")
        rows = []
        for stretch, last in self.rows():
            cells = [_joined([stretch.begin], 1), _joined([stretch.end], 1)]
            cells += [_joined([last["bandwidth"]], 3), _joined(last["bandwidth_ci95"], 3)]
            cells += [_joined([1e3 * last["delay"]], 1), _joined(1e3 * last["delay_ci95"], 1)]
            if self.truth:
                delays = (1e3 * stretch.small_signal_delay, 1e3 * stretch.best_linear_delay)
                cells += [stretch.payload, _joined([stretch.small_signal_hz], 3), _joined(stretch.best_linear_ci95, 3)]
                cells.append(_joined(delays, 1, between=", "))
            rows.append(tuple(cells))
        return ResultTable(f"{self.name}: the last estimate of each part", tuple(columns), tuple(rows))

    def alarms_in_words(self) -> tuple[str, ...]:
        """Say of each true change when its alarm came, of each other alarm when it was, and what stays unknown."""
        lines = []
        for stretch in self.truth[1:]:
            alarm = self.alarm(stretch)
            outcome = f"alarm after {alarm.detected - stretch.begin:.1f} s" if alarm else "missed"
            lines.append(f"change at {stretch.begin:g} s to payload {stretch.payload}: {outcome}")
        if self.truth:
            lines += [f"false alarm at {change.detected:.1f} s" for change in self.false_alarms]
        else:
            lines += [f"alarm at {change.detected:.1f} s" for change in self.track.changes]
        if not self.track.changes:
            lines.append("no change detected")
        for stretch, last in self.rows():
            low, high = last["bandwidth_ci95"]
            if high > WIDEST * low:
                lines.append(
                    f"from {stretch.begin:g} s on the record tells no bandwidth, and hardly a change: the interval "
                    f"is {low:.3g} to {high:.3g} Hz; --gain where the gain at 0 Hz is known, a stronger command or "
                    "a longer --calibration would narrow it"
                )
        return tuple(lines)


def _joined(values: Iterable[float], digits: int, *, between: str = " to ") -> str:
    """Numbers as texts, a dash for NaN."""
    return between.join(f"{value:.{digits}f}" for value in values).replace("nan", "—")


def true_stretches(
    log: JointLog, joint: str, *, gain: float | None = None, best_linear: bool = True, threads: int | None = None
) -> tuple[Stretch, ...]:
    """Return the truth about a log with each of its payloads; estimates never see it.

    Args:
        log: A log of the twin.
        joint: The joint.
        gain: Gain at 0 Hz that bandwidths are relative to; by default that of each model.
        best_linear: Whether to measure the best linear approximation with each payload: some seconds for each.
        threads: Threads for the physics.

    Raises:
        ScenarioError: A shutdown or work in contact, which has no linear truth.
        TwinError: The provenance of the log is incomplete.
    """
    if log.unit_pose is not None or (log.status & Status.SHUT_DOWN).any():
        raise ScenarioError(f"{log.name}: a shutdown, or work in contact, has no linear truth")
    if "scenario" not in log.provenance:
        raise TwinError(f"{log.name}: its provenance lacks scenario; expected a log of hmtb simulate")
    scenario = Scenario.from_toml(log.provenance["scenario"], source=f"{log.name}, its scenario")
    payloads = logged_payloads(log)
    last = len(log) * log.dt
    ends = [time for time, _ in payloads[1:] if time < last] + [last]
    data, stretches = log.iodata(joint), []
    for (begin, payload), end in zip(payloads, ends, strict=False):
        truth = linearize(logged_arm(log, payload), scenario.pose, amplitudes=()).joint(joint)
        delay = phase_delay(truth.model.frequency_response, truth.bandwidth_hz)
        stretch = Stretch(begin, end, payload, truth.bandwidth_hz, delay)
        # A best linear approximation is of commands to this joint alone.
        if best_linear and log.axes == (joint,):
            setting = replace(scenario, payload=payload, payload_changes=())
            # From the start the arm first settles into its pose; a change of payload is quick.
            record = data[round((begin or SETTLING) / log.dt) : round(end / log.dt)].detrend()
            bla = best_linear_of_test(setting, [record], test=log.name, threads=threads)
            hz, ci95, delay = best_linear_servo(bla.response, truth, gain)
            stretch = replace(stretch, best_linear_hz=hz, best_linear_ci95=ci95, best_linear_delay=delay)
        stretches.append(stretch)
    return tuple(stretches)


def best_linear_servo(
    response: FrequencyResponse, truth: JointTruth, gain: float | None = None
) -> tuple[float, tuple[float, float], float]:
    """Return bandwidth, its 95 % interval and phase delay of a best linear approximation of few lines; NaN without one.

    Under a heavy payload the arm resonates between the lines. The ratio to the small-signal response varies slowly, and
    is interpolated in place of the response itself. The bandwidth is relative to the gain at 0 Hz: `gain`, by default
    that of the truth times the ratio at the lowest line.
    """
    linear = truth.model.frequency_response
    f, values = response.frequencies, response.response[:, 0, 0]
    ratio = values / linear(f)[:, 0, 0]
    # So fine that the crossing needs no interpolation of its own.
    fine = np.geomspace(f[0], f[-1], 4000)
    size = np.abs(linear(fine)[:, 0, 0]) * np.interp(fine, f, np.abs(ratio))
    static_gain = truth.dc_gain * np.abs(ratio[0]) if gain is None else gain
    below = np.flatnonzero(size < HALF_POWER * static_gain)
    if not below.size or below[0] == 0 or response.covariance is None:
        return np.nan, (np.nan, np.nan), np.nan
    hz = float(fine[below[0]])
    # Half the variance of a complex number is that of its modulus.
    relative = np.sqrt(0.5 * np.trace(response.covariance[:, 0, 0], axis1=1, axis2=2)) / np.abs(values)
    slope = np.gradient(np.log(size), np.log(fine))[below[0]]
    # A gain at 0 Hz that is estimated from the lowest line has that line's error.
    of_static_gain = relative[0] if gain is None else 0.0
    # An error of the gain moves the crossing by the inverse of the slope, on logarithmic scales.
    spread = np.hypot(np.interp(hz, f, relative), of_static_gain) / abs(slope)
    factor = float(np.exp(1.96 * spread))
    advance = float(np.interp(hz, f, np.unwrap(np.angle(ratio)))) / (2.0 * np.pi * hz)
    return hz, (hz / factor, hz * factor), phase_delay(linear, hz) - advance


def phase_delay(response: Callable[[np.ndarray], np.ndarray], hz: float) -> float:
    """Return the phase delay in s of a frequency response at a frequency in Hz, its phase followed from 0 Hz on."""
    # From near 0 Hz on, so that the phase is unwrapped from zero; at 0 Hz an integrator has none.
    values = response(np.linspace(1e-3 * hz, hz, 400))[:, 0, 0]
    return float(-np.unwrap(np.angle(values))[-1] / (2.0 * np.pi * hz))
