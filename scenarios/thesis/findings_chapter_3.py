"""Findings of chapter III, F1 to F7: gain, slope, delay, whiteness, spectra and disturbances.

Each is decided on the estimate that the thesis used, and on another where a claim can be read so.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import find_peaks

import sysid
from hmtb_twin import JOINTS
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.waveform import POINTS
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import CLAIMS, Finding, Parts, decided_finding, finding_by_reading, words
from scenarios.thesis.nonparametric import GRID, PULSE, SINES, WHITENING, excited_lines, period_of
from scenarios.truth.published import BREAK_FREQUENCY, PUBLISHED
from sysid import FrequencyResponse
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from sysid.polynomial.correlation import prewhitened

FASTEST = CLAIMS["F1"].limits["fastest"]
"""Upper end of the band that the thesis excites, Hz: the upper of the two sines."""

CLAIMED_DELAY = ("shoulder_pitch", "elbow_pitch")
"""Joints for which the thesis states a delay [Morris1996, sec. III.3]."""

TONES, LINES = "by the thesis' own estimate from two sines", "on the lines of the PRBS"
"""Readings of claims on the response."""

WHOLE, POWERED = "over all frequencies, as the thesis plots them", "where the input has power"
"""Readings of claims on spectra: without input power, a windowed estimate consists of side lobes."""

SHORT = {TONES: "two sines", LINES: "PRBS lines", WHOLE: "all frequencies", POWERED: "input's power"}
"""Short names of the readings, used in keys of numbers."""


def gain_and_cutoff(study: Comparison) -> Finding:
    """F1: the gain stays below one and falls off at 6 to 7 rad/s."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for way, response in _estimates(study, joint).items():
            top, at = float(response.magnitude.max()), 2 * np.pi * gain_crossing(response, HALF_POWER)
            near = abs(at / BREAK_FREQUENCY[joint] - 1) <= CLAIMS["F1"].limits["near"]
            readings[way] |= {f"gain on {words(joint)}": top < 1.0, f"cutoff on {words(joint)}": bool(near)}
            values |= {f"{joint}, {SHORT[way]}": at} if np.isfinite(at) else {}
            values[f"{joint}, {SHORT[way]}, largest gain"] = top
    best = [2 * np.pi * entry.best_linear.half_power_hz for entry in study.joints.values()]
    return finding_by_reading(
        "F1",
        readings,
        values,
        f"The best linear truth falls below 0.707 at {_list_text(best, '.2f')} rad/s. {printed_breaks()}",
        cause=f"the two sines have power at {_powered(study, SINES)} % of the frequencies only; elsewhere their "
        "estimate consists of side lobes of the window",
    )


def printed_breaks() -> str:
    """Say which printed models fall below 0.707 at the very break frequencies that the thesis reads off its spectra."""
    crossings = {model.label: (model.joint, 2 * np.pi * model.half_power_hz) for model in PUBLISHED}
    same = [f"{at:.2f} rad/s ({label})" for label, (joint, at) in crossings.items() if _rounds_to_break(joint, at)]
    other = [f"{at:.2f} ({label})" for label, (joint, at) in crossings.items() if not _rounds_to_break(joint, at)]
    breaks = ", ".join(f"{value:g}" for value in BREAK_FREQUENCY.values())
    return (
        f"{len(same)} printed models cross 0.707 where the thesis' spectra break, to the nearest rad/s ({breaks} "
        f"for yaw, shoulder and elbow pitch): {', '.join(same)}; the others at {', '.join(other)}"
    )


def _rounds_to_break(joint: str, at: float) -> bool:
    return bool(np.isfinite(at)) and round(at) == BREAK_FREQUENCY[joint]


def slope(study: Comparison) -> Finding:
    """F2: a second-order slope from the break to 10 rad/s, resonances and disturbances above."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for way, response in _estimates(study, joint).items():
            steep, peaks = gain_slope(response), _resonances(response)
            first_order = first_order_slope(gain_crossing(response, HALF_POWER))
            readings[way] |= {
                f"slope on {words(joint)}": bool(steep < first_order),
                f"resonance on {words(joint)}": len(peaks) > 0,
            }
            name = f"{joint}, {SHORT[way]}"
            values |= {name: steep, f"{name}, first order": first_order} if np.isfinite(steep) else {}
            values |= {
                f"{name}, peaks where the input is weak": float((~excited_lines(response)[peaks]).sum()),
                f"of {name}": float(len(peaks)),
            }
    true = [_true_response(entry) for entry in study.joints.values()]
    return finding_by_reading(
        "F2",
        readings,
        values,
        f"The small-signal truth falls by {_list_text([gain_slope(entry) for entry in true], '.0f')} dB per decade "
        f"there and has {sum(len(_resonances(_up_to(entry, FASTEST))) for entry in true)} resonances",
        cause="peaks where the input is weak are leakage of the window, as their counts show",
    )


def gain_slope(response: FrequencyResponse) -> float:
    """Decibel per decade from the cutoff to 10 rad/s; NaN where the cutoff is not below that."""
    f, gain = response.frequencies, response.magnitude[:, 0, 0]
    ends = np.array([gain_crossing(response, HALF_POWER), CLAIMS["F2"].limits["end"] / (2 * np.pi)])
    if not ends[0] < ends[1]:
        return float("nan")
    decibel = 20 * np.interp(np.log10(ends), np.log10(f), np.log10(gain))
    return float((decibel[1] - decibel[0]) / (np.log10(ends[1]) - np.log10(ends[0])))


def first_order_slope(cutoff_hz: float) -> float:
    """Return the same of a first-order system with this cutoff."""
    end = CLAIMS["F2"].limits["end"] / (2 * np.pi)
    if not cutoff_hz < end:
        return float("nan")
    return float(-10 * np.log10(0.5 * (1 + (end / cutoff_hz) ** 2)) / np.log10(end / cutoff_hz))


def _resonances(response: FrequencyResponse) -> np.ndarray:
    """Return the indices of the peaks of the gain above 10 rad/s."""
    limits = CLAIMS["F2"].limits
    above = np.flatnonzero(response.frequencies >= limits["end"] / (2 * np.pi))
    peaks, _ = find_peaks(20 * np.log10(response.magnitude[above, 0, 0]), prominence=limits["resonance"])
    return np.asarray(above[peaks], dtype=int)


def delay(study: Comparison) -> Finding:
    """F3: two to five samples of delay on the pitches, where the correlation has its peak."""
    limits = CLAIMS["F3"].limits
    results = study.nonparametric.items()
    peaks = {joint: float(np.argmax(result.delay.correlations[:, 0, 0])) for joint, result in results}
    first = [int(result.delay.correlation[0, 0]) for _, result in results]
    own = [str(entry.truth.delay_samples) for entry in study.joints.values()]
    return decided_finding(
        "F3",
        {words(joint): limits["shortest"] <= peaks[joint] <= limits["longest"] for joint in CLAIMED_DELAY},
        peaks,
        f"The correlation leaves its 99 % bounds at {', '.join(map(str, first))} samples first (yaw, shoulder pitch, "
        f"elbow pitch); the twin's own delays are {', '.join(own)}, "
        "one for the hold and those of the bus",
    )


def prbs_looks_white(study: Comparison) -> Finding:
    """F4: the PRBS looks white with periodic side peaks."""
    limits = CLAIMS["F4"].limits
    values: dict[str, float] = {}
    plain, filtered = "as recorded", "made white, as the toolbox of the thesis does before it correlates"
    readings: dict[str, dict[str, bool]] = {plain: {}, filtered: {}}
    for joint in study.joints:
        record = study.joints[joint].data[study.estimation_test]
        repeats = period_of(record.name)
        ((white, _),) = prewhitened([record], 0, WHITENING)
        for way, short, command in ((plain, "as recorded", record.u), (filtered, "made white", white[WHITENING:])):
            half = correlation(command[:, 0], range(POINTS // 2 + 1))
            spread = float(np.sqrt(np.mean(half[1:] ** 2)))
            period = float(correlation(command[:, 0], [repeats])[0])
            beyond = half[int(np.argmax(half <= 0.0)) :] if (half <= 0.0).any() else half[-1:]
            peak = float(np.abs(beyond).max())
            values |= {
                f"{joint}, {short}": spread,
                f"{joint}, {short}, one period later": period,
                f"{joint}, {short}, largest peak": peak,
            }
            readings[way] |= {
                f"white on {words(joint)}": spread <= limits["white"],
                f"periodic on {words(joint)}": period >= limits["white"],
                f"small peaks on {words(joint)}": peak <= limits["small"],
            }
    limited = max(entry.slewing[study.estimation_test] for entry in study.joints.values())
    return finding_by_reading(
        "F4",
        readings,
        values,
        f"The command moves at its velocity limit in up to {100 * limited:.0f} % of the samples. It repeats every "
        f"{repeats} samples, file and hold of the hand controller together, and then correlates with itself fully but "
        "for noise; up to which lag the thesis' graph goes its text does not say",
    )


def correlation(signal: np.ndarray, lags: Sequence[int]) -> np.ndarray:
    """Correlation coefficients of a signal of zero mean (N,) with itself at some lags."""
    return np.array([np.mean(signal[lag:] * signal[: len(signal) - lag]) for lag in lags]) / np.mean(signal**2)


def pulse_spectra(study: Comparison) -> Finding:
    """F5: with the bipolar ramping pulse the disturbance lies around and below 1 Hz."""
    limits = CLAIMS["F5"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    for joint, result in study.nonparametric.items():
        spectrum = spectrum_of(study, PULSE, joint)
        reach = result.resolution_hz(PULSE)
        f = spectrum.frequencies
        # The window widens a line by its resolution; those at 1 and at 5 Hz count whole.
        inside = (f >= 1.0 - reach) & (f <= 5.0 + reach)
        for way, mask in frequency_masks(spectrum).items():
            shares = {
                "disturbance": _share(f <= limits["around"], mask * _power(spectrum.noise_spectrum)),
                "input": _share(inside, mask * _power(spectrum.input_spectrum)),
                "output": _share(inside, mask * _power(spectrum.output_spectrum)),
            }
            values |= {f"{joint} {what}, {SHORT[way]}": share for what, share in shares.items()}
            readings[way] |= {f"{what} on {words(joint)}": share > limits["most"] for what, share in shares.items()}
    repeated = [
        _share(again.frequencies <= limits["around"], again.disturbance)
        for again in (result.repeated[PULSE] for result in study.nonparametric.values())
    ]
    return finding_by_reading(
        "F5",
        readings,
        values,
        f"Told apart by repetition instead, {_span(repeated)} % of the disturbance lies up to {limits['around']:g} Hz",
        cause=_leaks(study, PULSE),
    )


def sinusoid_disturbance(study: Comparison) -> Finding:
    """F6: with two sines up to 10 Hz the disturbance lies orders below the output."""
    limits = CLAIMS["F6"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    for joint, result in study.nonparametric.items():
        spectrum = spectrum_of(study, SINES, joint)
        # The line at 10 Hz counts whole.
        near = spectrum.frequencies <= FASTEST + result.resolution_hz(SINES)
        for way, mask in frequency_masks(spectrum).items():
            orders = values[f"{joint}, {SHORT[way]}"] = orders_below(spectrum, near & mask)
            readings[way][words(joint)] = orders >= limits["pitch" if joint in CLAIMED_DELAY else "yaw"]
    repeated = [-float(np.log10(entry.repeated[SINES].disturbance_share)) for entry in study.nonparametric.values()]
    return finding_by_reading(
        "F6",
        readings,
        values,
        f"Told apart by repetition the disturbance lies {_span(repeated, '.1f')} orders below the output",
        cause=_leaks(study, SINES),
    )


def measurement_against_process(study: Comparison) -> Finding:
    """F7: measurement disturbances exceed process disturbances; here both are known."""
    values: dict[str, float] = {}
    sizes = []
    whole, other = "all that is not linear", "what does not repeat"
    for joint, entry in study.joints.items():
        measurement, departure, random = disturbances(study, entry)
        values[f"{joint}, {whole}"] = measurement / departure
        values[f"{joint}, {other}"] = measurement / random
        sizes.append(1000 * np.array([measurement, departure, random]))
    low, high = np.min(sizes, axis=0), np.max(sizes, axis=0)
    ranges = [f"{a:.3f} to {b:.3f} mrad" for a, b in zip(low, high, strict=True)]
    least = CLAIMS["F7"].limits["ratio"]
    readings: dict[str, Parts] = {
        f"if process disturbance is {way}": {words(joint): values[f"{joint}, {way}"] > least for joint in study.joints}
        for way in (whole, other)
    }
    return finding_by_reading(
        "F7",
        readings,
        values,
        f"On the twin all are known: resolver noise and rounding are {ranges[0]}, the true angle departs from the "
        f"linear answer by {ranges[1]}, and what it does differently from one period to the next, beyond its answer to "
        f"the noise on the command, is {ranges[2]}. A spectrum shows their sum only",
    )


def disturbances(study: Comparison, entry: JointResult) -> tuple[float, float, float]:
    """Root mean squares of the known disturbances of one joint in the PRBS test, rad.

    Returns:
        Of measurement noise and rounding; of the true angle's deviation from the linear truth; of the part of that
        which is another in every period.
    """
    log = study.logs[entry.data[study.estimation_test].name]
    column = JOINTS.index(entry.joint)
    angle, measured = log.true_angles[:, column], log.measured[:, column]
    # The resolver reading reaches the bus up to a few ticks late; that delay belongs to the dynamics, not to the noise.
    late = min(range(4), key=lambda k: float(np.std(measured[k:] - angle[: len(angle) - k])))
    delayed = np.concatenate([np.full(late, angle[0]), angle[: len(angle) - late]])
    expected = sysid.simulate(entry.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    start = len(log.commanded) - len(entry.data[study.estimation_test])
    departure = (delayed - expected)[start:]
    periods = departure[: len(departure) // POINTS * POINTS].reshape(-1, POINTS)
    other = periods - periods.mean(axis=0)
    # One mean was taken off for every sample of the period.
    random = np.sqrt(np.sum(other**2) / ((len(periods) - 1) * POINTS))
    return float(np.std((measured - delayed)[start:])), float(np.std(departure)), float(random)


def spectrum_of(study: Comparison, test: int, joint: str) -> FrequencyResponse:
    """The windowed spectra of a test; raises `MissingRecordError` where there is no record of it."""
    study.campaign.log(single_joint_test(test, joint))
    return study.nonparametric[joint].spectra[test]


def frequency_masks(spectrum: FrequencyResponse) -> dict[str, np.ndarray]:
    """Frequency masks of each reading of a claim on spectra."""
    return {WHOLE: np.ones(len(spectrum.frequencies), dtype=bool), POWERED: excited_lines(spectrum)}


def orders_below(spectrum: FrequencyResponse, mask: np.ndarray) -> float:
    """Orders of magnitude between the powers of output and disturbance at some frequencies."""
    return float(np.log10(_power(spectrum.output_spectrum)[mask].sum() / _power(spectrum.noise_spectrum)[mask].sum()))


def _estimates(study: Comparison, joint: str) -> dict[str, FrequencyResponse]:
    """The thesis' estimate up to 10 Hz where it is finite, and the estimate on the lines that the PRBS excites."""
    spectrum = spectrum_of(study, SINES, joint)
    return {TONES: _up_to(spectrum, FASTEST), LINES: _up_to(study.joints[joint].spa, FASTEST)}


def _up_to(response: FrequencyResponse, hz: float) -> FrequencyResponse:
    mask = np.isfinite(response.response[:, 0, 0]) & (response.frequencies <= hz + 1e-9)
    return replace(
        FrequencyResponse(response.frequencies[mask], response.response[mask], response.dt, response.method),
        input_spectrum=None if response.input_spectrum is None else response.input_spectrum[mask],
    )


def _true_response(entry: JointResult) -> FrequencyResponse:
    return FrequencyResponse(GRID, entry.truth.model.frequency_response(GRID), entry.truth.model.dt, "model")


def _powered(study: Comparison, test: int) -> str:
    """Percent of the frequencies at which the input of a test stands above the window's side lobes."""
    masks = [excited_lines(spectrum_of(study, test, joint)) for joint in study.nonparametric]
    return _span([100 * float(mask.mean()) for mask in masks])


def _leaks(study: Comparison, test: int) -> str:
    return (
        "the disturbance of this estimator is the output less what correlates with the input; the input stands above "
        f"the window's side lobes at {_powered(study, test)} % of the frequencies, and leakage elsewhere counts as "
        "disturbance"
    )


def _share(inside: np.ndarray, density: np.ndarray) -> float:
    """Share of the power inside a band, percent."""
    return float(100 * density[inside].sum() / density.sum())


def _power(spectrum: np.ndarray | None) -> np.ndarray:
    """Density of one channel; negative or undetermined values of a lag window count as zero."""
    if spectrum is None:
        raise ValueError("the spectral estimate has no such spectrum")
    density = spectrum[:, 0, 0].real
    return np.where(np.isfinite(density), np.maximum(density, 0.0), 0.0)


def _span(values: Sequence[float], form: str = ".0f") -> str:
    """Smallest and largest value as text, or one number where both print the same."""
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _list_text(values: Sequence[float], form: str) -> str:
    return ", ".join(format(value, form) if np.isfinite(value) else "nothing" for value in values)
