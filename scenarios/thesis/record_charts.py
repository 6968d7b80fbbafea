"""Charts over time and lag: waveforms, records, outputs, residuals, correlations, Markov parameters."""

from collections.abc import Mapping, Sequence

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.excitation import chirp, chirp_as_printed, two_sines, white_noise
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import Waveform
from scenarios.report.figure_style import MRAD, method_style, short
from scenarios.thesis.chart import JOINT, Chart, Panel, Series, by_view, record_series
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.multivariable import FAST_CHIRP
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES
from scenarios.thesis.response_charts import joints
from sysid import IOData, ResidualTest
from sysid.plots import PALETTE, Style

COMMAND = Style("#56b4e9", "-", 1.2)
MEASURED = Style("#222222", "-", 1.2)
PAIR = {"SysID": PALETTE["armax"], "OKID": PALETTE["okid"]}
ANGLE, SECONDS, MAGNIFIED = "angle / mrad", "time / s", "time, magnified / s"

TESTS = {"two sines": (SINES, 1.6), "PRBS": (PRBS, 4.0), "pulse": (PULSE, 3.0), "5–10 Hz chirp": (8, 2.0)}
"""Tests whose records and outputs are drawn: number, and how much is magnified, s."""

START = 40.0
"""Beginning of the magnified part, s; earlier where the record is shorter."""

SHOWN = 36
"""System Markov parameters that are drawn: 0.7 s."""


def waveforms(study: Comparison) -> Chart:
    """The excitations as files of 100 points, with their spectra [Morris1996, fig. 11 to 16]."""
    binary, pulse = (
        load(single_joint_test(number, "shoulder_yaw")).excitation[0].waveform() for number in (PRBS, PULSE)
    )
    files: Mapping[str, Waveform] = {
        "white noise": white_noise(seed=0),
        "two sines": two_sines(frequency=0.5, amplitude=2.0),
        "PRBS": binary,
        "chirp as played": chirp(f_start=1.0, f_end=2.0),
        "chirp (2.15) as printed": chirp_as_printed(f_low=1.0, f_high=2.0, f_center=4.0),
        "pulse": pulse,
    }
    return Chart(by_view(_waveform, files), ("Waveform",), columns=2, height=220)


def _waveform(file: Waveform) -> tuple[Panel, ...]:
    time = np.arange(len(file.points) + 1) / file.update_rate
    # The last point is held too.
    volts = Series("file", time, np.append(file.points, file.points[-1]), PALETTE["armax"], kind="step")
    density = file.psd()
    power = Series("power of each line", density.frequency, density.density, PALETTE["oe"], kind="stem")
    return (
        Panel(SECONDS, "file / V", (volts,)),
        Panel("frequency / Hz", "density / (V²/Hz)", (power,), x_limits=(-0.5, 25.5)),
    )


def _magnified(samples: int, dt: float, length: float) -> slice:
    first = round(min(START, max(samples * dt - length, 0.0)) / dt)
    return slice(first, first + round(length / dt) + 1)


def records(study: Comparison) -> Chart:
    """Commanded and measured angle of a test: the whole record, and magnified."""

    def panels(entry: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
        number, length = test
        log = study.logs.get(single_joint_test(number, entry.joint))
        if log is None:
            return ()
        column = JOINTS.index(entry.joint)
        home, part = log.commanded[0, column], _magnified(len(log), log.dt, length)
        signals = [
            ("commanded", MRAD * (log.commanded[:, column] - home), COMMAND, True),
            ("measured", MRAD * (log.measured[:, column] - home), MEASURED, False),
        ]
        whole = tuple(record_series(label, values, log.dt, look) for label, values, look, _ in signals)
        near = tuple(
            record_series(label, values[part], log.dt, look, start=part.start * log.dt, held=held)
            for label, values, look, held in signals
        )
        return Panel(SECONDS, ANGLE, whole), Panel(MAGNIFIED, ANGLE, near)

    return Chart(by_view(panels, joints(study), TESTS), (JOINT, "Test"), height=190)


def outputs(study: Comparison) -> Chart:
    """Outputs of the identified and the printed models against the measurement of a test, and what they leave."""

    def panels(entry: JointResult, test: tuple[int, float]) -> tuple[Panel, ...]:
        number, length = test
        data = entry.data.get(number)
        if data is None:
            return ()
        part = _magnified(len(data), data.dt, length)
        models = {model.label: (model.estimate.model, method_style(model.method)) for model in entry.models.values()}
        models |= {f"published {one.label}": (one.model, PALETTE["published"]) for one in entry.published}
        fits = sysid.compare({label: model for label, (model, _) in models.items()}, data)
        values = [
            (f"{label}: {fit.simulation[0]:.1f} %", fit.simulated[:, 0], look)
            for (label, (_, look)), fit in zip(models.items(), fits, strict=True)
            # What an unstable model simulates grows beyond all numbers.
            if np.isfinite(fit.simulated).all() and fit.simulation[0] > -1000.0
        ]
        okid = next(fit for (label, _), fit in zip(models.items(), fits, strict=True) if "OKID" in label)
        values.append(
            (f"OKID one step ahead: {okid.one_step[0]:.2f} %", okid.predicted[:, 0], Style("#b14a7c", ":", 1.6))
        )
        start = SETTLING + part.start * data.dt
        measured = record_series("measured", MRAD * data.y[part, 0], data.dt, MEASURED, start=start)
        drawn = [record_series(label, MRAD * y[part], data.dt, look, start=start) for label, y, look in values]
        left = [
            record_series(label, MRAD * (data.y[:, 0] - y)[part], data.dt, look, start=start)
            for label, y, look in values
        ]
        return (
            Panel(SECONDS, ANGLE, (measured, *drawn)),
            Panel(SECONDS, "measured − model / mrad", tuple(left)),
        )

    return Chart(by_view(panels, joints(study), TESTS), (JOINT, "Test"), height=210)


def residuals(study: Comparison) -> Chart:
    """Residuals of each model on its own record: over time, their autocorrelation, their correlation with the input."""

    def panels(entry: JointResult, method: str) -> tuple[Panel, ...]:
        model = entry.models[method]
        test, look = model.residual_test, method_style(model.method)
        values = MRAD * test.residuals[:, 0]
        label = f"{model.label}, standard deviation {np.std(values):.3g} mrad"
        return (
            Panel(SECONDS, "residual / mrad", (record_series(label, values, model.estimate.model.dt, look),)),
            *_tests([(label, test, look)], 0),
        )

    methods = {"ARMAX": "armax", "OE": "oe", "OKID": "okid", "OE, sufficient order": "oe_high"}
    return Chart(by_view(panels, joints(study), methods), (JOINT, "Model"), height=150)


def _tests(tests: Sequence[tuple[str, ResidualTest, Style]], channel: int) -> tuple[Panel, Panel]:
    """Autocorrelation of the residuals of a channel, and their correlation with its input, models side by side."""
    auto, cross, marks = [], [], []
    for place, (label, test, look) in enumerate(tests):
        apart = 0.4 * place
        auto.append(Series(label, test.lags[1:] + apart, test.autocorrelation[1:, channel, channel], look, kind="stem"))
        values = test.cross_correlation[:, channel, channel]
        cross.append(Series(label, test.cross_lags + apart, values, look, kind="stem"))
    for bound in (float(test.whiteness_bound), float(test.independence_bound[channel, channel])):
        marks.append((("y", bound, "99 %"), ("y", -bound, "")))
    return (
        Panel("lag / samples", "autocorrelation", tuple(auto), marks=marks[0]),
        Panel("lag / samples", "with the input", tuple(cross), marks=marks[1]),
    )


def correlations(study: Comparison) -> Chart:
    """Correlations of the PRBS test, as recorded and with the input made white, and the pulse response from them."""

    def panels(entry: JointResult) -> tuple[Panel, ...]:
        known = study.nonparametric[entry.joint]
        looks = {"as recorded": "#8a8a8a", "input made white": "#0072b2"}
        functions = dict(zip(looks, (known.covariances, known.whitened), strict=True))
        drawn = []
        for i, j, title in ((0, 0, "output"), (1, 1, "input"), (0, 1, "input to output")):
            series = tuple(
                Series(name, function.lags, function.normalised[:, i, j], Style(looks[name], "-", 1.0))
                for name, function in functions.items()
            )
            drawn.append(Panel("lag / samples", "correlation", series, title))
        lags, bound = known.pulse.lags, float(known.delay.bound[0, 0])
        points = Style(PALETTE["oe"].colour, "", 1.0, "^")
        pulse = Series("from correlations", lags, known.pulse.response[:, 0, 0], points)
        first = int(known.delay.correlation[0, 0])
        truth = Series("truth", lags, entry.truth.model.markov(len(lags))[:, 0, 0], PALETTE["truth"])
        text = f"pulse response (first lag beyond ±{bound:.2g}, 99 % of chance: {first})"
        return (*drawn, Panel("lag / samples", "rad/rad", (truth, pulse), text, marks=(("x", first, ""),)))

    return Chart(by_view(panels, joints(study)), columns=2, height=190)


def observers(study: Comparison) -> Chart:
    """OKID: Markov parameters of observer and system, errors over p, Hankel singular values."""

    def panels(entry: JointResult) -> tuple[Panel, ...]:
        known, look = study.observers[entry.joint], PALETTE["okid"]
        diagnostics = known.estimate.diagnostics
        ours = []
        for name, label, shift, colour in (
            ("u", "of the command", -0.2, look.colour),
            ("y", "of the measurement", 0.2, "#7a5195"),
        ):
            values = np.asarray(diagnostics[f"observer_markov_{name}"])[:, 0, 0]
            ours.append(Series(label, np.arange(1, len(values) + 1) + shift, values, Style(colour), kind="stem"))
        system, true = np.asarray(diagnostics["system_markov"])[:SHOWN, 0, 0], known.true_markov[:SHOWN]
        numbers = np.arange(len(system))
        hankel = np.asarray(diagnostics["hankel_singular_values"], dtype=float)[:8]
        points, tried = Style(look.colour, "", 1.0, "D"), [row.p for row in known.errors]
        pulse = (Series("truth", numbers, true, PALETTE["truth"]), Series("from the observer", numbers, system, points))
        sizes = (Series("Hankel singular value", np.arange(1, len(hankel) + 1), hankel / hankel[0], points),)
        errors = tuple(
            Series(f"{label} error", tried, [100 * getattr(row, label) for row in known.errors], style)
            for label, style in (("prediction", look), ("smoothing", PALETTE["oe"]))
        )
        drawn = (
            Panel("lag / samples", "rad/rad", tuple(ours), "Markov parameters of the observer"),
            Panel("sample after the pulse", "rad/rad", pulse, "Markov parameters of the system"),
            Panel("number", "over the largest", sizes, "Hankel singular values", "y"),
        )
        if not known.errors:
            return drawn
        p, mark = "observer Markov parameters p", (("x", 5.0, "p of the thesis"),)
        return (*drawn, Panel(p, "% of the output", errors, "errors over p", "y", marks=mark))

    return Chart(by_view(panels, joints(study)), columns=2, height=200)


def several(study: Comparison) -> Chart:
    """The three-joint models on the exchange and on the fast chirp: outputs, what they miss, one-step residuals."""
    known = {"exchange": RPCM, "5–10 Hz chirp": FAST_CHIRP}
    data = {name: study.campaign.several(name) for name in known.values() if name in study.multivariable.records}
    pair = study.multivariable.pair()
    fits = {name: sysid.compare([entry.model for entry in pair], record) for name, record in data.items()}

    def panels(i: int, name: str) -> tuple[Panel, ...]:
        if name not in data:
            return ()
        record = data[name]
        part = slice(None) if name == RPCM else _magnified(len(record), record.dt, 2.0)
        start = SETTLING + (part.start or 0) * record.dt
        angles = [_piece("commanded", record, record.u[:, i], part, start, COMMAND)]
        angles.append(_piece("measured", record, record.y[:, i], part, start, MEASURED))
        missed, ahead, tests = [], [], []
        for entry, fit in zip(pair, fits[name], strict=True):
            look = Style(PAIR[entry.kind].colour, "-", 0.9)
            label = f"{entry.kind}: {fit.simulation[i]:.1f} % simulated, {fit.one_step[i]:.1f} % one step ahead"
            angles.append(_piece(label, record, fit.simulated[:, i], part, start, look))
            missed.append(_piece(label, record, record.y[:, i] - fit.simulated[:, i], part, start, look))
            ahead.append(_piece(label, record, record.y[:, i] - fit.predicted[:, i], part, start, look))
            tests.append((label, entry.residual_test(name), look))
        return (
            Panel(SECONDS, ANGLE, tuple(angles)),
            Panel(SECONDS, "missed / mrad", tuple(missed), "simulation"),
            Panel(SECONDS, "residual / mrad", tuple(ahead), "one step ahead"),
            *_tests(tests, i),
        )

    order = {short(name): i for i, name in enumerate(STUDIED_JOINTS)}
    return Chart(by_view(panels, order, known), (JOINT, "Record"), height=135)


def _piece(label: str, data: IOData, values: np.ndarray, part: slice, start: float, look: Style) -> Series:
    return record_series(label, MRAD * values[part], data.dt, look, start=start)
