"""Findings of chapter III on windowed spectra, F5 and F6: where the disturbance lies, and how far below the output.

Each is read twice: over all frequencies, and where the input has power.
"""

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided_finding
from scenarios.thesis.nonparametric import PULSE, SINES, excited_lines
from scenarios.thesis.verdicts import verdict_by_reading
from sysid import FrequencyResponse

FASTEST = 10.0
"""Upper end of the band that the thesis excites, Hz: the upper of the two sines."""

WHOLE, POWERED = "over all frequencies, as the thesis plots them", "where the input has power"
"""Readings of claims on spectra: without input power, a windowed estimate consists of side lobes."""

NAMED = {WHOLE: "all frequencies", POWERED: "input's power"}
"""Short names of the readings, used in keys of numbers."""

AROUND_1_HZ = 1.5
"""Upper end of the band around and below 1 Hz."""


def spectrum_of(study: Comparison, test: int, joint: str) -> FrequencyResponse:
    """The windowed spectra of a test.

    Raises:
        MissingRecordError: There is no record of it, with the reason.
    """
    study.campaign.log(single_joint_test(test, joint))
    return study.nonparametric[joint].spectra[test]


def pulse_spectra(study: Comparison) -> Finding:
    """F5: with the bipolar ramping pulse the disturbance lies around and below 1 Hz."""
    low: dict[str, float] = {}
    passed = {WHOLE: 0, POWERED: 0}
    bands: dict[str, list[float]] = {WHOLE: [], POWERED: []}
    repeated, powered = [], []
    for joint, result in study.nonparametric.items():
        spectrum = spectrum_of(study, PULSE, joint)
        reach = result.resolution_hz(PULSE)
        f = spectrum.frequencies
        # The window widens a line by its resolution; those at 1 and at 5 Hz count whole.
        inside = (f >= 1.0 - reach) & (f <= 5.0 + reach)
        for way, mask in _frequency_masks(spectrum).items():
            low[f"{joint}, {NAMED[way]}"] = below = _share(f <= AROUND_1_HZ, mask * _power(spectrum.noise_spectrum))
            shares = [_share(inside, mask * _power(s)) for s in (spectrum.input_spectrum, spectrum.output_spectrum)]
            bands[way] += shares
            passed[way] += sum(value > 50 for value in (below, *shares))
        again = result.repeated[PULSE]
        repeated.append(_share(again.frequencies <= AROUND_1_HZ, again.disturbance))
        powered.append(100 * float(excited_lines(spectrum).mean()))
    decision, text = verdict_by_reading({way: (count, 3 * len(study.nonparametric)) for way, count in passed.items()})
    return decided_finding(
        "F5",
        decision,
        low,
        f"percent of the disturbance power up to {AROUND_1_HZ:g} Hz (above 50: concentrated there); above 50 is asked "
        "for from 1 to 5 Hz too, of input and output: three parts for each joint",
        f"{text}. From 1 to 5 Hz lie {_span(bands[WHOLE])} % of input and output over all frequencies, "
        f"{_span(bands[POWERED])} % where the input has power. "
        + _leaks(powered)
        + f"Told apart by repetition instead, {_span(repeated)} % of the disturbance lies up "
        f"to {AROUND_1_HZ:g} Hz: the noise of the resolver is spread over all frequencies",
    )


def sinusoid_disturbance(study: Comparison) -> Finding:
    """F6: with two sines up to 10 Hz the disturbance lies orders below the output."""
    values: dict[str, float] = {}
    passed = {WHOLE: 0, POWERED: 0}
    repeated, pulses, powered = [], [], []
    expected = {"shoulder_yaw": 2.0, "shoulder_pitch": 1.0, "elbow_pitch": 1.0}
    for joint, result in study.nonparametric.items():
        spectrum = spectrum_of(study, SINES, joint)
        # The line at 10 Hz counts whole.
        near = spectrum.frequencies <= FASTEST + result.resolution_hz(SINES)
        for way, mask in _frequency_masks(spectrum).items():
            orders = values[f"{joint}, {NAMED[way]}"] = _orders(spectrum, near & mask)
            passed[way] += orders >= expected[joint]
        powered.append(100 * float(excited_lines(spectrum)[near].mean()))
        again = result.repeated[SINES]
        lines = again.frequencies <= FASTEST + result.resolution_hz(SINES)
        repeated.append(float(np.log10(again.output[lines].sum() / again.disturbance[lines].sum())))
        if PULSE in result.spectra:
            pulse = result.spectra[PULSE]
            pulses.append(_orders(pulse, pulse.frequencies <= FASTEST + result.resolution_hz(PULSE)))
    decision, text = verdict_by_reading({way: (count, len(expected)) for way, count in passed.items()})
    return decided_finding(
        "F6",
        decision,
        values,
        f"orders of magnitude between the powers of output and disturbance up to {FASTEST:g} Hz: at least 2 (yaw), 1 "
        "(pitches)",
        f"{text}. " + _leaks(powered) + "Told apart by repetition from period to period the disturbance lies "
        f"{_span(repeated, '.1f')} orders below the output"
        + (f"; with the ramping pulse the estimator gives {_span(pulses, '.1f')} {WHOLE}" if pulses else ""),
    )


def _frequency_masks(spectrum: FrequencyResponse) -> dict[str, np.ndarray]:
    """Frequency masks of each reading of a claim on spectra."""
    return {WHOLE: np.ones(len(spectrum.frequencies), dtype=bool), POWERED: excited_lines(spectrum)}


def _leaks(powered: list[float]) -> str:
    """Describe the estimator between the lines, with the percent of frequencies at which the input has power."""
    return (
        "The disturbance of this estimator is the output less what correlates with the input; the input stands above "
        f"the window's side lobes at {_span(powered)} % of the frequencies only, and what the "
        "window leaks elsewhere counts as disturbance. "
    )


def _span(values: list[float], form: str = ".0f") -> str:
    """Smallest and largest value as text, or one number where both print the same."""
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _orders(spectrum: FrequencyResponse, mask: np.ndarray) -> float:
    return float(np.log10(_power(spectrum.output_spectrum)[mask].sum() / _power(spectrum.noise_spectrum)[mask].sum()))


def _share(inside: np.ndarray, density: np.ndarray) -> float:
    """Share of the power inside a band, percent."""
    return float(100 * density[inside].sum() / density.sum())


def _power(spectrum: np.ndarray | None) -> np.ndarray:
    """Density of one channel; negative or undetermined values of a lag window count as zero."""
    if spectrum is None:
        raise ValueError("the spectral estimate has no such spectrum")
    density = spectrum[:, 0, 0].real
    return np.where(np.isfinite(density), np.maximum(density, 0.0), 0.0)
