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
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, finding_by_reading
from scenarios.thesis.nonparametric import GRID, PULSE, SINES, WHITENING, excited_lines
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
    **{TONES: "two sines", LINES: "PRBS lines", WHOLE: "all frequencies", POWERED: "input's power"},
    **{PLAIN: "as recorded", WHITENED: "made white"},
}
"""Short names of the readings, used in keys of numbers."""


def gain_and_cutoff(study: Comparison) -> Finding:
    """F1: the gain stays below one and falls off at 6 to 7 rad/s."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for way, response in _estimates(study, joint).items():
            top, at = float(response.magnitude.max()), 2 * np.pi * gain_crossing(response, HALF_POWER)
            near = abs(at / BREAK_FREQUENCY[joint] - 1) <= CLAIMS["F1"].limits["near"]
            readings[way] |= {f"gain on {joint}": top < 1.0, f"cutoff on {joint}": near}
            values |= {f"{joint}, {SHORT[way]}": at, f"{joint}, {SHORT[way]}, largest gain": top}
    same, other = printed_breaks()
    facts = {
        "best": [2 * np.pi * entry.best_linear.half_power_hz for entry in study.joints.values()],
        "count": len(same),
        "breaks": list(BREAK_FREQUENCY.values()),
        "same": [f"{at:.2f} rad/s ({label})" for label, at in same.items()],
        "other": [f"{at:.2f} ({label})" for label, at in other.items()],
        "powered": _powered(study, SINES),
    }
    return finding_by_reading("F1", readings, values, facts)


def printed_breaks() -> tuple[dict[str, float], dict[str, float]]:
    """Frequencies, rad/s, where printed models fall below 0.707, by label: at the spectra's breaks, and elsewhere."""
    same, other = dict[str, float](), dict[str, float]()
    for model in PUBLISHED:
        at = 2 * np.pi * model.half_power_hz
        (same if np.round(at) == BREAK_FREQUENCY[model.joint] else other)[model.label] = at
    return same, other


def slope(study: Comparison) -> Finding:
    """F2: a second-order slope from the break to 10 rad/s, resonances and disturbances above."""
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    for joint in study.joints:
        for way, response in _estimates(study, joint).items():
            steep, peaks = gain_slope(response), _resonances(response)
            first_order = first_order_slope(gain_crossing(response, HALF_POWER))
            readings[way] |= {f"slope on {joint}": steep < first_order, f"resonance on {joint}": len(peaks) > 0}
            name = f"{joint}, {SHORT[way]}"
            values |= {
                name: steep,
                f"{name}, first order": first_order,
                f"{name}, peaks where the input is weak": (~excited_lines(response)[peaks]).sum(),
                f"of {name}": len(peaks),
            }
    true = [
        FrequencyResponse(GRID, entry.truth.model.frequency_response(GRID), entry.truth.model.dt, "model")
        for entry in study.joints.values()
    ]
    count = sum(len(_resonances(_up_to(entry, FASTEST))) for entry in true)
    return finding_by_reading("F2", readings, values, {"slopes": [gain_slope(entry) for entry in true], "count": count})


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
    delays = {joint: result.delay for joint, result in study.nonparametric.items()}
    peaks = {joint: float(np.argmax(entry.correlations[:, 0, 0])) for joint, entry in delays.items()}
    facts = {
        "first": [int(entry.correlation[0, 0]) for entry in delays.values()],
        "own": [entry.truth.delay_samples for entry in study.joints.values()],
    }
    parts = {joint: limits["shortest"] <= peaks[joint] <= limits["longest"] for joint in CLAIMED_DELAY}
    return decided_finding("F3", parts, peaks, facts)


def prbs_looks_white(study: Comparison) -> Finding:
    """F4: the PRBS looks white with periodic side peaks."""
    limits = CLAIMS["F4"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {PLAIN: {}, WHITENED: {}}
    for joint in study.joints:
        record = study.joints[joint].data[study.estimation_test]
        repeats = load(record.name).period
        ((white, _),) = prewhitened([record], 0, WHITENING)
        for way, command in ((PLAIN, record.u), (WHITENED, white[WHITENING:])):
            half = correlation(command[:, 0], range(POINTS // 2 + 1))
            spread = np.sqrt(np.mean(half[1:] ** 2))
            (period,) = correlation(command[:, 0], [repeats])
            beyond = half[int(np.argmax(half <= 0.0)) :] if (half <= 0.0).any() else half[-1:]
            peak = np.abs(beyond).max()
            name = f"{joint}, {SHORT[way]}"
            values |= {name: spread, f"{name}, one period later": period, f"{name}, largest peak": peak}
            readings[way] |= {
                f"white on {joint}": spread <= limits["white"],
                f"periodic on {joint}": period >= limits["white"],
                f"small peaks on {joint}": peak <= limits["small"],
            }
    limited = 100 * max(entry.slewing[study.estimation_test] for entry in study.joints.values())
    return finding_by_reading("F4", readings, values, {"limited": limited, "repeats": repeats})


def correlation(signal: np.ndarray, lags: Sequence[int]) -> np.ndarray:
    """Correlation coefficients of a signal of zero mean (N,) with itself at some lags."""
    return np.array([np.mean(signal[lag:] * signal[: len(signal) - lag]) for lag in lags]) / np.mean(signal**2)


def pulse_spectra(study: Comparison) -> Finding:
    """F5: with the bipolar ramping pulse the disturbance lies around and below 1 Hz."""
    limits = CLAIMS["F5"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    repeated = []
    for joint, result in study.nonparametric.items():
        spectrum, reach = spectrum_of(study, PULSE, joint), result.resolution_hz[PULSE]
        f, again = spectrum.frequencies, result.repeated[PULSE]
        # The window widens a line by its resolution; those at 1 and at 5 Hz count whole.
        inside = (f >= 1.0 - reach) & (f <= 5.0 + reach)
        for way, mask in frequency_masks(spectrum).items():
            for what, band, density in (
                ("disturbance", f <= limits["around"], spectrum.noise_spectrum),
                ("input", inside, spectrum.input_spectrum),
                ("output", inside, spectrum.output_spectrum),
            ):
                share = values[f"{joint} {what}, {SHORT[way]}"] = _share(band, mask * _power(density))
                readings[way][f"{what} on {joint}"] = share > limits["most"]
        repeated.append(_share(again.frequencies <= limits["around"], again.disturbance))
    return finding_by_reading("F5", readings, values, {"repeated": repeated, "powered": _powered(study, PULSE)})


def sinusoid_disturbance(study: Comparison) -> Finding:
    """F6: with two sines up to 10 Hz the disturbance lies orders below the output."""
    limits = CLAIMS["F6"].limits
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {WHOLE: {}, POWERED: {}}
    for joint, result in study.nonparametric.items():
        spectrum = spectrum_of(study, SINES, joint)
        # The line at 10 Hz counts whole.
        near = spectrum.frequencies <= FASTEST + result.resolution_hz[SINES]
        for way, mask in frequency_masks(spectrum).items():
            orders = values[f"{joint}, {SHORT[way]}"] = orders_below(spectrum, near & mask)
            readings[way][joint] = orders >= limits["pitch" if joint in CLAIMED_DELAY else "yaw"]
    repeated = [-np.log10(entry.repeated[SINES].disturbance_share) for entry in study.nonparametric.values()]
    return finding_by_reading("F6", readings, values, {"repeated": repeated, "powered": _powered(study, SINES)})


def measurement_against_process(study: Comparison) -> Finding:
    """F7: measurement disturbances exceed process disturbances; here both are known."""
    least = CLAIMS["F7"].limits["ratio"]
    known = {joint: disturbances(study, entry) for joint, entry in study.joints.items()}
    values: dict[str, float] = {}
    readings: dict[str, dict[str, bool]] = {}
    for joint, (measurement, departure, random) in known.items():
        for way, process in (("all that is not linear", departure), ("what does not repeat", random)):
            ratio = values[f"{joint}, {way}"] = measurement / process
            readings.setdefault(f"if process disturbance is {way}", {})[joint] = ratio > least
    sizes = 1000 * np.array(list(known.values()))
    facts = dict(zip(("measurement", "departure", "random"), sizes.T.tolist(), strict=True))
    return finding_by_reading("F7", readings, values, facts)


def disturbances(study: Comparison, entry: JointResult) -> tuple[float, float, float]:
    """Root mean squares, rad, of the known disturbances of one joint in the PRBS test.

    Of measurement noise and rounding; of the true angle's deviation from the linear truth; of the part of that which is
    another in every period.
    """
    log = study.logs[entry.data[study.estimation_test].name]
    column = JOINTS.index(entry.joint)
    # The resolver reading reaches the bus a few ticks late; that delay belongs to the dynamics, not to the noise.
    angle = delayed(log.true_angles, study.campaign.condition.arm().delays)[:, column]
    expected = sysid.simulate(entry.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    start = len(log.commanded) - len(entry.data[study.estimation_test])
    departure = (angle - expected)[start:]
    periods = departure[: len(departure) // POINTS * POINTS].reshape(-1, POINTS)
    other = periods - periods.mean(axis=0)
    # One mean was taken off for every sample of the period.
    random = np.sqrt(np.sum(other**2) / ((len(periods) - 1) * POINTS))
    return float(np.std((log.measured[:, column] - angle)[start:])), float(np.std(departure)), float(random)


def spectrum_of(study: Comparison, test: int, joint: str) -> FrequencyResponse:
    """The windowed spectra of a test; raises `MissingRecordError` where there is no record of it."""
    study.campaign.log(single_joint_test(test, joint))
    return study.nonparametric[joint].spectra[test]


def frequency_masks(spectrum: FrequencyResponse) -> dict[str, np.ndarray]:
    """Frequency masks of each reading of a claim on spectra."""
    return {WHOLE: np.ones(len(spectrum.frequencies), dtype=bool), POWERED: excited_lines(spectrum)}


def orders_below(spectrum: FrequencyResponse, mask: np.ndarray) -> float:
    """Orders of magnitude between the powers of output and disturbance at some frequencies."""
    output, noise = (_power(density)[mask].sum() for density in (spectrum.output_spectrum, spectrum.noise_spectrum))
    return float(np.log10(output / noise))


def _estimates(study: Comparison, joint: str) -> dict[str, FrequencyResponse]:
    """The thesis' estimate up to 10 Hz where it is finite, and the estimate on the lines that the PRBS excites."""
    spectrum = spectrum_of(study, SINES, joint)
    return {TONES: _up_to(spectrum, FASTEST), LINES: _up_to(study.joints[joint].spa, FASTEST)}


def _up_to(response: FrequencyResponse, hz: float) -> FrequencyResponse:
    return response.select(np.isfinite(response.response[:, 0, 0]) & (response.frequencies <= hz + 1e-9))


def _powered(study: Comparison, test: int) -> list[float]:
    """Percent of the frequencies at which the input of a test stands above the window's side lobes, by joint."""
    return [100 * float(excited_lines(spectrum_of(study, test, joint)).mean()) for joint in study.nonparametric]


def _share(inside: np.ndarray, density: np.ndarray) -> float:
    """Share of the power inside a band, percent."""
    return float(100 * density[inside].sum() / density.sum())


def _power(spectrum: np.ndarray | None) -> np.ndarray:
    """Density of one channel; negative or undetermined values of a lag window count as zero."""
    if spectrum is None:
        raise ValueError("the spectral estimate has no such spectrum")
    return np.maximum(np.nan_to_num(spectrum[:, 0, 0].real, posinf=0.0), 0.0)
