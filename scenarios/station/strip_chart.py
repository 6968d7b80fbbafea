"""Strip charts: the last seconds of some signals, drawn by the browser."""

from collections import deque
from typing import TYPE_CHECKING, cast

import numpy as np

from scenarios.experiments.preview_figure import COLOURS

if TYPE_CHECKING:
    import viser

SHOWN = 20.0
"""Length of a strip chart, s."""

STRIDE = 2
"""Ticks from one drawn sample to the next: 25 a second."""


class StripChart:
    """Signals over time, of which the last `SHOWN` seconds are drawn.

    Args:
        gui: Where to put it, in the container that is open.
        title: What is drawn, with its unit.
        signals: Name of each signal.
        height: Pixels.
    """

    def __init__(self, gui: "viser.GuiApi", title: str, signals: tuple[str, ...], height: int = 170) -> None:
        self._points: deque[tuple[float, ...]] = deque(maxlen=round(SHOWN * 50 / STRIDE))
        self._width = len(signals)
        lines = [
            {"label": name, "stroke": colour, "width": 1.5} for name, colour in zip(signals, COLOURS, strict=False)
        ]
        series = cast("tuple[viser.uplot.Series, ...]", ({"label": "time / s"}, *lines))
        self._chart = gui.add_uplot(
            self._data(),
            series,
            title=title,
            scales={"x": {"time": False}},
            axes=({"label": "time / s", "labelSize": 18, "size": 36}, {"size": 56, "space": 18}),
            height=height,
            padding=(8, 10, 0, 0),
        )

    def clear(self) -> None:
        """Begin anew."""
        self._points.clear()
        self._chart.data = self._data()

    def add(self, tick: int, time: float, values: tuple[float, ...]) -> None:
        """Add the signals of a tick; `draw` shows them."""
        if tick % STRIDE == 0:
            self._points.append((time, *values))

    def draw(self) -> None:
        """Send what was added to the browser."""
        self._chart.data = self._data()

    def _data(self) -> tuple[np.ndarray, ...]:
        if not self._points:
            return tuple(np.zeros(1) for _ in range(self._width + 1))
        return tuple(np.array(self._points).T)
