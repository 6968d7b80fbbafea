"""Nonparametric estimates of the frequency response, with spectra averaged over periods."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal.windows import parzen

import sysid
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import POINTS
from scenarios.identification.identification import long_lag
from scenarios.record_figures.period_spectra import FEWEST, PeriodSpectra, period_spectra
from scenarios.thesis.campaign import Campaign
from sysid import FrequencyResponse, IOData
from sysid.frequency import CovarianceFunction, DelayEstimate, ImpulseResponse
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from sysid.polynomial.correlation import prewhitened

SINES, PRBS, PULSE = 4, 5, 7
"""Numbers of the single-joint tests that chapter III rests on [Morris1996, table 1]."""

GRID = np.linspace(0.05, 25.0, 500)
"""Frequencies of windowed spectra, Hz: the lines of every waveform lie on them."""

LAGS = 125
"""Largest lag of the correlations, samples: beyond the 100 after which a waveform repeats."""

PULSE_LAGS = 40
"""Largest lag of the pulse response, samples: long enough for it to fade, well below the period of the input, beyond
which responses to this pulse and to the next cannot be told apart."""

WHITENING = 10
"""Coefficients of the filter that makes the PRBS white: the default of the toolbox that the thesis used."""

OCTAVE = 2.0
"""Widest gap between two known gains, as a ratio of frequencies, that a crossing is interpolated over."""


@dataclass(frozen=True)
class RecordSummary:
    """One record of one joint in a row of a table.

    Attributes:
        half_power_hz: Where the gain on them falls below 0.707, Hz; None where the lines do not reach from above it to
            below it.
        peak_lag: First lag at which the cross-correlation is largest, samples: delay and dynamics together.
        disturbance_percent: Power of what does not follow the input from period to period, percent of the output's.
    """

    half_power_hz: float | None
    peak_lag: int
    disturbance_percent: float


@dataclass(frozen=True, eq=False)
class Nonparametric:
    """Nonparametric estimates from the records of one joint.

    Attributes:
        spectra: Windowed spectra by number of the test, with the response that is their ratio: Hamming window, lag a
            tenth of the samples.
        resolution_hz: Half-width of their windows, to the first zero, Hz.
        repeated: Spectra by repetition, by number of the test.
        positive: Response from the two sines by the Parzen window of the same lag, whose side lobes are 53 dB down, not
            43.
        covariances: Covariance functions of the PRBS record.
        whitened: The same, both signals filtered so that the input is white.
        pulse: Pulse response from its correlations, the input made white.
        delay: First significant lag of those correlations.
        tests: Every record of the joint by name of the scenario; empty where only findings are asked for.
    """

    spectra: Mapping[int, FrequencyResponse]
    resolution_hz: Mapping[int, float]
    repeated: Mapping[int, PeriodSpectra]
    positive: FrequencyResponse | None
    covariances: CovarianceFunction
    whitened: CovarianceFunction
    pulse: ImpulseResponse
    delay: DelayEstimate
    tests: Mapping[str, RecordSummary]


def nonparametric(joint: str, campaign: Campaign, *, summaries: bool = True) -> Nonparametric:
    """Analyse the records of one joint; a test other than the PRBS whose record is missing is left out.

    With summaries every record gets its row, beside the three analyses of the thesis.
    """
    binary = campaign.single(PRBS, joint)
    # The record filtered so that its input is white, without the start-up of the filter.
    ((u, y),) = prewhitened([binary], 0, WHITENING)
    white = replace(binary, u=u, y=y)[WHITENING:]
    spectra: dict[int, FrequencyResponse] = {}
    resolution_hz: dict[int, float] = {}
    repeated = {PRBS: _spectra_by_repetition(binary, PRBS, joint)}
    positive = None
    for test in (SINES, PULSE):
        if single_joint_test(test, joint) not in campaign.logs:
            continue
        record = campaign.single(test, joint)
        lag = long_lag(record)
        spectra[test] = sysid.spa(record, lag=lag, frequencies=GRID)
        resolution_hz[test] = SAMPLE_RATE / lag
        repeated[test] = _spectra_by_repetition(record, test, joint)
        if test == SINES:
            positive = sysid.spa(record, lag=lag, window=parzen, frequencies=GRID)
    tests = _summaries(joint, campaign) if summaries else {}
    return Nonparametric(
        spectra=spectra,
        resolution_hz=resolution_hz,
        repeated=repeated,
        positive=positive,
        covariances=sysid.covf(binary, lags=LAGS),
        whitened=sysid.covf(white, lags=LAGS),
        pulse=sysid.cra(binary, lags=PULSE_LAGS, whitening=WHITENING),
        delay=sysid.delayest(binary, whitening=WHITENING),
        tests=tests,
    )


def _spectra_by_repetition(record: IOData, test: int, joint: str) -> PeriodSpectra:
    """Spectra of a single-joint test from blocks of the period of its waveform."""
    return period_spectra(record, load(single_joint_test(test, joint)).period)


def half_power(response: FrequencyResponse) -> float | None:
    """Return where the gain of one channel on known lines falls below 0.707, interpolated on logarithmic axes, Hz.

    None where the lines do not bracket it within an octave.
    """
    hz, f = gain_crossing(response, HALF_POWER), response.frequencies
    if not np.isfinite(hz):
        return None
    # Over a wider gap the gain may do anything.
    above = int(np.searchsorted(f, hz))
    return hz if f[above] <= OCTAVE * f[above - 1] else None


def _summaries(joint: str, campaign: Campaign) -> dict[str, RecordSummary]:
    """All records that move the joint and repeat often enough: its own tests and those of several joints."""
    summaries = {}
    for name in campaign.logs:
        # The exchange does not repeat; the tests of another joint do not move this one.
        of_another_joint = name.startswith("siso-") and not name.endswith(f"-{joint}")
        if name == RPCM or of_another_joint:
            continue
        record, period = campaign.record(name, joint), load(name).period
        if len(record) >= FEWEST * period:
            summaries[name] = summary(record, period)
    return summaries


def summary(data: IOData, period: int = POINTS) -> RecordSummary:
    """A record of one input and one output, settled, without means, whose input repeats after a period, in one row."""
    spectra = period_spectra(data, period)
    # Circular over the whole periods: the lag by which the output follows, up to one period.
    samples = len(data) // period * period
    mean_u, mean_y = (channel[:samples, 0].reshape(-1, period).mean(axis=0) for channel in (data.u, data.y))
    correlation = np.fft.irfft(np.fft.rfft(mean_y) * np.fft.rfft(mean_u).conj(), period)
    peaks = (correlation >= np.roll(correlation, 1)) & (correlation > np.roll(correlation, -1))
    # A tone reaches the same correlation every cycle: take the first peak among those within chance of the largest.
    nearest = int(np.argmax(peaks & (correlation > 0.99 * correlation.max())))
    return RecordSummary(
        half_power_hz=half_power(spectra.reliable_response()),
        peak_lag=nearest,
        disturbance_percent=100.0 * spectra.disturbance_share,
    )
