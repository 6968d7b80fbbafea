"""Models with every input on every output: what a shared waveform does to them, and what independent ones allow."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import Campaign
from scenarios.experiments.joint_inputs import joint_inputs
from scenarios.experiments.log_review import SETTLING
from scenarios.thesis.coupled_response import off_diagonal, relative_error
from sysid import IOData, StateSpace, SysidError
from sysid.models import block_diagonal

SHARED = "mimo-7"
"""The binary sequence of table 2, the same on every axis."""

INDEPENDENT = "mimo-7-independent"
"""Another sequence on every axis, which two analogue outputs could not play."""

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
    found = []
    for method, identify in METHODS.items():
        try:
            model = identify(data)
        except SysidError:
            continue
        found.append(
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
    return tuple(found)


def _arx(data: IOData) -> StateSpace:
    """One model of three inputs for each output, side by side."""
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
