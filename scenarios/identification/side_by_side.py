"""Identified models side by side, beside the truth and the models that the thesis prints: bandwidths and figures."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import sysid
from hmtb_twin import TwinError
from scenarios.files.data_file import joints_of
from scenarios.files.errors import ScenarioError
from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.identification import Identification, long_lag
from scenarios.identification.model_comparison import JudgedModel, ModelName, compare_models
from sysid import Estimate, IOData, StateSpace, plots
from sysid.plots import PALETTE, Style, Trace
from sysid.plots.traces import curves_of, roots_of
from sysid.polynomial.fit_with_offset import subtract_means

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = ("Bode", "Poles and zeros", "Residuals", "Fit")
"""Names of the figures."""

PIECE = 8.0
"""Length of the outputs that are drawn, from the middle of the record, s."""

COHERENT = 0.5
"""Least coherence of the nonparametric response that is drawn: below, it shows the disturbance."""

PATTERNS = ("-.", ":", "--")
"""Lines of printed models, which share a colour."""


@dataclass(frozen=True, eq=False)
class DrawnModel:
    """An identified model with its look.

    Attributes:
        name: Its name in legends.
        result: The model and how it was judged.
        style: Its colour and line.
    """

    name: str
    result: Identification
    style: Style


def known_models(found: FileIdentification, path: Path) -> tuple[tuple[JudgedModel, ...], tuple[str, ...]]:
    """Judge the truth and the printed models of a joint on the record that judges a model.

    Args:
        found: The model.
        path: Its file: the truth is that of the log's arm.

    Returns:
        The models, and why there is no truth or no printed model; neither for records that are of no single joint.
    """
    parts = [part.retrend() for part in found.result.checked]
    judged, remarks = list[JudgedModel](), list[str]()
    for kind, words in (("truth", "truth"), ("published", "printed model")) if len(joints_of(parts[0])) == 1 else ():
        try:
            keep_mean = found.result.fitted.estimate.operating_point is None
            judged += compare_models([ModelName(kind, kind)], parts, path, keep_mean=keep_mean)[1]
        except (ScenarioError, TwinError) as error:
            remarks.append(f"no {words}: {error}")
    return tuple(judged), tuple(remarks)


def bandwidth_row(found: FileIdentification | JudgedModel) -> tuple[str, str, str]:
    """Fit in simulation, bandwidth and 95 % interval of a single path, as `hmtb compare` prints them."""
    if isinstance(found, JudgedModel):
        fit, paths = found.fit, np.dstack((found.bandwidth_hz, found.ci95))
    else:
        claims = found.result.fitted.claims
        fit, paths = found.result.fit, np.array([[(one.hz, one.low, one.high) for one in row] for row in claims])
    fits = ", ".join(f"{value:.2f}" for value in fit.simulation)
    if paths.size > 3:
        return fits, "several", ""
    hz, low, high = paths[0, 0]
    return fits, f"{hz:.3f}" if np.isfinite(hz) else "—", f"{low:.3f} to {high:.3f}" if np.isfinite(low) else ""


def holds_truth(found: FileIdentification, known: Sequence[JudgedModel]) -> str:
    """Whether the interval of the bandwidth holds that of the truth: yes or no; nothing where one is not known."""
    claim = found.result.fitted.claims[0][0]
    (truth,) = [one.bandwidth_hz[0, 0] for one in known if one.kind == "truth"] or [np.nan]
    return ("yes" if claim.low <= truth <= claim.high else "no") if np.isfinite([truth, claim.low]).all() else ""


def side_by_side(
    models: Sequence[DrawnModel], beside: Sequence[JudgedModel], width: float
) -> dict[str, list["str | Figure"]]:
    """Draw models in the same figures.

    Args:
        models: One or more.
        beside: Truth and printed models, judged on the record of the first model.
        width: Width of a figure, inch.

    Returns:
        Figures by name, and lines about models that are left out: their channels or records differ from the first's.
    """
    printed = (replace(PALETTE["published"], line=pattern) for pattern in PATTERNS * len(beside))
    styled = [(one, PALETTE["truth"] if one.kind == "truth" else next(printed)) for one in beside]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        drawings = (
            _bode(models, styled, width),
            _roots(models, styled, width),
            _residuals(models, width),
            _outputs(models, styled, width),
        )
        return dict(zip(FIGURES, map(list, drawings), strict=True))


Beside = Sequence[tuple[JudgedModel, Style]]
"""Models that are known beforehand, with their styles."""


def _items(models: Sequence[DrawnModel], beside: Beside) -> list[tuple[str, Estimate | StateSpace, Style]]:
    estimates: list[tuple[str, Estimate | StateSpace, Style]]
    estimates = [(one.name, one.result.fitted.estimate, one.style) for one in models]
    return estimates + [(one.label, one.model.input_path(), style) for one, style in beside]


def _bode(models: Sequence[DrawnModel], beside: Beside, width: float) -> Iterator["str | Figure"]:
    parts = models[0].result.fitted.parts
    alike = [one for one in models if _channels(one) == _channels(models[0])]
    curves = []
    with suppress(sysid.SysidError):
        response = sysid.spa(parts, lag=long_lag(parts)).determined()
        if response.coherence is not None and response.coherence[0].size == 1:
            response = response.select(response.coherence[:, 0, 0] > COHERENT)
        curves += curves_of({"spectral analysis": response}, None)
    for label, item, style in _items(alike, beside):
        curves += [replace(curve, style=style) for curve in curves_of({label: item}, None)]
    for i, j in product(range(parts[0].ny), range(parts[0].nu)):
        if parts[0].ny * parts[0].nu > 1:
            yield f"{(parts[0].input_names or ())[j]} → {(parts[0].output_names or ())[i]}"
        yield plots.bode(curves, output=i, input=j, relative_to_dc=True, size=(width, 1.1 * width))
    yield from _left_out(models, alike, "its channels are others")


def _roots(models: Sequence[DrawnModel], beside: Beside, width: float) -> Iterator["str | Figure"]:
    drawn = [
        replace(one, style=style) for label, item, style in _items(models, beside) for one in roots_of({label: item})
    ]
    yield plots.pzmap(drawn, size=(width, 1.1 * width))
    yield "The same near z = 1, where the slow poles are:"
    near = plots.pzmap(drawn, size=(width, 1.1 * width))
    near.axes[0].set(xlim=(0.6, 1.1), ylim=(-0.25, 0.25))
    yield near


def _residuals(models: Sequence[DrawnModel], width: float) -> Iterator["str | Figure"]:
    for one in models:
        if one.result.test is None:
            yield f"{one.name}: not tested, {one.result.untested}"
            continue
        yield one.name
        outputs, inputs = one.result.test.independence_bound.shape
        for i in range(outputs):
            size = (width, 0.33 * width * (1 + inputs))
            yield plots.correlations(one.result.test, one.style, output=i, size=size)


def _outputs(models: Sequence[DrawnModel], beside: Beside, width: float) -> Iterator["str | Figure"]:
    first = models[0].result.checked
    k = max(range(len(first)), key=lambda part: len(first[part]))
    about = first if first[k].output_offset is None else subtract_means([part.retrend() for part in first])
    record, alike = about[k], [one for one in models if _same(first, one.result.checked)]
    traces = []
    for name, fit, level, style in (
        *((one.name, one.result.fit, _offset(one.result.checked[k]) - _offset(record), one.style) for one in alike),
        *((one.label, one.fit, one.level, style) for one, style in beside),
    ):
        own = fit.by_experiment[k] if fit.by_experiment else fit
        percents = ", ".join(f"{value:.1f}" for value in fit.simulation)
        traces.append(Trace(f"{name}, {percents} %", own.simulated + level, style))
    scale, unit = (1000.0, "mrad") if joints_of(record) else (1.0, None)
    start = max(0.5 * (len(record) * record.dt - PIECE), 0.0)
    for i in range(record.ny):
        figure = plots.output_comparison(
            record, traces, output=i, start=start, length=PIECE, scale=scale, unit=unit, size=(width, width)
        )
        figure.axes[0].set_ylabel(f"output about its mean{f' / {unit}' if unit else ''}")
        yield f"{(record.output_names or ())[i]}, simulated from the input alone"
        yield figure
    yield from _left_out(models, alike, "another record judges it")


def _offset(record: IOData) -> "np.ndarray | float":
    return 0.0 if record.output_offset is None else record.output_offset


def _channels(one: DrawnModel) -> tuple[object, ...]:
    record = one.result.fitted.parts[0]
    return record.input_names, record.output_names, record.dt


def _same(parts: Sequence[IOData], others: Sequence[IOData]) -> bool:
    """Whether records are the same samples, about any operating point."""
    pairs = [(one.retrend().y, other.retrend().y) for one, other in zip(parts, others, strict=False)]
    return len(parts) == len(others) and all(
        one.shape == other.shape and np.allclose(one, other, rtol=0.0, atol=1e-9, equal_nan=True)
        for one, other in pairs
    )


def _left_out(models: Sequence[DrawnModel], drawn: Sequence[DrawnModel], why: str) -> Iterator[str]:
    yield from (f"{one.name} is not drawn: {why}" for one in models if one not in drawn)
