"""Make the gallery of data sets: a picture of each that comes with the package. Run by `make images`.

A picture carries the hash of what its data set is built from, so that a test can tell one that is of another spec.
"""

import json
import tomllib
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from scipy.signal import welch

from scenarios.datasets import DataRecord, DataSet, open_data_set
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.build import build
from scenarios.datasets.plan import arm_file
from scenarios.datasets.record_block import PARTS
from scenarios.datasets.spec import BaselineSpec, DataSetSpec, TruthSpec, shipped
from scenarios.report.figures import save_figure
from sysid.plots.palette import GRID, PALETTE

FOLDER = Path(__file__).parent / "datasets"
ARMS = 100
"""Randomised arms that are drawn for a picture: more make it no clearer."""

NOTE = "spec-sha256"
"""Name of the text in a picture that says of which spec it is."""

TEXTS = ("withheld", "title", "description", "creators", "keywords", "date", "url", "scoring", "truth", "baselines")
"""Keys of a spec that change no number of a record."""

SECONDS = 12.0
"""How much of a record is shown, s."""

ROWS = 3
"""Records, or channels of one, that are shown over time."""

MOST = 40
"""Records of a part whose spectra are averaged."""

FLEET = 10
"""From so many arms with a truth on, their bandwidths are shown as a distribution."""

COLOURS = {"train": PALETTE["armax"].colour, "validation": PALETTE["pem_ss"].colour, "test": PALETTE["okid"].colour}
MARKERS = {"train": "o", "validation": "^", "test": "s"}


def main() -> None:
    """Write `<label>.png` of each data set into the folder `datasets` beside this file."""
    FOLDER.mkdir(exist_ok=True)
    for label, spec in shipped().items():
        with TemporaryDirectory() as folder:
            draw(build(pictured(spec), Path(folder)).folder, FOLDER / f"{label}.png", drawn_from(spec))


def pictured(spec: DataSetSpec) -> DataSetSpec:
    """As much of a data set as its picture shows: no baselines, and of a fleet some arms."""
    plain = replace(spec, truth=TruthSpec(floors=0), baselines=BaselineSpec(models=()))
    return replace(plain, twins=replace(spec.twins, count=min(ARMS, spec.twins.count))) if spec.twins else plain


def drawn_from(spec: DataSetSpec) -> str:
    """Hash of what the picture of a data set depends on: its pictured spec, but for what no number depends on."""
    table = tomllib.loads(pictured(spec).to_toml())
    numbers = {key: value for key, value in table.items() if key not in TEXTS}
    return sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


def draw(data_set: Path, path: Path, spec_hash: str) -> None:
    """Draw a data set that has been built, and note in the picture what it was built from."""
    save_figure(gallery_figure(open_data_set(data_set)), path, dpi=120)
    note = PngInfo()
    note.add_text(NOTE, spec_hash)
    # A third of the size, and no eye sees it.
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True, pnginfo=note)


def gallery_figure(data_set: DataSet) -> Figure:
    """Draw records, spectra of the inputs by part, and output over input of each record or bandwidths of many arms."""
    figure = Figure(figsize=(8.4, 4.5), layout="constrained")
    halves = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    shown = _shown(data_set)
    rows = halves[0].subgridspec(len(shown), 1, hspace=0.08)
    above: Axes | None = None
    for number, (record, channel) in enumerate(shown):
        axes = figure.add_subplot(rows[number], sharex=above)
        _draw_record(axes, record, channel, first=number == 0, last=number == len(shown) - 1)
        above = above or axes
    column = halves[1].subgridspec(2, 1)
    upper, lower = (figure.add_subplot(column[number]) for number in (0, 1))
    _draw_spectra(upper, data_set)
    bandwidths = _bandwidths(data_set)
    if len(bandwidths) >= FLEET:
        _draw_bandwidths(lower, bandwidths)
    else:
        _draw_sizes(lower, data_set)
    for axes in figure.axes:
        axes.grid(True, color=GRID, lw=0.5)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    seconds = sum(len(record) * record.sampling_time for record in data_set.records())
    length = f"{seconds / 3600:.1f} h" if seconds >= 3600 else f"{seconds / 60:.0f} min"
    figure.suptitle(f"{data_set.label}: {len(data_set.records())} records, {length}", x=0.01, ha="left", fontsize=11)
    return figure


def _shown(data_set: DataSet) -> list[tuple[DataRecord, int]]:
    """Channels of a training record; of records with one channel some, from all over the part."""
    single = [record for record in data_set.train if len(record.joints) == 1]
    if not single:
        return [(data_set.train[0], channel) for channel in range(min(ROWS, len(data_set.train[0].joints)))]
    places = np.linspace(0, len(single) - 1, min(ROWS, len(single))).astype(int)
    return [(single[place], 0) for place in places]


def _draw_record(axes: Axes, record: DataRecord, channel: int, *, first: bool, last: bool) -> None:
    signals = record.signals
    count = min(len(record), round(SECONDS / float(signals.dt)))
    time = np.arange(count) * float(signals.dt)
    rest = signals.u[0, channel]
    command, answer = (np.rad2deg(values[:count, channel] - rest) for values in (signals.u, signals.y))
    axes.step(time, command, where="post", color=PALETTE["measured"].colour, lw=1.1, label="u, command")
    axes.plot(time, answer, color=PALETTE["armax"].colour, lw=1.2, label="y, measured")
    axes.set_ylabel("angle / °", fontsize=8)
    name = record.name if len(record.joints) == 1 else f"{record.name}: {record.joints[channel]}"
    axes.set_title(name, fontsize=8, loc="left", pad=2)
    axes.tick_params(labelbottom=last)
    if last:
        axes.set_xlabel("time / s", fontsize=8)
    if first:
        legend = axes.legend(fontsize=7, ncols=2, handlelength=1.2, columnspacing=1.0, frameon=False, borderpad=0.0)
        legend.set_loc("lower right")
        legend.set_bbox_to_anchor((1.0, 0.97))


def _draw_spectra(axes: Axes, data_set: DataSet) -> None:
    """Root power density of the inputs, the mean over the records of each part."""
    for part in PARTS:
        records = data_set.records(part)
        chosen = [records[place] for place in np.linspace(0, len(records) - 1, min(MOST, len(records))).astype(int)]
        length = min((len(record) for record in chosen), default=0)
        if not length:
            continue
        densities = []
        for record in chosen:
            rate = 1 / record.sampling_time
            frequency, density = welch(record.signals.u, rate, nperseg=min(1024, length), detrend="constant", axis=0)
            densities.append(density.mean(axis=1))
        root = np.sqrt(np.mean(densities, axis=0))[1:]
        axes.loglog(frequency[1:], 1000 * root, color=COLOURS[part], lw=1.1, label=part)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    top = axes.get_ylim()[1]
    axes.set_ylim(bottom=max(axes.get_ylim()[0], 1e-5 * top))
    axes.set_xlabel("frequency / Hz", fontsize=8)
    axes.set_ylabel("input / (mrad/√Hz)", fontsize=8)
    axes.legend(fontsize=7, frameon=False)


def _draw_sizes(axes: Axes, data_set: DataSet) -> None:
    """Every record: how large its output is over its input, against its input."""
    for part in PARTS:
        records = data_set.records(part)
        points = np.array([_sizes(record) for record in records]).reshape(-1, 2)
        if len(points):
            x, ratio = 1000 * points[:, 0], points[:, 1] / points[:, 0]
            axes.plot(x, ratio, MARKERS[part], color=COLOURS[part], ms=4, alpha=0.75, mew=0, label=part)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(bottom=0)
    axes.set_xlabel("input, rms about its mean / mrad", fontsize=8)
    axes.set_ylabel("output over input", fontsize=8)
    axes.legend(fontsize=7, frameon=False)


def _sizes(record: DataRecord) -> tuple[float, float]:
    """Root mean square of inputs and of outputs about their means, rad."""
    u, y = (np.sqrt(np.mean(np.nanvar(values, axis=0))) for values in (record.signals.u, record.signals.y))
    return float(u), float(y)


def _bandwidths(data_set: DataSet) -> np.ndarray:
    """True bandwidths of the arms for the joint of their first record, Hz."""
    joints = {line.arm: line.joints[0] for line in reversed(data_set.index)}
    arms = {arm: read_arm(data_set.folder / arm_file(arm)) for arm in data_set.arms}
    return np.array([stored.joints[joints[arm]].bandwidth_hz for arm, stored in arms.items()])


def _draw_bandwidths(axes: Axes, bandwidths: np.ndarray) -> None:
    axes.hist(bandwidths, bins=24, color=PALETTE["measured"].colour, edgecolor="white", lw=0.5)
    axes.axvline(float(np.median(bandwidths)), color=PALETTE["truth"].colour, lw=1.4, label="median")
    axes.set_xlabel(
        f"true bandwidth of {len(bandwidths)} randomised {'arm' if len(bandwidths) == 1 else 'arms'} / Hz", fontsize=8
    )
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel("arms", fontsize=8)
    axes.legend(fontsize=7, frameon=False)


if __name__ == "__main__":
    main()
