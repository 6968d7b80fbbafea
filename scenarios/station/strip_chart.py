"""Charts of signals over time, drawn by the browser; strip charts show the last seconds of a motion."""

from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from scenarios.experiments.preview_figure import COLOURS

if TYPE_CHECKING:
    import viser

SHOWN = 20.0
"""Length of a strip chart, s."""

DRAWINGS = 0.2
"""Time between two drawings while the arm moves, s."""

STRIDE = 2
"""Ticks from one drawn sample to the next: 25 a second."""


def time_chart(
    gui: "viser.GuiApi",
    signals: Mapping[str, str],
    height: int,
    axes: tuple[Any, ...],
    *,
    title: str | None = None,
    padding: tuple[int, int, int, int] | None = None,
) -> Any:
    """Put a chart into the container that is open, with a colour for each signal; it has two empty samples so far."""
    lines = [{"label": name, "stroke": colour, "width": 1.5} for name, colour in signals.items()]
    series = cast("tuple[viser.uplot.Series, ...]", ({"label": "time / s"}, *lines))
    empty = tuple(np.zeros(2) for _ in series)
    return gui.add_uplot(
        empty, series, scales={"x": {"time": False}}, axes=axes, title=title, height=height, padding=padding
    )


class StripChart:
    """Signals over time, of which the last `SHOWN` seconds are drawn.

    Args:
        gui: Where to put it, in the container that is open.
        title: What is drawn, with its unit.
        signals: Name of each signal.
        height: Pixels.
    """

    def __init__(self, gui: "viser.GuiApi", title: str, signals: tuple[str, ...], height: int = 170) -> None:
        # The arm has 50 ticks a second.
        self._points: deque[tuple[float, ...]] = deque(maxlen=round(SHOWN * 50 / STRIDE))
        self._width = len(signals)
        axes = ({"label": "time / s", "labelSize": 18, "size": 36}, {"size": 56, "space": 18})
        colours = dict(zip(signals, COLOURS, strict=False))
        self._chart = time_chart(gui, colours, height, axes, title=title, padding=(8, 10, 0, 0))

    def clear(self) -> None:
        """Begin anew."""
        self._points.clear()
        self.draw()

    def add(self, tick: int, time: float, values: tuple[float, ...]) -> None:
        """Add the signals of a tick; `draw` shows them."""
        if tick % STRIDE == 0:
            self._points.append((time, *values))

    def draw(self) -> None:
        """Send what was added to the browser."""
        # The chart draws nothing, and says so in the browser's log, where a signal has no points.
        signals = np.array(self._points).T if self._points else np.zeros((self._width + 1, 2))
        self._chart.data = tuple(signals)
