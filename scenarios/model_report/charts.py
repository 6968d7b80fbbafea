"""Charts of one identified model: outputs, step response, frequency response, correlations of the residuals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

import sysid
from scenarios.identification.identification import Identification, spectral_analysis
from scenarios.report.chart import Chart, Panel, Series, record_series
from scenarios.report.figure_style import points
from sysid import Estimate, FrequencyResponse
from sysid.models.confidence_bands import band
from sysid.plots import BOUND, PALETTE, Style

PIECE = 500
"""Samples of the piece of a record that is drawn sample by sample."""

FREQUENCIES = 200
"""Frequencies of a response."""

DECADES = 3.0
"""Decades below the Nyquist frequency that a response shows, where the record is that long."""

SHORTEST_STEP, LONGEST_STEP = 20, 1000
"""Samples of a step response."""

SETTLED = 0.01
"""What is left of the slowest mode where a step response ends."""

MEASURED, SIMULATED = "measured", "simulated from the input alone"


Views = dict[tuple[str, ...], tuple[Panel, ...]]
"""Panels by what was chosen."""


@dataclass(frozen=True)
class LabelledChart:
    """A chart and what it shows.

    Attributes:
        heading: Heading of its section.
        caption: What it shows.
        chart: The chart.
    """

    heading: str
    caption: str
    chart: Chart


def model_charts(result: Identification) -> dict[str, LabelledChart]:
    """Return the charts of a model by name: outputs, step, bode, and residuals where they were tested."""
    estimate = result.fitted.estimate
    # solid: dashes of long curves run together on a screen
    style = replace(PALETTE.get(estimate.method, PALETTE["oe"]), line="-")
    charts = {"outputs": _outputs(result, style)}
    step = Chart(_by_path(estimate, lambda i, j: (_step_panel(result, style, i, j),)), ("Path",))
    caption = "Response of the output to a step of one unit of the input, with the 95 % interval of the parameters."
    charts["step"] = LabelledChart("Step response", caption, step)
    nonparametric = _nonparametric(result)
    bode = _by_path(estimate, lambda i, j: _bode_panels(result, style, nonparametric, i, j))
    caption = (
        "Gain and phase with the 95 % intervals of the parameters, beside spectral analysis where a single input has "
        "power. Dotted: the bandwidth."
    )
    if result.error is not None and result.error.is_wider.any():
        caption += " Dashed: 95 % interval of the gain with nonlinear distortion and too low an order."
    charts["bode"] = LabelledChart("Frequency response", caption, Chart(bode, ("Path",), columns=2))
    if result.test is not None:
        where, model = _judged_in_words(result)
        residuals = _by_path(estimate, lambda i, j: _residual_panels(result, style, i, j))
        level = f"{100.0 * result.test.level:g} %"
        caption = (
            f"Correlation, with themselves and with the input, of the residuals that {model} leaves one step ahead on "
            f"the record {where}; dotted lines: {level} bounds of residuals without any. To the right of zero an input "
            "acts on later outputs."
        )
        charts["residuals"] = LabelledChart("Residuals", caption, Chart(residuals, ("Path",), columns=2))
    return charts


def _judged_in_words(result: Identification) -> tuple[str, str]:
    """Which record judged which model, in words."""
    if result.is_estimated_again:
        return "held out", "a model of the chosen orders, estimated without it,"
    if not result.on_own_records:
        return "that it was not estimated from", "the model"
    return "that it was estimated from", "the model"


def _by_path(
    estimate: Estimate, draw: Callable[[int, int], tuple[Panel, ...]]
) -> dict[tuple[str, ...], tuple[Panel, ...]]:
    """Views of all paths, by their names."""
    views: Views = {}
    for i, output in enumerate(estimate.data.output_names):
        for j, input in enumerate(estimate.data.input_names):
            views[(f"{input} → {output}",)] = draw(i, j)
    return views


def _outputs(result: Identification, style: Style) -> LabelledChart:
    """Measured and simulated outputs of the longest record that judges the model, and their difference."""
    checked = result.checked
    longest = max(range(len(checked)), key=lambda k: len(checked[k]))
    record = checked[longest]
    fit = result.fit.by_experiment[longest] if result.fit.by_experiment else result.fit
    # the samples of the window only give the initial state
    first = record.window
    middle = (first + len(record)) // 2
    piece = slice(max(middle - PIECE // 2, first), middle + PIECE // 2)
    parts = {"a piece": piece, "all": slice(first, len(record))}
    if len(record) - first <= PIECE:
        parts = {"all": slice(first, len(record))}
    views: Views = {}
    for name, part in parts.items():
        for i, output in enumerate(record.output_names or ()):
            # in the values of the record, but for a straight line of the model
            level = 0.0 if record.output_offset is None else record.output_offset[i]
            measured, simulated = record.y[part, i] + level, fit.simulated[part, i] + level
            views[name, output] = _output_panels(measured, simulated, record, i, part, style)
    where, model = _judged_in_words(result)
    caption = f"Output on the record {where}, and what {model} leaves of it."
    return LabelledChart("Measured and simulated output", caption, Chart(views, ("Show", "Output"), height=220))


def _output_panels(
    measured: np.ndarray, simulated: np.ndarray, record: sysid.IOData, i: int, part: slice, style: Style
) -> tuple[Panel, ...]:
    dt, start = record.dt, record.start + part.start * record.dt
    units = record.output_units or ()
    unit = f" / {units[i]}" if units and units[i] else ""
    series = [
        record_series(MEASURED, measured, dt, replace(PALETTE["measured"], width=1.6), start=start),
        record_series(SIMULATED, simulated, dt, style, start=start),
    ]
    error = record_series("measured - simulated", measured - simulated, dt, Style(BOUND.colour, "-", 1.0), start=start)
    return (
        Panel("time / s", f"{(record.output_names or ())[i]}{unit}", series),
        Panel("time / s", f"difference{unit}", [error]),
    )


def _step_panel(result: Identification, style: Style, i: int, j: int) -> Panel:
    """Step response of one path with its interval."""
    estimate = result.fitted.estimate
    samples = _settling(estimate)
    time = estimate.model.dt * np.arange(samples)
    values, low, high = estimate.step_response(samples)[:, i, j], None, None
    if np.isfinite(estimate.covariance).all():
        low, high = band(estimate, lambda model: model.step_response(samples)[:, i, j]).ci95
    return Panel("time / s", "output", [Series("step response", time, values, style, low, high)])


def _settling(estimate: Estimate) -> int:
    """Samples until the slowest mode has died out."""
    # all poles of a finite response are at zero
    if estimate.method == "impulseest":
        return len(estimate.parameters) // len(estimate.data.input_names) + 1
    slowest = float(np.abs(estimate.model.input_path().poles()).max(initial=0.0))
    if slowest >= 1.0:
        return LONGEST_STEP
    samples = np.log(SETTLED) / np.log(max(slowest, 1e-9))
    return int(np.clip(np.ceil(samples), SHORTEST_STEP, LONGEST_STEP))


def _nonparametric(result: Identification) -> FrequencyResponse | None:
    """Spectral analysis of the records of the fit; None of several inputs, of integrators, or of too short records."""
    parts = result.fitted.parts
    # the drift of an integrator leaks into every frequency
    if parts[0].nu > 1 or result.fitted.integrates.any():
        return None
    return spectral_analysis(parts)


def _bode_panels(
    result: Identification, style: Style, nonparametric: FrequencyResponse | None, i: int, j: int
) -> tuple[Panel, ...]:
    """Gain and phase of one path, with intervals."""
    fitted, dt = result.fitted, result.fitted.parts[0].dt
    longest = max(map(len, fitted.parts)) * dt
    nyquist = 0.5 / dt
    frequencies = np.geomspace(max(nyquist / 10.0**DECADES, 1.0 / longest), nyquist, FREQUENCIES)
    response = fitted.estimate.frequency_response(frequencies)
    gains, phases = [], []
    if nonparametric is not None:
        of_spectrum = _spectral_style(nonparametric)
        gains.append(_gain_series("spectral analysis", nonparametric, of_spectrum, i, j, with_interval=False))
        phases.append(_phase_series("spectral analysis", nonparametric, of_spectrum, i, j, with_interval=False))
    gains.append(_gain_series("model", response, style, i, j))
    gain_limits = _limits_of(gains)
    gains += _error_series(result, i, j)
    phases.append(_phase_series("model", response, style, i, j))
    hz = fitted.claims[i][j].hz
    marks = (("x", hz, f"{hz:.3g} Hz"),) if np.isfinite(hz) else ()
    limits = (float(frequencies[0]), float(frequencies[-1]))
    return (
        Panel("frequency / Hz", "gain / dB", gains, log="x", x_limits=limits, y_limits=gain_limits, marks=marks),
        Panel("frequency / Hz", "phase / °", phases, log="x", x_limits=limits, marks=marks),
    )


def _spectral_style(response: FrequencyResponse) -> Style:
    """A line, or points where most known values stand between unknown ones, as under an input of separate lines."""
    known = np.isfinite(response.response[:, 0, 0])
    beside = np.zeros_like(known)
    beside[1:] |= known[:-1]
    beside[:-1] |= known[1:]
    alone = known & ~beside
    return points("spa", "o") if alone.sum() > 0.5 * known.sum() else PALETTE["spa"]


def _limits_of(gains: Sequence[Series]) -> tuple[float, float]:
    """Range of an axis that shows gains in dB: intervals with distortion may leave it, which would flatten the rest."""
    values = np.concatenate([np.asarray(series.y) for series in gains])
    values = values[np.isfinite(values)]
    return float(values.min(initial=0.0)) - 10.0, float(values.max(initial=0.0)) + 10.0


def _gain_series(
    label: str, response: FrequencyResponse, style: Style, i: int, j: int, *, with_interval: bool = True
) -> Series:
    low = high = None
    with np.errstate(divide="ignore", invalid="ignore"):
        if with_interval and response.covariance is not None:
            low, high = (20.0 * np.log10(end[:, i, j]) for end in response.magnitude_ci95())
            # an interval that reaches down to zero ends at the edge of the panel
            floor = 20.0 * np.log10(response.magnitude[:, i, j]) - 20.0
            low = np.maximum(low, floor)
        gain = 20.0 * np.log10(response.magnitude[:, i, j])
    return Series(label, response.frequencies, gain, style, low, high)


def _error_series(result: Identification, i: int, j: int) -> list[Series]:
    """Ends of the interval with distortion and too low an order, from the lowest strong line on; none if no wider."""
    error = result.error
    if error is None or not error.is_wider[i]:
        return []
    rows = (error.frequencies > 0.0) & (error.frequencies >= error.strong_line)
    series = []
    for end in error.interval:
        with np.errstate(divide="ignore"):
            gain = 20.0 * np.log10(end[rows, i, j])
        series.append(Series("95 % with distortion and order", error.frequencies[rows], gain, BOUND))
    return series


def _phase_series(
    label: str, response: FrequencyResponse, style: Style, i: int, j: int, *, with_interval: bool = True
) -> Series:
    # unwrapped from its value at the lowest frequency
    known = np.isfinite(response.response[:, i, j])
    phase = np.full(len(known), np.nan)
    phase[known] = np.degrees(np.unwrap(np.angle(response.response[known, i, j])))
    low = high = None
    if with_interval and response.covariance is not None:
        ends = [np.degrees(end[:, i, j] - response.phase[:, i, j]) for end in response.phase_ci95()]
        low, high = phase + ends[0], phase + ends[1]
    return Series(label, response.frequencies, phase, style, low, high)


def _residual_panels(result: Identification, style: Style, i: int, j: int) -> tuple[Panel, ...]:
    """Autocorrelation of the residuals of an output, and their correlation with an input."""
    test = result.test
    if test is None:
        return ()
    lags, own = test.lags[1:], test.autocorrelation[1:, i, i]
    cross, bound = test.cross_correlation[:, i, j], float(test.independence_bound[i, j])
    white = float(test.whiteness_bound)
    # lag zero, where it is one by definition, would flatten all others
    of_residuals = Series("residuals", lags, own, style, kind="stem")
    with_input = Series("residuals", test.cross_lags, cross, style, kind="stem")
    bounds = (("y", white, ""), ("y", -white, ""))
    cross_bounds = (("y", bound, ""), ("y", -bound, ""))
    first = Panel("lag / samples", "correlation with themselves", [of_residuals], marks=bounds)
    # another label than that of the first panel: axes of one label are linked on the page
    label = "lag to input / samples"
    return first, Panel(label, "correlation with the input", [with_input], marks=cross_bounds)
