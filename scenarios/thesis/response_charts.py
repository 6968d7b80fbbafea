"""Charts over frequency and in the z plane: responses, spectra, poles and zeros, coupling."""

from collections.abc import Iterable, Mapping

import numpy as np

import sysid
from hmtb_twin import JOINTS
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.waveform import POINTS
from scenarios.report.figure_style import MRAD, method_style, short
from scenarios.thesis.chart import Chart, Panel, Series, by_view, gain_series
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.multi_input import FULL_OKID, INDEPENDENT
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES, excited_lines
from scenarios.truth.published import PublishedModel
from sysid import FrequencyResponse, StateSpace
from sysid.models.bandwidth import HALF_POWER
from sysid.plots import BOUND, PALETTE, Style

FREQUENCIES = np.geomspace(0.05, 25.0, 90)

EXCITED_FROM = SAMPLE_RATE / POINTS
"""Lowest frequency with power in the input of a 100-point file played at 50 Hz, Hz."""

FASTEST_DRAWN = 12.5
"""Largest frequency drawn, Hz, half of Nyquist: above the upper sine of 10 Hz the record has little information."""

WEAK = 0.1
"""Weak lines: the PRBS has less than this fraction of its middle line's power there."""

PRINTED = (PALETTE["published"], Style("#b8860b", ":", 1.6), Style("#6b4e00", "--", 1.4), Style("#6b4e00", "-", 1.0))
"""Line styles of the printed models of one joint."""

HZ, GAIN, DEGREES = "frequency / Hz", "gain / (rad/rad)", "phase / °"

EXCITED = ("x", EXCITED_FROM, "lowest line of the file")

LEVEL = ("y", HALF_POWER, "0.707")

REACH = 1.5
"""Limits of the z plane; roots beyond are counted in the legend."""


def joints(study: Comparison) -> dict[str, JointResult]:
    """The joints by the names that people read."""
    return {short(name): entry for name, entry in study.joints.items()}


def printed_styles(entry: JointResult) -> list[tuple[PublishedModel, Style]]:
    """The printed models of a joint, each with its look."""
    return list(zip(entry.published, PRINTED, strict=False))


def responses(study: Comparison) -> Chart:
    """Frequency responses of a joint: truth, estimates without a model, identified models, printed models."""
    return Chart(by_view(lambda entry: _responses(study, entry), joints(study)), height=230)


def _responses(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    arx = study.data_sets[entry.joint].find(single_joint_test(study.estimation_test, entry.joint), "arx")
    curves = [("small-signal truth", _of_model(entry.truth.model), PALETTE["truth"])]
    curves += [("spectral estimate, its lines", well_known(entry.spa), Style(PALETTE["spa"].colour, "", 1.0, "."))]
    curves += [
        (model.label, model.estimate.frequency_response(FREQUENCIES), method_style(model.method))
        for model in entry.models.values()
    ]
    curves += [] if arx is None else [("ARX", _of_model(arx.estimate.model), PALETTE["arx"])]
    curves += [(f"published {one.label}", _of_model(one.model), look) for one, look in printed_styles(entry)]
    phases = [_phase(label, response, look, entry) for label, response, look in curves]
    marks = (EXCITED, ("x", 1.0, "1 Hz"))
    limits = (0.05, 25.0)
    return (
        Panel(HZ, GAIN, tuple(_gain(*curve) for curve in curves), "", "xy", limits, (0.003, 3.0), (*marks, LEVEL)),
        Panel(HZ, DEGREES, tuple(phases), "", "x", limits, (-400.0, 20.0), (("x", EXCITED_FROM, ""), ("x", 1.0, ""))),
    )


def _of_model(model: StateSpace) -> FrequencyResponse:
    return FrequencyResponse(FREQUENCIES, model.frequency_response(FREQUENCIES), model.dt, "model")


def _gain(label: str, response: FrequencyResponse, style: Style) -> Series:
    """Gain with its 95 % band where it is known."""
    gain = response.magnitude[:, 0, 0]
    low, high = (
        (edge[:, 0, 0] for edge in response.magnitude_ci95()) if response.covariance is not None else (None,) * 2
    )
    return Series(label, response.frequencies, np.where(gain > 0.0, gain, np.nan), style, low, high)


def _phase(label: str, response: FrequencyResponse, style: Style, entry: JointResult) -> Series:
    """Phase in degrees, unwrapped onto the same turn as the true phase."""
    dense = np.linspace(0.05, 25.0, 500)
    true = np.unwrap(np.angle(entry.truth.model.frequency_response(dense)[:, 0, 0]))
    angle = np.angle(response.response[:, 0, 0])
    turns = np.round((angle - np.interp(response.frequencies, dense, true)) / (2 * np.pi))
    return Series(label, response.frequencies, np.degrees(angle - 2 * np.pi * turns), style)


def well_known(response: FrequencyResponse) -> FrequencyResponse:
    """The lines up to half of Nyquist whose gain is known to a fifth; the others show noise and distortion."""
    covariance = response.covariance
    if covariance is None:
        return response
    spread = np.sqrt(np.trace(covariance[:, 0, 0], axis1=1, axis2=2))
    return _part(response, (spread < 0.2 * response.magnitude[:, 0, 0]) & (response.frequencies <= SAMPLE_RATE / 4))


def _part(response: FrequencyResponse, kept: np.ndarray) -> FrequencyResponse:
    return FrequencyResponse(response.frequencies[kept], response.response[kept], response.dt, response.method)


def transfer_function(study: Comparison) -> Chart:
    """The ratio of cross and input spectrum from two sines, where it is known, and the truth."""
    return Chart(by_view(lambda entry: _transfer_function(study, entry), joints(study)), height=230)


def _transfer_function(study: Comparison, entry: JointResult) -> tuple[Panel, ...]:
    estimates = study.nonparametric[entry.joint]
    spectrum = estimates.spectra.get(SINES)
    if spectrum is None:
        return ()
    power = np.interp(entry.spa.frequencies, estimates.repeated[PRBS].frequencies, estimates.repeated[PRBS].input)
    lines = estimates.repeated[PRBS].frequencies <= FASTEST_DRAWN
    strong = power >= WEAK * np.median(estimates.repeated[PRBS].input[lines])
    known = well_known(entry.spa)
    strong_lines = _part(known, np.isin(known.frequencies, entry.spa.frequencies[strong]))
    tones = _part(spectrum, excited_lines(spectrum))
    window = Style(PALETTE["spa"].colour, "-", 0.8)
    curves = [("two sines, Hamming window", spectrum, window)]
    if estimates.positive is not None:
        curves.append(("Parzen window", estimates.positive, Style("#6b6b00", "-", 0.9)))
    points = [
        ("truth", _of_model(entry.truth.model), PALETTE["truth"]),
        ("where the input has power", tones, Style(PALETTE["spa"].colour, "", 1.0, "v")),
        ("from repetition", estimates.repeated[SINES].reliable_response(), Style(PALETTE["oe"].colour, "", 1.0, "^")),
        ("strong PRBS lines", strong_lines, Style(PALETTE["armax"].colour, "", 1.0, ".")),
    ]
    limits = (0.1, FASTEST_DRAWN)
    gains = tuple(_gain(*curve) for curve in (*curves, *points))
    turns = tuple(_phase(*curve, entry) for curve in points)
    return (
        Panel(HZ, GAIN, gains, "", "xy", limits, (0.008, 30.0), (LEVEL,)),
        Panel(HZ, DEGREES, turns, "", "x", limits, None),
    )


def four_spectra(study: Comparison) -> Chart:
    """Disturbance, output, input and cross spectrum of pulse and two sines: windowed, by repetition, and true."""
    tests = {"pulse": PULSE, "two sines": SINES}
    views = by_view(lambda entry, test: _four_spectra(study, entry, test), joints(study), tests)
    return Chart(views, ("Joint", "Test"), columns=2, height=210)


def _four_spectra(study: Comparison, entry: JointResult, test: int) -> tuple[Panel, ...]:
    estimates = study.nonparametric[entry.joint]
    if test not in estimates.spectra:
        return ()
    spectrum, again, scale = estimates.spectra[test], estimates.repeated[test], MRAD**2
    true = np.abs(entry.truth.model.frequency_response(again.frequencies)[:, 0, 0])
    lines = again.repeating > 0.5
    parts: list[tuple[str, np.ndarray | None, np.ndarray, np.ndarray | None]] = [
        ("disturbance", spectrum.noise_spectrum, again.disturbance, None),
        ("output", spectrum.output_spectrum, again.output, true**2 * again.input),
        ("input", spectrum.input_spectrum, again.input, None),
        ("cross, magnitude", spectrum.cross_spectrum, np.abs(again.cross), true * again.input),
    ]
    # The window resolves no more than this many lines over a logarithmic axis.
    thin = np.unique(np.searchsorted(spectrum.frequencies, np.geomspace(0.1, 24.9, 160)))
    panels = []
    for title, windowed, repeated, expected in parts:
        series = []
        if windowed is not None:
            density = np.abs(windowed[thin, 0, 0]) if title.startswith("cross") else windowed[thin, 0, 0].real
            # The Hamming window makes densities negative: gaps.
            known = scale * np.where(density > 0.0, density, np.nan)
            series.append(
                Series("Hamming window", spectrum.frequencies[thin], known, Style(PALETTE["spa"].colour, "-", 0.8))
            )
        # Lines without input power beyond rounding are left out.
        seen = np.where(repeated > 1e-15 * repeated.max(), scale * repeated, np.nan)
        series.append(Series("by repetition", again.frequencies, seen, Style(PALETTE["oe"].colour, "", 1.0, "^")))
        look = Style(PALETTE["truth"].colour, "", 1.0, "o")
        if expected is not None:
            series.append(Series("true answer to the input", again.frequencies[lines], scale * expected[lines], look))
        elif title == "disturbance":
            left = scale * _known_disturbance(study, entry, test, 2 * len(again.frequencies) + 2)
            series.append(Series("left by the linear truth", again.frequencies, left, PALETTE["truth"]))
        panels.append(Panel(HZ, "density / (mrad²/Hz)", tuple(series), title, "xy", (0.1, 25.0)))
    return tuple(panels)


def _known_disturbance(study: Comparison, entry: JointResult, test: int, period: int) -> np.ndarray:
    """Density, on the lines of a period of so many samples, of the measurement minus the true answer to the command."""
    data = entry.data[test]
    log = study.logs[data.name]
    column = JOINTS.index(entry.joint)
    expected = sysid.simulate(entry.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    residual = (log.measured[:, column] - expected)[len(expected) - len(data) :]
    count = len(residual) // period
    lines = np.fft.rfft(residual[: count * period].reshape(count, period))[:, 1 : period // 2]
    return np.asarray(data.dt / period * np.mean(np.abs(lines) ** 2, axis=0))


def roots(study: Comparison) -> Chart:
    """Poles and zeros of the models of each joint, and of the three-joint models."""
    views = by_view(_roots_of_joint, joints(study))
    models = study.multivariable.models
    looks = (PALETTE["armax"], PALETTE["okid"], PALETTE["pem_ss"], *PRINTED)
    kinds = [(entry.name, entry.model, look) for entry, look in zip(models, looks, strict=False)]
    views[("three joints",)] = (_root_panel(kinds),)
    return Chart(views, ("Model of",), height=360)


def _roots_of_joint(entry: JointResult) -> tuple[Panel, ...]:
    systems = [("truth", entry.truth.model, PALETTE["truth"])]
    systems += [(one.label, one.estimate.model.input_path(), method_style(one.method)) for one in entry.models.values()]
    systems += [(f"published {one.label}", one.model.input_path(), look) for one, look in printed_styles(entry)]
    return (_root_panel(systems),)


def _root_panel(systems: Iterable[tuple[str, StateSpace, Style]]) -> Panel:
    angle = np.linspace(0.0, 2.0 * np.pi, 91)
    series = [Series("unit circle", np.cos(angle), np.sin(angle), Style(BOUND.colour, "-", 0.9))]
    for label, model, look in systems:
        for values, marker in ((model.poles(), "x"), (model.zeros(), "o")):
            inside = values[(np.abs(values.real) < REACH) & (np.abs(values.imag) < REACH)]
            beyond = len(values) - len(inside)
            name = f"{label}, {'poles' if marker == 'x' else 'zeros'}" + (f" ({beyond} beyond)" if beyond else "")
            series.append(Series(name, inside.real, inside.imag, Style(look.colour, "", 1.0, marker)))
    ends = (-REACH, REACH)
    return Panel("real part of z", "imaginary part of z", tuple(series), "", "", ends, ends, equal=True)


def coupling(study: Comparison) -> Chart:
    """Gain of the true three-joint response to each joint, beside models with and without coupling."""
    names = [short(name) for name in study.joints]
    models = study.multivariable
    curves: list[tuple[str, StateSpace, Style]] = [
        ("truth", models.truth, PALETTE["truth"]),
        ("OKID model, block-diagonal", models.pair()[1].model, PALETTE["okid"]),
    ]
    for entry in models.full:
        if entry.method == FULL_OKID:
            apart = entry.record == INDEPENDENT
            label = f"all nine, {'a waveform each' if apart else 'shared waveform'}"
            curves.append((label, entry.model, Style(*(("#0072b2", "--") if apart else ("#d55e00", ":")), 1.4)))

    def gains(row: int, column: int) -> tuple[Series, ...]:
        shown = [curve for curve in curves if row == column or "diagonal" not in curve[0]]
        return tuple(gain_series(label, model, FREQUENCIES, look, (row, column)) for label, model, look in shown)

    def panels(row: int) -> tuple[Panel, ...]:
        limits = (0.05, 25.0), (1e-4, 5.0)
        return tuple(Panel(HZ, GAIN, gains(row, k), f"from {name}", "xy", *limits) for k, name in enumerate(names))

    rows: Mapping[str, int] = {name: row for row, name in enumerate(names)}
    return Chart(by_view(panels, rows), ("To",), columns=3, height=240)
