"""Drawings of curves: a panel for each estimator and problem, with errors over frequency or over amplitude."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from scenarios.bench.leaderboard_rows import LeaderboardRow, numbers
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress
from sysid.plots.palette import BOUND, DISTORTION, INK, NOISE, PALETTE, Style

NOT_METHODS = ("truth", "measured", "bla", "published", "welch", "etfe", "cra", "spa")
"""Styles of the palette that are of no method."""

MOST = 4
"""Problems or joints that are drawn, side by side: the first ones."""

DECADES = 5.0
"""Range of an axis below the largest gain: errors without noise would take all room."""

SHARES: Mapping[str, tuple[str, Style]] = {
    "systematic": ("systematic error", PALETTE["armax"]),
    "noise": ("noise", NOISE),
    "distortion": ("nonlinear distortion", DISTORTION),
}
"""Shares of an error on the arm, with their words and styles."""

Curve = dict[str, np.ndarray]
"""Arrays of one length by name."""


def styles(rows: Sequence[LeaderboardRow]) -> dict[int, Style]:
    """Style of each estimator by its number: that of the method that its name ends in, else one that is free.

    With more estimators than styles, styles repeat; drawings name each estimator by its number too.
    """
    methods = {name: style for name, style in PALETTE.items() if name not in NOT_METHODS}
    chosen: dict[int, Style] = {}
    free = dict(methods)
    for row in rows:
        words = "_" + row.name.lower().replace("-", "_")
        if named := [name for name in free if words.endswith(f"_{name}")]:
            chosen[row.number] = free.pop(max(named, key=len))
    spare = list(free.values()) or list(methods.values())
    others = [row for row in rows if row.number not in chosen]
    return chosen | {row.number: spare[k % len(spare)] for k, row in enumerate(others)}


def label(row: LeaderboardRow, width: int = 18) -> str:
    """Number and name on at most two lines of a drawing; the number tells names apart that are cut."""
    return literal("\n".join(textwrap.wrap(row.title, width, max_lines=2, placeholder="…")))


def literal(text: str) -> str:
    """Text that matplotlib does not read as a formula."""
    return text.replace("\\", "\N{REVERSE SOLIDUS OPERATOR}").replace("$", r"\$")


def plain_ticks(*axes: Axes) -> None:
    """Write the numbers of logarithmic x axes out, and leave minor ticks without."""
    for one in axes:
        one.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        one.xaxis.set_minor_locator(NullLocator())


def responses(rows: Sequence[LeaderboardRow]) -> tuple[Figure, str] | None:
    """A panel for each estimator and problem: rms error, claimed band, bound and truth over frequency.

    Returns:
        The figure and its caption; None where no row has curves.
    """
    curves = {row.number: _responses_of(row) for row in rows}
    problems = _columns(curves)
    if not problems:
        return None
    looks = styles(rows)

    def draw(axes: Axes, row: LeaderboardRow, curve: Curve) -> None:
        kinds = {
            "truth": (PALETTE["truth"].colour, 0.7, "-"),
            "bound": (BOUND.colour, 0.9, ":"),
            "error": (looks[row.number].colour, 1.5, "-"),
            "claimed": (INK, 0.9, "--"),
        }
        for key, (colour, width, line) in kinds.items():
            if key in curve:
                axes.plot(curve["frequencies"], _positive(curve[key]), color=colour, lw=width, ls=line)

    figure, panels = _grid(rows, problems[:MOST], curves, draw, sharey="col")
    for column, name in enumerate(problems[:MOST]):
        panels[0, column].set_title(literal(one_line(name)), fontsize=8)
        _decades(panels[0, column], [of_row[name] for of_row in curves.values() if name in of_row])
    figure.supxlabel("frequency / Hz", fontsize=8)
    marks = [
        Line2D([], [], color=PALETTE["armax"].colour, lw=1.5, label="rms error"),
        Line2D([], [], color=INK, lw=0.9, ls="--", label="claimed"),
        Line2D([], [], color=BOUND.colour, lw=0.9, ls=":", label="bound"),
        Line2D([], [], color=PALETTE["truth"].colour, lw=0.7, label="gain of the truth"),
    ]
    figure.legend(handles=marks, loc="outside upper left", ncols=4, frameon=False, fontsize=7)
    rest = f" Drawn are the first {MOST} of {len(problems)} problems." if len(problems) > MOST else ""
    return figure, (
        "Error of the frequency response over frequency, root mean square over records, and over channels where there "
        "are several. Where the error lies above what is claimed (dashed), intervals are too narrow; dotted is the "
        f"bound of the estimator’s own structure. Without a dashed line nothing is claimed.{rest}"
    )


def _responses_of(row: LeaderboardRow) -> dict[str, Curve]:
    """Curves over frequency by problem; malformed ones are left out."""
    curves = {}
    for name, table in row.curves("frequency_response").items():
        frequencies = numbers(table.get("frequencies_hz")) if isinstance(table, Mapping) else None
        if frequencies is None or not (frequencies > 0.0).all():
            continue
        curve = {"frequencies": frequencies}
        for key in ("truth", "error", "claimed", "bound"):
            values = numbers(table.get(key), 3)
            if values is not None and len(values) == len(frequencies):
                curve[key] = np.sqrt(np.mean(values**2, axis=(1, 2)))
        if "error" in curve:
            curves[str(name)] = curve
    return curves


def _decades(axes: Axes, curves: Sequence[Curve]) -> None:
    axes.set(xscale="log", yscale="log")
    values = np.concatenate([v for curve in curves for key, v in curve.items() if key != "frequencies"])
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values):
        high = float(values.max())
        axes.set_ylim(max(float(values.min()), high * 10.0**-DECADES) / 1.5, high * 1.5)
    low, high = (f(c["frequencies"][end] for c in curves) for f, end in ((min, 0), (max, -1)))
    axes.xaxis.set_major_locator(FixedLocator([10.0**k for k in range(-4, 5) if low <= 10.0**k <= high] or [low]))
    plain_ticks(axes)
    axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())


def splits(rows: Sequence[LeaderboardRow]) -> tuple[Figure, str] | None:
    """A panel for each estimator and joint of the arm: systematic error, noise and distortion over amplitude.

    Returns:
        The figure and its caption; None where no row has curves.
    """
    curves = {row.number: _splits_of(row) for row in rows}
    joints = _columns(curves)[:MOST]
    if not joints:
        return None
    figure, panels = _grid(rows, joints, curves, _draw_split, sharey=True)
    for column, joint in enumerate(joints):
        axes = panels[0, column]
        axes.set_title(literal(one_line(joint).replace("_", " ")), fontsize=8)
        ticks = sorted({float(a) for of_row in curves.values() if joint in of_row for a in of_row[joint]["mrad"]})
        axes.set_xscale("log")
        axes.set_xticks(ticks)
        plain_ticks(axes)
        axes.set_xlim(ticks[0] / 1.5, ticks[-1] * 1.5)
    panels[0, 0].set_yscale("log")
    panels[0, 0].set_ylim(*_range([of_row[j] for of_row in curves.values() for j in joints if j in of_row]))
    panels[0, 0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    figure.supxlabel("amplitude of the command / mrad", fontsize=8)
    figure.supylabel("% of the linear part", fontsize=8)
    marks = [
        Line2D([], [], color=style.colour, marker=style.marker, ms=4, lw=1.2, label=text)
        for text, style in SHARES.values()
    ]
    marks.append(Line2D([], [], color=BOUND.colour, ls="", marker="_", ms=8, label="limit of the systematic error"))
    figure.legend(handles=marks, loc="outside upper left", ncols=2, frameon=False, fontsize=7)
    return figure, (
        "Errors of the response on the arm over the amplitude of the command, in percent of the linear part: what "
        "stays in the mean over waveforms, what differs between repeats, what differs between waveforms. Bars: 95 % "
        "intervals, cut off at the lower edge, where also stands what is 0; dotted: noise and distortion of the "
        "records themselves, without a model. The limit is wide where an estimator scatters."
    )


def _splits_of(row: LeaderboardRow) -> dict[str, Curve]:
    """Numbers over amplitude by joint; malformed ones are left out."""
    curves = {}
    for joint, table in row.curves("amplitude_split").items():
        arrays = {key: numbers(table.get(key)) for key in ("mrad", *SHARES)} if isinstance(table, Mapping) else {}
        curve = {key: values for key, values in arrays.items() if values is not None}
        if len(curve) < 1 + len(SHARES) or len({len(values) for values in curve.values()}) > 1:
            continue
        if not (curve["mrad"] > 0.0).all():
            continue
        for key in ("systematic_limit", "expected_noise", "expected_distortion"):
            values = numbers(table.get(key))
            if values is not None and len(values) == len(curve["mrad"]):
                curve[key] = values
        for key in SHARES:
            ends = numbers(table.get(f"{key}_interval"), 2)
            if ends is not None and ends.shape == (len(curve["mrad"]), 2):
                curve[f"{key}_interval"] = ends
        curves[str(joint)] = curve
    return curves


def _draw_split(axes: Axes, _: LeaderboardRow, curve: Curve) -> None:
    for place, (key, (_text, style)) in enumerate(SHARES.items()):
        at = curve["mrad"] * 1.06 ** (place - 1)  # beside each other, so that bars do not hide one another
        axes.plot(at, _positive(curve[key]), color=style.colour, marker=style.marker, ms=3.5, lw=1.0)
        zeros = at[curve[key] == 0.0]
        # A logarithmic axis has no 0: such marks stand on its edge.
        (edge,) = axes.plot(zeros, np.zeros(len(zeros)), style.marker, transform=axes.get_xaxis_transform())
        edge.set(color=style.colour, mfc="white", ms=3.5, clip_on=False, zorder=4)
        edge.set_in_layout(False)
        if f"{key}_interval" in curve:
            low, high = curve[f"{key}_interval"].T
            known = np.isfinite(low) & np.isfinite(high) & (high > 0.0)
            axes.vlines(at[known], np.maximum(low, 1e-3 * high)[known], high[known], color=style.colour, lw=1.0)
        if f"expected_{key}" in curve:
            axes.plot(at, _positive(curve[f"expected_{key}"]), color=style.colour, lw=0.9, ls=":")
    if "systematic_limit" in curve:
        axes.plot(curve["mrad"], _positive(curve["systematic_limit"]), "_", color=BOUND.colour, ms=8)


def _range(curves: Sequence[Curve]) -> tuple[float, float]:
    """Limits of an axis that hold all marks; bars may be cut off."""
    values = np.concatenate([v for curve in curves for key, v in curve.items() if key != "mrad" and v.ndim == 1])
    values = values[np.isfinite(values) & (values > 0.0)]
    return (values.min() / 2.0, values.max() * 2.0) if len(values) else (0.1, 100.0)


def _columns(curves: Mapping[int, Mapping[str, Curve]]) -> list[str]:
    return list(dict.fromkeys(name for of_row in curves.values() for name in of_row))


def _grid(
    rows: Sequence[LeaderboardRow],
    columns: Sequence[str],
    curves: Mapping[int, Mapping[str, Curve]],
    draw: Callable[[Axes, LeaderboardRow, Curve], None],
    *,
    sharey: Literal["col"] | bool,
) -> tuple[Figure, np.ndarray]:
    """Panels (estimator, column) of curves, dressed; a panel without a curve says so."""
    figure = Figure(figsize=(WIDTH, 1.0 + 0.95 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(columns), squeeze=False, sharex="col", sharey=sharey)
    for line, row in zip(panels, rows, strict=True):
        for axes, name in zip(line, columns, strict=True):
            if name in curves[row.number]:
                draw(axes, row, curves[row.number][name])
            else:
                axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", fontsize=7, color=BOUND.colour)
        line[0].set_ylabel(label(row, 14), fontsize=7, rotation=0, ha="right", va="center")
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=6.5, pad=1.5)
    return figure, panels


def _positive(values: np.ndarray) -> np.ndarray:
    return np.where(values > 0.0, values, np.nan)
