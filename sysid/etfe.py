"""The empirical transfer function estimate."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import rfft, rfftfreq

from sysid.data import IOData, as_experiments
from sysid.errors import SysidError
from sysid.excitation import check_excitation
from sysid.frequency import FrequencyResponse

SILENT = 1e-20


def etfe(data: IOData | Sequence[IOData]) -> FrequencyResponse:
    """Ratio of Fourier transforms Y(f) / U(f) [Ljung1999, eq. 6.24].

    Unbiased apart from transients, but its variance does not fall with N: it is for looking, and for periodic inputs,
    where it is exact in the limit. Several experiments of equal length give sum(Y conj U) / sum |U|^2, and from two
    on a covariance. Detrend first.

    Args:
        data: One experiment with one input, or several of equal length.

    Returns:
        Response at the frequencies k / (N dt), k >= 1, at which the input has power.

    Raises:
        SysidError: Several inputs, constant input, experiments of different length.
    """
    experiments = as_experiments(data)
    first = experiments[0]
    if first.nu != 1:
        raise SysidError(f"etfe takes one input, got {first.nu}: use spa, or data.select(inputs=[...])")
    if len({len(e) for e in experiments}) > 1:
        raise SysidError(f"etfe needs experiments of equal length, got {[len(e) for e in experiments]} samples")
    check_excitation(experiments, [0])
    u = np.array([rfft(e.u[:, 0]) for e in experiments])[:, 1:, None]
    y = np.array([rfft(e.y, axis=0) for e in experiments])[:, 1:]
    power = np.sum(np.abs(u) ** 2, axis=0)
    heard = power[:, 0] > SILENT * power.max()
    response = np.sum(y * u.conj(), axis=0)[heard] / power[heard]
    covariance = None
    r = len(experiments)
    if r > 1:
        errors = y[:, heard] - response * u[:, heard]
        variance = np.sum(np.abs(errors) ** 2, axis=0) / (r - 1) / power[heard]
        covariance = 0.5 * variance[:, :, None, None, None] * np.eye(2)
    return FrequencyResponse(
        frequencies=rfftfreq(len(first), first.dt)[1:][heard],
        response=response[:, :, None],
        dt=first.dt,
        method="etfe",
        covariance=covariance,
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )
