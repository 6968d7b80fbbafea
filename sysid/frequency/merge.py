"""Frequency responses of several experiments merged into one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

EXACT = 1e-12  # variance of an exact value, relative to the largest of the same entry


def merge(responses: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Average frequency responses, weighted by inverse covariance; MATLAB's `merge` takes data or estimated models.

    The responses are independent measurements of one system, such as `spa` of each experiment.

    The average is the maximum-likelihood estimate from all of them. Records of equal accuracy are better averaged
    before the division: `spa`, `spafdr`, `welch`, `etfe` and `bla` take a list of experiments.

    Args:
        responses: Responses with covariance, of the same channels at the same frequencies; where some are NaN the
            others count.

    Returns:
        Response, covariance of all its entries, and the sum of the degrees of freedom.

    Raises:
        SysidError: No response, one without covariance, other frequencies, sampling intervals or channels.
    """
    measurements = list(responses) if isinstance(responses, Sequence) else []
    _check_same_channels(measurements)
    first = measurements[0]
    nf, ny, nu = first.response.shape
    size = 2 * ny * nu
    usable = np.zeros((len(measurements), nf), dtype=bool)
    values, covariances = np.zeros((len(measurements), nf, size, 1)), np.zeros((len(measurements), nf, size, size))
    for k, measurement in enumerate(measurements):
        determined = measurement.determined()
        at = np.isin(measurement.frequencies, determined.frequencies)
        real_and_imaginary = np.stack((determined.response.real, determined.response.imag), axis=-1)
        usable[k] = at
        values[k, at] = real_and_imaginary.reshape(-1, size, 1)
        covariances[k, at] = determined.full_covariance()
    mean, covariance = _weighted_mean(values, covariances, usable)
    mean = mean.reshape(nf, ny, nu, 2)
    blocks = covariance.reshape(nf, ny * nu, 2, ny * nu, 2)
    # E e e* of e = x + i y, from the covariances of x and y
    real_part = blocks[:, :, 0, :, 0] + blocks[:, :, 1, :, 1]
    imaginary_part = blocks[:, :, 1, :, 0] - blocks[:, :, 0, :, 1]
    freedoms = [m.degrees_of_freedom for m in measurements if m.degrees_of_freedom is not None]
    widths = [m.resolution for m in measurements if m.resolution is not None]
    return replace(
        FrequencyResponse(first.frequencies, mean[..., 0] + 1j * mean[..., 1], first.dt, "merge"),
        covariance=np.einsum("fepeq->fepq", blocks).reshape(nf, ny, nu, 2, 2),
        joint_covariance=real_part + 1j * imaginary_part,
        resolution=np.max(widths, axis=0) if widths else None,
        degrees_of_freedom=float(sum(freedoms)) if len(freedoms) == len(measurements) else None,
        input_names=first.input_names,
        output_names=first.output_names,
    )


def _check_same_channels(measurements: Sequence[FrequencyResponse]) -> None:
    """Refuse what is no list of responses, and responses of other channels, frequencies or sampling intervals."""
    if not measurements or not all(isinstance(m, FrequencyResponse) for m in measurements):
        raise SysidError("expected a list of FrequencyResponse; estimators take a list of experiments themselves")
    first = measurements[0]
    for k, measurement in enumerate(measurements[1:], 1):
        same_shape = measurement.response.shape == first.response.shape
        same = same_shape and np.isclose(measurement.dt, first.dt, rtol=1e-9)
        if not same or not np.allclose(measurement.frequencies, first.frequencies, rtol=1e-9, atol=0.0):
            raise SysidError(f"response {k} has other frequencies, sampling interval or channels than response 0")
        if (measurement.input_names, measurement.output_names) != (first.input_names, first.output_names):
            raise SysidError(f"the channels of response {k} have other names than those of response 0")


def _weighted_mean(
    values: FloatArray, covariances: FloatArray, usable: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Mean (nf, p, 1) weighted by the inverse covariances, and its covariance (nf, p, p); NaN where nothing is usable.

    Args:
        values: Of each measurement (m, nf, p, 1), zero where not usable.
        covariances: Likewise (m, nf, p, p).
        usable: Mask of the usable values (m, nf).
    """
    size = covariances.shape[-1]
    deviation = np.sqrt(np.einsum("kfpp->kfp", covariances).max(axis=0))[..., None]
    # the largest deviation of an entry, to which EXACT is relative
    unit = np.where(deviation > 0.0, deviation, 1.0)
    # exact values, as imaginary parts at 0 Hz, have nearly all the weight but no infinite one
    relative = covariances / (unit * unit.transpose(0, 2, 1)) + EXACT * np.eye(size)
    weights = np.where(usable[..., None, None], np.linalg.inv(relative), 0.0)
    empty = np.logical_not(np.any(usable, axis=0)).reshape(-1, 1, 1)
    joined = np.linalg.inv(weights.sum(axis=0) + empty * np.eye(size)) + np.where(empty, np.nan, 0.0)
    mean = unit * (joined @ (weights @ (values / unit)).sum(axis=0))
    return mean, joined * deviation * deviation.transpose(0, 2, 1)
