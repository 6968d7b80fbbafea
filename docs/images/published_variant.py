"""Make the figures of docs/published-variant.md: `PYTHONPATH=. python docs/images/published_variant.py`."""

import re
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from docs.images.published_servos import TARGETS, dominant_poles
from hmtb_twin import STUDIED_JOINTS, Truth, linearize, load_arm
from scenarios.truth.published import EQUATIONS, published
from sysid import StateSpace
from sysid.plots.palette import GRID, PALETTE

FOLDER = Path(__file__).parent
HYPOTHESES = FOLDER.parent / "measured/yaw-hypotheses.md"
LOWEST_LINE = 0.5


def main() -> None:
    """Write the figures beside this file."""
    # Text as text keeps the files small; the same ids on every run keep their differences small.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "published", "font.family": "sans-serif"})
    nominal, variant = linearize(load_arm()), linearize(load_arm("published"))
    for name, figure in {
        "published-poles.svg": poles(variant),
        "published-bode.svg": bode(variant, nominal),
        "yaw-friction.svg": friction(HYPOTHESES.read_text(encoding="utf-8")),
    }.items():
        figure.savefig(FOLDER / name, metadata={"Date": None})


def poles(variant: Truth) -> Figure:
    """Poles of the printed models under those of the variant's truth: how fast each, and what it carries."""
    figure = Figure(figsize=(9.6, 3.0), layout="constrained")
    for axes, joint in zip(figure.subplots(1, 3), STUDIED_JOINTS, strict=True):
        entries = published(joint)
        rows = [("the variant", variant.joint(joint).model, "black", "o")]
        rows += [
            (entry.label, entry.model, PALETTE[entry.method].colour, PALETTE[entry.method].marker) for entry in entries
        ]
        for height, (_, model, colour, marker) in enumerate(reversed(rows)):
            s, share = natural(model)
            real = np.abs(s.imag) < 1e-6
            for kept, face in ((real, colour), (~real, "none")):
                size = 12.0 + 110.0 * np.minimum(share[kept], 1.0)
                axes.scatter(np.abs(s[kept]), np.full(kept.sum(), height), size, fc=face, ec=colour, marker=marker)
        targets = [entry for entry in entries if entry in TARGETS]
        for pole in (pole for entry in targets for pole in dominant_poles(entry)):
            axes.axvline(abs(pole), color=PALETTE["measured"].colour, lw=0.9, ls=(0, (2, 2)), zorder=0)
        axes.set(xscale="log", xlim=(0.5, 400.0), ylim=(-0.6, len(rows) - 0.4), title=joint.replace("_", " "))
        axes.set_yticks(range(len(rows)), [label for label, *_ in reversed(rows)], fontsize=8.5)
        axes.set_xlabel("modulus of the pole / (rad/s)")
        _dress(axes)
    return figure


def natural(model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles in the s plane that are images of one or of a pair there, rad/s, and the part of the DC gain of each."""
    z, vectors = np.linalg.eig(model.A.astype(complex))
    residues = (model.C @ vectors)[0] * np.linalg.solve(vectors, model.B.astype(complex))[:, 0]
    share = np.abs(residues / (1.0 - z)) / abs(model.dc_gain()[0, 0])
    kept = (np.abs(z) > 1e-6) & (z.imag > -1e-9) & ~((np.abs(z.imag) < 1e-9) & (z.real < 0.0)) & (share > 1e-3)
    return np.log(z[kept]) / model.dt, share[kept]


def bode(variant: Truth, nominal: Truth) -> Figure:
    """Responses of the printed models over those of the variant and of the nominal arm."""
    figure = Figure(figsize=(9.6, 5.6), layout="constrained")
    f = np.geomspace(0.02, 10.0, 60)
    grid = figure.subplots(2, 3, sharex=True, sharey="row")
    for column, joint in enumerate(STUDIED_JOINTS):
        upper, lower = grid[:, column]
        _response(upper, lower, f, nominal.joint(joint).model, "the nominal arm", PALETTE["measured"].colour, "-", 2.4)
        _response(upper, lower, f, variant.joint(joint).model, "the variant", "black", "-", 2.2)
        for entry in published(joint):
            style = PALETTE[entry.method]
            line = ":" if "4.9" in entry.label else style.line
            _response(upper, lower, f, entry.model, entry.label, style.colour, line, style.width)
        upper.axvspan(f[0], LOWEST_LINE, color=GRID, alpha=0.45, lw=0)
        lower.axvspan(f[0], LOWEST_LINE, color=GRID, alpha=0.45, lw=0)
        upper.set(title=joint.replace("_", " "), xscale="log", yscale="log", ylim=(0.02, 2.2))
        upper.legend(fontsize=7.5, loc="lower left", frameon=False)
        lower.set(xlabel="frequency / Hz", xlim=(f[0], f[-1]), ylim=(-270, 5))
        lower.set_yticks([-270, -180, -90, 0])
        _dress(upper)
        _dress(lower)
    grid[0, 0].set_ylabel("gain")
    grid[1, 0].set_ylabel("phase / degrees")
    return figure


def _response(
    upper: Axes, lower: Axes, f: np.ndarray, model: StateSpace, label: str, colour: str, line: str, width: float
) -> None:
    answer = model.frequency_response(f)[:, 0, 0]
    upper.plot(f, np.abs(answer), line, color=colour, lw=width, label=label)
    lower.plot(f, np.degrees(np.unwrap(np.angle(answer))), line, color=colour, lw=width)


def friction(page: str) -> Figure:
    """What the three estimators read off the nominal arm against its dry friction, from the table of hypotheses."""
    label = r"(?:as it is \()?dry friction ([\d.]+) %\)?"
    rows = re.findall(rf"^\| {label} \|((?: +-?[\d.a-z]+ \|){{9}})", page, re.M)
    rows.sort(key=lambda one: float(one[0]))
    level = [float(percent) for percent, _ in rows]
    values = np.array([[float(cell) for cell in cells.split("|")[:9]] for _, cells in rows]).reshape(-1, 3, 3)
    figure = Figure(figsize=(9.6, 3.2), layout="constrained")
    titles = ("bandwidth / Hz", "DC gain", "gain at 0.5 Hz")
    for i, (axes, title) in enumerate(zip(figure.subplots(1, 3), titles, strict=True)):
        for method, found in zip(("armax", "oe", "okid"), values.transpose(1, 0, 2), strict=True):
            style = PALETTE[method]
            axes.plot(
                level, found[:, i], style.line, marker=style.marker, color=style.colour, ms=4, label=method.upper()
            )
        for entry in (EQUATIONS["4.7"], EQUATIONS["5.8"]):
            gain = np.abs(entry.model.frequency_response(np.array([LOWEST_LINE]))[0, 0, 0])
            printed = (entry.bandwidth_hz, entry.model.dc_gain()[0, 0], gain)[i]
            axes.axhline(printed, color=PALETTE[entry.method].colour, lw=0.9, ls=(0, (1, 2)))
        axes.set(xlabel="dry friction / % of maximum torque", title=title)
        if i == 0:
            axes.set(yscale="log")
            axes.set_yticks([0.05, 0.1, 0.2, 0.5, 1.0], ["0.05", "0.1", "0.2", "0.5", "1"])
            axes.minorticks_off()
            axes.legend(fontsize=8, frameon=False)
        _dress(axes)
    return figure


def _dress(axes: Axes) -> None:
    """Draw a light grid behind the curves, and no frame above or on the right."""
    axes.grid(True, color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


if __name__ == "__main__":
    main()
