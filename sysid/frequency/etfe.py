"""The empirical transfer function estimate."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.frequency.spectra import SILENT, response_of_spectra
from sysid.frequency.unclaimed_errors import scatter_messages, smoothing_messages
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.data_checks import check_excitation
from sysid.records.arguments import whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, warn_each


def etfe(data: IOData | Sequence[IOData], *, smoothing: int = 0) -> FrequencyResponse:
    """Ratio of Fourier transforms Y(f) / U(f), smoothed over neighbours on request [Ljung1999, sec. 6.3].

    Without smoothing it is unbiased apart from transients, but its variance does not decrease with N: use it for a
    first look, and for periodic inputs, where it is consistent. Several experiments of equal length give
    sum(Y conj U) / sum |U|^2, and from two on a covariance. With smoothing the sums run over 2 smoothing + 1
    neighbouring frequencies too, weighted by a Hann window; one experiment then gives a covariance. The scatter of
    experiments with the same input shows noise alone, no nonlinear distortion: `bla` of several inputs does.
    Detrend first. Initialisation windows are omitted.

    Args:
        data: One experiment with one input, or several of equal length.
        smoothing: Neighbours on either side, in steps of 1 / (N dt).

    Returns:
        Response at the frequencies k / (N dt), k >= 1, at which the input has power; with smoothing the spectra too.

    Warns:
        SysidWarning: A response that scatters from line to line by more than the deviations, as distortion that repeats
            makes it; with smoothing one that changes within its width.

    Raises:
        SysidError: Several inputs, constant input, experiments of different length, more neighbours than frequencies.
    """
    experiments = tuple(e.scored for e in as_experiments(data))
    first = experiments[0]
    if first.nu != 1:
        raise SysidError(f"etfe takes one input, got {first.nu}: use spa, or data.select(inputs=[...])")
    if len({len(e) for e in experiments}) > 1:
        raise SysidError(f"etfe needs experiments of equal length, got {[len(e) for e in experiments]} samples")
    n = len(first)
    if n < 2:
        raise SysidError(f"too few samples: {n} behind the initialisation window, at least 2 are needed")
    smoothing = whole_number("smoothing", smoothing, 0, n // 2 - 1)
    check_excitation(experiments, [0])
    # (experiments, N, channels), both signs of the frequency: smoothing wraps around 0 and Nyquist
    u = np.array([scipy.fft.fft(e.u, axis=0) for e in experiments])
    y = np.array([scipy.fft.fft(e.y, axis=0) for e in experiments])
    f = scipy.fft.rfftfreq(n, first.dt)[1:]
    if smoothing:
        return _smoothed(experiments, u, y, f, smoothing)
    u, y = u[:, 1 : len(f) + 1], y[:, 1 : len(f) + 1]
    power = np.sum(np.abs(u) ** 2, axis=0)
    excited = power[:, 0] > SILENT * power.max()
    response = np.sum(y * u.conj(), axis=0)[excited] / power[excited]
    covariance = freedom = None
    r = len(experiments)
    if r > 1:
        # the common response takes one degree of freedom of every line
        errors = y[:, excited] - response * u[:, excited]
        variance = np.sum(np.abs(errors) ** 2, axis=0) / (r - 1) / power[excited]
        covariance = 0.5 * variance[:, :, None, None, None] * np.eye(2)
        freedom = 2.0 * (r - 1)
        lines = f[excited], response[:, :, None], variance[:, :, None]
        warn_each(scatter_messages(*lines, power[excited, 0], freedom))
    return FrequencyResponse(
        frequencies=f[excited],
        response=response[:, :, None],
        dt=first.dt,
        method="etfe",
        covariance=covariance,
        degrees_of_freedom=freedom,
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )


def _smoothed(
    experiments: Sequence[IOData], u: ComplexArray, y: ComplexArray, f: FloatArray, smoothing: int
) -> FrequencyResponse:
    """Response from spectra that are averaged over neighbouring lines under a Hann window."""
    # without the zeros at its ends
    weights = np.hanning(2 * smoothing + 3)[1:-1]
    weights /= weights.sum()
    n = u.shape[1]

    def over_neighbours(products: ComplexArray, w: FloatArray) -> ComplexArray:
        return np.asarray(scipy.ndimage.convolve1d(products.sum(axis=0), w, axis=0, mode="wrap"))[1 : len(f) + 1]

    scale = experiments[0].dt / (n * len(experiments))
    z = np.concatenate((u, y), axis=2)
    products = z[:, :, :, None] * z[:, :, None, :].conj()
    phi = scale * over_neighbours(products, weights)
    averages = len(experiments) / float(np.sum(weights**2))
    # with input lines of unequal power, fewer of them determine the estimate
    input_power = phi[:, 0, 0].real
    squares = scale * over_neighbours(products[..., 0, 0], weights**2).real
    effective = len(experiments) * input_power / np.where(squares > 0.0, squares, 1.0)
    effective = np.maximum(effective, 1e-12)
    response = response_of_spectra("etfe", experiments, f, phi, averages=averages, weights=effective)
    warn_each(smoothing_messages(experiments, response, "smooth over fewer neighbours"))
    return response
