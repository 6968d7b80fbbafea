"""Figures of one record without a model: the record, transfer function, correlations, spectra."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import sysid
from scenarios.experiments.film_plot import COMMAND, MEASURED
from scenarios.record_figures.drawing import SECONDS, Drawing, views_with_reasons
from scenarios.record_figures.frequency_panels import (
    DEGREES,
    HZ,
    gain_series,
    phase_series,
    reliable_lines,
    spectra_panels,
)
from scenarios.record_figures.lag_panels import AFTER, correlation_panel
from scenarios.record_figures.measured_record import Channels, MeasuredRecord
from scenarios.record_figures.period_spectra import excited_lines
from scenarios.report.chart import Panel, Series, record_series
from scenarios.report.figure_style import points
from sysid import FrequencyResponse, IOData, SysidError, SysidWarning
from sysid.frequency import CovarianceFunction, ImpulseResponse
from sysid.plots import PALETTE, Style
from sysid.polynomial.correlation import prewhitened
from sysid.records.data import complete_parts

PIECE = 500
"""Samples of the piece of a record that is magnified."""

MOST_LAGS = 125
"""Largest lag of correlations, samples; of an input that repeats after up to four times as many, a quarter more."""

FEWEST_PER_LAG = 4
"""Samples for each lag of a correlation, at least."""

SHORTEST = 100
"""Samples of a stretch from which correlations are computed, at least."""

PULSE_LAGS = 40
"""Largest lag of a pulse response, samples."""

UNTOLD = 10.0
"""Deviation of a pulse response, relative to the ratio of output and input, beyond which it tells nothing."""

WHITENING = 10
"""Coefficients of the filter that makes an input white: the default of the toolbox that the thesis used."""

RATIO = 1e3
"""Highest over lowest frequency of a figure."""

Records = Mapping[str, MeasuredRecord]


def piece_of(record: IOData) -> slice:
    """The samples of a record that are magnified: from its middle."""
    middle = (record.window + len(record)) // 2
    return slice(max(middle - PIECE // 2, record.window), middle + PIECE // 2)


def record(records: Records, channels: Channels) -> Drawing:
    """Inputs and outputs: whole, and magnified."""

    def draw(measured: MeasuredRecord) -> tuple[Panel, ...]:
        longest = measured.longest.retrend()
        return _joint_panels(longest, channels) if channels.joints else _channel_panels(longest, channels)

    return views_with_reasons(draw, {"Record": records}, columns=2, height=190)


def _joint_panels(record: IOData, channels: Channels) -> tuple[Panel, ...]:
    """Commanded and measured angle of every joint, whole and magnified, from where the command begins."""
    panels = []
    for i, joint in enumerate(channels.outputs):
        scale = channels.output_scales[i]
        # From where the command begins: its distance to the measured angle stays visible.
        level = record.u[0, i]
        signals = [
            ("commanded", scale * (record.u[:, i] - level), COMMAND),
            ("measured", scale * (record.y[:, i] - level), MEASURED),
        ]
        panels += _whole_and_piece(
            record, signals, channels.output_axis(i, "angle less the first command"), joint, held="commanded"
        )
    return tuple(panels)


def _channel_panels(record: IOData, channels: Channels) -> tuple[Panel, ...]:
    """Every input and output of a record from elsewhere, whole and magnified."""
    panels = []
    for j, name in enumerate(channels.inputs):
        signals = [(f"input {name}", channels.input_scales[j] * record.u[:, j], COMMAND)]
        panels += _whole_and_piece(record, signals, channels.input_axis(j), "", held=f"input {name}")
    for i, name in enumerate(channels.outputs):
        signals = [(f"output {name}", channels.output_scales[i] * record.y[:, i], MEASURED)]
        panels += _whole_and_piece(record, signals, channels.output_axis(i), "", held="")
    return tuple(panels)


def _whole_and_piece(
    record: IOData, signals: Sequence[tuple[str, np.ndarray, Style]], axis: str, title: str, *, held: str
) -> list[Panel]:
    """Two panels of the same signals: over the whole record, and magnified."""
    piece = piece_of(record)
    entire, magnified = [], []
    for label, values, look in signals:
        entire.append(record_series(label, values, record.dt, look, start=record.start))
        start = record.start + piece.start * record.dt
        magnified.append(record_series(label, values[piece], record.dt, look, start=start, held=label == held))
    return [Panel(SECONDS, axis, entire, title), Panel("time, magnified / s", axis, magnified)]


def transfer(records: Records, channels: Channels) -> Drawing:
    """The ratio of cross and input spectrum, and where the input has power [Morris1996, fig. 22]."""

    def draw(measured: MeasuredRecord, path: tuple[int, int]) -> tuple[Panel, ...]:
        return _transfer_panels(measured, channels, *path)

    return views_with_reasons(draw, {"Record": records, "Path": channels.paths}, height=230)


def _transfer_panels(measured: MeasuredRecord, channels: Channels, output: int, input: int) -> tuple[Panel, ...]:
    response = measured.windowed
    gains = response.magnitude[:, output, input]
    # Inputs that move together have no spectral matrix that could be inverted.
    if not np.isfinite(gains).any():
        raise SysidError("no frequency at which the inputs have power of their own: they are constant or move together")
    excited = replace(response.select(excited_lines(response, input)), covariance=None)
    window = replace(response, covariance=None)
    curves = [
        ("Hamming window", window, Style(PALETTE["spa"].colour, "-", 0.8)),
        ("where the input has power", excited, points("spa", "v")),
    ]
    if measured.repeated is not None:
        curves.append(("from repetition", measured.repeated.reliable_response(), points("oe", "^")))
    # Gaps of the covariance do not matter here: the band of a windowed estimate would hide the estimate itself.
    # The phase of side lobes is random: it is drawn, and unwrapped, only where the response is known.
    known = np.isfinite(excited.response[:, output, input])
    frequencies = excited.frequencies[known]
    reference = (frequencies, np.unwrap(np.angle(excited.response[known, output, input])))
    phases = [phase_series(*curve, reference, output, input) for curve in curves[1:]] if known.any() else []
    limits = frequency_limits(response)
    drawn = [gain_series(*curve, output, input) for curve in curves]
    shown = np.concatenate([series.y for series in drawn[1:]])
    return (
        Panel(HZ, channels.gain_axis(output, input), drawn, "", "xy", limits, _gain_limits(shown, gains)),
        Panel(HZ, DEGREES, phases, "", "x", limits),
    )


def frequency_limits(response: FrequencyResponse) -> tuple[float, float]:
    """Limits of a logarithmic axis for a response, Hz."""
    lowest, highest = float(response.frequencies[0]), float(response.frequencies[-1])
    return max(lowest, highest / RATIO), highest


def _gain_limits(known: np.ndarray, gains: np.ndarray) -> tuple[float, float]:
    """Limits of a gain's axis: what is known with a decade to either side; side lobes may leave the panel."""
    values = known[np.isfinite(known) & (known > 0.0)]
    if not values.size:
        values = gains[np.isfinite(gains) & (gains > 0.0)]
    return float(values.min()) / 3.0, float(values.max()) * 5.0


def correlations(records: Records, channels: Channels) -> Drawing:
    """Correlations as recorded and with the input made white, and the pulse response [Morris1996, fig. 25]."""
    analyse = cache(_correlation_analysis)

    def draw(measured: MeasuredRecord, path: tuple[int, int]) -> tuple[Panel, ...]:
        return _correlation_panels(analyse(measured), channels, *path)

    return views_with_reasons(draw, {"Record": records, "Path": channels.paths}, columns=2, height=190)


@dataclass(frozen=True, eq=False)
class CorrelationAnalysis:
    """Correlations of all channels of a record.

    Attributes:
        recorded: Covariance functions as recorded.
        whitened: The same with all signals filtered so that an input is white, for each input.
        pulse: Response to a pulse in every input.
    """

    recorded: CovarianceFunction
    whitened: tuple[CovarianceFunction, ...]
    pulse: ImpulseResponse


def _correlation_analysis(measured: MeasuredRecord) -> CorrelationAnalysis:
    """Correlations of a record's stretches without lost samples.

    Raises:
        SysidError: They are too short.
    """
    parts = [part for part in complete_parts(measured.parts) if len(part) >= SHORTEST]
    if not parts:
        raise SysidError(f"no stretch without lost samples has {SHORTEST} samples")
    lags = _largest_lag(parts, measured.period)
    # Beyond one period the responses to this pulse and to the next cannot be told apart.
    of_one_period = measured.period - 1 if measured.period else lags
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        pulse = sysid.cra(parts, lags=min(PULSE_LAGS, lags, of_one_period), whitening=WHITENING)
    # An input of a narrow band leaves single lags open, whose values are then as large as their deviations.
    outputs, inputs = (np.vstack(signals).std(axis=0) for signals in zip(*((e.y, e.u) for e in parts), strict=True))
    is_open = pulse.deviation > UNTOLD * outputs[:, None] / inputs
    pulse = replace(pulse, deviation=np.where(is_open, np.inf, pulse.deviation))
    whitened = []
    for j in range(parts[0].nu):
        white = _whitened(parts, j)
        whitened.append(sysid.covf(white, lags=min(lags, *(len(part) - 1 for part in white))))
    return CorrelationAnalysis(sysid.covf(parts, lags=lags), tuple(whitened), pulse)


def _correlation_panels(
    analysis: CorrelationAnalysis, channels: Channels, output: int, input: int
) -> tuple[Panel, ...]:
    functions = (
        ("as recorded", analysis.recorded, "#8a8a8a"),
        ("input made white", analysis.whitened[input], "#0072b2"),
    )
    row_of_input = len(channels.outputs) + input
    pairs = (
        (output, output, f"output {channels.outputs[output]}"),
        (row_of_input, row_of_input, f"input {channels.inputs[input]}"),
        (output, row_of_input, "input to output"),
    )
    panels = [replace(correlation_panel(functions, row, column), title=title) for row, column, title in pairs]
    pulse = analysis.pulse
    bound = pulse.bound[:, output, input]
    # An infinite bound marks lags that the inputs do not determine.
    values = np.where(np.isfinite(bound), pulse.response[:, output, input], np.nan)
    estimate = Series("from correlations", pulse.lags, values, points("oe", "^"), values - bound, values + bound)
    title = "pulse response"
    if not np.isfinite(bound).any():
        title += ": not determined by this input"
    return *panels, Panel(AFTER, channels.pulse_axis(output, input), [estimate], title)


def _largest_lag(parts: Sequence[IOData], period: int) -> int:
    """Largest lag of the correlations of stretches: beyond one period of an input that repeats, if not too long."""
    # The peak after a whole period tells an input that repeats from white noise [Morris1996, sec. III.2B].
    wanted = max(MOST_LAGS, period + period // 4) if period <= 4 * MOST_LAGS else MOST_LAGS
    return min(wanted, min(map(len, parts)) // FEWEST_PER_LAG)


def _whitened(parts: Sequence[IOData], input: int) -> list[IOData]:
    """The records with all signals filtered so that an input is white, without the start-up of the filter."""
    filtered = []
    for part, (u, y) in zip(parts, prewhitened(parts, input, WHITENING), strict=True):
        filtered.append(replace(part, u=u, y=y)[WHITENING:])
    return filtered


def spectra(records: Records, channels: Channels) -> Drawing:
    """Spectra of disturbance, output and input, and the cross spectrum [Morris1996, fig. 27 to 30]."""

    def draw(measured: MeasuredRecord, path: tuple[int, int]) -> tuple[Panel, ...]:
        output, input = path
        windowed = measured.windowed
        return spectra_panels(
            windowed,
            measured.repeated,
            output,
            input,
            scales=(channels.output_scales[output], channels.input_scales[input]),
            units=channels.density_units(output, input),
            limits=frequency_limits(windowed),
        )

    return views_with_reasons(draw, {"Record": records, "Path": channels.paths}, columns=2, height=210)


def known_response(measured: MeasuredRecord, output: int, input: int) -> FrequencyResponse | None:
    """Spectral estimate of a path where it knows the gain to a fifth; None where it knows none.

    Of several inputs that repeat, the few lines in its window leave errors that its intervals do not hold.
    """
    if measured.period and measured.longest.nu > 1:
        return None
    try:
        response = measured.windowed
    except SysidError:
        return None
    known = reliable_lines(response, output, input) & excited_lines(response, input)
    return replace(response.select(known), covariance=None) if known.any() else None
