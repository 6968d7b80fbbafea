"""Figures of models of any origin side by side: responses, poles and zeros, residuals and simulated outputs."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import sysid
from scenarios.files.data_file import joints_of
from scenarios.files.errors import ScenarioError
from scenarios.identification.identification import Identification, spectral_analysis
from scenarios.identification.model_comparison import JudgedModel, records_about_means
from sysid import IOData, plots
from sysid.plots import PALETTE, Style, Trace
from sysid.plots.traces import curves_of, roots_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = ("Bode", "Poles and zeros", "Residuals", "Fit")
"""Names of the figures of `side_by_side`."""

PIECE = 8.0
"""Length of the outputs that `side_by_side` draws, from the middle of the record, s."""

SHORT_PIECE = 5.0
"""Length of the outputs that `outputs_figure` draws when none is given, s."""

PATTERNS = ("-.", ":", "--")
"""Lines of printed models, which share a colour."""


class StyledModel(NamedTuple):
    """A model of a comparison with its look.

    Attributes:
        model: The model.
        style: Its colour and line.
    """

    model: JudgedModel
    style: Style

    @property
    def label(self) -> str:
        """Its name in legends."""
        return self.model.label

    @property
    def result(self) -> Identification:
        """How the model was identified."""
        if self.model.identification is None:
            raise ScenarioError(f"{self.label} was not identified here; expected an identified model")
        return self.model.identification


def side_by_side(
    models: Sequence[StyledModel], beside: Sequence[JudgedModel], width: float
) -> dict[str, list["str | Figure"]]:
    """Draw identified models in the same figures.

    Args:
        models: One or more identified models.
        beside: Truth and printed models, judged on the record of the first model.
        width: Width of a figure, inch.

    Returns:
        Figures by name, and lines about models that are left out: their channels or records differ from the first's.
    """
    patterns = iter(PATTERNS * len(beside))
    known_beside = []
    for known in beside:
        style = PALETTE["truth"] if known.kind == "truth" else replace(PALETTE["published"], line=next(patterns))
        known_beside.append(StyledModel(known, style))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        drawings = (
            _bode(models, known_beside, width),
            _roots(models, known_beside, width),
            _residuals(models, width),
            _outputs(models, known_beside, width),
        )
        return dict(zip(FIGURES, map(list, drawings), strict=True))


def outputs_figure(
    records: Sequence[IOData], models: Sequence[JudgedModel], title: str, piece: tuple[float, float] | None = None
) -> "Figure":
    """Draw the simulated outputs of models beside the measured ones, on the longest record.

    Args:
        records: The records about their means.
        models: The models, judged on them.
        title: Title of the figure.
        piece: Start and length of the part that is drawn, s; `SHORT_PIECE` from the middle when None.

    Raises:
        ScenarioError: The part does not lie in the record.
    """
    longest = max(range(len(records)), key=lambda k: len(records[k]))
    record = records[longest]
    seconds = len(record) * record.dt
    start, length = piece or (max(0.5 * (seconds - SHORT_PIECE), 0.0), min(SHORT_PIECE, seconds))
    if not (0.0 <= start < seconds and length > 0.0):
        raise ScenarioError(f"--piece {start:g} {length:g} given, expected a start from 0 to below {seconds:g} s")
    traces = []
    for model, style in zip(models, styles_of_kinds([model.kind for model in models]), strict=True):
        traces.append(_simulated_trace(model, longest, style, f"{model.label}: fit {_percents(model)} %"))
    is_in_radians = all(unit == "rad" for unit in record.output_units or ("",))
    scale, unit = (1000.0, "mrad") if is_in_radians else (1.0, None)
    figure = plots.output_comparison(record, traces, start=start, length=length, scale=scale, unit=unit)
    figure.axes[0].set_title(title, loc="left", fontsize=10)
    return figure


def styles_of_kinds(kinds: Sequence[str]) -> list[Style]:
    """Styles of models: the first of a kind has the one that its kind has everywhere, others take those left over.

    Args:
        kinds: `truth`, `published`, `file` or the method of an estimator, of each model.
    """
    of_kinds = {kind: PALETTE[kind] for kind in kinds if kind in PALETTE}
    # What is measured and what is true keep their looks to themselves.
    reserved = (*of_kinds, "measured", "etfe", "truth")
    free = [style for kind, style in PALETTE.items() if kind not in reserved]
    styles = []
    for kind in kinds:
        if kind in of_kinds:
            styles.append(of_kinds.pop(kind))
        elif free:
            styles.append(free.pop(0))
        else:
            styles.append(PALETTE["published"])
    return styles


def _simulated_trace(model: JudgedModel, experiment: int, style: Style, label: str) -> Trace:
    """Simulated outputs of a model in one of the experiments that judge it, about the means of the record."""
    fit = model.fit.by_experiment[experiment] if model.fit.by_experiment else model.fit
    return Trace(label, fit.simulated + model.trends[experiment], style)


def _percents(model: JudgedModel) -> str:
    return ", ".join(f"{value:.1f}" for value in model.fit.simulation)


def _bode(models: Sequence[StyledModel], beside: Sequence[StyledModel], width: float) -> Iterator["str | Figure"]:
    records = models[0].result.fitted.parts
    first = records[0]
    alike = [drawn for drawn in models if _channels(drawn) == _channels(models[0])]
    curves = []
    # records too short for a spectrum still have models to draw
    if (response := spectral_analysis(records)) is not None:
        curves += curves_of({"spectral analysis": response}, None)
    for drawn in (*alike, *beside):
        curves += [replace(curve, style=drawn.style) for curve in curves_of({drawn.label: drawn.model.item}, None)]
    for i, j in product(range(first.ny), range(first.nu)):
        if first.ny * first.nu > 1:
            yield f"{(first.input_names or ())[j]} → {(first.output_names or ())[i]}"
        # Relative to 0 Hz the bandwidth is where a curve crosses -3 dB.
        yield plots.bode(curves, output=i, input=j, relative_to_dc=True, size=(width, 1.1 * width))
    yield from _left_out(models, alike, "its channels are others")


def _roots(models: Sequence[StyledModel], beside: Sequence[StyledModel], width: float) -> Iterator["str | Figure"]:
    roots = []
    for drawn in (*models, *beside):
        roots += [replace(of_model, style=drawn.style) for of_model in roots_of({drawn.label: drawn.model.item})]
    yield plots.pzmap(roots, size=(width, 1.1 * width))
    yield "The same near z = 1, where the slow poles are:"
    near = plots.pzmap(roots, size=(width, 1.1 * width))
    near.axes[0].set(xlim=(0.6, 1.1), ylim=(-0.25, 0.25))
    yield near


def _residuals(models: Sequence[StyledModel], width: float) -> Iterator["str | Figure"]:
    for drawn in models:
        test = drawn.result.test
        if test is None:
            yield f"{drawn.label}: not tested, {drawn.result.untested}"
            continue
        yield drawn.label
        outputs, inputs = test.independence_bound.shape
        for i in range(outputs):
            size = (width, 0.33 * width * (1 + inputs))
            yield plots.correlations(test, drawn.style, output=i, size=size)


def _outputs(models: Sequence[StyledModel], beside: Sequence[StyledModel], width: float) -> Iterator["str | Figure"]:
    """Titles and figures of measured and simulated outputs, a piece from the middle of the longest record."""
    checked = models[0].result.checked
    longest = max(range(len(checked)), key=lambda k: len(checked[k]))
    record = records_about_means(models[0].result)[longest]
    alike = [drawn for drawn in models if _same_samples(checked, drawn.result.checked)]
    traces = []
    for drawn in (*alike, *beside):
        label = f"{drawn.label}, {_percents(drawn.model)} %"
        traces.append(_simulated_trace(drawn.model, longest, drawn.style, label))
    scale, unit = (1000.0, "mrad") if joints_of(record) else (1.0, None)
    start = max(0.5 * (len(record) * record.dt - PIECE), 0.0)
    for i in range(record.ny):
        figure = plots.output_comparison(
            record, traces, output=i, start=start, length=PIECE, scale=scale, unit=unit, size=(width, width)
        )
        shown_unit = f" / {unit}" if unit else ""
        figure.axes[0].set_ylabel(f"output about its mean{shown_unit}")
        yield f"{(record.output_names or ())[i]}, simulated from the input alone"
        yield figure
    yield from _left_out(models, alike, "another record judges it")


def _channels(drawn: StyledModel) -> tuple[object, ...]:
    record = drawn.result.fitted.parts[0]
    return record.input_names, record.output_names, record.dt


def _same_samples(records: Sequence[IOData], others: Sequence[IOData]) -> bool:
    """Whether records are the same samples, about any operating point."""
    if len(records) != len(others):
        return False
    for part, other in zip(records, others, strict=True):
        outputs, other_outputs = part.retrend().y, other.retrend().y
        # A window is not judged: a part held out stands behind one.
        if outputs.shape != other_outputs.shape or part.window != other.window:
            return False
        # Subtracting an operating point and adding it again costs the last digits.
        if not np.allclose(outputs, other_outputs, rtol=0.0, atol=1e-9, equal_nan=True):
            return False
    return True


def _left_out(models: Sequence[StyledModel], drawn: Sequence[StyledModel], why: str) -> Iterator[str]:
    for styled in models:
        if styled not in drawn:
            yield f"{styled.label} is not drawn: {why}"
