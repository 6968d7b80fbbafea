"""Tests for errors of a response that its deviations do not include: smoothing, and scatter from line to line."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.frequency.local_fit import SIGNIFICANT, SPARE, Lines, LocalFit, left_by_rational, tested_rows, where_in_words
from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData

DEGREE = 2  # of the polynomials, and of the rational functions, that a response follows over a few lines
LEAST_SMOOTHING = 0.01  # share of the output's power that smoothing makes a disturbance, at least, to be told
WINDOW = 11  # lines over which a response is smooth
LEAST = 1e-12  # power of a scatter, relative to the response, below which it is none


def smoothing_messages(experiments: Sequence[IOData], response: FrequencyResponse, remedy: str) -> list[str]:
    """Warn where a response changes within the width that its estimate averages over, which counts as disturbance.

    About a frequency, a constant and a polynomial of second degree are fitted to the lines that the average takes in.
    An F test says whether the response changes there, the ratio of what both leave how much larger that makes the
    disturbance. Told is what exceeds the standard deviation that the spectrum of the disturbance claims, and a
    hundredth of the power of the output: a record almost without noise has no disturbance to be wrong about.

    Args:
        experiments: The records of the estimate.
        response: The estimate, with its resolution and degrees of freedom.
        remedy: What to change to resolve more, for the text.
    """
    if response.resolution is None or not response.degrees_of_freedom or not experiments[0].nu:
        return []
    longest = max(map(len, experiments))
    records = tuple(Lines.of(e) for e in experiments if len(e) == longest and e.complete)
    if not records:
        return []
    local = LocalFit(records, DEGREE, 0)
    duration, most = longest * response.dt, (len(records[0].frequencies) - 1) // 2
    f = response.frequencies
    asked = tested_rows(len(f))
    least = 1.0 + np.sqrt(2.0 / response.degrees_of_freedom)
    found = []
    for k in asked:
        width = min(round(0.5 * float(response.resolution[k]) * duration), most)
        if local.spare(width) < SPARE:
            continue
        p_value, ratio, share = local.of_constant(float(f[k]), width)
        if p_value < SIGNIFICANT / len(asked) and ratio > least and share > LEAST_SMOOTHING:
            found.append((ratio, float(f[k])))
    if not found:
        return []
    where = where_in_words(np.array([hz for _, hz in found]))
    ratio, hz = max(found)
    return [
        f"the response changes {where} within the width that the estimate averages over, which counts as disturbance: "
        f"its spectrum is too large, {ratio:.3g} times at {hz:.3g} Hz, and the response is smoothed there; {remedy}"
    ]


def scatter_messages(
    frequencies: FloatArray, response: ComplexArray, variance: FloatArray, power: FloatArray, freedom: float
) -> list[str]:
    """Warn of a response that scatters from line to line by more than its variance, as nonlinear distortion makes it.

    Eleven lines at a time are compared with a rational function of second degree [McKelvey2012] by an F test; Fisher's
    method joins the tests.

    Args:
        frequencies: Hz (nf,).
        response: Of independent lines (nf, ny, nu).
        variance: Mean of |error|^2 that is claimed, shape as `response`.
        power: Relative power of the excitation (nf,), by which lines are weighed.
        freedom: Degrees of freedom of the variance of a line.
    """
    windows = len(frequencies) // WINDOW
    if not windows:
        return []
    spare = WINDOW - 2 * DEGREE - 1
    statistics, scatter, claimed = np.zeros((3, *response.shape[1:]))
    for window in np.arange(windows * WINDOW).reshape(windows, WINDOW):
        distance = (frequencies[window] - frequencies[window].mean()) / (np.ptp(frequencies[window]) / 2.0)
        root = np.sqrt(power[window] / power[window].mean())
        weighted = root[:, None, None] * response[window]
        of_lines = np.empty(response.shape[1:])
        for entry in np.ndindex(*of_lines.shape):
            of_lines[entry] = left_by_rational(root, weighted[:, *entry], distance, DEGREE) / spare
        of_periods = np.mean(root[:, None, None] ** 2 * variance[window], axis=0)
        # without noise rounding, and the degree of the function, decide
        of_periods = np.maximum(of_periods, LEAST * np.mean(np.abs(weighted) ** 2, axis=0))
        of_periods = np.maximum(of_periods, np.finfo(float).tiny)
        statistics -= 2.0 * scipy.stats.f.logsf(of_lines / of_periods, 2 * spare, WINDOW * freedom)
        scatter, claimed = scatter + of_lines, claimed + of_periods
    p_values = scipy.stats.chi2.sf(statistics, 2 * windows)
    if p_values.min() * p_values.size > SIGNIFICANT:
        return []
    worst = np.unravel_index(np.argmin(p_values), p_values.shape)
    times = float(np.sqrt((scatter / claimed)[worst]))
    return [
        f"the response scatters from line to line by {times:.2g} times the deviations, which show noise between "
        "periods alone: nonlinear distortion repeats with the input, or the periods are too short for a sharp "
        "resonance; `lpm` counts such scatter, and `bla` of several sequences measures distortion"
    ]
