"""Frequency responses of several experiments merged into one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.models.frequency_response import FrequencyResponse
from sysid.records.errors import SysidError

EXACT = 1e-12  # variance of an exact value, relative to the largest of the same entry


def merge(responses: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Mean of independent measurements of one response, weighted by the inverses of their covariances.

    It is the estimate of greatest likelihood from all of them. Records of equal accuracy are better averaged before the
    division: `spa`, `spafdr`, `welch`, `etfe` and `bla` take a list of experiments.

    Args:
        responses: Responses with covariance, of the same channels at the same frequencies; where some are NaN the
            others count.

    Returns:
        Response, covariance of all its entries, and the sum of the degrees of freedom.

    Raises:
        SysidError: No response, one without covariance, other frequencies, sampling intervals or channels.
    """
    parts = list(responses) if isinstance(responses, Sequence) else []
    if not parts or not all(isinstance(one, FrequencyResponse) for one in parts):
        raise SysidError("expected a list of FrequencyResponse; estimators take a list of experiments themselves")
    first = parts[0]
    nf, ny, nu = first.response.shape
    for k, one in enumerate(parts[1:], 1):
        same = one.response.shape == first.response.shape and np.isclose(one.dt, first.dt, rtol=1e-9)
        if not same or not np.allclose(one.frequencies, first.frequencies, rtol=1e-9, atol=0.0):
            raise SysidError(f"response {k} has other frequencies, sampling interval or channels than response 0")
        if (one.input_names, one.output_names) != (first.input_names, first.output_names):
            raise SysidError(f"the channels of response {k} have other names than those of response 0")
    size = 2 * ny * nu
    determined = [one.determined() for one in parts]
    known = np.array([np.isin(one.frequencies, few.frequencies) for one, few in zip(parts, determined, strict=True)])
    values, covariances = np.zeros((len(parts), nf, size, 1)), np.zeros((len(parts), nf, size, size))
    for k, (measured, at) in enumerate(zip(determined, known, strict=True)):
        values[k, at] = np.stack((measured.response.real, measured.response.imag), axis=-1).reshape(-1, size, 1)
        covariances[k, at] = measured.full_covariance()
    deviation = np.sqrt(np.einsum("kfpp->kfp", covariances).max(axis=0))[..., None]
    unit = np.where(deviation > 0.0, deviation, 1.0)
    # exact values, as imaginary parts at 0 Hz, have nearly all the weight but no infinite one
    relative = covariances / (unit * unit.transpose(0, 2, 1)) + EXACT * np.eye(size)
    weights = np.where(known[..., None, None], np.linalg.inv(relative), 0.0)
    nothing = np.logical_not(np.any(known, axis=0)).reshape(-1, 1, 1)
    joined = np.linalg.inv(weights.sum(axis=0) + nothing * np.eye(size)) + np.where(nothing, np.nan, 0.0)
    mean = (unit * (joined @ (weights @ (values / unit)).sum(axis=0))).reshape(nf, ny, nu, 2)
    covariance = joined * deviation * deviation.transpose(0, 2, 1)
    blocks = covariance.reshape(nf, ny * nu, 2, ny * nu, 2)
    joint = blocks[:, :, 0, :, 0] + blocks[:, :, 1, :, 1] + 1j * (blocks[:, :, 1, :, 0] - blocks[:, :, 0, :, 1])
    freedoms = [one.degrees_of_freedom for one in parts if one.degrees_of_freedom is not None]
    widths = [one.resolution for one in parts if one.resolution is not None]
    return replace(
        FrequencyResponse(first.frequencies, mean[..., 0] + 1j * mean[..., 1], first.dt, "merge"),
        covariance=np.einsum("fepeq->fepq", blocks).reshape(nf, ny, nu, 2, 2),
        joint_covariance=joint,
        resolution=np.max(widths, axis=0) if widths else None,
        degrees_of_freedom=float(sum(freedoms)) if len(freedoms) == len(parts) else None,
        input_names=first.input_names,
        output_names=first.output_names,
    )
