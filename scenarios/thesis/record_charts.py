"""Charts over time and lag: waveforms, records, outputs, residuals, correlations, Markov parameters."""

from collections.abc import Iterable

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.excitation import chirp, chirp_as_printed, two_sines, white_noise
from scenarios.experiments.film_plot import COMMAND, MEASURED
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import Waveform
from scenarios.report.figure_style import MRAD, method_style, points, short
from scenarios.thesis.chart import Panel, Series, chart_of, joints, record_series
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.multivariable import FAST_CHIRP
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES
from sysid import IOData, ResidualTest
from sysid.plots import PALETTE, Style

ANGLE, SECONDS, MAGNIFIED, LAG = "angle / mrad", "time / s", "time, magnified / s", "lag / samples"

TESTS = {"two sines": (SINES, 1.6), "PRBS": (PRBS, 4.0), "pulse": (PULSE, 3.0), "5–10 Hz chirp": (8, 2.0)}
"""Tests whose records and outputs are drawn: number, and how much is magnified, s."""

START = 40.0
"""Beginning of the magnified part, s; earlier where the record is shorter."""

SHOWN = 36
"""System Markov parameters that are drawn: 0.7 s."""


def _files(_: Comparison) -> dict[str, Waveform]:
    tests = (load(single_joint_test(number, "shoulder_yaw")) for number in (PRBS, PULSE))
    binary, pulse = (test.excitation[0].waveform() for test in tests)
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
    first = round(min(START, max(samples * dt - length, 0.0)) / dt)
    return slice(first, first + round(length / dt) + 1)


def _piece(label: str, data: IOData, values: np.ndarray, part: slice, look: Style) -> Series:
    start = SETTLING + (part.start or 0) * data.dt
    return record_series(label, MRAD * values[part], data.dt, look, start=start)


@chart_of({"Joint": joints, "Test": TESTS}, height=190)
def records(study: Comparison, entry: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
    """Commanded and measured angle of a test: the whole record, and magnified."""
    number, length = test
    log = study.logs.get(single_joint_test(number, entry.joint))
    if log is None:
        return ()
    column, part = JOINTS.index(entry.joint), _magnified(len(log), log.dt, length)
    whole, near = [], []
    for label, angles, look in (("commanded", log.commanded, COMMAND), ("measured", log.measured, MEASURED)):
        values = MRAD * (angles[:, column] - log.commanded[0, column])
        whole.append(record_series(label, values, log.dt, look))
        start, held = part.start * log.dt, label == "commanded"
        near.append(record_series(label, values[part], log.dt, look, start=start, held=held))
    return Panel(SECONDS, ANGLE, whole), Panel(MAGNIFIED, ANGLE, near)


@chart_of({"Joint": joints, "Test": TESTS}, height=210)
def outputs(study: Comparison, entry: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
    """Outputs of the identified and the printed models against the measurement of a test, and what they leave."""
    number, length = test
    data = entry.data.get(number)
    if data is None:
        return ()
    part, measured = _magnified(len(data), data.dt, length), data.y[:, 0]
    models = [(one.label, one.estimate.model, method_style(one.method)) for one in entry.models.values()]
    models += [(f"published {one.label}", one.model, PALETTE["published"]) for one in entry.published]
    fits = sysid.compare([model for _, model, _ in models], data)
    values = [
        (f"{label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], look)
        for (label, _, look), fit in zip(models, fits, strict=True)
        # What an unstable model simulates grows beyond all numbers.
        if np.isfinite(fit.simulated).all() and fit.simulation[0] > -1000.0
    ]
    okid = fits[list(entry.models).index("okid")]
    ahead = f"OKID one step ahead: {okid.one_step[0]:.2f} %"
    values.append((ahead, okid.predicted[:, 0], Style("#b14a7c", ":", 1.6)))
    drawn = [_piece(label, data, y, part, look) for label, y, look in values]
    left = [_piece(label, data, measured - y, part, look) for label, y, look in values]
    return (
        Panel(SECONDS, ANGLE, [_piece("measured", data, measured, part, MEASURED), *drawn]),
        Panel(SECONDS, "measured − model / mrad", left),
    )


@chart_of(
    {"Joint": joints, "Model": {"ARMAX": "armax", "OE": "oe", "OKID": "okid", "OE, sufficient order": "oe_high"}},
    height=150,
)
def residuals(study: Comparison, entry: JointResult, method: str) -> tuple[Panel, ...]:
    """Residuals of each model on its own record: over time, their autocorrelation, their correlation with the input."""
    model = entry.models[method]
    test, look = model.residual_test, method_style(model.method)
    values = MRAD * test.residuals[:, 0]
    label = f"{model.label}, standard deviation {np.std(values):.3g} mrad"
    curve = record_series(label, values, model.estimate.model.dt, look)
    return Panel(SECONDS, "residual / mrad", [curve]), *_tests([(label, test, look)], 0)


def _tests(tests: Iterable[tuple[str, ResidualTest, Style]], channel: int) -> tuple[Panel, Panel]:
    """Autocorrelation of the residuals of a channel, and their correlation with its input, models side by side."""
    auto, cross = [], []
    for place, (label, test, look) in enumerate(tests):
        apart = 0.4 * place
        auto.append(Series(label, test.lags[1:] + apart, test.autocorrelation[1:, channel, channel], look, kind="stem"))
        values = test.cross_correlation[:, channel, channel]
        cross.append(Series(label, test.cross_lags + apart, values, look, kind="stem"))
    white, independent = float(test.whiteness_bound), float(test.independence_bound[channel, channel])
    return (
        Panel(LAG, "autocorrelation", auto, marks=(("y", white, "99 %"), ("y", -white, ""))),
        Panel(LAG, "with the input", cross, marks=(("y", independent, "99 %"), ("y", -independent, ""))),
    )


@chart_of({"Joint": joints}, columns=2, height=190)
def correlations(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    """Correlations of the PRBS test, as recorded and with the input made white, and the pulse response from them."""
    known = study.nonparametric[entry.joint]
    functions = (("as recorded", known.covariances, "#8a8a8a"), ("input made white", known.whitened, "#0072b2"))
    drawn = []
    for i, j, title in ((0, 0, "output"), (1, 1, "input"), (0, 1, "input to output")):
        series = [
            Series(name, of.lags, of.normalised[:, i, j], Style(colour, "-", 1.0)) for name, of, colour in functions
        ]
        drawn.append(Panel(LAG, "correlation", series, title))
    lags, bound, first = known.pulse.lags, float(known.delay.bound[0, 0]), int(known.delay.correlation[0, 0])
    truth = Series("truth", lags, entry.truth.model.markov(len(lags))[:, 0, 0], PALETTE["truth"])
    pulse = Series("from correlations", lags, known.pulse.response[:, 0, 0], points("oe", "^"))
    text = f"pulse response (first lag beyond ±{bound:.2g}, 99 % of chance: {first})"
    return *drawn, Panel(LAG, "rad/rad", [truth, pulse], text, marks=(("x", first, ""),))


@chart_of({"Joint": joints}, columns=2, height=200)
def observers(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    """OKID: Markov parameters of observer and system, errors over p, Hankel singular values."""
    errors, look, diamonds = study.observers[entry.joint].errors, PALETTE["okid"], points("okid", "D")
    diagnostics = entry.models["okid"].estimate.diagnostics
    ours = []
    for name, label, shift, colour in (
        ("u", "of the command", -0.2, look.colour),
        ("y", "of the measurement", 0.2, "#7a5195"),
    ):
        values = np.asarray(diagnostics[f"observer_markov_{name}"])[:, 0, 0]
        ours.append(Series(label, np.arange(1, len(values) + 1) + shift, values, Style(colour), kind="stem"))
    system = np.asarray(diagnostics["system_markov"])[:SHOWN, 0, 0]
    true = entry.truth.model.markov(len(system))[:, 0, 0]
    numbers = np.arange(len(system))
    pulse = [Series("truth", numbers, true, PALETTE["truth"]), Series("from the observer", numbers, system, diamonds)]
    hankel = np.asarray(diagnostics["hankel_singular_values"], dtype=float)[:8]
    sizes = Series("Hankel singular value", np.arange(1, len(hankel) + 1), hankel / hankel[0], diamonds)
    drawn = (
        Panel(LAG, "rad/rad", ours, "Markov parameters of the observer"),
        Panel("sample after the pulse", "rad/rad", pulse, "Markov parameters of the system"),
        Panel("number", "over the largest", [sizes], "Hankel singular values", "y"),
    )
    if not errors:
        return drawn
    tried = [row.p for row in errors]
    curves = [
        Series(f"{label} error", tried, [100 * getattr(row, label) for row in errors], style)
        for label, style in (("prediction", look), ("smoothing", PALETTE["oe"]))
    ]
    p, mark = "observer Markov parameters p", (("x", 5.0, "p of the thesis"),)
    return *drawn, Panel(p, "% of the output", curves, "errors over p", "y", marks=mark)


@chart_of(
    {
        "Joint": lambda _: {short(name): i for i, name in enumerate(STUDIED_JOINTS)},
        "Record": {"exchange": RPCM, "5–10 Hz chirp": FAST_CHIRP},
    },
    height=135,
)
def several(study: Comparison, i: int, name: str) -> tuple[Panel, ...]:
    """The three-joint models on the exchange and on the fast chirp: outputs, what they miss, one-step residuals."""
    if name not in study.multivariable.records:
        return ()
    record, pair = study.campaign.several(name), study.multivariable.pair()
    part = slice(None) if name == RPCM else _magnified(len(record), record.dt, 2.0)
    angles = [_piece("commanded", record, record.u[:, i], part, COMMAND)]
    angles.append(_piece("measured", record, record.y[:, i], part, MEASURED))
    missed, ahead, tests = [], [], []
    for entry, fit in zip(pair, sysid.compare([entry.model for entry in pair], record), strict=True):
        look = Style(PALETTE["okid" if entry.kind == "OKID" else "armax"].colour, "-", 0.9)
        label = f"{entry.kind}: {fit.simulation[i]:.1f} % simulated, {fit.one_step[i]:.1f} % one step ahead"
        angles.append(_piece(label, record, fit.simulated[:, i], part, look))
        missed.append(_piece(label, record, record.y[:, i] - fit.simulated[:, i], part, look))
        ahead.append(_piece(label, record, record.y[:, i] - fit.predicted[:, i], part, look))
        tests.append((label, entry.residual_test(name), look))
    return (
        Panel(SECONDS, ANGLE, angles),
        Panel(SECONDS, "missed / mrad", missed, "simulation"),
        Panel(SECONDS, "residual / mrad", ahead, "one step ahead"),
        *_tests(tests, i),
    )
