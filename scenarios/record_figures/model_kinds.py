"""Figures of the models of a record: Bode plots, Markov parameters, errors, Hankel values, roots, residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import sysid
from scenarios.experiments.film_plot import MEASURED
from scenarios.record_figures.drawing import SECONDS, Drawing, no_drawing, views_with_reasons
from scenarios.record_figures.figure_models import FigureModel, ModelOnRecord
from scenarios.record_figures.frequency_panels import DEGREES, HZ, gain_series, phase_series, root_panel
from scenarios.record_figures.lag_panels import (
    AFTER,
    LAG,
    autocorrelation_panel,
    cross_correlation_panel,
    hankel_panel,
    observer_error_panel,
    observer_markov_series,
)
from scenarios.record_figures.measured_record import Channels, MeasuredRecord
from scenarios.record_figures.observer_errors import observer_errors
from scenarios.record_figures.record_kinds import RATIO, known_response, piece_of
from scenarios.report.chart import Panel, Series, record_series
from scenarios.report.figure_style import points
from sysid import Estimate, FrequencyResponse, IOData, SysidError
from sysid.plots import PALETTE, Style
from sysid.records.excited_band import excited_band

FREQUENCIES = 200
"""Frequencies of the response of a model."""

DENSE = 4000
"""Frequencies, evenly spaced, from which phases are unwrapped."""

SHOWN = 50
"""System Markov parameters that are drawn, at most."""

LEVEL, LAGS = 0.99, 25
"""Level of the tests of residuals [Morris1996, ch. IV], and their largest lag, samples."""

SMALLEST_P = 1e-10
"""p-value below which its digits mean nothing."""

NO_OKID = "no model by okid among --models: only OKID has an observer's Markov parameters"

WORST = -1000.0
"""Fit in simulation, percent, below which a simulation would set the scale of its figure."""


@dataclass(frozen=True, eq=False)
class JudgedRecord:
    """A record with the models on it.

    Attributes:
        measured: The record.
        models: The models, judged on it.
    """

    measured: MeasuredRecord
    models: tuple[ModelOnRecord, ...]


Judged = Mapping[str, JudgedRecord]


def _labelled(models: Sequence[ModelOnRecord]) -> dict[str, ModelOnRecord]:
    return {model.drawn.label: model for model in models}


def _observers(judged: Judged) -> dict[str, FigureModel]:
    """Models by OKID, by their names."""
    first = next(iter(judged.values()))
    return {model.drawn.label: model.drawn for model in first.models if model.drawn.is_observer}


def bode(judged: Judged, channels: Channels) -> Drawing:
    """Gain and phase of all models on one figure [Morris1996, fig. 49]."""
    first = next(iter(judged.values()))
    record = first.measured.longest
    nyquist = 0.5 / record.dt
    limits = (max(nyquist / RATIO, 1.0 / (len(record) * record.dt)), nyquist)
    # Once for all paths: the bands of a model of many take a while.
    frequencies = np.geomspace(*limits, FREQUENCIES)
    responses = [_response(model, frequencies) for model in first.models]

    def draw(path: tuple[int, int]) -> tuple[Panel, ...]:
        return _bode_panels(first, responses, channels, *path)

    return views_with_reasons(draw, {"Path": channels.paths}, height=230)


def _bode_panels(
    judged: JudgedRecord, responses: Sequence[FrequencyResponse], channels: Channels, output: int, input: int
) -> tuple[Panel, ...]:
    curves: list[tuple[str, FrequencyResponse, Style]] = []
    phases: list[Series] = []
    references = []
    for model, response in zip(judged.models, responses, strict=True):
        if not np.abs(response.response[:, output, input]).any():
            # a block-diagonal model has no path between its blocks
            continue
        curves.append((model.drawn.label, response, model.drawn.style))
        # Each model on its own turn: zeros of one move its phase by half a turn where another has none.
        references.append(_unwrapped_phase(model, output, input))
        phases.append(phase_series(*curves[-1], references[-1], output, input))
    if not curves:
        raise SysidError("no model has this path")
    # Limits before the spectral estimate joins: its errors would set the scale.
    gain_limits = _gain_limits([response for _, response, _ in curves], output, input)
    estimate = known_response(judged.measured, output, input)
    if estimate is not None:
        curves.insert(0, ("spectral estimate, where known", estimate, points("spa", ".")))
        # An estimate at some frequencies alone does not tell how many turns its phase has made.
        phases.insert(0, phase_series(*curves[0], references[0], output, input))
    frequencies = responses[0].frequencies
    limits = (float(frequencies[0]), float(frequencies[-1]))
    low, high = _excited(judged.measured, input)
    marks = [("x", hz, name) for hz, name in ((low, "lowest excited"), (high, "highest excited")) if limits[0] < hz]
    gains = [gain_series(*curve, output, input) for curve in curves]
    unnamed = tuple((axis, hz, "") for axis, hz, _ in marks)
    return (
        Panel(HZ, channels.gain_axis(output, input), gains, "", "xy", limits, gain_limits, tuple(marks)),
        Panel(HZ, DEGREES, phases, "", "x", limits, None, unnamed),
    )


def _response(model: ModelOnRecord, frequencies: NDArray[np.float64]) -> FrequencyResponse:
    """Response of a model, with its covariance where it was estimated from this record's channels."""
    item = model.drawn.item
    # A model file may have its channels in another sequence, in which its covariance stays.
    if isinstance(item, Estimate) and model.drawn.kind != "file":
        return item.frequency_response(frequencies)
    return FrequencyResponse(frequencies, model.model.frequency_response(frequencies), model.model.dt, "model")


def _unwrapped_phase(model: ModelOnRecord, output: int, input: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies, Hz, and the phase of a path of a model there, rad, without jumps."""
    # Evenly spaced: delays turn the phase at a constant rate, which logarithmic steps would alias near Nyquist.
    dense = np.linspace(0.0, 0.5 / model.model.dt, DENSE + 1)[1:]
    return dense, np.unwrap(np.angle(model.model.frequency_response(dense)[:, output, input]))


def _excited(measured: MeasuredRecord, input: int) -> tuple[float, float]:
    """Lowest and highest frequency that an input excites in any stretch, Hz."""
    bands = [excited_band(part, input=input) for part in measured.parts]
    return min(low for low, _ in bands), max(high for _, high in bands)


def _gain_limits(responses: Sequence[FrequencyResponse], output: int, input: int) -> tuple[float, float]:
    """Limits of a gain's axis: those of the gains, of which deep zeros may leave the panel."""
    gains = np.concatenate([response.magnitude[:, output, input] for response in responses])
    gains = gains[np.isfinite(gains) & (gains > 0.0)]
    return float(max(gains.min(), 1e-4 * gains.max())) / 1.5, float(gains.max()) * 2.0


def markov(judged: Judged, channels: Channels) -> Drawing:
    """Markov parameters of observers and of the system [Morris1996, fig. 50]."""
    observers = _observers(judged)
    if not observers:
        return no_drawing(NO_OKID)
    first = next(iter(judged.values()))

    def draw(observer: FigureModel, path: tuple[int, int]) -> tuple[Panel, ...]:
        return _markov_panels(observer, first.models, channels, *path)

    return views_with_reasons(draw, {"Observer": observers, "Path": channels.paths}, height=210)


def _diagnostics(observer: FigureModel) -> Mapping[str, object]:
    if not isinstance(observer.item, Estimate):
        raise SysidError(NO_OKID)
    return observer.item.diagnostics


def _markov_panels(
    observer: FigureModel, models: Sequence[ModelOnRecord], channels: Channels, output: int, input: int
) -> tuple[Panel, ...]:
    diagnostics = _diagnostics(observer)
    system = np.asarray(diagnostics["system_markov"])[:SHOWN, output, input]
    samples = np.arange(len(system))
    pulses = []
    for model in models:
        response = model.model.markov(len(system))[:, output, input]
        # What an unstable model answers grows beyond all others; a block-diagonal one has no path between its blocks.
        if response.any() and np.abs(response).max() < 1e3 * np.abs(system).max():
            pulses.append(Series(model.drawn.label, samples, response, model.drawn.style))
    pulses.append(Series("from the observer, by recursion", samples, system, points("okid", "D")))
    axis = channels.pulse_axis(output, input)
    of_observer = observer_markov_series(diagnostics, output, input)
    return (
        Panel(LAG, "coefficient", of_observer, "Markov parameters of the observer"),
        Panel(AFTER, axis, pulses, "Markov parameters of the system"),
    )


def errors(judged: Judged, channels: Channels) -> Drawing:
    """Prediction errors of an observer over time, and errors of observers over their number p [Morris1996, fig. 51]."""
    observers = _observers(judged)
    if not observers:
        return no_drawing(NO_OKID)

    def draw(observer: FigureModel, output: int) -> tuple[Panel, ...]:
        return _error_panels(observer, output)

    outputs = {name: i for i, name in enumerate(channels.outputs)}
    return views_with_reasons(draw, {"Observer": observers, "Output": outputs}, height=200)


def _error_panels(observer: FigureModel, output: int) -> tuple[Panel, ...]:
    diagnostics = _diagnostics(observer)
    # About the operating point of the estimate, which the regression of the observer had.
    longest = max(observer.parts, key=len)
    spread = float(np.nanstd(np.concatenate([part.y[:, output] for part in observer.parts])))
    normalised = 100.0 * observer_prediction_errors(longest, diagnostics)[:, output] / spread
    p = len(np.asarray(diagnostics["observer_markov_u"]))
    look = Style(PALETTE["okid"].colour, "-", 0.8)
    start = longest.start + p * longest.dt
    over_time = record_series("over time", normalised, longest.dt, look, start=start)
    title = f"prediction error with p = {p}, standard deviation {np.nanstd(normalised):.3g} %"
    rows = observer_errors(observer.parts, output=output)
    if not rows:
        raise SysidError("the record is too short for errors over the number of observer Markov parameters")
    marks = (("x", float(p), f"p = {p}"),)
    return (
        Panel(SECONDS, "% of the output", [over_time], title),
        observer_error_panel(rows, marks),
    )


def observer_prediction_errors(record: IOData, diagnostics: Mapping[str, object]) -> NDArray[np.float64]:
    """Errors of y(t) - D u(t) - sum_i Ybar_i [u(t-i); y(t-i)] of an observer from its first whole past on (N - p, ny).

    Args:
        record: The record about the operating point of the estimate.
        diagnostics: Those of an estimate by `okid`.
    """
    from_u = np.asarray(diagnostics["observer_markov_u"])
    from_y = np.asarray(diagnostics["observer_markov_y"])
    direct = np.asarray(diagnostics["system_markov"])[0]
    p, samples = len(from_u), len(record)
    # The first p samples have no whole past, and are left out as in the regression.
    predicted = record.u[p:] @ direct.T
    for lag in range(1, p + 1):
        past = slice(p - lag, samples - lag)
        predicted = predicted + record.u[past] @ from_u[lag - 1].T + record.y[past] @ from_y[lag - 1].T
    return np.asarray(record.y[p:] - predicted)


def hankel(judged: Judged, channels: Channels) -> Drawing:
    """Hankel singular values, and what the first of them describe [Morris1996, fig. 52]."""
    observers = _observers(judged)
    if not observers:
        return no_drawing(NO_OKID)
    return views_with_reasons(_hankel_panels, {"Observer": observers}, height=200)


def _hankel_panels(observer: FigureModel) -> tuple[Panel, ...]:
    diagnostics = _diagnostics(observer)
    values = np.asarray(diagnostics["hankel_singular_values"], dtype=float)
    order = observer.item.orders["order"] if isinstance(observer.item, Estimate) else 0
    p, outputs = np.asarray(diagnostics["observer_markov_y"]).shape[:2]
    # Beyond as many as its recursion has states they are rounding.
    count = min(len(values), p * outputs)
    numbers = np.arange(1, count + 1)
    shares = []
    for label, power, look in (
        ("of the squares", 2, PALETTE["okid"]),
        ("of the values", 1, PALETTE["oe"]),
    ):
        # Of all values, as SOCIT counts them, although only the first are drawn.
        total = np.cumsum(values**power)
        shares.append(Series(label, numbers, 100.0 * total[:count] / total[-1], look))
    marks = (("x", float(order), f"order {order}"),)
    title, unnamed = "part of their sum in the first ones", (("x", float(order), ""),)
    return (
        hankel_panel(values, count, marks),
        Panel("number", "% of the sum", shares, title, marks=unnamed),
    )


def roots(judged: Judged, channels: Channels) -> Drawing:
    """Poles and transmission zeros of the models: all on one map, and one map each [Morris1996, fig. 64 and 65]."""
    models = next(iter(judged.values())).models
    # From the inputs alone: poles of the noise model are none of the plant.
    systems = [(model.drawn.label, model.model.input_path(), model.drawn.style) for model in models]
    maps = {label: [(label, system, style)] for label, system, style in systems}
    if len(systems) > 1:
        maps = {"all models": systems, **maps}
    return views_with_reasons(lambda drawn: (root_panel(drawn),), {"Models": maps}, height=380)


def outputs(judged: Judged, channels: Channels) -> Drawing:
    """Measured and simulated outputs, and what the simulations miss [Morris1996, fig. 67 to 69 and 73 to 75]."""

    def draw(of_record: JudgedRecord, output: int, is_whole: bool) -> tuple[Panel, ...]:
        return _output_panels(of_record, channels, output, is_whole=is_whole)

    names = {name: i for i, name in enumerate(channels.outputs)}
    choices = {"Record": judged, "Output": names, "Show": {"a piece": False, "all": True}}
    return views_with_reasons(draw, choices, height=210)


def _output_panels(judged: JudgedRecord, channels: Channels, output: int, *, is_whole: bool) -> tuple[Panel, ...]:
    record, place = judged.measured.longest, judged.measured.place
    part = slice(record.window, len(record)) if is_whole else piece_of(record)
    scale = channels.output_scales[output]
    start = record.start + part.start * record.dt
    measured = record.y[:, output]
    curves = [record_series("measured", scale * measured[part], record.dt, MEASURED, start=start)]
    missed = []
    for model in judged.models:
        fit = model.judged.fit
        simulated = (fit.by_experiment[place] if fit.by_experiment else fit).simulated
        simulated = simulated[:, output] + model.judged.trends[place][:, output]
        # What an unstable model simulates grows beyond all numbers.
        if not np.isfinite(simulated).all() or not fit.simulation[output] > WORST:
            continue
        label = f"{model.drawn.label}: {fit.simulation[output]:.1f} %"
        # Dashes of long curves run together.
        look = replace(model.drawn.style, width=1.0, line="-") if is_whole else model.drawn.style
        curves.append(record_series(label, scale * simulated[part], record.dt, look, start=start))
        errors = scale * (measured - simulated)[part]
        missed.append(record_series(label, errors, record.dt, look, start=start))
    if not missed:
        raise SysidError("the simulation of every model grows without bound")
    name = channels.output_axis(output, "angle" if channels.joints else "")
    axis = channels.output_axis(output, "measured − model")
    return Panel(SECONDS, name, curves), Panel(SECONDS, axis, missed)


def residuals(judged: Judged, channels: Channels) -> Drawing:
    """One-step residuals of every output over time [Morris1996, fig. 70 and 76]."""

    def draw(of_record: JudgedRecord, label: str) -> tuple[Panel, ...]:
        return _residual_panels(of_record, _labelled(of_record.models)[label], channels)

    choices = {"Record": judged, "Model": _model_options(judged)}
    return views_with_reasons(draw, choices, height=150)


def _model_options(judged: Judged) -> dict[str, str]:
    labels = [model.drawn.label for model in next(iter(judged.values())).models]
    return dict(zip(labels, labels, strict=True))


def _residual_panels(judged: JudgedRecord, model: ModelOnRecord, channels: Channels) -> tuple[Panel, ...]:
    # About the operating point of the model on this record, not that of its estimation.
    record = model.checked[judged.measured.place]
    errors = record.y - sysid.predict(model.drawn.item, record)
    if not np.isfinite(errors[record.known]).all():
        raise SysidError("the one-step prediction grows without bound")
    look = Style(model.drawn.style.colour, "-", 0.8)
    panels = []
    for i, name in enumerate(channels.outputs):
        values = channels.output_scales[i] * errors[record.window :, i]
        unit = f" {channels.output_units[i]}" if channels.output_units[i] else ""
        title = f"{name}: standard deviation {np.nanstd(values):.3g}{unit}"
        start = record.start + record.window * record.dt
        curve = record_series(model.drawn.label, values, record.dt, look, start=start)
        panels.append(Panel(SECONDS, channels.output_axis(i, "residual"), [curve], title))
    return tuple(panels)


def tests(judged: Judged, channels: Channels) -> Drawing:
    """Whiteness and independence of the residuals of every output, and of every input [Morris1996, fig. 71 and 72]."""
    by_model = {name: {} for name in judged}  # type: dict[str, dict[str, sysid.ResidualTest]]

    def draw(of_record: JudgedRecord, label: str, output: int) -> tuple[Panel, ...]:
        done = by_model[of_record.measured.name]
        model = _labelled(of_record.models)[label]
        # A test holds all outputs; each is a view.
        if label not in done:
            done[label] = model.residual_test(LAGS, LEVEL)
        return _test_panels(done[label], model, channels, output)

    names = {name: i for i, name in enumerate(channels.outputs)}
    choices = {"Record": judged, "Model": _model_options(judged), "Output": names}
    return views_with_reasons(draw, choices, columns=2, height=190)


def _test_panels(test: sysid.ResidualTest, model: ModelOnRecord, channels: Channels, output: int) -> tuple[Panel, ...]:
    drawn = [(model.drawn.label, test, replace(model.drawn.style, line="-"))]
    title = f"{channels.outputs[output]}, {_p(test.whiteness_p[output])}"
    panels = [autocorrelation_panel(drawn, output, title)]
    for j, name in enumerate(channels.inputs):
        # Another label than that of the first panel: axes of one label are linked on the page.
        panel = cross_correlation_panel(drawn, output, j, f"with input {name}, {_p(test.independence_p[output, j])}")
        panels.append(replace(panel, x="lag to the input / samples", y="correlation"))
    return tuple(panels)


def _p(value: float) -> str:
    """A p-value; one that is too small for its digits to mean anything as a bound."""
    return f"p < {SMALLEST_P:g}" if value < SMALLEST_P else f"p = {value:.2g}"
