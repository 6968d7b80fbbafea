"""Charts over frequency and in the z plane: responses, spectra, poles and zeros, coupling."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

import sysid
from hmtb_twin import JOINTS
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.waveform import POINTS
from scenarios.record_figures.frequency_panels import (
    DEGREES,
    HZ,
    gain_series,
    phase_series,
    reliable_lines,
    root_panel,
    spectra_panels,
)
from scenarios.record_figures.period_spectra import excited_lines
from scenarios.report.chart import Panel, Series
from scenarios.report.figure_style import MRAD, method_style, points, short
from scenarios.thesis.chart import chart_of, joints
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.multivariable import FULL_OKID, INDEPENDENT
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES
from sysid import FrequencyResponse, StateSpace
from sysid.models.bandwidth import HALF_POWER
from sysid.plots import PALETTE, Style

# Up to the Nyquist frequency of the records.
FREQUENCIES = np.geomspace(0.05, 25.0, 90)

EXCITED_FROM = SAMPLE_RATE / POINTS
"""Lowest frequency with power in the input of a 100-point file played at 50 Hz, Hz."""

FASTEST_DRAWN = 12.5
"""Largest frequency drawn, Hz, half of Nyquist: above the upper sine of 10 Hz the record has little information."""

WEAK = 0.1
"""Weak lines: the PRBS has less than this fraction of its middle line's power there."""

PRINTED = (PALETTE["published"], Style("#b8860b", ":", 1.6), Style("#6b4e00", "--", 1.4), Style("#6b4e00", "-", 1.0))
"""Line styles of the printed models of one joint."""

GAIN = "gain / (rad/rad)"

LEVEL = ("y", HALF_POWER, "0.707")

Curve = tuple[str, StateSpace | FrequencyResponse, Style]
"""Name, model or response, and look."""


@chart_of({"Joint": joints}, height=230)
def responses(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """Frequency responses of a joint: truth, estimates without a model, identified models, printed models."""
    curves: list[Curve] = [
        ("small-signal truth", result.truth.model, PALETTE["truth"]),
        ("spectral estimate, its lines", well_known(result.spa), points("spa", ".")),
    ]
    for model in result.models.values():
        # The estimate's response, not the model's: it has the covariance of the band.
        curves.append((model.label, model.estimate.frequency_response(FREQUENCIES), method_style(model.method)))
    arx = study.data_sets[result.joint].find(single_joint_test(study.estimation_test, result.joint), "arx")
    if arx is not None:
        curves.append(("ARX", arx.estimate.model, PALETTE["arx"]))
    for printed, look in zip(result.published, PRINTED, strict=False):
        curves.append((f"published {printed.label}", printed.model, look))
    gains, phases = [_gain(*curve) for curve in curves], [_phase(*curve, result) for curve in curves]
    marks = (("x", EXCITED_FROM, "lowest line of the file"), ("x", 1.0, "1 Hz"), LEVEL)
    limits = (0.05, 25.0)
    return (
        Panel(HZ, GAIN, gains, "", "xy", limits, (0.003, 3.0), marks),
        Panel(HZ, DEGREES, phases, "", "x", limits, (-400.0, 20.0), (("x", EXCITED_FROM, ""), ("x", 1.0, ""))),
    )


def _response(drawn: StateSpace | FrequencyResponse) -> FrequencyResponse:
    """The response of a model at `FREQUENCIES`; a response as it is."""
    if isinstance(drawn, FrequencyResponse):
        return drawn
    return FrequencyResponse(FREQUENCIES, drawn.frequency_response(FREQUENCIES), drawn.dt, "model")


def _gain(label: str, drawn: StateSpace | FrequencyResponse, style: Style, row: int = 0, column: int = 0) -> Series:
    """Gain from an input to an output, with its 95 % band where it is known."""
    return gain_series(label, _response(drawn), style, row, column)


def _phase(label: str, drawn: StateSpace | FrequencyResponse, style: Style, result: JointResult) -> Series:
    """Phase in degrees, unwrapped onto the same turn as the true phase."""
    # Dense enough for the true phase to move by less than half a turn from value to value.
    dense = np.linspace(0.05, 25.0, 500)
    true = np.unwrap(np.angle(result.truth.model.frequency_response(dense)[:, 0, 0]))
    return phase_series(label, _response(drawn), style, (dense, true))


def well_known(response: FrequencyResponse) -> FrequencyResponse:
    """The lines up to half of Nyquist whose gain is known to a fifth; the others show noise and distortion."""
    if response.covariance is None:
        return response
    kept = reliable_lines(response) & (response.frequencies <= SAMPLE_RATE / 4)
    return replace(response.select(kept), covariance=None)


@chart_of({"Joint": joints}, height=230)
def transfer_function(study: Comparison, result: JointResult) -> tuple[Panel, ...]:
    """The ratio of cross and input spectrum from two sines, where it is known, and the truth."""
    estimates = study.nonparametric[result.joint]
    spectrum = estimates.spectra.get(SINES)
    if spectrum is None:
        return ()
    excited = replace(spectrum.select(excited_lines(spectrum)), covariance=None)
    binary, prbs_lines = estimates.repeated[PRBS], well_known(result.spa)
    weakest = WEAK * np.median(binary.input[binary.frequencies <= FASTEST_DRAWN])
    strong = np.interp(prbs_lines.frequencies, binary.frequencies, binary.input) >= weakest
    windowed: list[Curve] = [("two sines, Hamming window", spectrum, Style(PALETTE["spa"].colour, "-", 0.8))]
    if estimates.positive is not None:
        windowed.append(("Parzen window", estimates.positive, Style("#6b6b00", "-", 0.9)))
    reliable: list[Curve] = [
        ("truth", result.truth.model, PALETTE["truth"]),
        ("where the input has power", excited, points("spa", "v")),
        ("from repetition", estimates.repeated[SINES].reliable_response(), points("oe", "^")),
        ("strong PRBS lines", prbs_lines.select(strong), points("armax", ".")),
    ]
    limits = (0.1, FASTEST_DRAWN)
    gains = [_gain(*curve) for curve in (*windowed, *reliable)]
    # The phase of side lobes is random: only where the response is known has it a turn to be unwrapped onto.
    phases = [_phase(*curve, result) for curve in reliable]
    return (
        Panel(HZ, GAIN, gains, "", "xy", limits, (0.008, 30.0), (LEVEL,)),
        Panel(HZ, DEGREES, phases, "", "x", limits),
    )


@chart_of({"Joint": joints, "Test": {"pulse": PULSE, "two sines": SINES}}, columns=2, height=210)
def four_spectra(study: Comparison, result: JointResult, test: int) -> tuple[Panel, ...]:
    """Disturbance, output, input and cross spectrum of pulse and two sines: windowed, by repetition, and true."""
    estimates = study.nonparametric[result.joint]
    if test not in estimates.spectra:
        return ()
    spectrum, periodic, scale = estimates.spectra[test], estimates.repeated[test], MRAD**2
    true_gain = np.abs(result.truth.model.frequency_response(periodic.frequencies)[:, 0, 0])
    # Elsewhere the input is noise of the wires.
    lines = periodic.repeating > 0.5
    label, look = "true answer to the input", points("truth", "o")
    output_power, cross_power = true_gain**2 * periodic.input, true_gain * periodic.input
    true_output = Series(label, periodic.frequencies[lines], scale * output_power[lines], look)
    true_cross = Series(label, periodic.frequencies[lines], scale * cross_power[lines], look)
    disturbance = scale * _known_disturbance(study, result, test, 2 * len(periodic.frequencies) + 2)
    true_disturbance = Series("left by the linear truth", periodic.frequencies, disturbance, PALETTE["truth"])
    # The window resolves no more than this many lines over a logarithmic axis.
    thin = np.unique(np.searchsorted(spectrum.frequencies, np.geomspace(0.1, 24.9, 160)))
    density = "mrad²/Hz"
    return spectra_panels(
        spectrum.select(thin),
        periodic,
        scales=(MRAD, MRAD),
        units=(density, density, density),
        beside=([true_disturbance], [true_output], [], [true_cross]),
        limits=(0.1, 25.0),
    )


def _known_disturbance(study: Comparison, result: JointResult, test: int, period: int) -> np.ndarray:
    """Density, on the lines of a period of so many samples, of the measurement minus the true answer to the command."""
    data = result.data[test]
    log = study.logs[data.name]
    column = JOINTS.index(result.joint)
    expected = sysid.simulate(result.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    residual = (log.measured[:, column] - expected)[len(expected) - len(data) :]
    count = len(residual) // period
    lines = np.fft.rfft(residual[: count * period].reshape(count, period))[:, 1 : period // 2]
    return np.asarray(data.dt / period * np.mean(np.abs(lines) ** 2, axis=0))


def _systems(study: Comparison) -> dict[str, list[tuple[str, StateSpace, Style]]]:
    """Systems whose poles and zeros are drawn: of each joint, and of the three joints."""
    systems: dict[str, list[tuple[str, StateSpace, Style]]] = {}
    for name, result in joints(study).items():
        drawn = [("truth", result.truth.model, PALETTE["truth"])]
        for model in result.models.values():
            drawn.append((model.label, model.estimate.model.input_path(), method_style(model.method)))
        for printed, look in zip(result.published, PRINTED, strict=False):
            drawn.append((f"published {printed.label}", printed.model.input_path(), look))
        systems[name] = drawn
    looks = (PALETTE["armax"], PALETTE["okid"], PALETTE["pem_ss"], *PRINTED)
    models = zip(study.multivariable.models, looks, strict=False)
    systems["three joints"] = [(model.name, model.model, look) for model, look in models]
    return systems


@chart_of({"Model of": _systems}, height=360)
def roots(study: Comparison, systems: Iterable[tuple[str, StateSpace, Style]]) -> tuple[Panel, ...]:
    """Poles and zeros of the models of each joint, and of the three-joint models."""
    return (root_panel(systems),)


@chart_of({"To": lambda study: {short(name): row for row, name in enumerate(study.joints)}}, columns=3, height=240)
def coupling(study: Comparison, row: int) -> tuple[Panel, ...]:
    """Gain of the true three-joint response to each joint, beside models with and without coupling."""
    models, panels = study.multivariable, []
    for column, name in enumerate(study.joints):
        curves: list[Curve] = [("truth", models.truth, PALETTE["truth"])]
        if row == column:
            curves.append(("OKID model, block-diagonal", models.pair()[1].model, PALETTE["okid"]))
        for full in models.full:
            if full.method != FULL_OKID:
                continue
            if full.record == INDEPENDENT:
                curves.append(("all nine, a waveform each", full.model, Style("#0072b2", "--", 1.4)))
            else:
                curves.append(("all nine, shared waveform", full.model, Style("#d55e00", ":", 1.4)))
        series = [_gain(*curve, row, column) for curve in curves]
        panels.append(Panel(HZ, GAIN, series, f"from {short(name)}", "xy", (0.05, 25.0), (1e-4, 5.0)))
    return tuple(panels)
