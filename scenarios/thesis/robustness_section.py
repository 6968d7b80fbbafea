"""Report section on robustness to disturbances, with its figures."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.report.figure_style import WIDTH, dress, short
from scenarios.report.figures import Gallery
from scenarios.thesis import robustness_section as draw
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, TREATMENTS
from scenarios.thesis.findings_chapter_6 import bias_and_outliers
from scenarios.thesis.robustness import COMPARABLE, PART, Robustness, Summary, Tolerance, sysid_method, tolerance
from scenarios.thesis.robustness import MARGIN as ORDER_MARGIN
from sysid.plots import BOUND, INK, PALETTE, Style

CROSSED = ("bias", "drift", "sway")
"""Disturbances that are crossed with detrending."""

ALONE = ("outliers", "outlier size", "held drop-outs", "marked drop-outs", "length", "white noise", "coloured noise")
"""Disturbances that detrending does not remove."""

COMPARED = ("bias", "outliers", "white noise", "coloured noise")
"""Disturbances on which structures that the thesis did not choose are tried too."""

SHORT = {
    "bias": "constant",
    "drift": "even rise",
    "sway": "slow sine",
    "outliers": "outliers",
    "outlier size": "outlier size",
    "held drop-outs": "lost, held",
    "marked drop-outs": "lost, marked",
    "length": "length",
    "white noise": "white noise",
    "coloured noise": "coloured noise",
}
UNIT = {
    "standard deviations": "standard deviations",
    "percent of samples": "% of samples",
    "size, standard deviations": "standard deviations",
    "s": "s",
    "signal over noise, dB": "signal over noise, dB",
}

LINES = {"nothing removed": "-", "mean removed": "--", "line removed": ":"}

Measure = Callable[[Summary], tuple[float, float, float]]

ERROR = "bandwidth over truth − 1 / %"
REST = "100 − fit in simulation / %"


def errors_and_detrending(robustness: Robustness) -> Figure:
    """Draw the effect of constants and trends on the bandwidth, with and without detrending."""
    return _grid(robustness, CROSSED, _chosen, tuple(LINES), _error, ERROR)


def fits_and_detrending(robustness: Robustness) -> Figure:
    """Draw the effect of constants and trends on the simulation fit to a clean record of another test."""
    return _grid(robustness, CROSSED, _chosen, tuple(LINES), _fit_error, REST)


def errors(robustness: Robustness) -> Figure:
    """Draw the effect of every other disturbance on the bandwidth."""
    return _grid(robustness, ALONE, _chosen, AS_IT_IS, _error, ERROR)


def fits(robustness: Robustness) -> Figure:
    """Draw the effect of every other disturbance on the fit."""
    return _grid(robustness, ALONE, _chosen, AS_IT_IS, _fit_error, REST)


def fits_of_structures(robustness: Robustness) -> Figure:
    """Fits of the structures that the thesis did not choose, beside those that it chose."""
    return _grid(robustness, COMPARED, _all, AS_IT_IS, _fit_error, REST)


def _chosen(joint: str) -> dict[str, tuple[str, Style]]:
    return {"SysID": (sysid_method(joint), PALETTE["armax"]), "OKID": ("okid", PALETTE["okid"])}


def _all(_: str) -> dict[str, tuple[str, Style]]:
    return {name.upper(): (name, PALETTE[name]) for name in ("armax", "oe", "arx", "okid")}


def _error(point: Summary) -> tuple[float, float, float]:
    return point.error


def _fit_error(point: Summary) -> tuple[float, float, float]:
    middle, low, high = point.fit
    return 100 - middle, 100 - high, 100 - low


def _grid(
    robustness: Robustness,
    kinds: Sequence[str],
    looks: Callable[[str], dict[str, tuple[str, Style]]],
    treatments: Sequence[str],
    measure: Measure,
    label: str,
) -> Figure:
    joints = list(robustness.judged_by)
    figure = Figure(figsize=(WIDTH, 0.9 + 1.28 * len(kinds)), layout="constrained")
    panels = figure.subplots(len(kinds), len(joints), sharey=True, squeeze=False)
    for row, kind in zip(panels, kinds, strict=True):
        for axes, joint in zip(row, joints, strict=True):
            for method, style in looks(joint).values():
                _clean(axes, robustness, joint, method, style, measure)
                for treatment in treatments:
                    line = LINES[treatment] if len(treatments) > 1 else "-"
                    points = [
                        p
                        for p in robustness.curve(kind, joint, method, treatment)
                        if p.degree or DISTURBANCES[kind].decibel
                    ]
                    _curve(axes, points, style, line, measure)
            _axes(axes, kind, measure)
        row[0].set_ylabel(SHORT[kind], fontsize=8)
        row[len(joints) // 2].set_xlabel(UNIT[DISTURBANCES[kind].unit], fontsize=8, labelpad=1)
    for axes, joint in zip(panels[0], joints, strict=True):
        axes.set_title(short(joint), fontsize=9)
    dress(panels.ravel())
    for axes in panels.ravel():
        # the grid marks the ticks
        axes.tick_params(labelsize=7, left=False, bottom=False)
    figure.supylabel(label, fontsize=9)
    _legend(figure, looks(joints[0]), treatments, measure)
    return figure


def _clean(axes: Axes, robustness: Robustness, joint: str, method: str, style: Style, measure: Measure) -> None:
    """The record as it is, as a thin line across."""
    clean = [p for p in robustness.curve("bias", joint, method) if p.degree == 0.0]
    if clean:
        axes.axhline(measure(clean[0])[0], color=style.colour, lw=0.6, ls=(0, (1, 2)))


def _curve(axes: Axes, points: Sequence[Summary], style: Style, line: str, measure: Measure) -> None:
    known = [p for p in points if np.isfinite(measure(p)[0])]
    x = [p.degree for p in known]
    middle, low, high = (np.array([measure(p)[k] for p in known]) for k in range(3))
    if known:
        axes.plot(x, middle, color=style.colour, ls=line, lw=1.3, marker=style.marker, ms=3)
    spread = [p.draws > 1 for p in known]
    if any(spread):
        axes.vlines(x, low, np.where(np.isfinite(high), high, middle), color=style.colour, lw=0.8, alpha=0.7)
    for point in points:
        failed = sum(point.failures.values()) if measure is _error else point.failures.get("refused", 0)
        if failed:
            # Above the panel's curves: there is no number to draw it at.
            place = axes.get_xaxis_transform()
            axes.plot(point.degree, 0.93, "x", color=style.colour, ms=5, mew=1.4, transform=place, clip_on=False)
            if point.draws > 1:
                axes.annotate(
                    f"{failed}",
                    (point.degree, 0.93),
                    xycoords=place,
                    xytext=(4, 0),
                    textcoords="offset points",
                    fontsize=7,
                    va="center",
                    color=style.colour,
                )


def _axes(axes: Axes, kind: str, measure: Measure) -> None:
    disturbance = DISTURBANCES[kind]
    levels = [degree for degree in disturbance.degrees if degree or disturbance.decibel]
    if disturbance.decibel:
        reach = 0.05 * (max(levels) - min(levels))
        axes.set_xlim(min(levels) - reach, max(levels) + reach)
    else:
        # Of a short record not every degree is there: the axis is that of the disturbance, not of what was found.
        reach = (max(levels) / min(levels)) ** 0.05
        axes.set_xlim(min(levels) / reach, max(levels) * reach)
        axes.set_xscale("log")
    axes.set_xticks(levels, [f"{degree:g}" for degree in levels])
    axes.minorticks_off()
    if disturbance.falling:
        axes.invert_xaxis()
    if measure is _error:
        axes.axhline(0.0, color=PALETTE["truth"].colour, lw=0.9)
        axes.set_yscale("symlog", linthresh=20.0, linscale=1.0)
        axes.set_ylim(-150.0, 4000.0)
        axes.set_yticks([-100, -10, 0, 10, 100, 1000], ["−100", "−10", "0", "10", "100", "1000"])
    else:
        axes.set_yscale("log")
        axes.set_ylim(0.3, 300.0)
        axes.set_yticks([1, 10, 100], ["1", "10", "100"])
    axes.minorticks_off()


def _legend(figure: Figure, looks: dict[str, tuple[str, Style]], treatments: Sequence[str], measure: Measure) -> None:
    marks = [
        Line2D([], [], color=style.colour, marker=style.marker, ms=4, label=name) for name, (_, style) in looks.items()
    ]
    if len(treatments) > 1:
        marks += [Line2D([], [], color=INK, ls=LINES[name], label=name) for name in treatments]
    marks.append(Line2D([], [], color=BOUND.colour, ls=(0, (1, 2)), lw=0.8, label="record as it is"))
    if measure is _error:
        marks.append(Line2D([], [], color=PALETTE["truth"].colour, lw=0.9, label="truth"))
        marks.append(Line2D([], [], color=INK, ls="", marker="x", ms=5, label="no bandwidth (draws)"))
    figure.legend(handles=marks, loc="outside upper left", ncols=4, frameon=False, fontsize=8)


READING = (
    "Blue: the thesis' prediction-error structure; green: OKID. Marks are medians over the draws, bars reach from the "
    "smallest to the largest; harm grows to the right. "
)

FAILED = "A cross stands for draws without a bandwidth (refused, unstable, or a gain that never falls by 3 dB)."


def robustness(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    results = study.robustness
    section: dict[str, object] = {
        "joints": tuple(results.judged_by),
        "judged_by": sorted({number for numbers in results.judged_by.values() for number in numbers}),
        "seconds": PART / SAMPLE_RATE,
        "comparable": COMPARABLE,
        "order_margin": ORDER_MARGIN,
        "tolerances": _tolerances(study),
        "orders": results.orders,
        "statements": bias_and_outliers(study).parts if results.judged_by else {},
        "coverage": _coverage(study),
        "figures": (),
        "thorough": _thorough(study),
    }
    if not section["thorough"]:
        return section
    section["figures"] = (
        gallery.add(
            draw.errors_and_detrending(results),
            "Constants and trends left in the output, and taken out again: error of the bandwidth. Full lines: nothing "
            "removed; dashed: mean removed; dotted: straight line removed. " + READING + FAILED,
            name="robustness-trends-bandwidth",
        ),
        gallery.add(
            draw.fits_and_detrending(results),
            "The same records: what the models leave unexplained in simulation of clean records of other waveforms. "
            + READING,
            name="robustness-trends-fit",
        ),
        gallery.add(
            draw.errors(results),
            "Outliers, lost samples, length of the record and added noise: error of the bandwidth. " + READING + FAILED,
            name="robustness-bandwidth",
        ),
        gallery.add(
            draw.fits(results),
            "The same records: what the models leave unexplained in simulation of clean records of other waveforms. "
            + READING,
            name="robustness-fit",
        ),
        gallery.add(
            draw.fits_of_structures(results),
            "Other structures beside the thesis' own: fits in simulation of clean records of other tests. ARX, like "
            "OKID, has the disturbed output among its regressors; OE has none of it. What the thesis did not choose "
            "is tried on one draw.",
            name="robustness-structures",
        ),
    )
    return section


def _thorough(study: Comparison) -> bool:
    return bool(study.robustness.outcomes)


def _tolerances(study: Comparison) -> list[tuple[str, str, list[tuple[str, str]]]]:
    """By disturbance and treatment: unit, and for each joint what SysID and OKID tolerate, in words."""
    results, rows = study.robustness, []
    treatments = {(entry.disturbance, entry.treatment) for entry in results.outcomes}
    for key, disturbance in DISTURBANCES.items():
        for treatment in TREATMENTS:
            if (key, treatment) not in treatments:
                continue
            label = disturbance.label if disturbance.treatments == AS_IT_IS else f"{disturbance.label}; {treatment}"
            cells = [
                (
                    _tolerance_text(
                        tolerance(results, key, joint, sysid_method(joint), treatment), disturbance.falling
                    ),
                    _tolerance_text(tolerance(results, key, joint, "okid", treatment), disturbance.falling),
                )
                for joint in results.judged_by
            ]
            rows.append((label, disturbance.unit, cells))
    return rows


def _tolerance_text(known: Tolerance | None, falling: bool) -> str:
    if known is None:
        return "–"
    if known.degree is None:
        return "none"
    word = "down to" if falling else "up to"
    return f"all, {word} {known.degree:g}" if known.everything else f"{word} {known.degree:g}"


def _coverage(study: Comparison) -> list[tuple[str, int, int]]:
    """Count the intervals that hold the truth, by method, over every record."""
    counts = []
    for name, okid in (("SysID", False), ("OKID", True)):
        entries: Sequence[bool] = [
            entry.covers for entry in study.robustness.outcomes if entry.chosen and (entry.method == "okid") == okid
        ]
        counts.append((name, sum(entries), len(entries)))
    return counts
