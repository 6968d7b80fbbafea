"""The record of experiments side by side: written tick by tick for all of them, kept by each at its own length."""

from collections.abc import Mapping, Sequence

import numpy as np

BLOCK = 256
"""Ticks that are computed ahead, and recorded before each experiment is given its part: 5 s.

Long enough that Python's work per block does not count, short enough that the blocks of a thousand experiments are
small beside their logs."""


class Recording:
    """Channels of experiments of different lengths.

    Args:
        lengths: Ticks of each experiment.
        widths: Numbers that each channel has at a tick.

    Attributes:
        records: Of each experiment, its channels by name, (ticks, width), complete after `close`.
    """

    def __init__(self, lengths: Sequence[int], widths: Mapping[str, int]) -> None:
        rows, longest = len(lengths), max(lengths)
        self._blocks = {name: np.empty((min(BLOCK, longest), rows, width)) for name, width in widths.items()}
        self._first = 0
        self.records = [{name: np.empty((ticks, width)) for name, width in widths.items()} for ticks in lengths]

    def write(self, tick: int, values: Mapping[str, np.ndarray]) -> None:
        """Write the channels (rows, width) of a tick; ticks come in turn."""
        if tick - self._first == BLOCK:
            self._hand_out(tick)
        for name, now in values.items():
            self._blocks[name][tick - self._first] = now

    def close(self, ticks: int) -> None:
        """Hand out what is left of a run of so many ticks."""
        self._hand_out(ticks)

    def _hand_out(self, stop: int) -> None:
        first, self._first = self._first, stop
        for row, record in enumerate(self.records):
            for name, kept in record.items():
                part = kept[first:stop]
                part[:] = self._blocks[name][: len(part), row]
