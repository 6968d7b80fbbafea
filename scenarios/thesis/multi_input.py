"""Multi-input models of the arm and errors of their coupling terms."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg

import sysid
from hmtb_twin import STUDIED_JOINTS, Truth
from scenarios.experiments.joint_inputs import joint_inputs
from scenarios.experiments.log_review import SETTLING
from scenarios.thesis.campaign import Campaign
from sysid import IOData, StateSpace, SysidError
from sysid.models import block_diagonal

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
    estimated, true = model.frequency_response(f), truth.frequency_response(f)
    if diagonal:
        estimated, true = (np.diagonal(response, axis1=1, axis2=2) for response in (estimated, true))
    return float(np.linalg.norm(estimated - true) / np.linalg.norm(true))


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
    """Return the motion of a joint due to the other commands, relative to that due to its own command.

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


SHARED = "mimo-7"
"""The binary sequence of table 2, the same on every axis."""

INDEPENDENT = "mimo-7-independent"
"""Another sequence on every axis; the two analogue outputs of the thesis could not play it."""

EXCITED = (0.5, 10.0)
"""Band in which a 2 s file has power and the joints still respond, Hz."""

FULL_OKID = "OKID, 6 states"

ALONE = "OKID, 2 states each joint alone"


@dataclass(frozen=True, eq=False)
class FullModel:
    """A model identified from a record of several joints.

    Attributes:
        record: Its record.
        condition: Condition index between the commands of the joints; 1 is the best, above 30 counts as dependent.
        method: Method and orders; `ALONE` identifies each joint by its own command, all others every response.
        model: The model, 3 inputs and 3 outputs.
        error: Relative error of its response against the true 3 x 3 response, 0.5 to 10 Hz.
        diagonal_error: The same of the diagonal alone.
        coupling: What lies off the diagonal of its response, relative to all of it; the truth's is to be compared.
    """

    record: str
    condition: float
    method: str
    model: StateSpace
    error: float
    diagonal_error: float
    coupling: float


def full_models(name: str, campaign: Campaign, truth: StateSpace) -> tuple[FullModel, ...]:
    """Identify models of all nine responses from a record, and one of each joint alone beside them.

    Args:
        name: Of the record.
        campaign: Holds it.
        truth: The true response of the three joints.

    Returns:
        A model for each method that does not refuse the record.

    Raises:
        MissingRecordError: There is no such record.
    """
    data, log = campaign.several(name), campaign.log(name)
    inputs = joint_inputs(log.commanded[round(SETTLING / log.dt) :], STUDIED_JOINTS)
    condition = float("inf") if inputs is None else inputs.condition
    models = []
    for method, identify in METHODS.items():
        try:
            model = identify(data)
        except SysidError:
            continue
        models.append(
            FullModel(
                name,
                condition,
                method,
                model,
                relative_error(model, truth, band=EXCITED),
                relative_error(model, truth, diagonal=True, band=EXCITED),
                off_diagonal(model, band=EXCITED),
            )
        )
    return tuple(models)


def _arx(data: IOData) -> StateSpace:
    """One three-input model for each output, combined into one model."""
    models = [sysid.arx(IOData(data.u, data.y[:, i], data.dt), 5, 5, 1).model for i in range(data.ny)]
    return StateSpace(
        scipy.linalg.block_diag(*(model.A for model in models)),
        np.vstack([model.B for model in models]),
        scipy.linalg.block_diag(*(model.C for model in models)),
        np.vstack([model.D for model in models]),
        None,
        data.dt,
    )


def _alone(data: IOData) -> StateSpace:
    return block_diagonal(
        [sysid.okid(IOData(data.u[:, i], data.y[:, i], data.dt), 2, p=5).model for i in range(data.ny)]
    )


METHODS: dict[str, Callable[[IOData], StateSpace]] = {
    ALONE: _alone,
    FULL_OKID: lambda data: sysid.okid(data, 6, p=5).model,
    "N4SID, 6 states": lambda data: sysid.n4sid(data, 6).model,
    "ARX 5/5 for each output": _arx,
}
"""Number of states, that of the OKID model of three joints; the ARX model needs no such choice."""
