"""Findings of chapter III, F1 to F7: gain, slope, delay, whiteness, spectra and disturbances.

Each is decided on the estimate that the thesis used, and on another where a claim can be read so.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import find_peaks

import sysid
from hmtb_twin import JOINTS
from hmtb_twin.bus.recorder import delayed
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import POINTS
from scenarios.record_figures.period_spectra import excited_lines
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, finding_by_reading
from scenarios.thesis.nonparametric import GRID, PULSE, SINES, WHITENING
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

PLAIN, WHITENED = "as recorded", "made white, as the toolbox of the thesis does before it correlates"
"""Readings of claims on the command."""

SHORT = {
    TONES: "two sines",
    LINES: "PRBS lines",
    WHOLE: "all frequencies",
    POWERED: "input's power",
    PLAIN: "as recorded",
    WHITENED: "made white",
}
"""Short names of the readings, used in keys of numbers."""


def gain_and_cutoff(study: Comparison) -> Finding:
    """F1: the gain stays below one and falls off at 6 to 7 rad/s."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for reading, response in response_estimates(study, joint).items():
            largest_gain = float(response.magnitude.max())
            cutoff = 2 * np.pi * gain_crossing(response, HALF_POWER)
            near = abs(cutoff / BREAK_FREQUENCY[joint] - 1) <= CLAIMS["F1"].limits["near"]
            readings[reading] |= {f"gain on {joint}": largest_gain < 1.0, f"cutoff on {joint}": near}
            name = f"{joint}, {SHORT[reading]}"
            values |= {name: cutoff, f"{name}, largest gain": largest_gain}
    best_linear = [2 * np.pi * result.best_linear.half_power_hz for result in study.joints.values()]
    at_breaks, elsewhere = printed_breaks()
    facts = {
        "best": best_linear,
        "count": len(at_breaks),
        "breaks": list(BREAK_FREQUENCY.values()),
        "same": [f"{cutoff:.2f} rad/s ({label})" for label, cutoff in at_breaks.items()],
        "other": [f"{cutoff:.2f} ({label})" for label, cutoff in elsewhere.items()],
        "powered": powered_percent(study, SINES),
    }
    return finding_by_reading("F1", readings, values, facts)


def printed_breaks() -> tuple[dict[str, float], dict[str, float]]:
    """Frequencies, rad/s, where printed models fall below 0.707, by label: at the spectra's breaks, and elsewhere."""
    at_breaks: dict[str, float] = {}
    elsewhere: dict[str, float] = {}
    for model in PUBLISHED:
        cutoff = 2 * np.pi * model.half_power_hz
        # The thesis reads its spectra in whole rad/s.
        if np.round(cutoff) == BREAK_FREQUENCY[model.joint]:
            at_breaks[model.label] = cutoff
        else:
            elsewhere[model.label] = cutoff
    return at_breaks, elsewhere


def slope(study: Comparison) -> Finding:
    """F2: a second-order slope from the break to 10 rad/s, resonances and disturbances above."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for reading, response in response_estimates(study, joint).items():
            measured_slope = gain_slope(response)
            peaks = _resonances(response)
            # A true second-order slope of -40 dB per decade is reached only far above the break: at 10 rad/s a response
            # counts as steeper than first order if it falls faster than a first-order system with the same cutoff.
            first_order = first_order_slope(gain_crossing(response, HALF_POWER))
            readings[reading] |= {
                f"slope on {joint}": measured_slope < first_order,
                f"resonance on {joint}": len(peaks) > 0,
            }
            name = f"{joint}, {SHORT[reading]}"
            values |= {
                name: measured_slope,
                f"{name}, first order": first_order,
                f"{name}, peaks where the input is weak": (~excited_lines(response)[peaks]).sum(),
                f"of {name}": len(peaks),
            }
    true_responses = []
    for result in study.joints.values():
        model = result.truth.model
        true_responses.append(FrequencyResponse(GRID, model.frequency_response(GRID), model.dt, "model"))
    true_slopes = [gain_slope(response) for response in true_responses]
    true_peaks = sum(len(_resonances(_up_to(response, FASTEST))) for response in true_responses)
    return finding_by_reading("F2", readings, values, {"slopes": true_slopes, "count": true_peaks})


def gain_slope(response: FrequencyResponse) -> float:
    """Decibel per decade from the cutoff to 10 rad/s; NaN where the cutoff is not below that."""
    f, gain = response.frequencies, response.magnitude[:, 0, 0]
    ends = np.array([gain_crossing(response, HALF_POWER), CLAIMS["F2"].limits["end"] / (2 * np.pi)])
    if not ends[0] < ends[1]:
        return float("nan")
    decibel = 20 * np.interp(np.log10(ends), np.log10(f), np.log10(gain))
    return float((decibel[1] - decibel[0]) / (np.log10(ends[1]) - np.log10(ends[0])))


def first_order_slope(cutoff_hz: float) -> float:
    """Decibel per decade of a first-order system from its cutoff to 10 rad/s; NaN where the cutoff is not below that.

    |G(f)|^2 = 1 / (1 + (f / f_c)^2); at the cutoff f_c it is 1/2.
    """
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
    peaks: dict[str, float] = {}
    first_significant_lags = []
    for joint, estimates in study.nonparametric.items():
        # The thesis reads the peak off a plot; the first lag beyond chance stands beside.
        peaks[joint] = float(np.argmax(estimates.delay.correlations[:, 0, 0]))
        first_significant_lags.append(int(estimates.delay.correlation[0, 0]))
    facts = {
        "first": first_significant_lags,
        "own": [result.truth.delay_samples for result in study.joints.values()],
    }
    verdict_parts = {joint: limits["shortest"] <= peaks[joint] <= limits["longest"] for joint in CLAIMED_DELAY}
    return decided_finding("F3", verdict_parts, peaks, facts)


def prbs_looks_white(study: Comparison) -> Finding:
    """F4: the PRBS looks white with periodic side peaks."""
    limits = CLAIMS["F4"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {PLAIN: {}, WHITENED: {}}
    for joint in study.joints:
        record = study.joints[joint].data[study.estimation_test]
        repeats = load(record.name).period
        ((white, _),) = prewhitened([record], 0, WHITENING)
        # The filter that makes it white starts from rest: its first outputs are left out.
        for reading, command in ((PLAIN, record.u), (WHITENED, white[WHITENING:])):
            # Peaks count within half a file: one period later an exactly repeating file correlates fully.
            half_period = correlation(command[:, 0], range(POINTS // 2 + 1))
            spread = np.sqrt(np.mean(half_period[1:] ** 2))
            (one_period_later,) = correlation(command[:, 0], [repeats])
            side_peak = largest_side_peak(half_period)
            name = f"{joint}, {SHORT[reading]}"
            values |= {
                name: spread,
                f"{name}, one period later": one_period_later,
                f"{name}, largest peak": side_peak,
            }
            readings[reading] |= {
                f"white on {joint}": spread <= limits["white"],
                f"periodic on {joint}": one_period_later >= limits["white"],
                f"small peaks on {joint}": side_peak <= limits["small"],
            }
    limited = 100 * max(result.slewing[study.estimation_test] for result in study.joints.values())
    return finding_by_reading("F4", readings, values, {"limited": limited, "repeats": repeats})


def largest_side_peak(coefficients: np.ndarray) -> float:
    """Largest modulus of a correlation from its first zero on; of its last value where it stays positive."""
    not_positive = coefficients <= 0.0
    # Up to the first zero it is the main lobe, as wide as the bits of the sequence.
    side = coefficients[int(np.argmax(not_positive)) :] if not_positive.any() else coefficients[-1:]
    return float(np.abs(side).max())


def correlation(signal: np.ndarray, lags: Sequence[int]) -> np.ndarray:
    """Correlation coefficients of a signal of zero mean (N,) with itself at some lags."""
    products = [np.mean(signal[lag:] * signal[: len(signal) - lag]) for lag in lags]
    return np.array(products) / np.mean(signal**2)


def pulse_spectra(study: Comparison) -> Finding:
    """F5: with the bipolar ramping pulse the disturbance lies around and below 1 Hz."""
    limits = CLAIMS["F5"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    shares_between_periods = []
    for joint, estimates in study.nonparametric.items():
        spectrum = spectrum_of(study, PULSE, joint)
        resolution = estimates.resolution_hz[PULSE]
        f = spectrum.frequencies
        # The window widens a line by its resolution; those at 1 and at 5 Hz count whole.
        claimed_band = (f >= 1.0 - resolution) & (f <= 5.0 + resolution)
        for reading, mask in frequency_masks(spectrum).items():
            for signal, band, density in (
                ("disturbance", f <= limits["around"], spectrum.noise_spectrum),
                ("input", claimed_band, spectrum.input_spectrum),
                ("output", claimed_band, spectrum.output_spectrum),
            ):
                share = _share(band, mask * _power(density))
                values[f"{joint} {signal}, {SHORT[reading]}"] = share
                readings[reading][f"{signal} on {joint}"] = share > limits["most"]
        averages = estimates.repeated[PULSE]
        shares_between_periods.append(_share(averages.frequencies <= limits["around"], averages.disturbance))
    facts = {"repeated": shares_between_periods, "powered": powered_percent(study, PULSE)}
    return finding_by_reading("F5", readings, values, facts)


def sinusoid_disturbance(study: Comparison) -> Finding:
    """F6: with two sines up to 10 Hz the disturbance lies orders below the output."""
    limits = CLAIMS["F6"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    for joint, estimates in study.nonparametric.items():
        spectrum = spectrum_of(study, SINES, joint)
        # The line at 10 Hz counts whole, as wide as the window makes it.
        in_band = spectrum.frequencies <= FASTEST + estimates.resolution_hz[SINES]
        # Two orders on yaw, one on the pitches [Morris1996, sec. III.2C and III.3].
        claimed_orders = limits["pitch"] if joint in CLAIMED_DELAY else limits["yaw"]
        for reading, mask in frequency_masks(spectrum).items():
            orders = orders_below(spectrum, in_band & mask)
            values[f"{joint}, {SHORT[reading]}"] = orders
            readings[reading][joint] = orders >= claimed_orders
    shares = [estimates.repeated[SINES].disturbance_share for estimates in study.nonparametric.values()]
    facts = {"repeated": [-np.log10(share) for share in shares], "powered": powered_percent(study, SINES)}
    return finding_by_reading("F6", readings, values, facts)


def measurement_against_process(study: Comparison) -> Finding:
    """F7: measurement disturbances exceed process disturbances; here both are known."""
    smallest_ratio = CLAIMS["F7"].limits["ratio"]
    by_joint = {joint: disturbances(study, result) for joint, result in study.joints.items()}
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {}
    # The thesis does not say whether what repeats with the input counts as a process disturbance.
    for joint, (measurement, departure, random) in by_joint.items():
        for meaning, process in (("all that is not linear", departure), ("what does not repeat", random)):
            ratio = measurement / process
            values[f"{joint}, {meaning}"] = ratio
            readings.setdefault(f"if process disturbance is {meaning}", {})[joint] = ratio > smallest_ratio
    milliradians = 1000 * np.array(list(by_joint.values()))
    facts = dict(zip(("measurement", "departure", "random"), milliradians.T.tolist(), strict=True))
    return finding_by_reading("F7", readings, values, facts)


def disturbances(study: Comparison, result: JointResult) -> tuple[float, float, float]:
    """Root mean squares, rad, of the known disturbances of one joint in the PRBS test.

    Of measurement noise and rounding; of the true angle's deviation from the linear truth; of the part of that
    deviation that does not repeat from period to period.
    """
    log = study.logs[result.data[study.estimation_test].name]
    column = JOINTS.index(result.joint)
    # The resolver reading reaches the bus a few ticks late; that delay belongs to the dynamics, not to the noise.
    angle = delayed(log.true_angles, study.campaign.condition.arm().delays)[:, column]
    expected = sysid.simulate(result.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    # The linear truth starts at rest with the log; the record starts later, once the joint has settled.
    start = len(log.commanded) - len(result.data[study.estimation_test])
    measurement_noise = (log.measured[:, column] - angle)[start:]
    departure = (angle - expected)[start:]
    periods = departure[: len(departure) // POINTS * POINTS].reshape(-1, POINTS)
    not_repeated = periods - periods.mean(axis=0)
    # One mean was taken off for every sample of the period.
    random = np.sqrt(np.sum(not_repeated**2) / ((len(periods) - 1) * POINTS))
    return float(np.std(measurement_noise)), float(np.std(departure)), float(random)


def spectrum_of(study: Comparison, test: int, joint: str) -> FrequencyResponse:
    """The windowed spectra of a test; raises `MissingRecordError` where there is no record of it."""
    study.campaign.log(single_joint_test(test, joint))
    return study.nonparametric[joint].spectra[test]


def frequency_masks(spectrum: FrequencyResponse) -> dict[str, np.ndarray]:
    """Frequency masks of each reading of a claim on spectra."""
    return {WHOLE: np.ones(len(spectrum.frequencies), dtype=bool), POWERED: excited_lines(spectrum)}


def orders_below(spectrum: FrequencyResponse, mask: np.ndarray) -> float:
    """Orders of magnitude between the powers of output and disturbance at some frequencies."""
    output = _power(spectrum.output_spectrum)[mask].sum()
    disturbance = _power(spectrum.noise_spectrum)[mask].sum()
    return float(np.log10(output / disturbance))


def response_estimates(study: Comparison, joint: str) -> dict[str, FrequencyResponse]:
    """The thesis' estimate up to 10 Hz where it is finite, and the estimate on the lines that the PRBS excites."""
    spectrum = spectrum_of(study, SINES, joint)
    return {TONES: _up_to(spectrum, FASTEST), LINES: _up_to(study.joints[joint].spa, FASTEST)}


def _up_to(response: FrequencyResponse, hz: float) -> FrequencyResponse:
    """The finite values of a response up to a frequency, which rounding shall not exclude."""
    return response.select(np.isfinite(response.response[:, 0, 0]) & (response.frequencies <= hz + 1e-9))


def powered_percent(study: Comparison, test: int) -> list[float]:
    """Percent of the frequencies at which the input of a test stands above the window's side lobes, by joint."""
    spectra = [spectrum_of(study, test, joint) for joint in study.nonparametric]
    return [100 * float(excited_lines(spectrum).mean()) for spectrum in spectra]


def _share(inside: np.ndarray, density: np.ndarray) -> float:
    """Share of the power inside a band, percent."""
    return float(100 * density[inside].sum() / density.sum())


def _power(spectrum: np.ndarray | None) -> np.ndarray:
    """Density of one channel; negative or undetermined values of a lag window count as zero."""
    if spectrum is None:
        raise ValueError("the spectral estimate has no such spectrum")
    return np.maximum(np.nan_to_num(spectrum[:, 0, 0].real, posinf=0.0), 0.0)
