"""The course of a plant along a record: parameters, bandwidth and delay over time, and its changes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.records.arguments import real_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.labelled import Labelled
from sysid.records.printing import Part, number
from sysid.recursive.tracker import Change, Tracker

CALIBRATION = 30.0  # s


@dataclass(frozen=True, eq=False, repr=False)
class Track(Labelled, Locked):
    """Bandwidth and delay of a plant over time, with 95 % intervals, and its changes.

    Attributes:
        times: Times (N,), s.
        parameters: b1..bn, f1..fn at every sample (N, 2 order), columns of degrees that are not in use NaN.
        deviations: Their standard errors, likewise.
        parameter_names: Names of the columns.
        bandwidth: Frequency at which the gain falls to 0.707 of that at 0 Hz (N,), Hz; NaN in the calibration and after
            alarms, see `settled`.
        bandwidth_ci95: Ends of its interval (N, 2).
        delay: Phase delay at the bandwidth (N,), s: dead time and lag together.
        delay_ci95: Ends of its interval (N, 2).
        changes: Detected changes.
        settled: Whether there was a model of data since the last alarm (N,).
        memory: Memory of the recursion, s.
    """

    times: FloatArray
    parameters: FloatArray
    deviations: FloatArray
    parameter_names: tuple[str, ...]
    bandwidth: FloatArray
    bandwidth_ci95: FloatArray
    delay: FloatArray
    delay_ci95: FloatArray
    changes: tuple[Change, ...]
    settled: np.ndarray[Any, np.dtype[np.bool_]]
    memory: float

    def _parts(self) -> list[Part]:
        last, (low, high) = float(self.bandwidth[-1]), self.bandwidth_ci95[-1].tolist()
        lines: list[Part] = [
            f"{len(self.times)} samples, memory {self.memory:.3g} s; bandwidth at the end {number(last)} Hz, "
            f"95 % from {number(low)} to {number(high)} Hz"
        ]
        for change in self.changes:
            lines.append(
                f"change at {change.time:.2f} s, detected at {change.detected:.2f} s: statistic "
                f"{change.statistic:.2f}, threshold {change.threshold:.2f}"
            )
        if not self.changes:
            lines.append("no change detected")
        return lines

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        arrays: dict[str, Any] = {}
        for name, unit in (("bandwidth", "Hz"), ("delay", "s")):
            low, high = getattr(self, f"{name}_ci95").T
            arrays[name] = "time", getattr(self, name), {"units": unit}
            arrays[f"{name}_low"] = "time", low, {"units": unit}
            arrays[f"{name}_high"] = "time", high, {"units": unit}
        for name, column in zip(self.parameter_names, self.parameters.T, strict=True):
            arrays[name] = "time", column
        arrays["settled"] = ("time", self.settled)
        return arrays, {"time": ("time", self.times, {"units": "s"})}, {"memory": self.memory}


def track(
    data: IOData,
    order: int = 8,
    nk: int = 1,
    *,
    calibration: float = CALIBRATION,
    gain: float | None = None,
    drift: float = 1e-3,
    false_alarms: float = 0.1,
) -> Track:
    """Follow a plant along a record: `Tracker`, sample by sample.

    Args:
        data: One experiment with one input and one output; offsets need not be removed.
        order: Largest degree of F; estimates are means over models of several degrees.
        nk: Delay in samples, at least 1: y(t) depends on u(t-nk) first.
        calibration: Length of the first stretch, in which the plant does not change, s. It gives the colour of the
            disturbance, the scale of the intervals and the threshold for changes.
        gain: Gain at 0 Hz where it is known, 1 for a position servo: the bandwidth is then no extrapolation to 0 Hz. By
            default that of the model.
        drift: Drift to be followed between changes: standard deviation of the bandwidth's relative change in a minute.
        false_alarms: Wanted false alarms per hour; dry friction raises more than normal errors would.

    Returns:
        Estimates with intervals at every sample, and the changes.

    Raises:
        SysidError: Several inputs or outputs, missing samples, a constant input, a calibration that is too short or as
            long as the record, arguments out of range.

    Warns:
        SysidWarning: Poor excitation of the calibration.
    """
    if not isinstance(data, IOData):
        raise SysidError(f"track takes one IOData record, got {type(data).__name__}")
    seconds = len(data) * data.dt
    if isinstance(calibration, float) and calibration == CALIBRATION >= seconds:
        raise SysidError(
            f"the record of {seconds:g} s is no longer than the calibration, {CALIBRATION:g} s unless given: expected "
            "a longer record, or a shorter calibration"
        )
    within = f"lie between 0 and {seconds:g} s", lambda s: 0.0 < s < seconds
    calibration = real_number("calibration", calibration, *within)
    first = max(round(calibration / data.dt), 1)
    tracker = Tracker(data[:first], order, nk, gain=gain, drift=drift, false_alarms=false_alarms)
    n, N = tracker.order, len(data)
    parameters, deviations = np.full((2, N, 2 * n), np.nan)
    values, settled = np.full((N, 6), np.nan), np.zeros(N, dtype=bool)
    changes = []
    u, y = data.u[:, 0].tolist(), data.y[:, 0].tolist()
    for t in range(first, N):
        sample = tracker.step(u[t], y[t])
        settled[t] = sample.settled
        if sample.change is not None:
            changes.append(sample.change)
        if not sample.settled:
            continue
        theta = tracker.parameters
        # a smaller degree leaves the last columns of B and of F unused
        degree = len(theta) // 2
        columns = [*range(degree), *range(n, n + degree)]
        parameters[t, columns] = theta
        deviations[t, columns] = np.sqrt(np.maximum(np.diag(tracker.covariance), 0.0))
        values[t] = sample.bandwidth, *sample.bandwidth_ci95, sample.delay, *sample.delay_ci95
    names = tuple(f"b{k + 1}" for k in range(n)) + tuple(f"f{k + 1}" for k in range(n))
    return Track(
        times=data.time,
        parameters=parameters,
        deviations=deviations,
        parameter_names=names,
        bandwidth=values[:, 0],
        bandwidth_ci95=values[:, 1:3],
        delay=values[:, 3],
        delay_ci95=values[:, 4:],
        changes=tuple(changes),
        settled=settled,
        memory=tracker.memory,
    )
