"""Spectral analysis by the method of Blackman and Tukey."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sysid.arrays import ComplexArray, FloatArray, real_array
from sysid.correlation import covariance_function
from sysid.data import IOData, as_experiments
from sysid.errors import SysidError
from sysid.excitation import check_excitation
from sysid.frequency import FrequencyResponse

GRID = 512


def spa(
    data: IOData | Sequence[IOData], *, lag: int | None = None, frequencies: ArrayLike | None = None
) -> FrequencyResponse:
    """Frequency response and spectra from windowed covariance functions [Ljung1999, sec. 6.4].

    Phi(f) = dt sum_tau w(tau) R(tau) exp(-2 pi i f dt tau) with a Hamming lag window; G = Phi_yu Phi_u^-1;
    disturbance Phi_v = Phi_y - Phi_yu Phi_u^-1 Phi_uy (in SISO Phi_y - |Phi_yu|^2 / Phi_u). Detrend first: a mean
    leaks into the lowest frequencies.

    Args:
        data: One experiment, or several whose covariances are averaged; any numbers of inputs and outputs.
        lag: Length of the lag window; by default a tenth of the samples.
        frequencies: Hz (nf,); by default 512 values, evenly spaced up to Nyquist, without 0.

    Returns:
        Response with covariance [Ljung1999, eqs. 6.62, 6.63], coherence, and the four spectra (two-sided, unit^2/Hz).
        Response and covariance are NaN where the input has no power to speak of.

    Raises:
        SysidError: Constant input, lag not between 1 and N - 1, frequencies beyond Nyquist.
    """
    experiments = as_experiments(data)
    check_excitation(experiments, [0] * experiments[0].nu)
    dt = experiments[0].dt
    samples = sum(len(e) for e in experiments)
    shortest = min(len(e) for e in experiments)
    m = max(1, min(samples // 10, shortest - 1)) if lag is None else lag
    if isinstance(m, bool) or not isinstance(m, int | np.integer) or not 1 <= m < shortest:
        raise SysidError(f"lag must be a whole number from 1 to {shortest - 1}, got {lag!r}")
    f = (
        np.arange(1, GRID + 1) / GRID * (0.5 / dt)
        if frequencies is None
        else np.atleast_1d(real_array("frequencies", frequencies))
    )
    if f.min() < 0.0 or f.max() > 0.5 / dt * (1 + 1e-12):
        raise SysidError(f"frequencies must lie between 0 and Nyquist ({0.5 / dt} Hz), got {f.min()} to {f.max()} Hz")
    u, y = [e.u for e in experiments], [e.y for e in experiments]
    window = np.hamming(2 * m + 1)
    phi_u, phi_y, phi_yu = (
        _transform(window, covariance_function(a, b, m), f, dt) for a, b in ((u, u), (y, y), (y, u))
    )
    power = np.einsum("fjj->fj", phi_u).real
    silent = np.linalg.eigvalsh(phi_u)[:, 0] <= 1e-12 * power.max()
    safe = np.where(silent[:, None, None], np.eye(phi_u.shape[1]), phi_u)
    inverse = np.linalg.inv(safe)
    g = phi_yu @ inverse
    g[silent] = 0.0
    phi_v = phi_y - g @ phi_yu.conj().transpose(0, 2, 1)
    noise = np.einsum("fii->fi", phi_v).real
    output_power = np.maximum(np.einsum("fii->fi", phi_y).real, np.finfo(float).tiny)
    # the window leaks into nulls of the input; where that explains more than the output has, nothing is known
    noise = np.where(noise < -1e-9 * output_power, np.nan, np.maximum(noise, 0.0))
    gain = np.maximum(np.einsum("fjj->fj", inverse).real, 0.0)
    variance = float(window @ window) / samples * noise[:, :, None] * gain[:, None, :]
    products = output_power[:, :, None] * np.maximum(power, 0.0)[:, None, :]
    audible = products > 1e-24 * products.max()
    coherence = np.where(audible, np.abs(phi_yu) ** 2 / np.where(audible, products, 1.0), 0.0)
    covariance = _complex_covariance(variance, f, dt)
    g[silent] = np.nan
    covariance[silent] = np.nan
    return FrequencyResponse(
        frequencies=f,
        response=g,
        dt=dt,
        method="spa",
        covariance=covariance,
        coherence=np.clip(coherence, 0.0, 1.0),
        noise_spectrum=phi_v,
        input_spectrum=phi_u,
        output_spectrum=phi_y,
        cross_spectrum=phi_yu,
        input_names=experiments[0].input_names or (),
        output_names=experiments[0].output_names or (),
    )


def _transform(window: FloatArray, covariances: FloatArray, f: FloatArray, dt: float) -> ComplexArray:
    m = len(window) // 2
    weighted = (window[:, None, None] * covariances).reshape(len(window), -1)
    lags = np.arange(-m, m + 1)
    out = np.empty((len(f), weighted.shape[1]), dtype=complex)
    # in pieces, so that a long window on a fine grid needs little memory
    for part in np.array_split(np.arange(len(f)), max(1, len(f) * len(lags) // 2_000_000 + 1)):
        out[part] = np.exp(-2j * np.pi * dt * np.outer(f[part], lags)) @ weighted
    return np.asarray(dt * out.reshape(len(f), *covariances.shape[1:]), dtype=np.complex128)


def _complex_covariance(variance: FloatArray, f: FloatArray, dt: float) -> FloatArray:
    """Half of the variance in each part; all of it in the real part at 0 and at Nyquist, where the response is real."""
    out = np.zeros((*variance.shape, 2, 2))
    real = (f == 0.0) | np.isclose(f, 0.5 / dt)
    out[..., 0, 0] = np.where(real[:, None, None], 2.0, 0.5) * variance
    out[..., 1, 1] = np.where(real[:, None, None], 0.0, 0.5) * variance
    return out
