"""Frequency response, disturbance, coherence and covariance from smoothed spectra."""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sysid.models.frequency_response import FrequencyResponse, complex_covariance
from sysid.records.arrays import ComplexArray, FloatArray, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

SILENT = 1e-20  # power of a line, relative to the strongest, that is rounding


def response_of_spectra(
    method: str,
    experiments: Sequence[IOData],
    f: FloatArray,
    phi: ComplexArray,
    *,
    averages: float | FloatArray,
    weights: FloatArray | None = None,
) -> FrequencyResponse:
    """G = Phi_yu Phi_u^-1, disturbance Phi_v = Phi_y - Phi_yu Phi_u^-1 Phi_uy, coherence, covariance.

    The variance of G is Phi_v / (K Phi_u) with K the number of independent averages that the smoothing amounts to
    [Ljung1999, sec. 6.4]; the variance corrects Phi_v for the nu averages that the fit of G removes from it. `phi` are
    the spectra of inputs and outputs together (nf, nu + ny, nu + ny) at the frequencies f, Hz. `averages` is K, for all
    frequencies or for each (nf,); intervals use Student's distribution with the smallest 2 (K - nu) degrees of freedom.
    `weights` is K per frequency for the variance, if the lines of the input differ in power.

    Raises:
        SysidError: Not more averages than inputs: the fit would be exact for any data.
    """
    first = experiments[0]
    nu = first.nu
    phi_u, phi_y, phi_yu = phi[:, :nu, :nu], phi[:, nu:, nu:], phi[:, nu:, :nu]
    count = np.broadcast_to(averages, f.shape)
    if count.min() <= nu:
        raise SysidError(
            f"the smoothing amounts to {count.min():.3g} independent averages, with {nu} input(s) more than {nu} are "
            "needed: use a shorter lag window, shorter segments, or more neighbours"
        )
    # also where inputs depend on each other one of their combinations has no power
    smallest_power = np.linalg.eigvalsh(phi_u)[:, :1]
    silent = (smallest_power <= 1e-12 * powers(phi_u).max(initial=0.0)).any(axis=1)
    if silent.all():
        warnings.warn(
            f"the inputs have no significant power, or are dependent, at all {len(f)} frequencies: the response is "
            "NaN; a pulse at the end of a window or a segment is lost",
            SysidWarning,
            stacklevel=3,
        )
    safe = np.where(silent[:, None, None], np.eye(nu), phi_u)
    inverse = np.linalg.inv(safe)
    g = phi_yu @ inverse
    # zero while the disturbance is computed, where no part of the output is explained; NaN in the result
    g[silent] = 0.0
    phi_v = phi_y - g @ phi_yu.conj().transpose(0, 2, 1)
    noise = _corrected_noise(phi_v, phi_y, count, nu)
    gain = np.maximum(powers(inverse), 0.0)
    effective = count if weights is None else weights
    variance = noise[:, :, None] * gain[:, None, :] / effective[:, None, None]
    covariance = complex_covariance(variance, f, first.dt)
    g[silent] = np.nan
    covariance[silent] = np.nan
    duration = sum(len(e) for e in experiments) * first.dt
    return FrequencyResponse(
        frequencies=f,
        response=g,
        dt=first.dt,
        method=method,
        covariance=covariance,
        coherence=coherence(phi_u, phi_y, phi_yu),
        noise_spectrum=phi_v,
        input_spectrum=phi_u,
        output_spectrum=phi_y,
        cross_spectrum=phi_yu,
        degrees_of_freedom=2.0 * (float(count.min()) - nu),
        # K averages of a record of T seconds smooth over K / T Hz
        resolution=effective / duration,
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )


def _corrected_noise(phi_v: ComplexArray, phi_y: ComplexArray, count: FloatArray, nu: int) -> FloatArray:
    """Power of the disturbance of each output (nf, ny), corrected for the averages that the fit removes from it."""
    noise = powers(phi_v)
    output_power = np.maximum(powers(phi_y), np.finfo(float).tiny)
    # the window leaks into nulls of the input; a negative noise power there means that nothing is determined
    noise = np.where(noise < -1e-9 * output_power, np.nan, np.maximum(noise, 0.0))
    return noise * count[:, None] / (count - nu)[:, None]


def powers(spectrum: NDArray[Any]) -> FloatArray:
    """Spectra of the single channels: the diagonal of (nf, n, n) as (nf, n)."""
    return np.asarray(np.einsum("fii->fi", spectrum).real)


def coherence(phi_u: ComplexArray, phi_y: ComplexArray, phi_yu: ComplexArray) -> FloatArray:
    """|Phi_yu|^2 / (Phi_y Phi_u) per pair (nf, ny, nu), 0 where there is no power."""
    products = np.maximum(powers(phi_y), 0.0)[:, :, None] * np.maximum(powers(phi_u), 0.0)[:, None, :]
    significant = products > 1e-24 * products.max(initial=0.0)
    ratio = np.abs(phi_yu) ** 2 / np.where(significant, products, 1.0)
    return np.clip(np.where(significant, ratio, 0.0), 0.0, 1.0)


def checked_frequencies(frequencies: ArrayLike, dt: float, *, zero: bool = True) -> FloatArray:
    """Frequencies (nf,), Hz, from 0 or above it up to Nyquist."""
    f, nyquist = np.atleast_1d(real_array("frequencies", frequencies)), 0.5 / dt
    if f.ndim != 1 or not len(f):
        raise SysidError(f"frequencies: expected a list of at least one, got an array of shape {f.shape}")
    if f.min() < 0.0 or (f.min() == 0.0 and not zero) or f.max() > nyquist * (1 + 1e-12):
        bounds = "between 0 and Nyquist" if zero else "above 0 and up to Nyquist"
        raise SysidError(f"frequencies must lie {bounds} ({nyquist} Hz), got {f.min()} to {f.max()} Hz")
    return f
