"""Spectral analysis with a resolution that depends on frequency."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.frequency.spectra import checked_frequencies, response_of_spectra
from sysid.frequency.unclaimed_errors import smoothing_messages
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.data_checks import check_excitation, large_means
from sysid.records.arrays import ComplexArray, real_array
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, warn_each

GRID = 100  # default number of frequencies
RELATIVE = 0.2  # default resolution, relative to the frequency
AVERAGES = 10.0  # least number of lines that the default resolution averages


def spafdr(
    data: IOData | Sequence[IOData], resolution: ArrayLike | None = None, frequencies: ArrayLike | None = None
) -> FrequencyResponse:
    """Frequency response and spectra, each frequency smoothed over its own width [Ljung1999, sec. 6.4].

    Periodograms are averaged under a Hann window over neighbouring frequencies. Wide windows at high frequencies
    remove the noise, narrow ones at low frequencies keep resonances. Response, disturbance, coherence and covariance
    follow as in `spa`. Detrend first. Initialisation windows are omitted.

    Args:
        data: One experiment, or several of any lengths; any numbers of inputs and outputs.
        resolution: Equivalent width of the window in Hz, one number or one per frequency (nf,); by default a fifth of
            the frequency, at least ten lines.
        frequencies: Hz (nf,); by default 100, logarithmically spaced up to Nyquist.

    Returns:
        Response with covariance, coherence, and the four spectra (two-sided, unit^2/Hz). Degrees of freedom are those
        of the frequency with the fewest averages.

    Warns:
        SysidWarning: Means that dominate, inputs that depend on each other, no frequency at which they have power; a
            response that changes within the width of the smoothing.

    Raises:
        SysidError: Constant input, frequencies not above 0 and up to Nyquist, a resolution that leaves too few lines.
    """
    experiments = tuple(e.scored for e in as_experiments(data))
    first = experiments[0]
    warn_each(check_excitation(experiments, [0] * first.nu) + large_means(experiments))
    samples, nyquist = sum(len(e) for e in experiments), 0.5 / first.dt
    line = 1.0 / (samples * first.dt)
    if frequencies is None:
        f = np.geomspace(min(AVERAGES * line, 0.1 * nyquist), nyquist, GRID)
    else:
        f = checked_frequencies(frequencies, first.dt, zero=False)
    widths = np.maximum(RELATIVE * f, AVERAGES * line)
    if resolution is not None:
        widths = real_array("resolution", resolution)
    if widths.shape not in ((), f.shape) or widths.min() <= 0.0:
        raise SysidError(f"resolution: expected a width above 0 Hz or {len(f)} of them, got shape {widths.shape}")
    widths = np.broadcast_to(widths, f.shape)
    lines = np.concatenate([scipy.fft.fftfreq(len(e), first.dt) for e in experiments])
    # of weight 1 / N each: the periodogram of a short experiment has few lines
    transforms = np.vstack([np.sqrt(first.dt / len(e)) * _transform(e) for e in experiments])
    nu, size = first.nu, first.nu + first.ny
    phi: ComplexArray = np.zeros((len(f), size, size), dtype=complex)
    averages, effective = np.zeros(len(f)), np.zeros(len(f))
    for k, width in enumerate(widths):
        # frequencies wrap around at Nyquist
        distance = np.abs((lines - f[k] + nyquist) % (2.0 * nyquist) - nyquist)
        # a Hann window of this equivalent width reaches 0.75 times as far to either side
        relative = distance / (0.75 * width)
        near = np.flatnonzero(relative < 1.0)
        if not len(near):
            # refused below
            continue
        weights = 1.0 + np.cos(np.pi * relative[near])
        weights, x = weights / weights.sum(), transforms[near]
        phi[k] = (x * weights[:, None]).T @ x.conj()
        averages[k] = 1.0 / float(weights @ weights)
        power = np.sum(np.abs(x[:, :nu]) ** 2, axis=1)
        # with input lines of unequal power, fewer of them determine the estimate
        effective[k] = float(weights @ power) / max(float(weights**2 @ power), np.finfo(float).tiny)
    if averages.min() <= nu:
        k = int(np.argmin(averages))
        raise SysidError(
            f"a resolution of {widths[k]:.3g} Hz at {f[k]:.3g} Hz has {averages[k]:.3g} lines {line:.3g} Hz apart; "
            f"with {nu} input(s) more than {nu} are needed: use a wider resolution or higher frequencies"
        )
    weights = np.maximum(effective, 1e-12)
    response = response_of_spectra("spafdr", experiments, f, phi, averages=averages, weights=weights)
    warn_each(smoothing_messages(experiments, response, "use a finer resolution"))
    return response


def _transform(experiment: IOData) -> ComplexArray:
    """Fourier transform of inputs and outputs, both signs of the frequency (N, nu + ny)."""
    return np.asarray(scipy.fft.fft(np.hstack((experiment.u, experiment.y)), axis=0))
