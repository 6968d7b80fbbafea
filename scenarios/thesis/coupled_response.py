"""The response of three joints to three commands: the true one, and how far models are from it."""

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Truth
from sysid import StateSpace

BAND = (0.1, 10.0)
"""Frequencies over which responses are compared, Hz."""


def three_joint_truth(truth: Truth) -> StateSpace:
    """The true coupled response of the studied joints, commanded to measured angles.

    Args:
        truth: Small-signal truth of the whole arm.

    Returns:
        Its model with 3 inputs and 3 outputs, without noise.
    """
    inputs = list(truth.model.input_names or ())
    columns = [inputs.index(f"{joint} commanded") for joint in STUDIED_JOINTS]
    model = truth.model
    return StateSpace(model.A, model.B[:, columns], model.C[columns], model.D[np.ix_(columns, columns)], None, truth.dt)


def relative_error(
    model: StateSpace, truth: StateSpace, *, diagonal: bool = False, band: tuple[float, float] = BAND
) -> float:
    """Distance of two responses over the norm of the true one, 200 frequencies evenly spaced on a logarithmic axis.

    Args:
        model: The model.
        truth: The true response.
        diagonal: Compare only channels from each input to its own output.
        band: Lowest and highest frequency, Hz.

    Returns:
        The ratio.
    """
    f = np.geomspace(*band, 200)
    found, true = model.frequency_response(f), truth.frequency_response(f)
    if diagonal:
        found, true = (np.diagonal(response, axis1=1, axis2=2) for response in (found, true))
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def off_diagonal(model: StateSpace, *, band: tuple[float, float] = BAND) -> float:
    """Return the off-diagonal part of a response, relative to the whole.

    Args:
        model: As many inputs as outputs.
        band: Lowest and highest of the 200 frequencies, Hz.

    Returns:
        The ratio.
    """
    response = model.frequency_response(np.geomspace(*band, 200))
    return float(np.linalg.norm(response * ~np.eye(model.ny, dtype=bool)) / np.linalg.norm(response))


def pushed_by_others(model: StateSpace, *, band: tuple[float, float]) -> dict[str, float]:
    """Return how much the other commands move a joint, relative to its own: little where the response is diagonal.

    Args:
        model: Commands of the studied joints to their angles.
        band: Lowest and highest of the 200 frequencies, Hz.

    Returns:
        By joint, the largest sum of the other commands' gains over the own one's in the band.
    """
    gain = np.abs(model.frequency_response(np.geomspace(*band, 200)))
    own = np.diagonal(gain, axis1=1, axis2=2)
    ratio = (gain.sum(axis=2) - own) / own
    return dict(zip(STUDIED_JOINTS, map(float, ratio.max(axis=0)), strict=True))
