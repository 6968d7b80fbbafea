"""Multi-input models of the arm and errors of their coupling terms."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

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
    """The true coupled response of the studied joints, commanded to measured angles, without noise."""
    inputs = list(truth.model.input_names or ())
    columns = [inputs.index(f"{joint} commanded") for joint in STUDIED_JOINTS]
    model = truth.model
    return StateSpace(model.A, model.B[:, columns], model.C[columns], model.D[np.ix_(columns, columns)], None, truth.dt)


def _response(model: StateSpace, band: tuple[float, float]) -> np.ndarray:
    """Response (200, ny, nu) at frequencies evenly spaced on a logarithmic axis from the lowest to the highest, Hz."""
    return model.frequency_response(np.geomspace(*band, 200))


def relative_error(
    model: StateSpace, truth: StateSpace, *, diagonal: bool = False, band: tuple[float, float] = BAND
) -> float:
    """Distance of two responses over the norm of the true one, of all channels or each input to its own output."""
    estimated, true = _response(model, band), _response(truth, band)
    if diagonal:
        estimated, true = (np.diagonal(response, axis1=1, axis2=2) for response in (estimated, true))
    return float(np.linalg.norm(estimated - true) / np.linalg.norm(true))


def off_diagonal(model: StateSpace, *, band: tuple[float, float] = BAND) -> float:
    """Return the off-diagonal part of a response with as many inputs as outputs, relative to the whole."""
    response = _response(model, band)
    return float(np.linalg.norm(response * ~np.eye(model.ny, dtype=bool)) / np.linalg.norm(response))


def pushed_by_others(model: StateSpace, *, band: tuple[float, float]) -> dict[str, float]:
    """Return by studied joint the largest sum of the other commands' gains over the own one's in a band."""
    gain = np.abs(_response(model, band))
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
    """Identify models of all nine responses from a record by name, and one of each joint alone beside them.

    A method that refuses the record is left out; raises `MissingRecordError` where there is none.
    """
    data, log = campaign.several(name), campaign.log(name)
    inputs = joint_inputs(log.commanded[round(SETTLING / log.dt) :], STUDIED_JOINTS)
    condition = float("inf") if inputs is None else inputs.condition
    models = []
    for method, identify in METHODS.items():
        with suppress(SysidError):
            model = identify(data)
            whole, own = (relative_error(model, truth, diagonal=own, band=EXCITED) for own in (False, True))
            models.append(FullModel(name, condition, method, model, whole, own, off_diagonal(model, band=EXCITED)))
    return tuple(models)


def _arx(data: IOData) -> StateSpace:
    """One three-input model for each output, combined into one model."""
    model = block_diagonal([sysid.arx(IOData(data.u, data.y[:, i], data.dt), 5, 5, 1).model for i in range(data.ny)])
    shared = np.tile(np.eye(data.nu), (data.ny, 1))
    return StateSpace(model.A, model.B @ shared, model.C, model.D @ shared, None, data.dt)


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
"""Methods by name, with the number of states of the OKID model of three joints; the ARX model needs no such choice."""
