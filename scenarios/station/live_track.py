"""Bandwidth that follows a live run: the recursive estimator in a thread of its own, drawn as a strip chart."""

import threading
from itertools import islice
from queue import SimpleQueue

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from scenarios.station.fields import Message
from scenarios.station.strip_chart import StripChart
from sysid import IOData, SysidError
from sysid.recursive import Tracker, TrackSample

CALIBRATION = 30.0
"""First part of a run, from which the estimator takes structure and thresholds, s."""

EVERY = 10
"""Ticks from one drawn bandwidth to the next."""


class LiveTrack:
    """Follows the joint of a live run; a thread, so that a fit of half a second does not hold up the arm.

    Args:
        chart: Where bandwidth and interval are drawn.
        message: Where the calibration, the alarms and a refusal are told.
    """

    def __init__(self, chart: StripChart, message: Message) -> None:
        self.chart, self.message = chart, message
        self._samples: SimpleQueue[tuple[float, float] | None] = SimpleQueue()
        # A daemon: a run that is never closed must not keep the station from ending.
        self._thread = threading.Thread(target=self._follow, daemon=True, name="track")
        self._thread.start()

    def add(self, command: float, measured: float) -> None:
        """Take the commanded and the measured angle of the next tick, rad."""
        self._samples.put((command, measured))

    def close(self) -> None:
        """End after the samples that were added."""
        self._samples.put(None)

    def _follow(self) -> None:
        self.message.say(f"the bandwidth follows after {CALIBRATION:g} s of calibration", remark=True)
        samples = iter(self._samples.get, None)
        start = list(islice(samples, round(CALIBRATION * SAMPLE_RATE)))
        # The run ended before the calibration did.
        if len(start) < round(CALIBRATION * SAMPLE_RATE):
            return
        u, y = np.array(start).T
        try:
            # The gain of a position servo at 0 Hz is known.
            tracker = Tracker(IOData(u, y, SAMPLE_TIME), gain=1.0)
            for sample in samples:
                self._show(tracker.step(*sample))
        except SysidError as error:
            self.message.say(f"the bandwidth is not followed: {error}")

    def _show(self, sample: TrackSample) -> None:
        if sample.change is not None:
            self.message.say(f"change at {sample.change.time:.1f} s, noticed at {sample.change.detected:.1f} s")
        tick = round(sample.time * SAMPLE_RATE)
        if tick % EVERY == 0:
            self.chart.add(tick, sample.time, (sample.bandwidth, *sample.bandwidth_ci95))
            self.chart.draw()
