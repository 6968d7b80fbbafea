"""Charts over time and lag: waveforms, records, outputs, residuals, correlations, Markov parameters."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.excitation import chirp, chirp_as_printed, two_sines, white_noise
from scenarios.experiments.film_plot import COMMAND, MEASURED
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import Waveform
from scenarios.record_figures.lag_panels import (
    LAG,
    autocorrelation_panel,
    correlation_panel,
    cross_correlation_panel,
    hankel_panel,
    observer_error_panel,
    observer_markov_series,
)
from scenarios.report.chart import Panel, Series, record_series
from scenarios.report.figure_style import MRAD, method_style, points, short
from scenarios.thesis.chart import chart_of, joints
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.multivariable import FAST_CHIRP
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES
from sysid import IOData, ResidualTest
from sysid.plots import PALETTE, Style

ANGLE, SECONDS, MAGNIFIED = "angle / mrad", "time / s", "time, magnified / s"

TESTS = {"two sines": (SINES, 1.6), "PRBS": (PRBS, 4.0), "pulse": (PULSE, 3.0), "5–10 Hz chirp": (8, 2.0)}
"""Tests whose records and outputs are drawn: number, and how much is magnified, s."""

START = 40.0
"""Beginning of the magnified part, s; earlier where the record is shorter."""

SHOWN = 36
"""System Markov parameters that are drawn: 0.7 s."""


def _files(_: Comparison) -> dict[str, Waveform]:
    """The kinds of excitation file of the thesis by name."""
    binary, pulse = (load(single_joint_test(test, "shoulder_yaw")).excitation[0].waveform() for test in (PRBS, PULSE))
    return {
        "white noise": white_noise(seed=0),
        "two sines": two_sines(frequency=0.5, amplitude=2.0),
        "PRBS": binary,
        "chirp as played": chirp(f_start=1.0, f_end=2.0),
        "chirp (2.15) as printed": chirp_as_printed(f_low=1.0, f_high=2.0, f_center=4.0),
        "pulse": pulse,
    }


@chart_of({"Waveform": _files}, columns=2, height=220)
def waveforms(study: Comparison, file: Waveform) -> tuple[Panel, ...]:
    """The excitations as files of 100 points, with their spectra [Morris1996, fig. 11 to 16]."""
    time = np.arange(len(file.points) + 1) / file.update_rate
    # The last point is held too.
    volts = Series("file", time, np.append(file.points, file.points[-1]), PALETTE["armax"], kind="step")
    density = file.psd()
    power = Series("power of each line", density.frequency, density.density, PALETTE["oe"], kind="stem")
    return (
        Panel(SECONDS, "file / V", [volts]),
        Panel("frequency / Hz", "density / (V²/Hz)", [power], x_limits=(-0.5, 25.5)),
    )


def _magnified(samples: int, dt: float, length: float) -> slice:
    """The samples that are drawn magnified: so many seconds from `START`, or the last ones of a shorter record."""
    first = round(min(START, max(samples * dt - length, 0.0)) / dt)
    return slice(first, first + round(length / dt) + 1)


def _piece(label: str, data: IOData, values: np.ndarray, window: slice, look: Style) -> Series:
    """A curve over a window of a record, mrad; times count from the start of the log, before it had settled."""
    start = SETTLING + (window.start or 0) * data.dt
    return record_series(label, MRAD * values[window], data.dt, look, start=start)


@chart_of({"Joint": joints, "Test": TESTS}, height=190)
def records(study: Comparison, result: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
    """Commanded and measured angle of a test: the whole record, and magnified."""
    test_number, length = test
    log = study.logs.get(single_joint_test(test_number, result.joint))
    if log is None:
        return ()
    column, window = JOINTS.index(result.joint), _magnified(len(log), log.dt, length)
    entire, magnified = [], []
    for label, angles, look in (("commanded", log.commanded, COMMAND), ("measured", log.measured, MEASURED)):
        values = MRAD * (angles[:, column] - log.commanded[0, column])
        entire.append(record_series(label, values, log.dt, look))
        start, held = window.start * log.dt, label == "commanded"
        magnified.append(record_series(label, values[window], log.dt, look, start=start, held=held))
    return Panel(SECONDS, ANGLE, entire), Panel(MAGNIFIED, ANGLE, magnified)


@chart_of({"Joint": joints, "Test": TESTS}, height=210)
def outputs(study: Comparison, result: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
    """Outputs of the identified and the printed models against the measurement of a test, and what they leave."""
    test_number, length = test
    data = result.data.get(test_number)
    if data is None:
        return ()
    window, measured = _magnified(len(data), data.dt, length), data.y[:, 0]
    models = [(model.label, model.estimate.model, method_style(model.method)) for model in result.models.values()]
    models += [(f"published {model.label}", model.model, PALETTE["published"]) for model in result.published]
    fits = sysid.compare([model for _, model, _ in models], data)
    curves = []
    for (label, _, look), fit in zip(models, fits, strict=True):
        # What an unstable model simulates grows beyond all numbers.
        if np.isfinite(fit.simulated).all() and fit.simulation[0] > -1000.0:
            curves.append((f"{label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], look))
    okid = fits[list(result.models).index("okid")]
    one_step_label = f"OKID one step ahead: {okid.one_step[0]:.2f} %"
    curves.append((one_step_label, okid.predicted[:, 0], Style("#b14a7c", ":", 1.6)))
    drawn = [_piece(label, data, output, window, look) for label, output, look in curves]
    remainders = [_piece(label, data, measured - output, window, look) for label, output, look in curves]
    return (
        Panel(SECONDS, ANGLE, [_piece("measured", data, measured, window, MEASURED), *drawn]),
        Panel(SECONDS, "measured − model / mrad", remainders),
    )


@chart_of(
    {"Joint": joints, "Model": {"ARMAX": "armax", "OE": "oe", "OKID": "okid", "OE, sufficient order": "oe_high"}},
    height=150,
)
def residuals(study: Comparison, result: JointResult, method: str) -> tuple[Panel, ...]:
    """Residuals of each model on its own record: over time, their autocorrelation, their correlation with the input."""
    model = result.models[method]
    test, look = model.residual_test, method_style(model.method)
    values = MRAD * test.residuals[:, 0]
    label = f"{model.label}, standard deviation {np.std(values):.3g} mrad"
    curve = record_series(label, values, model.estimate.model.dt, look)
    return Panel(SECONDS, "residual / mrad", [curve]), *_tests([(label, test, look)], 0)


def _tests(tests: Sequence[tuple[str, ResidualTest, Style]], channel: int) -> tuple[Panel, Panel]:
    """Autocorrelation of the residuals of a channel, and their correlation with its input, models side by side."""
    return autocorrelation_panel(tests, channel), cross_correlation_panel(tests, channel, channel)


@chart_of({"Joint": joints}, columns=2, height=190)
def correlations(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """Correlations of the PRBS test, as recorded and with the input made white, and the pulse response from them."""
    estimates = study.nonparametric[result.joint]
    functions = (("as recorded", estimates.covariances, "#8a8a8a"), ("input made white", estimates.whitened, "#0072b2"))
    drawn = []
    # Of the two channels, the output is the first.
    for row, column, title in ((0, 0, "output"), (1, 1, "input"), (0, 1, "input to output")):
        drawn.append(replace(correlation_panel(functions, row, column), title=title))
    lags = estimates.pulse.lags
    bound, first = float(estimates.delay.bound[0, 0]), int(estimates.delay.correlation[0, 0])
    truth = Series("truth", lags, result.truth.model.markov(len(lags))[:, 0, 0], PALETTE["truth"])
    pulse = Series("from correlations", lags, estimates.pulse.response[:, 0, 0], points("oe", "^"))
    title = f"pulse response (first lag beyond ±{bound:.2g}, 99 % of chance: {first})"
    return *drawn, Panel(LAG, "rad/rad", [truth, pulse], title, marks=(("x", first, ""),))


@chart_of({"Joint": joints}, columns=2, height=200)
def observers(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """OKID: Markov parameters of observer and system, errors over p, Hankel singular values."""
    diagnostics = result.models["okid"].estimate.diagnostics
    system = np.asarray(diagnostics["system_markov"])[:SHOWN, 0, 0]
    samples = np.arange(len(system))
    pulse = [
        Series("truth", samples, result.truth.model.markov(len(system))[:, 0, 0], PALETTE["truth"]),
        Series("from the observer", samples, system, points("okid", "D")),
    ]
    drawn = (
        Panel(LAG, "rad/rad", observer_markov_series(diagnostics), "Markov parameters of the observer"),
        Panel("sample after the pulse", "rad/rad", pulse, "Markov parameters of the system"),
        hankel_panel(diagnostics["hankel_singular_values"], 8),
    )
    errors = study.observers[result.joint].errors
    if not errors:
        return drawn
    return *drawn, observer_error_panel(errors, (("x", 5.0, "p of the thesis"),))


@chart_of(
    {
        "Joint": lambda _: {short(name): i for i, name in enumerate(STUDIED_JOINTS)},
        "Record": {"exchange": RPCM, "5–10 Hz chirp": FAST_CHIRP},
    },
    height=135,
)
def several(study: Comparison, channel: int, name: str) -> tuple[Panel, ...]:
    """The three-joint models on the exchange and on the fast chirp: outputs, what they miss, one-step residuals."""
    if name not in study.multivariable.records:
        return ()
    record, pair = study.campaign.several(name), study.multivariable.pair()
    # The exchange is slow enough to be seen as a whole.
    window = slice(None) if name == RPCM else _magnified(len(record), record.dt, 2.0)
    measured = record.y[:, channel]
    angles = [
        _piece("commanded", record, record.u[:, channel], window, COMMAND),
        _piece("measured", record, measured, window, MEASURED),
    ]
    missed, one_step_residuals, tests = [], [], []
    for model, fit in zip(pair, sysid.compare([model.model for model in pair], record), strict=True):
        colour = PALETTE["okid"].colour if model.kind == "OKID" else PALETTE["armax"].colour
        look = Style(colour, "-", 0.9)
        simulation, one_step = fit.simulation[channel], fit.one_step[channel]
        label = f"{model.kind}: {simulation:.1f} % simulated, {one_step:.1f} % one step ahead"
        angles.append(_piece(label, record, fit.simulated[:, channel], window, look))
        missed.append(_piece(label, record, measured - fit.simulated[:, channel], window, look))
        one_step_residuals.append(_piece(label, record, measured - fit.predicted[:, channel], window, look))
        tests.append((label, model.residual_test(name), look))
    return (
        Panel(SECONDS, ANGLE, angles),
        Panel(SECONDS, "missed / mrad", missed, "simulation"),
        Panel(SECONDS, "residual / mrad", one_step_residuals, "one step ahead"),
        *_tests(tests, channel),
    )
