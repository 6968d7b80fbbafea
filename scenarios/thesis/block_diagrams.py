"""Block diagrams of the two prediction-error structures of the three-joint model [Morris1996, sec. VI.1]."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from scenarios.report.figure_style import WIDTH
from sysid.plots import INK, PALETTE

_FILL = "#eef3f7"
_TEXT = 9


def block_diagrams() -> Figure:
    """ARMAX and output error, from command u and white noise e to the measured angle y."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    armax, oe = figure.subplots(2, 1)
    _frame(armax, "ARMAX: the noise passes the poles of the dynamics", PALETTE["armax"].colour)
    _arrow(armax, (0.2, 1.0), (2.0, 1.0), "u")
    _box(armax, 2.6, 1.0, "B(q)")
    _arrow(armax, (3.2, 1.0), (4.8, 1.0))
    _sum(armax, 5.0, 1.0)
    _arrow(armax, (2.0, 2.3), (4.4, 2.3), "e")
    _box(armax, 5.0, 2.3, "C(q)")
    _arrow(armax, (5.0, 1.98), (5.0, 1.2))
    _arrow(armax, (5.2, 1.0), (6.8, 1.0))
    _box(armax, 7.4, 1.0, "1 / A(q)")
    _arrow(armax, (8.0, 1.0), (9.7, 1.0), "y", end=True)
    _frame(oe, "output error: the noise is added as it is", PALETTE["oe"].colour)
    _arrow(oe, (0.2, 1.0), (2.9, 1.0), "u")
    _box(oe, 3.7, 1.0, "B(q) / F(q)", width=1.6)
    _arrow(oe, (4.5, 1.0), (7.2, 1.0))
    _sum(oe, 7.4, 1.0)
    _arrow(oe, (7.4, 2.4), (7.4, 1.2), "e")
    _arrow(oe, (7.6, 1.0), (9.7, 1.0), "y", end=True)
    return figure


def _frame(axes: Axes, title: str, colour: str) -> None:
    axes.set(xlim=(0.0, 10.0), ylim=(0.4, 2.9), aspect="equal")
    axes.axis("off")
    axes.set_title(title, loc="left", fontsize=_TEXT, color=colour)


def _box(axes: Axes, x: float, y: float, text: str, width: float = 1.2) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2 + 0.06, y - 0.26), width - 0.12, 0.52, boxstyle="round,pad=0.06", fc=_FILL, ec=INK, lw=1.0
        )
    )
    axes.text(x, y, text, ha="center", va="center", fontsize=_TEXT, color=INK)


def _sum(axes: Axes, x: float, y: float) -> None:
    axes.add_patch(Circle((x, y), 0.2, fc="white", ec=INK, lw=1.0))
    axes.text(x, y, "+", ha="center", va="center", fontsize=_TEXT, color=INK)


def _arrow(
    axes: Axes,
    start: tuple[float, float],
    end_at: tuple[float, float],
    text: str = "",
    *,
    end: bool = False,
) -> None:
    axes.annotate(
        "", end_at, start, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    )
    if text:
        x, y = end_at if end else start
        upright = start[0] == end_at[0]
        axes.text(
            x + (0.18 if upright else (-0.2 if end else 0.15)),
            y + (-0.15 if upright else 0.12),
            text,
            fontsize=_TEXT + 1,
            style="italic",
            color=INK,
            ha="left" if upright else "center",
            va="bottom" if not upright else "top",
        )
