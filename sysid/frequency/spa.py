"""Spectral analysis by the method of Blackman and Tukey."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sysid.frequency.spectra import checked_frequencies, coherence, powers, response_of_spectra
from sysid.frequency.unclaimed_errors import smoothing_messages
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.correlation import covariance_function, covariance_with_gaps
from sysid.polynomial.data_checks import check_excitation, large_means
from sysid.records.arguments import whole_number, window_values
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each

GRID = 512  # default number of frequencies
LAG = 30  # longest default lag, as in MATLAB: more resolution costs variance and is the user's choice
SHORT = 10  # shortest lag window whose end is judged
UNRELATED, UNDECAYED = 0.1, 0.2  # largest correlation of inputs, and of outputs relative to its peak, at its end
SIDE_LOBES = 0.01  # power relative to the peak: above the side lobes of the Hamming window, at -43 dB


def spa(
    data: IOData | Sequence[IOData],
    *,
    lag: int | None = None,
    window: Callable[[int], FloatArray] = np.hamming,
    frequencies: ArrayLike | None = None,
) -> FrequencyResponse:
    """Frequency response and spectra from windowed covariance functions [Ljung1999, sec. 6.4].

    Phi(f) = dt sum_tau w(tau) R(tau) exp(-2 pi i f dt tau) with the lag window w; G = Phi_yu Phi_u^-1;
    disturbance Phi_v = Phi_y - Phi_yu Phi_u^-1 Phi_uy (in SISO Phi_y - |Phi_yu|^2 / Phi_u). Detrend first: a mean
    leaks into the lowest frequencies. Intervals include the variance, not the bias by smoothing over about
    1 / (lag dt) Hz: near a sharp resonance, and for frequencies below that, use a longer lag. A response that changes
    within that width counts as disturbance; a test warns of it.

    Missing outputs enter as zeros and widen the intervals as one more disturbance; with little noise this costs far
    more than the missing samples: use `data.complete_parts()` if the parts are long.

    Args:
        data: One experiment, or several whose covariances are averaged; any numbers of inputs and outputs. Of a time
            series the disturbance is the output itself.
        lag: Length of the lag window; by default a tenth of the samples, 30 at most.
        window: Lag window: 2 lag + 1 values, 1 in the middle, e.g. `np.hamming`, `np.bartlett`,
            `scipy.signal.windows.parzen`. The last two cannot give a negative spectrum; where another one makes
            that of the disturbance negative, it and the covariance are those of the Parzen window of the same lag.
        frequencies: Hz (nf,); by default 512 values, evenly spaced up to Nyquist, without 0.

    Returns:
        Response with covariance [Ljung1999, sec. 6.4], coherence, and the four spectra (two-sided, unit^2/Hz).
        Response and covariance are NaN where the input has no significant power.

    Warns:
        SysidWarning: Means that dominate, inputs that depend on each other, a window shorter than the response, no
            frequency at which the inputs have power; a response that changes within the width of the smoothing.

    Raises:
        SysidError: Constant input, lag not between 1 and N - 1, an invalid window, frequencies beyond Nyquist.
    """
    experiments = tuple(e.scored for e in as_experiments(data, missing=True, series=True))
    warn_each(check_excitation(experiments, [0] * experiments[0].nu) + large_means(experiments))
    dt, nu = experiments[0].dt, experiments[0].nu
    samples = sum(len(e) for e in experiments)
    shortest = min(len(e) for e in experiments)
    if shortest < 2:
        raise SysidError(f"too few samples: {shortest} behind the initialisation window, at least 2 are needed")
    default_lag = max(1, min(samples // 10, LAG, shortest - 1))
    m = whole_number("lag", default_lag if lag is None else lag, 1, shortest - 1)
    f = np.arange(1, GRID + 1) / GRID * (0.5 / dt)
    if frequencies is not None:
        f = checked_frequencies(frequencies, dt)
    complete = all(e.complete for e in experiments)
    y = [e.y for e in experiments] if complete else _filled(experiments)
    z = [np.hstack((e.u, outputs)) for e, outputs in zip(experiments, y, strict=True)]
    weights = window_values(window, 2 * m + 1)
    if not np.isclose(weights[m], 1.0) or not np.allclose(weights, weights[::-1]):
        raise SysidError(f"window({2 * m + 1}) must be symmetric round a 1 in the middle")
    covariances = covariance_function(z, z, m)
    if m >= SHORT and nu and _truncated(covariances, nu, samples):
        message = (
            f"the lag window of {m} samples is shorter than the response: the estimate is smoothed; use a longer lag"
        )
        warnings.warn(message, SysidWarning, stacklevel=2)
    phi = _spectra(weights, covariances, nu, f, dt)
    response = response_of_spectra("spa", experiments, f, phi, averages=samples / float(weights @ weights))
    if not complete:
        return _with_gaps(response, experiments, weights)
    warn_each(smoothing_messages(experiments, response, "use a longer lag"))
    # the spectrum of the disturbance is negative somewhere, beyond rounding
    noise, output = powers(np.asarray(response.noise_spectrum)), powers(phi[:, nu:, nu:])
    negative = (noise < -1e-9 * np.abs(output)).any(axis=1)
    if not negative.any():
        return response
    with warnings.catch_warnings():
        # reported above
        warnings.simplefilter("ignore", SysidWarning)
        positive = spa(experiments, lag=m, window=scipy.signal.windows.parzen, frequencies=f)
    power = np.linalg.eigvalsh(phi[:, :nu, :nu])[:, :1]
    # An input below the side lobes of its peak determines nothing, whatever the window.
    determined = (power > SIDE_LOBES * power.max(initial=0.0)).all(axis=1)
    return _with_disturbance_of(positive, response, negative & determined)


def _spectra(weights: FloatArray, covariances: FloatArray, nu: int, f: FloatArray, dt: float) -> ComplexArray:
    """Spectra of inputs and outputs together (nf, nu + ny, nu + ny), the inputs first."""
    inputs, outputs = slice(nu), slice(nu, None)

    def transform(rows: slice, columns: slice) -> ComplexArray:
        return _transform(weights, covariances[:, rows, columns], f, dt)

    return np.block(
        [
            [transform(inputs, inputs), transform(inputs, outputs)],
            [transform(outputs, inputs), transform(outputs, outputs)],
        ]
    )


def _with_disturbance_of(
    positive: FrequencyResponse, response: FrequencyResponse, at: NDArray[np.bool_]
) -> FrequencyResponse:
    """The response with disturbance and covariance of another one at some frequencies (nf,)."""
    noise = np.where(at[:, None, None], np.asarray(positive.noise_spectrum), np.asarray(response.noise_spectrum))
    of_entries = at[:, None, None, None, None]
    covariance = np.where(of_entries, np.asarray(positive.covariance), np.asarray(response.covariance))
    return replace(response, noise_spectrum=noise, covariance=covariance)


def _truncated(covariances: FloatArray, nu: int, samples: int) -> bool:
    """Whether outputs still correlate with an input at the end of the window, where inputs no longer correlate."""
    of_inputs, cross = covariances[:, :nu, :nu], covariances[:, nu:, :nu]
    end = slice(-max(len(covariances) // 20, 1), None)
    inputs_decay = np.abs(of_inputs[end]).max() < UNRELATED * np.abs(of_inputs).max()
    if not inputs_decay:
        # inputs of long memory: the cross covariance says nothing about the response there
        return False
    deviations = np.sqrt(np.diagonal(covariances[len(covariances) // 2]))
    # six standard deviations of the covariance of unrelated white signals
    significant = 6.0 * (deviations[nu:, None] * deviations[:nu]) / np.sqrt(samples)
    at_end, peak = np.abs(cross[end]).max(axis=0), np.abs(cross).max(axis=0)
    return bool(((at_end > UNDECAYED * peak) & (at_end > significant)).any())


def _filled(experiments: Sequence[IOData]) -> list[FloatArray]:
    """Outputs with zeros in their gaps, divided by the share of known samples.

    Its mean over gaps that are independent of the signal is the output; the difference is one more disturbance,
    independent of the input, so that response and covariance hold as without gaps.
    """
    share = np.concatenate([e.known for e in experiments]).mean(axis=0)
    return [np.nan_to_num(e.y, nan=0.0) / share for e in experiments]


def _with_gaps(response: FrequencyResponse, experiments: Sequence[IOData], weights: FloatArray) -> FrequencyResponse:
    """Remove the contribution of the gaps from output spectrum, disturbance and coherence."""
    y = [e.y for e in experiments]
    phi_y = _transform(weights, covariance_with_gaps(y, y, len(weights) // 2), response.frequencies, response.dt)
    g, phi_u, phi_yu = map(np.asarray, (response.response, response.input_spectrum, response.cross_spectrum))
    return replace(
        response,
        output_spectrum=phi_y,
        noise_spectrum=phi_y - np.nan_to_num(g) @ phi_yu.conj().transpose(0, 2, 1),
        coherence=coherence(phi_u, phi_y, phi_yu),
    )


def _transform(window: FloatArray, covariances: FloatArray, f: FloatArray, dt: float) -> ComplexArray:
    """Fourier transform dt sum_tau w(tau) R(tau) exp(-2 pi i f dt tau) of covariance functions, entry by entry."""
    m = len(window) // 2
    weighted = (window[:, None, None] * covariances).reshape(len(window), -1)
    lags = np.arange(-m, m + 1)
    out = np.empty((len(f), weighted.shape[1]), dtype=complex)
    # in blocks: a long window on a fine grid would need much memory
    blocks = max(1, len(f) * len(lags) // 2_000_000 + 1)
    for block in np.array_split(np.arange(len(f)), blocks):
        out[block] = np.exp(-2j * np.pi * dt * np.outer(f[block], lags)) @ weighted
    return np.asarray(dt * out.reshape(len(f), *covariances.shape[1:]), dtype=np.complex128)
