"""Focus of a fit: one-step prediction, simulation, or a band of frequencies [Ljung1999, sec. 14.4, 8.5].

A fit to inputs and outputs that pass the same filter L minimises L times the prediction errors, so that the path from
the input is most accurate where L passes. The noise model is that of the filtered record: of L times the disturbance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.trends import LINE, OFFSET
from sysid.records.arguments import rectangular, shown
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

FILTER_ORDER = 5  # of the Butterworth filter, as in MATLAB's idfilt
SETTLED = 0.01  # of the filter's transient, relative to its beginning, that remains in the record
LONGEST = 0.5  # of the shortest record, that transients of the filter may take

Focus = str | tuple[float, float]
"""prediction, simulation, or the lower and the upper edge of a band in Hz."""


@dataclass(frozen=True)
class Band:
    """A band of frequencies.

    Attributes:
        low: Lower edge in Hz, 0 for none.
        high: Upper edge in Hz, infinity for none.
    """

    low: float
    high: float

    def filtered(
        self, experiments: Sequence[IOData], initial_conditions: InitialConditions, trend: int
    ) -> tuple[IOData, ...]:
        """Records whose channels have passed a Butterworth filter, its transients within their windows.

        From rest, zero before the record, there are none. Otherwise the filter starts in the steady state of the first
        sample, and the window lasts until its slowest mode has decayed to 1 %.

        Args:
            experiments: The records.
            initial_conditions: Assumption about the time before.
            trend: Degree of the trend of the outputs that is estimated.

        Raises:
            SysidError: Edges beyond Nyquist, missing samples, a trend that the filter takes away, or a band so narrow
                that transients fill half the shortest record.
        """
        if trend == LINE or (trend == OFFSET and self.low > 0.0):
            raise SysidError(
                f"focus={(self.low, self.high)} removes or delays what offset and trend estimate: expected both False, "
                "or a band from 0 Hz with offset alone"
            )
        for k, experiment in enumerate(experiments):
            if not experiment.complete:
                raise SysidError(
                    f"experiment {k} has missing samples, which no filter takes: expected focus='prediction', or "
                    "data.complete_parts() as experiments"
                )
        poles, sections = self._filter(experiments[0].dt)
        self._check_resolution(experiments)
        if initial_conditions is InitialConditions.ZERO:
            return tuple(_passed(experiment, sections, at_rest=True) for experiment in experiments)
        transient = _settling_samples(poles)
        shortest = min(len(experiment) - experiment.window for experiment in experiments)
        if transient > LONGEST * shortest:
            raise SysidError(
                f"the filter of focus={(self.low, self.high)} takes {transient:g} samples to settle, the shortest "
                f"record has {shortest}: expected a wider band, a longer record, or one from rest "
                "(initial_conditions='zero')"
            )
        filtered = []
        for experiment in experiments:
            passed = _passed(experiment, sections, at_rest=False)
            filtered.append(replace(passed, window=max(experiment.window, int(transient))))
        return tuple(filtered)

    def _check_resolution(self, experiments: Sequence[IOData]) -> None:
        """Refuse a band, up to Nyquist, narrower than the distance of frequencies that the longest record resolves."""
        dt = experiments[0].dt
        duration = dt * max(map(len, experiments))
        if min(self.high, 0.5 / dt) - self.low < 1.0 / duration:
            raise SysidError(
                f"focus={(self.low, self.high)} is narrower than the longest record of {duration:g} s resolves: "
                f"expected {1.0 / duration:.3g} Hz at least between the edges, or a longer record"
            )

    def _filter(self, dt: float) -> tuple[ComplexArray, FloatArray]:
        """Poles of the filter, and its second-order sections."""
        nyquist = 0.5 / dt
        if self.low >= nyquist:
            raise SysidError(f"focus: expected a band that begins below Nyquist, {nyquist:g} Hz, got {self.low:g} Hz")
        has_upper_edge = self.high < nyquist
        edges = [edge for edge in (self.low, self.high) if 0.0 < edge < nyquist]
        if self.low > 0.0 and has_upper_edge:
            kind = "bandpass"
        elif self.low > 0.0:
            kind = "highpass"
        elif has_upper_edge:
            kind = "lowpass"
        else:
            raise SysidError(
                f"focus: expected 'prediction' or a part of 0 to {nyquist:g} Hz, the Nyquist frequency, got all of it: "
                f"{self.low:g} to {self.high:g} Hz"
            )
        zeros, poles, gain = scipy.signal.butter(FILTER_ORDER, np.squeeze(edges), kind, fs=1.0 / dt, output="zpk")
        return poles, scipy.signal.zpk2sos(zeros, poles, gain)


def _passed(experiment: IOData, sections: FloatArray, *, at_rest: bool) -> IOData:
    """All channels behind the filter, from rest or from the steady state of the first sample."""
    # the state of each section for a constant of one; from rest it does not count
    state = np.zeros((len(sections), 2)) if at_rest else scipy.signal.sosfilt_zi(sections)

    def passed(channels: FloatArray) -> FloatArray:
        return np.asarray(scipy.signal.sosfilt(sections, channels, axis=0, zi=state[:, :, None] * channels[0])[0])

    u = passed(experiment.u) if experiment.nu else experiment.u
    return replace(experiment, u=u, y=passed(experiment.y))


def _settling_samples(poles: ComplexArray) -> float:
    """Samples until the slowest mode of the filter has decayed; infinite where rounding puts it on the unit circle."""
    radius = float(np.abs(poles).max())
    if radius >= 1.0:
        return np.inf
    return float(np.ceil(np.log(SETTLED) / np.log(radius)))


EXPECTED = "focus must be 'prediction', 'simulation' or two frequencies (low, high) in Hz"


def checked_focus(focus: Any) -> tuple[Band | None, bool]:
    """The band, None for all frequencies, and whether the simulation counts instead of the prediction.

    Raises:
        SysidError: Another word, or no two frequencies in ascending order.
    """
    if isinstance(focus, str) and focus in ("prediction", "simulation"):
        return None, focus == "simulation"
    try:
        edges = rectangular("focus", focus)
    except SysidError as error:
        raise SysidError(f"{EXPECTED}, got {shown(focus)}") from error
    if edges.shape != (2,) or edges.dtype.kind not in "iuf":
        raise SysidError(f"{EXPECTED}, got {shown(focus)}")
    # an infinite upper edge is none; NaN fails the comparison below
    low, high = float(edges[0]), float(edges[1])
    if not 0.0 <= low < high:
        raise SysidError(f"{EXPECTED}, 0 <= low < high, got {shown(focus)}")
    return Band(low, high), False
