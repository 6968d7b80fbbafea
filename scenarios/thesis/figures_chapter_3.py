"""Figures of chapter III: records, transfer function, correlations and spectra."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import sysid
from hmtb_twin import JOINTS, JointLog
from hmtb_twin.parameters.values import MOTIONS, SAMPLE_RATE
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import POINTS
from scenarios.report.figure_style import MRAD, WIDTH, dress
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.envelope import envelope
from scenarios.thesis.nonparametric import PRBS, SINES, Nonparametric, PeriodSpectra, excited_lines
from scenarios.thesis.response_figures import model_response, well_known
from sysid import FrequencyResponse
from sysid.plots import BOUND, INK, PALETTE, Style

COMMAND, ANSWER = PALETTE["measured"], PALETTE["armax"]
WINDOWED, REPEATED, TRUE = PALETTE["spa"], PALETTE["oe"], PALETTE["truth"]
WINDOW, OTHER_WINDOW = Style(WINDOWED.colour, "-", 0.8), Style("#6b6b00", "-", 0.9)
SMALL = 7.5

FASTEST_DRAWN = 12.5
"""Largest frequency drawn, Hz, half of Nyquist: above the upper sine of 10 Hz the record has little information."""

WEAK = 0.1
"""Weak lines: the PRBS has less than this fraction of its middle line's power there."""

LEVELS = 60
"""Periods whose samples at one instant are compared."""


def tests(study: Comparison, entry: JointResult) -> Figure:
    """Two seconds of each test: commanded and measured angle about the operating point."""
    figure = Figure(figsize=(WIDTH, 7.4), layout="constrained")
    grid = figure.subplots(4, 2, sharex=True).ravel()
    for axes, (number, data) in zip(grid, entry.data.items(), strict=False):
        count = min(len(data), round(2 * SAMPLE_RATE))
        time = np.arange(count) / SAMPLE_RATE
        axes.step(time, MRAD * data.u[:count, 0], where="post", color=COMMAND.colour, lw=1.1, label="commanded")
        axes.plot(time, MRAD * data.y[:count, 0], color=ANSWER.colour, lw=1.4, label="measured")
        description = load(f"siso-{number}-{entry.joint}").description.split(": ", 1)[1]
        axes.set_title(f"{number}: {description}", loc="left", fontsize=7.5)
    dress(grid)
    for axes in grid[-2:]:
        axes.set_xlabel("time / s", fontsize=8)
    figure.supylabel("angle / mrad", fontsize=9)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def record(log: JointLog, joint: str, *, length: float, start: float = 40.0) -> Figure:
    """A test as recorded: whole, magnified, and magnified to the quantisation steps of the converters.

    Args:
        log: The log.
        joint: The joint.
        length: Length of the magnified part, s.
        start: Its beginning, s; earlier where the record is shorter.

    Returns:
        The figure.
    """
    column = JOINTS.index(joint)
    home = log.commanded[0, column]
    command, measured = MRAD * (log.commanded[:, column] - home), MRAD * (log.measured[:, column] - home)
    figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
    panels = figure.subplot_mosaic([["whole", "whole"], ["near", "near"], ["command", "measured"]])
    dress(panels.values())
    for values, style, label in ((command, COMMAND, "commanded"), (measured, ANSWER, "measured")):
        envelope(panels["whole"], values, log.dt, style, label=label)
    panels["whole"].set_title("the whole record", loc="left", fontsize=8)
    panels["whole"].set_xlim(0.0, len(command) * log.dt)

    first = round(min(start, max(len(command) * log.dt - length, 0.0)) / log.dt)
    part = slice(first, first + round(length / log.dt) + 1)
    time = log.dt * np.arange(len(command))[part]
    panels["near"].step(time, command[part], where="post", color=COMMAND.colour, lw=1.2)
    panels["near"].plot(time, measured[part], color=ANSWER.colour, lw=1.2, marker=".", ms=3)
    panels["near"].set_title("magnified: commands held for 20 ms, angles read every 20 ms", loc="left", fontsize=8)
    panels["near"].set_xlim(time[0], time[-1])
    for name in ("whole", "near"):
        panels[name].set(ylabel="angle / mrad", xlabel="time / s")

    limit = MRAD * MOTIONS[joint].velocity_limit * log.dt
    for name, values, style in (("command", command, COMMAND), ("measured", measured, ANSWER)):
        _levels(panels[name], values, style, limit)
    panels["command"].set_title("commanded, one instant of each period", loc="left", fontsize=SMALL)
    panels["measured"].set_title("measured, one instant of each period", loc="left", fontsize=SMALL)
    panels["command"].set_ylabel("angle / mrad")
    for axes in panels.values():
        axes.xaxis.label.set_fontsize(8)
        axes.yaxis.label.set_fontsize(8)
    figure.legend(
        *panels["whole"].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8
    )
    return figure


def _levels(axes: Axes, values: np.ndarray, style: Style, limit: float) -> None:
    """Draw a signal at one instant of every period: rows of dots where it is rounded.

    The instant is the one at which periods differ most among those at which the signal is slower than the limit, where
    a command is what the converter read.
    """
    count = min(len(values) // POINTS, LEVELS + 2)
    periods = values[: count * POINTS].reshape(count, POINTS)[2:]
    steps = np.abs(np.diff(periods, axis=1, prepend=np.roll(periods, 1, axis=0)[:, -1:])).max(axis=0)
    free = steps < 0.99 * limit
    spread = np.where(free, periods.std(axis=0), -1.0) if free.any() else periods.std(axis=0)
    period = periods[:, int(np.argmax(spread))]
    axes.plot(np.arange(3, count + 1), period, ls="none", marker="_", ms=6, mew=1.4, color=style.colour)
    axes.set_xlabel("period")
    gaps = np.diff(np.unique(np.round(period, 6)))
    if len(gaps):
        axes.annotate(
            f"least step {gaps.min():.3f} mrad", (0.98, 0.97), xycoords="axes fraction", ha="right", va="top",
            fontsize=SMALL, color=INK, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0},
        )  # fmt: skip
        axes.margins(y=0.25)


def transfer_function(entry: JointResult, estimates: Nonparametric) -> Figure:
    """The ratio of cross and input spectrum from two sines, where it is known, and the truth."""
    spectrum = estimates.spectra[SINES]
    powered = excited_lines(spectrum)
    true = model_response(entry.truth.model)
    tones = FrequencyResponse(spectrum.frequencies[powered], spectrum.response[powered], spectrum.dt, "spa")
    strong = _strong(well_known(entry.spa), estimates.repeated[PRBS])
    figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
    gain, phase = figure.subplots(2, 1, sharex=True, height_ratios=[1.35, 1.0])
    dress((gain, phase))
    _level(gain, spectrum, WINDOW, "two sines, Hamming window")
    if estimates.positive is not None:
        _level(gain, estimates.positive, OTHER_WINDOW, "Parzen window")
    points = (
        (true, TRUE, "truth"),
        (estimates.repeated[SINES].reliable_response(), Style(REPEATED.colour, "", 1.0, "^"), "from repetition"),
        (strong, Style(ANSWER.colour, "", 1.0, "."), "strong PRBS lines"),
    )
    for response, style, label in points:
        _level(gain, response, style, label)
        _turn(phase, response, style, entry)
    _turn(phase, tones, Style(WINDOWED.colour, "", 1.0, "v"), entry)
    at = tones.frequencies[tones.frequencies <= FASTEST_DRAWN]
    gain.plot(
        at, np.full(len(at), 27.0), ls="none", marker="v", ms=6, color=WINDOWED.colour, label="the input has power"
    )
    for axes in (gain, phase):
        for f in at:
            axes.axvline(f, color=WINDOWED.colour, lw=0.7, ls=":", zorder=0)
    edge = ("axes fraction", "data")
    for value, text in ((0.0, "1"), (20 * np.log10(np.sqrt(0.5)), "0.707")):
        gain.axhline(value, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
        gain.annotate(
            text, (1.0, value), (2, 0), xycoords=edge, textcoords="offset points", fontsize=SMALL, va="center"
        )
    gain.set_ylim(-42.0, 30.0)
    gain.set_ylabel("gain / dB", fontsize=8)
    phase.set_ylabel("phase / degrees", fontsize=8)
    phase.set(xscale="log", xlim=(0.1, FASTEST_DRAWN))
    phase.set_xlabel("frequency / Hz", fontsize=8)
    ticks = [0.1, 0.2, 0.5, 1.0, 2.5, 5.0, 10.0]
    phase.set_xticks(ticks, [f"{value:g}" for value in ticks])
    phase.minorticks_off()
    figure.legend(*gain.get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure


def _strong(response: FrequencyResponse, lines: PeriodSpectra) -> FrequencyResponse:
    """A response where the input has at least a tenth of the power that its middle line has."""
    power = np.interp(response.frequencies, lines.frequencies, lines.input)
    band = lines.frequencies <= FASTEST_DRAWN
    mask = power >= WEAK * np.median(lines.input[band])
    return FrequencyResponse(response.frequencies[mask], response.response[mask], response.dt, response.method)


def _level(axes: Axes, response: FrequencyResponse, style: Style, label: str) -> None:
    f, value = response.frequencies, response.magnitude[:, 0, 0]
    mask = f <= FASTEST_DRAWN
    level = 20 * np.log10(np.where(value[mask] > 0.0, value[mask], np.nan))
    marker = "" if style.line else style.marker
    axes.plot(f[mask], level, color=style.colour, ls=style.line, lw=style.width, marker=marker, ms=5, label=label)


def _turn(axes: Axes, response: FrequencyResponse, style: Style, entry: JointResult) -> None:
    mask = response.frequencies <= FASTEST_DRAWN
    f, marker = response.frequencies[mask], "" if style.line else style.marker
    degrees = _unwrapped_phase(f, response.response[mask, 0, 0], entry)
    axes.plot(f, degrees, color=style.colour, ls=style.line, lw=style.width, marker=marker, ms=5)


def _unwrapped_phase(f: np.ndarray, response: np.ndarray, entry: JointResult) -> np.ndarray:
    """Phase in degrees, unwrapped onto the same turn as the true phase."""
    dense = np.linspace(0.05, 25.0, 500)
    true = np.unwrap(np.angle(entry.truth.model.frequency_response(dense)[:, 0, 0]))
    beside = np.interp(f, dense, true)
    angle = np.angle(response)
    return np.asarray(np.degrees(angle - 2 * np.pi * np.round((angle - beside) / (2 * np.pi))))


def correlation(study: Comparison, entry: JointResult, estimates: Nonparametric) -> Figure:
    """Correlations of the PRBS test, as recorded and with the input made white, and the pulse response from them."""
    figure = Figure(figsize=(WIDTH, 6.6), layout="constrained")
    grid = figure.subplots(4, 2, height_ratios=[1.0, 1.0, 1.0, 1.2])
    dress(grid.ravel())
    whole = {"left": estimates.covariances, "right": estimates.whitened}
    for column, (function, title) in enumerate(zip(whole.values(), ("as recorded", "input made white"), strict=True)):
        r, lags = function.normalised, function.lags
        for row, (i, j) in enumerate(((0, 0), (1, 1), (0, 1))):
            grid[row, column].plot(lags, r[:, i, j], color=ANSWER.colour, lw=1.0)
            grid[row, column].set_ylim(-1.15, 1.15)
            grid[row, column].set_xlim(lags[0], lags[-1])
        grid[0, column].set_title(title, loc="left", fontsize=8, fontweight="bold")
        grid[2, column].set_xlabel("lag / samples", fontsize=8)
    for row, text in enumerate(("output", "input", "input to output")):
        grid[row, 0].set_ylabel(f"{text}\ncorrelation", fontsize=8)
    near, pulse = grid[3]
    white = estimates.whitened
    part = (white.lags >= -5) & (white.lags <= 25)
    near.vlines(white.lags[part], 0.0, white.normalised[part, 0, 1], color=ANSWER.colour, lw=1.3)
    bound = float(estimates.delay.bound[0, 0])
    near.axhspan(-bound, bound, color=BOUND.colour, alpha=0.25, lw=0)
    first = int(estimates.delay.correlation[0, 0])
    near.axvline(first, color=REPEATED.colour, ls="--", lw=1.0)
    near.annotate(
        f"first beyond chance: {first}", (first + 0.6, -0.06), fontsize=SMALL, color=REPEATED.colour, va="top"
    )
    near.annotate("grey: 99 % of chance", (25, -0.22), fontsize=SMALL, color=INK, ha="right")
    near.set_ylim(-0.25, None)
    near.set_title("input to output, made white, magnified", loc="left", fontsize=SMALL)
    near.set_xlabel("lag / samples", fontsize=8)
    near.set_ylabel("correlation", fontsize=8)
    lags = estimates.pulse.lags
    pulse.plot(lags, entry.truth.model.markov(len(lags))[:, 0, 0], color=TRUE.colour, lw=TRUE.width, label="truth")
    pulse.plot(
        lags,
        estimates.pulse.response[:, 0, 0],
        color=REPEATED.colour,
        ls="none",
        marker="^",
        ms=3.5,
        label="from correlations",
    )
    pulse.set_title("pulse response", loc="left", fontsize=SMALL)
    pulse.set_xlabel("lag / samples", fontsize=8)
    pulse.legend(frameon=False, fontsize=SMALL, loc="upper right")
    return figure


def four_spectra(study: Comparison, entry: JointResult, estimates: Nonparametric, test: int) -> Figure:
    """Disturbance, output, input and cross spectrum of a test: windowed, from period averages, and true."""
    spectrum, again = estimates.spectra[test], estimates.repeated[test]
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    dress(grid.ravel())
    scale = MRAD**2
    true = np.abs(entry.truth.model.frequency_response(again.frequencies)[:, 0, 0])
    lines = again.repeating > 0.5
    panels: Sequence[tuple[str, np.ndarray | None, np.ndarray, np.ndarray | None]] = (
        ("disturbance", spectrum.noise_spectrum, again.disturbance, None),
        ("output", spectrum.output_spectrum, again.output, true**2 * again.input),
        ("input", spectrum.input_spectrum, again.input, None),
        ("cross, magnitude", spectrum.cross_spectrum, np.abs(again.cross), true * again.input),
    )
    for axes, (title, windowed, repeated, expected) in zip(grid.ravel(), panels, strict=True):
        if windowed is not None:
            density = np.abs(windowed[:, 0, 0]) if title.startswith("cross") else windowed[:, 0, 0].real
            axes.plot(
                spectrum.frequencies, scale * np.where(density > 0.0, density, np.nan), color=WINDOWED.colour, lw=0.8,
                label="Hamming window",
            )  # fmt: skip
            gone = spectrum.frequencies[(density <= 0.0) & (spectrum.frequencies >= 0.1)]
            if len(gone):
                axes.plot(
                    gone, np.full(len(gone), 0.015), "|", color=WINDOWED.colour, ms=5, mew=0.6,
                    transform=axes.get_xaxis_transform(), label="the same where not positive",
                )  # fmt: skip
        if expected is not None:
            axes.plot(
                again.frequencies[lines], scale * expected[lines], color=TRUE.colour, ls="none", marker="o", ms=6.5,
                mfc="none", label="true answer to the input",
            )  # fmt: skip
        # Lines without input power beyond rounding are left out.
        visible = np.where(repeated > 1e-15 * repeated.max(), scale * repeated, np.nan)
        axes.plot(
            again.frequencies, visible, color=REPEATED.colour, ls="none", marker="^", ms=2.8, label="by repetition"
        )
        axes.set_title(title, loc="left", fontsize=8.5)
        axes.set(xscale="log", yscale="log", xlim=(0.1, 25.0))
    true_noise = _known_disturbance(study, entry, test)
    grid[0, 0].plot(
        again.frequencies, scale * true_noise, color=TRUE.colour, lw=1.2, label="what the linear truth leaves"
    )
    for axes in grid[1]:
        axes.set_xlabel("frequency / Hz", fontsize=8)
        axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    figure.supylabel("density / (mrad²/Hz)", fontsize=8.5)
    handles = {
        label: handle for axes in grid.ravel() for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def _known_disturbance(study: Comparison, entry: JointResult, test: int) -> np.ndarray:
    """Density on the lines of the measurement minus the linear true response to the command."""
    data = entry.data[test]
    log = study.logs[data.name]
    column = JOINTS.index(entry.joint)
    expected = sysid.simulate(entry.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    residual = (log.measured[:, column] - expected)[len(expected) - len(data) :]
    count = len(residual) // POINTS
    lines = np.fft.rfft(residual[: count * POINTS].reshape(count, POINTS))[:, 1 : POINTS // 2]
    return np.asarray(data.dt / POINTS * np.mean(np.abs(lines) ** 2, axis=0))


def data_spectra(study: Comparison, entry: JointResult) -> Figure:
    """Input, output and disturbance spectrum of the estimation data [Morris1996, fig. 27 to 29]."""
    spectra = study.nonparametric[entry.joint].repeated[PRBS]
    traces = [
        sysid.plots.Trace("input", spectra.input, COMMAND),
        sysid.plots.Trace("output", spectra.output, ANSWER),
        sysid.plots.Trace("disturbance", spectra.disturbance, REPEATED),
    ]
    return sysid.plots.spectra(spectra.frequencies, traces, unit="rad", limits_hz=(0.4, 25.0), size=(WIDTH, 3.6))
