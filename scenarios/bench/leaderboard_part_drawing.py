"""A figure of the bench problem by problem: values with their intervals, and the limits within which they pass."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, SymmetricalLogLocator

from scenarios.bench.leaderboard_curves import drawable
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_style import label, literal, styles
from scenarios.bench.leaderboard_tables import title, unit
from scenarios.bench.leaderboard_verdict import Verdict, part_verdict
from scenarios.bench.metric import Part
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress
from scenarios.report.probability import plain_marks
from sysid.plots.palette import BOUND, INK, PALETTE, Style

MARKERS = {
    Verdict.PASSES: "o",
    Verdict.FAILS: "X",
    Verdict.FAILS_AS_THEORY_SAYS: "^",
    Verdict.NONE: "o",
}
"""Verdicts told by shape; one that is not given is an open circle."""

MOST = 8
"""Panels of a drawing; the table has the rest."""


FAR = 10.0
"""Value from which on an axis that may be is logarithmic."""


def parts_drawn(
    entries: Sequence[Entry], name: str, *, logarithmic: bool = False, far: bool = False, chosen: str | None = None
) -> tuple[Figure, str] | None:
    """A panel for each part of a figure, a line for each estimator in it.

    Args:
        entries: The rows.
        name: Of the figure.
        logarithmic: Whether its axis is.
        far: Whether values about 0 and far beyond 1 are both of interest: the axis is linear up to 1, then logarithmic.
        chosen: Parts are drawn whose labels hold this; all where none does.

    Returns:
        The figure and its caption; None where nothing was measured.
    """
    table = {
        entry.number: {part.label: part for part in made.parts} for entry in entries if (made := entry.figure(name))
    }
    labels = list(dict.fromkeys(text for parts in table.values() for text in parts))
    known = [text for text in labels if any(drawable(p[text].value) for p in table.values() if text in p)]
    if not known:
        return None
    known = [text for text in known if chosen is None or chosen in text] or known
    rest = f" Drawn are {MOST} of {len(known)} parts." if len(known) > MOST else ""
    known = known[:MOST]
    columns = min(2, len(known))
    rows = -(-len(known) // columns)
    figure = Figure(figsize=(WIDTH, 0.7 + rows * (0.55 + 0.25 * len(entries))), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    looks = styles(entries)
    for axes, text in zip(panels.flat, known, strict=False):
        for line, entry in enumerate(entries):
            part = table.get(entry.number, {}).get(text)
            if part is not None:
                _line(axes, line, part, looks[entry.number], logarithmic)
        expected = [p[text].expected for p in table.values() if text in p and drawable(p[text].expected)]
        if expected:
            axes.axvline(expected[0], color=PALETTE["truth"].colour, lw=0.9, zorder=1)
        axes.set_title(literal(one_line(text)), fontsize=8, loc="left")
        if logarithmic:
            axes.set_xscale("log")
        elif far and -1.0 < axes.dataLim.x0 < 1.0 and axes.dataLim.x1 > FAR:
            low, high = axes.dataLim.intervalx
            axes.set_xscale("symlog", linthresh=1.0)
            axes.set_xlim(low - 0.2, 2.0 * high)
            axes.xaxis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=1.0))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for axes in list(panels.flat)[len(known) :]:
        axes.set_axis_off()
    panels[0, 0].set_ylim(len(entries) - 0.4, -0.6)
    panels[0, 0].set_yticks(range(len(entries)), [label(entry) for entry in entries])
    if logarithmic:
        low, high = _common(panels.flat[: len(known)])
        for axes in panels.flat[: len(known)]:
            axes.set_xlim(low, high)
            plain_marks(axes.xaxis, (low, high))
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=7, left=False)
    heading = unit(entries, name)
    figure.supxlabel(literal(heading), fontsize=8)
    figure.legend(handles=_signs(), loc="outside upper left", ncols=3, frameon=False, fontsize=7)
    caption = (
        f"{title(entries, name)}, problem by problem. Bars: 95 % Monte-Carlo interval; brackets: limits within which a "
        "value passes, for each estimator by its own number of records; black line: what is expected." + rest
    )
    return figure, caption


def _line(axes: Axes, line: int, part: Part, style: Style, logarithmic: bool) -> None:
    found = part_verdict(part)
    low, high = part.limits
    for limit, sign in ((low, "["), (high, "]")):
        if drawable(limit) and not (logarithmic and limit <= 0.0):
            axes.text(limit, line, sign, color=BOUND.colour, fontsize=9, ha="center", va="center", clip_on=True)
            axes.update_datalim([(limit, line)])
    if not drawable(part.value) or (logarithmic and part.value <= 0.0):
        word = "no value" if math.isnan(part.value) or not part.value else f"{part.value:.0e}".replace("inf", "∞")
        axes.annotate(
            word,
            (0.02, line),
            xycoords=axes.get_yaxis_transform(),
            fontsize=6.5,
            color=BOUND.colour,
            va="center",
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=3,
        )
        return
    ends = np.array(part.interval)
    if drawable(ends).all():
        ends = np.maximum(ends, 1e-3 * part.value) if logarithmic else ends
        axes.hlines(line, *ends, color=style.colour, lw=1.6)
    axes.plot(
        part.value,
        line,
        MARKERS[found],
        color=style.colour,
        mfc="white" if found is Verdict.NONE else style.colour,
        ms=5.5 if found is not Verdict.PASSES else 4,
        zorder=3,
    )
    axes.autoscale_view()


def _common(panels: Iterable[Axes]) -> tuple[float, float]:
    """Limits that hold all panels, at least from half to twice, so that panels compare at a glance."""
    limits = [axes.get_xlim() for axes in panels]
    return min(0.5, *(low for low, _ in limits)), max(2.0, *(high for _, high in limits))


def _signs() -> list[Line2D]:
    return [
        Line2D(
            [],
            [],
            color=INK,
            ls="",
            marker=MARKERS[found],
            ms=5,
            label=found.word,
            mfc="white" if found is Verdict.NONE else INK,
        )
        for found in Verdict
    ]
