"""Look of the report's figures: width, colours, axes."""

from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sysid.plots import GRID, INK, PALETTE, Style

WIDTH = 5.2
"""Width of a figure, inch: narrow enough to be read on a phone."""

NOT_EXCITED = "#eef0f2"

MRAD = 1000.0

HIGH = Style("#7a5195", (0, (1, 1.2)), 1.6, "P")  # type: ignore[arg-type]
"""Style of the output-error model of higher order, unlike that of the thesis' own."""


def method_style(method: str) -> Style:
    """Colour and line of an estimation method, the same in every figure."""
    return HIGH if method == "oe_high" else PALETTE[method]


def points(method: str, marker: str) -> Style:
    """Marks alone, in the colour of a method."""
    return Style(PALETTE[method].colour, "", 1.0, marker)


def short(name: str) -> str:
    """A joint's name for people."""
    return name.replace("_", " ")


def dress(panels: Iterable[Axes]) -> None:
    """Grid, small labels and open corners for every panel."""
    for axes in panels:
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)


def plain_marks(axis: Axis, ends: tuple[float, float]) -> None:
    """Mark a logarithmic axis with plain numbers that do not meet: powers of ten alone beyond two decades."""
    beyond_two_decades = ends[1] > 100.0 * ends[0]
    steps = (1.0,) if beyond_two_decades else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=steps, numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
