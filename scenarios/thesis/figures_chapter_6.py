"""Figures of chapter 6: block diagrams and multivariable responses."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

from scenarios.report.figure_style import WIDTH, dress, short
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.findings_chapter_6 import ROUNDING
from scenarios.thesis.multi_input import FULL_OKID, INDEPENDENT
from scenarios.thesis.multivariable import Kind, ThreeJointModel
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL
from scenarios.thesis.response_figures import FREQUENCIES, mark_excited, model_response
from sysid import StateSpace
from sysid.plots import BOUND, INK, PALETTE, Curve, Style, bode

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


LOOKS = {
    "SysID model": PALETTE["armax"],
    "OKID model": PALETTE["okid"],
    "hybrid model": PALETTE["pem_ss"],
    "printed SysID model": Style("#b8860b", "--", 1.4, "*"),
    "printed OKID model": Style("#6b4e00", ":", 1.6, "P"),
}
"""Style of the models in every figure of the chapter."""

KINDS: tuple[Kind, ...] = ("SysID", "OKID")

REACH = 1.25
"""Limits of the z plane in a map of roots."""


def joint_bode(study: Comparison, joint: str) -> Figure:
    """Truth, and the SysID and the OKID model's responses of a joint, identified and as printed."""
    curves = [Curve("truth of the twin", model_response(study.joints[joint].truth.model), PALETTE["truth"])]
    for printed in (False, True):
        curves += [
            Curve(entry.name, model_response(entry.blocks[joint]), LOOKS[entry.name])
            for entry in study.multivariable.pair(printed=printed)
        ]
    return mark_excited(bode(curves, mark_hz=1.0, limits_hz=(0.05, 25.0), size=(WIDTH, 5.6)))


def root_maps(study: Comparison) -> Figure:
    """Poles and transmission zeros of the SysID and of the OKID model, identified and as printed."""
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for axes, kind in zip(panels, KINDS, strict=True):
        axes.plot(np.cos(angle), np.sin(angle), color=BOUND.colour, lw=0.9)
        below = "real part of z (× pole, ○ zero)"
        for printed, size in ((False, 8.0), (True, 5.0)):
            entry = study.multivariable.model(kind, printed=printed)
            label = "as printed" if printed else "from the twin"
            _roots(axes, entry.model, LOOKS[entry.name].colour, size, label)
            beyond = [value for value in entry.model.zeros() if max(abs(value.real), abs(value.imag)) > REACH]
            below += f"\n\nzeros outside, {label}:\n{_root_text(beyond)}"
        axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), aspect="equal")
        axes.set_title(f"{kind} model", loc="left", fontsize=9, pad=22)
        axes.legend(
            loc="lower left", bbox_to_anchor=(-0.03, 0.98), ncols=2, frameon=False, fontsize=8, handletextpad=0.1
        )
        axes.set_xlabel(below, fontsize=8)
    panels[0].set_ylabel("imaginary part of z", fontsize=8)
    dress(panels)
    return figure


def _roots(axes: Axes, model: StateSpace, colour: str, size: float, label: str) -> None:
    poles, zeros = model.poles(), model.zeros()
    axes.plot(poles.real, poles.imag, "x", color=colour, ms=size, mew=1.5, label=label)
    axes.plot(zeros.real, zeros.imag, "o", color=colour, ms=size, mew=1.2, mfc="none")


def _root_text(roots: Iterable[complex]) -> str:
    """Roots as text, three a line; one root of a conjugate pair represents both."""
    parts = []
    for value in roots:
        if abs(value.imag) < ROUNDING:
            parts.append(f"{value.real:.1f}")
        elif value.imag > 0:
            parts.append(f"{value.real:.1f} ± {value.imag:.1f}j")
    lines = [", ".join(parts[k : k + 3]) for k in range(0, len(parts), 3)]
    return "\n".join(lines).replace("-", "−") or "none"


def coupled(study: Comparison) -> Figure:
    """Gain of the true three-joint response, channel by channel, beside models with and without coupling."""
    names = list(study.joints)
    models = study.multivariable
    lines = [
        ("truth", models.truth, PALETTE["truth"], False),
        ("OKID model", models.pair()[1].model, LOOKS["OKID model"], True),
    ]
    for entry in models.full:
        if entry.method == FULL_OKID:
            apart = entry.record == INDEPENDENT
            label = f"all nine, {'a waveform each' if apart else 'shared waveform'}"
            style = Style("#0072b2", "--", 1.3) if apart else Style("#d55e00", ":", 1.4)
            lines.append((label, entry.model, style, False))
    figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
    grid = figure.subplots(len(names), len(names), sharex=True, sharey=True)
    for label, model, style, diagonal in lines:
        gain = np.abs(model.frequency_response(FREQUENCIES))
        for i, j in np.ndindex(grid.shape):
            if i == j or not diagonal:
                magnitude = np.maximum(gain[:, i, j], 1e-9)
                grid[i, j].loglog(
                    FREQUENCIES, magnitude, color=style.colour, ls=style.line, lw=style.width, label=label
                )
    for i, j in np.ndindex(grid.shape):
        grid[i, j].set_ylim(1e-4, 5.0)
        if i == 0:
            grid[i, j].set_title(f"from {short(names[j])}", fontsize=8)
        if j == 0:
            grid[i, j].set_ylabel(f"to {short(names[i])}", fontsize=8)
        grid[i, j].xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        grid[i, j].minorticks_off()
    dress(grid.ravel())
    figure.supxlabel("frequency / Hz", fontsize=9)
    figure.supylabel("gain / (rad/rad)", fontsize=9)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def every_fit(study: Comparison) -> Figure:
    """Fits of the SysID and the OKID model to every record of several joints, both ways, and of the linear truth."""
    records = study.multivariable.records
    figure = Figure(figsize=(WIDTH, 0.27 * len(records) + 1.4), layout="constrained")
    panels = figure.subplots(1, len(study.joints), sharey=True)
    place = np.arange(len(records), dtype=float)
    for axes, joint in zip(panels, study.joints, strict=True):
        for entry, shift in zip(study.multivariable.pair(), (-0.16, 0.16), strict=True):
            _fits(axes, entry, joint, records, place + shift)
        for kind, line in ((DIAGONAL, (0, (1.5, 1.0))), (COUPLED, "-")):
            reached = [study.multivariable.reference(kind, name)[joint] for name in records]
            axes.vlines(reached, place - 0.4, place + 0.4, color=PALETTE["truth"].colour, lw=1.0, ls=line, label=kind)
        axes.set_title(short(joint), fontsize=8)
        axes.set_xlim(left=max(axes.get_xlim()[0], -20.0), right=102.0)
    panels[0].set_yticks(place, labels=list(records))
    panels[0].invert_yaxis()
    dress(panels)
    figure.supxlabel("fit / %   (filled: simulation, open: one step ahead)", fontsize=8)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def _fits(axes: Axes, entry: ThreeJointModel, joint: str, records: Iterable[str], place: np.ndarray) -> None:
    style = LOOKS[entry.name]
    simulated = [entry.fits[name].simulation[joint] for name in records]
    ahead = [entry.fits[name].one_step[joint] for name in records]
    axes.hlines(place, simulated, ahead, color=style.colour, lw=0.8)
    axes.plot(ahead, place, ls="", marker=style.marker, ms=4.0, mfc="white", mec=style.colour, mew=0.9)
    axes.plot(simulated, place, ls="", marker=style.marker, ms=4.0, color=style.colour, label=entry.name)
