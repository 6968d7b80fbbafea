"""Frequency response, disturbance, coherence and covariance from smoothed spectra."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.models.frequency_response import FrequencyResponse, complex_covariance
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning


def response_of_spectra(
    method: str,
    experiments: Sequence[IOData],
    f: FloatArray,
    phi_u: ComplexArray,
    phi_y: ComplexArray,
    phi_yu: ComplexArray,
    *,
    averages: float | FloatArray,
    weights: FloatArray | None = None,
) -> FrequencyResponse:
    """G = Phi_yu Phi_u^-1, disturbance Phi_v = Phi_y - Phi_yu Phi_u^-1 Phi_uy, coherence, covariance.

    The variance of G is Phi_v / (K Phi_u) with K the number of independent averages that the smoothing amounts to
    [Ljung1999, sec. 6.4]; the variance corrects Phi_v for the nu averages that the fit of G removes from it.

    Args:
        method: Name of the estimator.
        experiments: The experiments.
        f: Hz (nf,).
        phi_u: Input spectrum (nf, nu, nu).
        phi_y: Output spectrum (nf, ny, ny).
        phi_yu: Cross spectrum (nf, ny, nu).
        averages: K, for all frequencies or for each (nf,); intervals use Student's distribution with the smallest
            2 (K - nu) degrees of freedom.
        weights: K per frequency (nf,) for the variance, if the lines of the input differ in power.

    Raises:
        SysidError: Not more averages than inputs: the fit would be exact for any data.
    """
    first = experiments[0]
    nu = phi_u.shape[1]
    count = np.broadcast_to(averages, f.shape)
    if count.min() <= nu:
        raise SysidError(
            f"the smoothing amounts to {count.min():.3g} independent averages, with {nu} input(s) more than {nu} are "
            "needed: use a shorter lag window, shorter segments, or more neighbours"
        )
    power = np.einsum("fjj->fj", phi_u).real
    silent = (np.linalg.eigvalsh(phi_u)[:, :1] <= 1e-12 * power.max(initial=0.0)).any(axis=1)
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
    g[silent] = 0.0
    phi_v = phi_y - g @ phi_yu.conj().transpose(0, 2, 1)
    noise = np.einsum("fii->fi", phi_v).real
    output_power = np.maximum(np.einsum("fii->fi", phi_y).real, np.finfo(float).tiny)
    # the window leaks into nulls of the input; a negative noise power there means that nothing is determined
    noise = np.where(noise < -1e-9 * output_power, np.nan, np.maximum(noise, 0.0))
    noise = noise * count[:, None] / (count - nu)[:, None]
    gain = np.maximum(np.einsum("fjj->fj", inverse).real, 0.0)
    effective = count if weights is None else weights
    variance = noise[:, :, None] * gain[:, None, :] / effective[:, None, None]
    products = output_power[:, :, None] * np.maximum(power, 0.0)[:, None, :]
    significant = products > 1e-24 * products.max(initial=0.0)
    coherence = np.where(significant, np.abs(phi_yu) ** 2 / np.where(significant, products, 1.0), 0.0)
    covariance = complex_covariance(variance, f, first.dt)
    g[silent] = np.nan
    covariance[silent] = np.nan
    return FrequencyResponse(
        frequencies=f,
        response=g,
        dt=first.dt,
        method=method,
        covariance=covariance,
        coherence=np.clip(coherence, 0.0, 1.0),
        noise_spectrum=phi_v,
        input_spectrum=phi_u,
        output_spectrum=phi_y,
        cross_spectrum=phi_yu,
        degrees_of_freedom=2.0 * (float(count.min()) - nu),
        # K averages of a record of T seconds smooth over K / T Hz
        resolution=effective / (sum(len(e) for e in experiments) * first.dt),
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )
