"""Findings of chapter III, on the data themselves: gain, slope, delay, whiteness, disturbances.

Each is decided on the estimate that the thesis used, and on another where a claim can be read so: a verdict for each
reading. Where repetition or the truth says otherwise, the reason tells.
"""

from dataclasses import replace

import numpy as np
from scipy.signal import find_peaks

import sysid
from hmtb_twin import JOINTS
from scenarios.experiments.waveform import POINTS
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import Finding, decided_finding, verdict
from scenarios.thesis.findings_spectra import FASTEST, spectrum_of
from scenarios.thesis.nonparametric import GRID, SINES, excited_lines, half_power
from scenarios.thesis.verdicts import verdict_by_reading
from scenarios.truth.published import BREAK_FREQUENCY
from sysid import FrequencyResponse
from sysid.frequency import CovarianceFunction
from sysid.models.bandwidth import HALF_POWER, gain_crossing

NEAR = 0.2
"""A frequency reproduces the thesis' value within 20 percent."""

SLOPE_TO = 10.0
"""End of the second-order slope according to the thesis, rad/s."""

STEEP = -30.0
"""Nearer to the -40 dB per decade of a second-order system than to the -20 of a first-order one."""

RESONANCE = 3.0
"""A peak of the gain counts where it stands so many dB above its surroundings."""

WHITE = 0.2
"""Root mean square of the correlation coefficients up to which a signal counts as white."""

SMALL = 0.5
"""A peak of the correlation one period later is small up to this part of the one at lag 0."""

CLAIMED_DELAY = ("shoulder_pitch", "elbow_pitch")
"""Joints for which the thesis states a delay [Morris1996, sec. III.3]."""

TONES, LINES = "by the thesis' own estimate from two sines", "on the lines of the PRBS"
"""Readings of claims on the response."""

SHORT = {TONES: "two sines", LINES: "PRBS lines"}
"""Short names of the readings, used in keys of numbers."""


def _estimates(study: Comparison, joint: str) -> dict[str, FrequencyResponse]:
    """The thesis' estimate up to 10 Hz where it is finite, and the estimate on the lines that the PRBS excites."""
    spectrum = spectrum_of(study, SINES, joint)
    lines = study.joints[joint].spa
    return {TONES: _up_to(spectrum, FASTEST), LINES: _up_to(lines, FASTEST)}


def _up_to(response: FrequencyResponse, hz: float) -> FrequencyResponse:
    mask = np.isfinite(response.response[:, 0, 0]) & (response.frequencies <= hz + 1e-9)
    return replace(
        FrequencyResponse(response.frequencies[mask], response.response[mask], response.dt, response.method),
        input_spectrum=None if response.input_spectrum is None else response.input_spectrum[mask],
    )


def _true_response(entry: JointResult) -> FrequencyResponse:
    return FrequencyResponse(GRID, entry.truth.model.frequency_response(GRID), entry.truth.model.dt, "model")


def _list_text(values: list[float], form: str) -> str:
    return ", ".join(format(value, form) if np.isfinite(value) else "nothing" for value in values)


def gain_and_cutoff(study: Comparison) -> Finding:
    """F1: the gain stays below one and falls off at 6 to 7 rad/s."""
    cutoff: dict[str, float] = {}
    passed = {TONES: 0, LINES: 0}
    largest: dict[str, list[float]] = {TONES: [], LINES: []}
    other: list[float] = []
    again: list[float] = []
    for joint in study.joints:
        for way, response in _estimates(study, joint).items():
            top, at = float(response.magnitude.max()), 2 * np.pi * gain_crossing(response, HALF_POWER)
            passed[way] += (top < 1.0) + bool(abs(at / BREAK_FREQUENCY[joint] - 1) <= NEAR)
            if np.isfinite(at):
                cutoff[f"{joint}, {SHORT[way]}"] = at
            largest[way].append(top)
        crossing = half_power(study.nonparametric[joint].repeated[SINES].reliable_response())
        again.append(float("nan") if crossing is None else 2 * np.pi * crossing)
        positive = study.nonparametric[joint].positive
        if positive is not None:
            other.append(2 * np.pi * gain_crossing(_up_to(positive, FASTEST), HALF_POWER))
    true = [2 * np.pi * gain_crossing(_true_response(entry), HALF_POWER) for entry in study.joints.values()]
    decision, text = verdict_by_reading({way: (count, 2 * len(study.joints)) for way, count in passed.items()})
    return decided_finding(
        "F1",
        decision,
        cutoff,
        "rad/s, where the gain first falls below 0.707; two parts for each joint: the gain below one up to "
        f"{FASTEST:g} Hz, the cutoff within {100 * NEAR:.0f} %",
        f"{text}. The arm itself falls below 0.707 at {_list_text(true, '.2f')} rad/s, by construction: its servo "
        f"poles "
        f"were placed after the published models. The largest gains are {_list_text(largest[TONES], '.2f')} by the two "
        f"sines and {_list_text(largest[LINES], '.2f')} on the lines: two sines have no power between the tones, and "
        f"the "
        "Hamming window leaks theirs. The same lag with a Parzen window, whose side lobes are lower, lets the noise of "
        f"the wires through, which excites too, and finds {_list_text(other, '.1f')} rad/s; comparing the record's "
        f"periods finds {_list_text(again, '.1f')}",
    )


def slope(study: Comparison) -> Finding:
    """F2: a second-order slope between the break and 10 rad/s, resonances and disturbances above."""
    slopes: dict[str, float] = {}
    passed = {TONES: 0, LINES: 0}
    seen, weak = ({way: [0] * len(study.joints) for way in passed} for _ in range(2))
    for number, joint in enumerate(study.joints):
        for way, response in _estimates(study, joint).items():
            steep, peaks = _slope(response), _resonances(response)
            seen[way][number], weak[way][number] = len(peaks), int((~excited_lines(response)[peaks]).sum())
            passed[way] += bool(steep <= STEEP) + (len(peaks) > 0)
            if np.isfinite(steep):
                slopes[f"{joint}, {SHORT[way]}"] = steep
    true = [_slope(_true_response(entry)) for entry in study.joints.values()]
    none = sum(len(_resonances(_up_to(_true_response(entry), FASTEST))) for entry in study.joints.values())
    said_of = "; ".join(
        f"{SHORT[way]} {', '.join(map(str, counts))} by joint"
        + (f" ({sum(weak[way])} of {sum(counts)} where the input is weak: below side lobes)" if sum(counts) else "")
        for way, counts in seen.items()
    )
    decision, text = verdict_by_reading({way: (count, 2 * len(study.joints)) for way, count in passed.items()})
    return decided_finding(
        "F2",
        decision,
        slopes,
        f"dB per decade between the cutoff and {SLOPE_TO:g} rad/s ({STEEP:g} or steeper counts); tried too: any peak "
        f"of more than {RESONANCE:g} dB above, up to {FASTEST:g} Hz; two parts for each joint",
        f"{text}. The true slope there is {_list_text(true, '.0f')} dB per decade, since so close above its break even "
        f"a "
        f"second-order servo has not reached -40, and the truth has {none} resonances. Peaks seen: {said_of}",
    )


def _slope(response: FrequencyResponse) -> float:
    """Decibel per decade from the cutoff to 10 rad/s; NaN where the cutoff is not below that."""
    f, gain = response.frequencies, response.magnitude[:, 0, 0]
    ends = np.array([gain_crossing(response, HALF_POWER), SLOPE_TO / (2 * np.pi)])
    if not ends[0] < ends[1]:
        return float("nan")
    decibel = 20 * np.interp(np.log10(ends), np.log10(f), np.log10(gain))
    return float((decibel[1] - decibel[0]) / (np.log10(ends[1]) - np.log10(ends[0])))


def _resonances(response: FrequencyResponse) -> np.ndarray:
    """Return the indices of the peaks of the gain above 10 rad/s."""
    above = np.flatnonzero(response.frequencies >= SLOPE_TO / (2 * np.pi))
    peaks, _ = find_peaks(20 * np.log10(response.magnitude[above, 0, 0]), prominence=RESONANCE)
    return np.asarray(above[peaks], dtype=int)


def delay(study: Comparison) -> Finding:
    """F3: two to five samples of delay on the pitches."""
    delays, peaks = {}, {}
    for joint, result in study.nonparametric.items():
        delays[joint] = float(result.delay.correlation[0, 0])
        peaks[joint] = int(np.argmax(result.delay.correlations[:, 0, 0]))
    inside = sum(2 <= delays[joint] <= 5 for joint in CLAIMED_DELAY)
    true = ", ".join(str(entry.truth.delay_samples) for entry in study.joints.values())
    low, high = min(delays[joint] for joint in CLAIMED_DELAY), max(peaks[joint] for joint in CLAIMED_DELAY)
    return decided_finding(
        "F3",
        verdict(inside, len(CLAIMED_DELAY)),
        delays,
        "samples, the first lag at which output and whitened input of the PRBS test correlate at 99 %; the thesis "
        "tells a delay of the pitches, and the verdict rests on them",
        f"so by construction: the twin's own delays are {true} samples, one for the hold and one on the bus where the "
        "published models have it (nk - 1); tried is whether the data show them again. From there the correlation "
        f"rises to its peak at {', '.join(map(str, peaks.values()))} samples: on the pitches a graph read by eye gives "
        f"between {low:.0f} and {high}",
    )


def prbs_looks_white(study: Comparison) -> Finding:
    """F4: the PRBS looks white with periodic side peaks."""
    values: dict[str, float] = {}
    plain, filtered = "as recorded", "made white, as the toolbox of the thesis does before it correlates"
    passed = {plain: 0, filtered: 0}
    for joint, result in study.nonparametric.items():
        for way, short, function in (
            (plain, "as recorded", result.covariances),
            (filtered, "made white", result.whitened),
        ):
            r = _input_correlation(function)
            spread, peak = float(np.sqrt(np.mean(r[1 : POINTS // 2 + 1] ** 2))), float(r[POINTS])
            values[f"{joint}, {short}"] = spread
            values[f"{joint}, {short}, side peak"] = peak
            passed[way] += (spread <= WHITE) + (peak > WHITE) + (peak <= SMALL)
    decision, text = verdict_by_reading({way: (count, 3 * len(study.nonparametric)) for way, count in passed.items()})
    limited = max(entry.slewing[study.estimation_test] for entry in study.joints.values())
    peaks = [value for name, value in values.items() if name.endswith("side peak")]
    return decided_finding(
        "F4",
        decision,
        values,
        f"correlation coefficients of the command; three parts for each joint: their root mean square at lags 1 to "
        f"{POINTS // 2} up to {WHITE:g} (white), the one at lag {POINTS} above it (a periodic side peak) and up to "
        f"{SMALL:g} (a small one)",
        f"{text}. The command moves at its velocity limit in up to {100 * limited:.0f} % of the samples, and ramps "
        "between the bits take its whiteness; filtered before it is correlated, which the thesis does not mention, it "
        f"has it again. Side peaks {POINTS} samples later are {min(peaks):.2f} to {max(peaks):.2f} of the centre, "
        "because a file repeats exactly; up to which lag the thesis' graph goes its text does not say, and smaller "
        "peaks within a period would be those of the sequence. Limit and gain are those of the twin",
    )


def _input_correlation(function: CovarianceFunction) -> np.ndarray:
    """Correlation coefficients of the input at lags 0, 1, ..."""
    return np.asarray(function.normalised[function.lags >= 0, function.ny, function.ny])


def measurement_against_process(study: Comparison) -> Finding:
    """F7: measurement disturbances exceed process disturbances; here both are known."""
    values, sizes = {}, []
    whole, other = "all that is not linear", "what does not repeat"
    for joint, entry in study.joints.items():
        measurement, departure, random = disturbances(study, entry)
        values[f"{joint}, {whole}"] = measurement / departure
        values[f"{joint}, {other}"] = measurement / random
        sizes.append(1000 * np.array([measurement, departure, random]))
    low, high = np.min(sizes, axis=0), np.max(sizes, axis=0)
    ranges = [f"{a:.3f} to {b:.3f} mrad" for a, b in zip(low, high, strict=True)]
    decision, text = verdict_by_reading(
        {
            f"if process disturbance is {way}": (sum(values[f"{j}, {way}"] > 1.0 for j in study.joints), len(sizes))
            for way in (whole, other)
        }
    )
    return decided_finding(
        "F7",
        decision,
        values,
        "measurement over process disturbance, root mean square, PRBS test: above one counts, joint by joint",
        f"{text}. On the twin all are known. Resolver noise and rounding are {ranges[0]}. The true angle departs from "
        f"the linear answer by {ranges[1]}: seal friction and what else is not linear. "
        f"What it does differently from one period to the next, beyond its answer to the noise on the command, "
        f"is {ranges[2]}. A spectrum shows their sum only, and cannot tell where a disturbance enters",
    )


def disturbances(study: Comparison, entry: JointResult) -> tuple[float, float, float]:
    """Root mean squares of the known disturbances of one joint in the PRBS test, rad.

    Args:
        study: The study.
        entry: The joint.

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
