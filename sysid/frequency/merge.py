"""Frequency responses of several experiments merged into one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.models.frequency_response import FrequencyResponse
from sysid.records.errors import SysidError


def merge(responses: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Mean of independent measurements of one response, weighted by the inverses of their covariances.

    It is the estimate of greatest likelihood from all of them. Records of equal accuracy are better averaged before the
    division: `spa`, `spafdr`, `welch`, `etfe` and `bla` take a list of experiments.

    Args:
        responses: Responses with covariance, of the same channels at the same frequencies.

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
    weights = [np.linalg.pinv(one.full_covariance(), rcond=1e-12, hermitian=True) for one in parts]
    values = [np.stack((one.response.real, one.response.imag), axis=-1).reshape(nf, -1, 1) for one in parts]
    covariance = np.linalg.pinv(np.sum(weights, axis=0), rcond=1e-12, hermitian=True)
    weighted = np.sum([w @ v for w, v in zip(weights, values, strict=True)], axis=0)
    mean = (covariance @ weighted).reshape(nf, ny, nu, 2)
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
