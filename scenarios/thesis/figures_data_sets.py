"""Figures of chapter IV: models from every data set, and searches for orders."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.report.figure_style import WIDTH, dress
from scenarios.thesis.comparison import JointResult
from scenarios.thesis.every_data_set import DataSets
from scenarios.thesis.order_search import Search, Searches
from sysid.plots import BOUND, INK, PALETTE, structures

METHODS = ("arx", "iv4", "armax", "oe", "okid")

HERTZ = (0.3, 4.0)
"""Bandwidths that are shown; an arrow stands for what lies beyond."""

SHOWN = np.geomspace(0.3, 12.0, 50)
"""Frequencies at which gains are compared with the truth, Hz."""


def bandwidths(entry: JointResult, sets: DataSets) -> Figure:
    """Bandwidth recovered from every data set by every method, with 95 % intervals."""
    records = list(sets.excited)
    figure = Figure(figsize=(WIDTH, 1.2 + 0.3 * len(records)), layout="constrained")
    axes = figure.subplots()
    low, high = HERTZ
    for number, method in enumerate(METHODS):
        style = PALETTE[method]
        models = [model for model in sets.models if model.structure.method == method]
        trusted = np.array([model.stable and model.enough for model in models], dtype=bool)
        hz = np.array([model.bandwidth_hz for model in models])
        at = np.array([records.index(model.record) + 0.15 * (number - 2) for model in models])
        # One line with gaps for all intervals of a method.
        ends = np.array([(*np.clip(model.ci95, low, high), np.nan) for model in models]).reshape(-1, 3)
        inside = trusted & (low <= hz) & (hz <= high)
        axes.plot(ends[inside].ravel(), np.repeat(at[inside], 3), color=style.colour, lw=1.0)
        beyond = {style.marker: (low <= hz) & (hz <= high), "<": hz < low, ">": ~(hz <= high)}
        for marker, there in beyond.items():
            for face, those in ((style.colour, there & trusted), ("white", there & ~trusted)):
                if those.any():
                    axes.plot(
                        np.clip(np.nan_to_num(hz[those], nan=high), low, high),
                        at[those],
                        ls="none",
                        marker=marker,
                        ms=4,
                        color=style.colour,
                        mfc=face,
                        clip_on=False,
                    )
        axes.plot([], [], ls="none", marker=style.marker, ms=4, color=style.colour, label=method.upper())
    axes.axvline(entry.truth.bandwidth_hz, color=PALETTE["truth"].colour, lw=1.6, label="truth")
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_xticks([0.3, 0.5, 1.0, 2.0, 4.0], ["0.3", "0.5", "1", "2", "4"])
    axes.minorticks_off()
    axes.set_yticks(range(len(records)), [shown(name, sets) for name in records])
    axes.set_xlabel("bandwidth / Hz (open: excited too little, or unstable)", fontsize=8)
    dress([axes])
    axes.set_ylim(len(records) - 0.5, -0.5)
    figure.legend(loc="outside upper left", ncols=6, frameon=False, fontsize=8, handletextpad=0.2, columnspacing=0.9)
    return figure


def shown(name: str, sets: DataSets) -> str:
    """Short name of a record: single-joint tests by their number."""
    return f"test {name.split('-')[1]}" if name in sets.single else name


def responses(entry: JointResult, sets: DataSets) -> Figure:
    """Gain over that of the truth, a panel for each method and a line for each single-joint data set."""
    figure = Figure(figsize=(WIDTH, 6.6), layout="constrained")
    grid = figure.subplots(3, 2, sharex=True, sharey=True)
    panels: list[Axes] = list(grid.ravel())
    true = np.abs(entry.truth.model.frequency_response(SHOWN)[:, 0, 0])
    colours = [f"C{number}" for number in range(10)]
    patterns = ("-", "--", "-.", ":")
    for axes, method in zip(panels, METHODS, strict=False):
        for number, name in enumerate(sets.single):
            model = sets.find(name, method)
            if model is None or not model.enough:
                continue
            gain = np.abs(model.model.frequency_response(SHOWN)[:, 0, 0])
            axes.plot(
                SHOWN,
                100 * (gain / true - 1),
                color=colours[number],
                ls=patterns[number % 4] if model.stable else (0, (1, 3)),
                lw=1.1,
            )
        count = sum(not model.stable for model in sets.singles(method, enough=True))
        axes.set_title(f"{method.upper()}{f': {count} unstable' if count else ''}", loc="left", fontsize=8.5)
        axes.axhline(0.0, color=INK, lw=0.8)
    last = panels[-1]
    last.axis("off")
    for number, name in enumerate(sets.single):
        last.plot([], [], color=colours[number], ls=patterns[number % 4], lw=1.3, label=shown(name, sets))
    last.legend(loc="center", frameon=False, fontsize=8)
    dress(panels[:-1])
    panels[0].set_xscale("log")
    panels[0].set_xlim(0.3, 12.0)
    panels[0].set_xticks([0.5, 1.0, 2.0, 5.0, 10.0], ["0.5", "1", "2", "5", "10"])
    panels[0].minorticks_off()
    panels[0].set_ylim(-40.0, 40.0)
    for axes in (panels[3], panels[4]):
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("frequency / Hz", fontsize=8)
    figure.supylabel("gain over that of the truth − 1 / %", fontsize=9)
    return figure


def searches(results: Searches) -> Figure:
    """Order searches: fit to other data sets, and lags outside the whiteness bounds, over the number of poles."""
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for offset, search in ((-0.08, results.armax), (0.08, results.oe)):
        _plot_search(upper, lower, search, offset)
    upper.set_ylabel("fit to other data\nsets, median / %", fontsize=8)
    lower.set_ylabel("of 25 lags\noutside the bounds", fontsize=8)
    lower.set_ylim(-1.0, 26.0)
    lower.set_xlabel("poles (each mark a structure: its zeros and its delay)", fontsize=8)
    lower.xaxis.get_major_locator().set_params(integer=True)
    dress([upper, lower])
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def _plot_search(upper: Axes, lower: Axes, search: Search, offset: float) -> None:
    style = PALETTE[search.method]
    name = search.method.upper()
    iterations = [entry for entry in search.iterations if np.isfinite(entry.held_out)]
    best = max(entry.held_out for entry in iterations)
    # A search begins far below where it ends: what matters is near the top.
    floor = best - 12.0
    for axes, values in (
        (upper, [entry.held_out for entry in iterations]),
        (lower, [entry.outside for entry in iterations]),
    ):
        x = np.array([entry.poles + offset for entry in iterations])
        axes.plot(x, values, ls="none", marker=style.marker, ms=4, color=style.colour, alpha=0.6, label=name)
    chosen = search.chosen
    for axes, value in ((upper, chosen.held_out), (lower, chosen.outside)):
        axes.plot(
            chosen.poles + offset,
            value,
            ls="none",
            marker="o",
            ms=10,
            mfc="none",
            mew=1.5,
            color=style.colour,
            label=f"chosen: {chosen.poles} poles, {chosen.zeros} zeros, delay {chosen.delay}",
        )
    own = [search.own] if search.own in iterations else []
    for axes, values in ((upper, [entry.held_out for entry in own]), (lower, [entry.outside for entry in own])):
        axes.plot(
            [entry.poles + offset for entry in own],
            values,
            ls="none",
            marker="*",
            ms=9,
            color=style.colour,
            mec=BOUND.colour,
            mew=0.5,
            label=f"{name} of the thesis",
        )
    bottom, top = upper.get_ylim()
    upper.set_ylim(max(bottom, floor) if iterations else bottom, max(top, best + 0.6))


def arx_orders(results: Searches) -> Figure:
    """Criteria of every ARX structure over its number of parameters."""
    return structures(results.arx, size=(WIDTH, 4.0))
