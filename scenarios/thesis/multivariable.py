"""Models of three joints: of a block for each joint and of all nine responses, their errors and fits to records."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, VARIANTS, Truth
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.joint_inputs import joint_inputs
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.registry import names
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.estimates import fits
from scenarios.thesis.reference_fits import References, reference_fits
from scenarios.truth.published import SYSTEMS
from sysid import IOData, ResidualTest, StateSpace, SysidError
from sysid.models import block_diagonal

T = TypeVar("T")

Kind = Literal["SysID", "OKID", "hybrid"]

Way = Literal["simulation", "one_step"]

WAYS: tuple[Way, ...] = ("simulation", "one_step")
"""Kinds of fit; both are always listed, because a model without a noise model cannot predict."""

RECORDS = (*names("mimo"), RPCM)
"""Every record of several joints: table 2, the independent waveforms, the exchange."""

FAST_CHIRP = "mimo-12"
"""The sweep from 5 to 10 Hz [Morris1996, sec. VI.5]."""

TESTED = (RPCM, FAST_CHIRP)
"""Records whose residuals the thesis tests [Morris1996, sec. VI.4 and VI.5]."""

LEVEL = 0.99
"""Level of the tests of residuals [Morris1996, ch. IV]."""

LAGS = 25
"""Largest lag of the tests of residuals, samples."""

BAND = (0.1, 10.0)
"""Frequencies over which responses are compared, Hz."""

SHARED = "mimo-7"
"""The binary sequence of table 2, the same on every axis."""

INDEPENDENT = "mimo-7-independent"
"""Another sequence on every axis; the two analogue outputs of the thesis could not play it."""

EXCITED = (0.5, 10.0)
"""Band in which a 2 s file has power and the joints still respond, Hz."""

FULL_OKID = "OKID, 6 states"

ALONE = "OKID, 2 states each joint alone"


@dataclass(frozen=True)
class JointFits:
    """Fits of a model to one record by joint, percent.

    Attributes:
        simulation: In simulation.
        one_step: One step ahead; where K = 0, the simulation again.
    """

    simulation: Mapping[str, float]
    one_step: Mapping[str, float]

    def of(self, way: Way) -> Mapping[str, float]:
        """Fits of one kind."""
        return self.simulation if way == "simulation" else self.one_step

    def mean(self, way: Way) -> float:
        """Mean fit over the joints, percent."""
        return float(np.mean(list(self.of(way).values())))


@dataclass(frozen=True, eq=False)
class ThreeJointModel:
    """A block-diagonal model of the three joints.

    Attributes:
        name: As people call it, e.g. `SysID model` or `printed OKID model`.
        kind: Prediction error, OKID, or OKID with the yaw joint of prediction error.
        printed: Whether it has the thesis' own digits; otherwise it was identified from the twin's records.
        blocks: Its models by joint.
        model: All of them side by side, 3 inputs and 3 outputs.
        error: Relative error of its response against the true coupled 3 x 3 response, 0.1 to 10 Hz.
        diagonal_error: The same of the diagonal alone.
        fits: By record.
        residual_tests: Of the one-step residuals, by record of `TESTED`.
    """

    name: str
    kind: Kind
    printed: bool
    blocks: Mapping[str, StateSpace]
    model: StateSpace
    error: float
    diagonal_error: float
    fits: Mapping[str, JointFits]
    residual_tests: Mapping[str, ResidualTest]

    @property
    def largest_pole(self) -> float:
        """Largest modulus of a pole; the model is stable below one, and one less this is its margin."""
        return float(np.abs(self.model.poles()).max())

    def predicts(self, joint: str) -> bool:
        """Whether a noise model (K other than zero) lets it predict; without one, a prediction is a simulation."""
        return bool(np.any(self.blocks[joint].gain))

    def fit(self, record: str) -> JointFits:
        """Fits of the model to a record; raises `MissingRecordError` where there is none."""
        return _result_of(self.fits, record)

    def residual_test(self, record: str) -> ResidualTest:
        """Test of the residuals on a record; raises `MissingRecordError` without it, or where they are not finite."""
        if record in self.fits and record not in self.residual_tests:
            raise MissingRecordError(
                f"the residuals of the {self.name} on {record} cannot be tested: they are not finite"
            )
        return _result_of(self.residual_tests, record)


@dataclass(frozen=True, eq=False)
class FullModel:
    """A model identified from a record of several joints.

    Attributes:
        condition: Condition index between the commands of the joints; 1 is the best, above 30 counts as dependent.
        method: Method and orders; `ALONE` identifies each joint by its own command, all others every response.
        model: The model, 3 inputs and 3 outputs.
        error: Relative error of its response, 0.5 to 10 Hz, against the true 3 x 3 one; that of the diagonal beside.
        coupling: What lies off the diagonal of its response, relative to all of it; the truth's is to be compared.
    """

    record: str
    condition: float
    method: str
    model: StateSpace
    error: float
    diagonal_error: float
    coupling: float


@dataclass(frozen=True, eq=False)
class Multivariable:
    """Chapter VI: the thesis' models of three joints, from the twin and as printed, on every record of several joints.

    Attributes:
        models: SysID, OKID and hybrid model, identified from the twin's records, then as printed.
        records: Records that are there, in the order of `RECORDS`.
        full: Models with every input on every output, from a shared and from independent waveforms.
        truth: The true response of the three joints.
        coupling: What lies off its diagonal, relative to all of it, 0.1 to 10 Hz.
        references: Fits of the truth without and with coupling, and of the true angles, by kind, record and joint.
    """

    models: tuple[ThreeJointModel, ...]
    records: tuple[str, ...]
    full: tuple[FullModel, ...]
    truth: StateSpace
    coupling: float
    references: References

    def reference(self, name: str, record: str) -> Mapping[str, float]:
        """Fits by joint of one kind of knowledge of the twin to a record, percent; see `ThreeJointModel.fit`."""
        return _result_of(self.references[name], record)

    def model(self, kind: Kind, *, printed: bool = False) -> ThreeJointModel:
        """One of the models."""
        return next(model for model in self.models if model.kind == kind and model.printed == printed)

    def pair(self, *, printed: bool = False) -> tuple[ThreeJointModel, ThreeJointModel]:
        """The SysID and the OKID model, identified or printed."""
        return self.model("SysID", printed=printed), self.model("OKID", printed=printed)


def multivariable(own: Mapping[str, StateSpace], okid: Mapping[str, StateSpace], campaign: Campaign) -> Multivariable:
    """Build the three-joint models of prediction-error and OKID models by joint, and compare them with every record.

    The hybrid model has the SysID model's yaw and the OKID model's pitches [Morris1996, sec. VI.6].
    """
    truth = three_joint_truth(campaign.truth)
    records = tuple(name for name in RECORDS if name in campaign.logs)
    yaw = STUDIED_JOINTS[0]
    identified: dict[Kind, Mapping[str, StateSpace]] = {"SysID": own, "OKID": okid, "hybrid": {**okid, yaw: own[yaw]}}
    models = [_compared(kind, False, blocks, truth, campaign) for kind, blocks in identified.items()]
    systems = {system.name: system for system in SYSTEMS}
    for kind in identified:
        printed = {equation.joint: equation.model for equation in systems[kind.lower()].parts}
        models.append(_compared(kind, True, printed, truth, campaign))
    full: list[FullModel] = []
    for name in (SHARED, INDEPENDENT):
        if name in records:
            full += full_models(name, campaign, truth)
    references = reference_fits(campaign, records, truth)
    return Multivariable(tuple(models), records, tuple(full), truth, off_diagonal(truth), references)


def _compared(
    kind: Kind, printed: bool, blocks: Mapping[str, StateSpace], truth: StateSpace, campaign: Campaign
) -> ThreeJointModel:
    """A model with its fits: block-diagonal, it follows each joint as that joint's block does."""
    blocks = {joint: blocks[joint] for joint in STUDIED_JOINTS}
    model = block_diagonal(list(blocks.values()))
    tests = {}
    for record in TESTED:
        if record in campaign.logs:
            # An unstable predictor leaves residuals too large for any test.
            with suppress(SysidError):
                tests[record] = sysid.resid(model, campaign.several(record), lags=LAGS, level=LEVEL)
    name = f"printed {kind} model" if printed else f"{kind} model"
    return ThreeJointModel(
        name=name,
        kind=kind,
        printed=printed,
        blocks=blocks,
        model=model,
        error=relative_error(model, truth),
        diagonal_error=relative_error(model, truth, diagonal=True),
        fits={record: _joint_fits(blocks, record, campaign) for record in RECORDS if record in campaign.logs},
        residual_tests=tests,
    )


def _joint_fits(blocks: Mapping[str, StateSpace], record: str, campaign: Campaign) -> JointFits:
    """Fits of every joint's block to the record of that joint."""
    simulation, one_step = {}, {}
    for joint, block in blocks.items():
        fit = fits(block, campaign.record(record, joint))
        simulation[joint], one_step[joint] = fit.simulation, fit.one_step
    return JointFits(simulation, one_step)


def _result_of(results: Mapping[str, T], record: str) -> T:
    """The result on a record; raises `MissingRecordError` without one, since a mean over fewer would mislead."""
    if record not in results:
        raise MissingRecordError(f"there is no record of {record}: it failed, or was not played")
    return results[record]


def three_joint_truth(truth: Truth) -> StateSpace:
    """The true coupled response of the studied joints, commanded to measured angles, without noise."""
    inputs = list(truth.model.input_names or ())
    # The truth has the commands of all seven joints; those of the others rest.
    columns = [inputs.index(f"{joint} commanded") for joint in STUDIED_JOINTS]
    model = truth.model
    return StateSpace(model.A, model.B[:, columns], model.C[columns], model.D[np.ix_(columns, columns)], None, truth.dt)


def _response(model: StateSpace, band: tuple[float, float]) -> np.ndarray:
    """Response (200, ny, nu) at frequencies evenly spaced on a logarithmic axis from the lowest to the highest, Hz."""
    # On a logarithmic axis every octave has the same weight in the norms below.
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
    direct = np.diagonal(gain, axis1=1, axis2=2)
    # Sums of moduli: the worst that commands of one frequency and any phase can do together.
    ratio = (gain.sum(axis=2) - direct) / direct
    return dict(zip(STUDIED_JOINTS, map(float, ratio.max(axis=0)), strict=True))


def full_models(name: str, campaign: Campaign, truth: StateSpace) -> tuple[FullModel, ...]:
    """Identify models of all nine responses from a record by name, and one of each joint alone beside them.

    A method that refuses the record is left out; raises `MissingRecordError` where there is none.
    """
    data, log = campaign.several(name), campaign.log(name)
    inputs = joint_inputs(log.commanded[round(SETTLING / log.dt) :], STUDIED_JOINTS, VARIANTS["nominal"])
    # There is no condition where fewer than two joints are commanded: the others' responses cannot be told.
    condition = float("inf") if inputs is None else inputs.condition
    models = []
    for method, identify in METHODS.items():
        with suppress(SysidError):
            model = identify(data)
            full_model = FullModel(
                record=name,
                condition=condition,
                method=method,
                model=model,
                error=relative_error(model, truth, band=EXCITED),
                diagonal_error=relative_error(model, truth, diagonal=True, band=EXCITED),
                coupling=off_diagonal(model, band=EXCITED),
            )
            models.append(full_model)
    return tuple(models)


def _arx(data: IOData) -> StateSpace:
    """One three-input model for each output, combined into one model."""
    models = []
    for output in range(data.ny):
        models.append(sysid.arx(IOData(data.u, data.y[:, output], data.dt), 5, 5, 1).model)
    separate = block_diagonal(models)
    # Side by side the models have inputs of their own; all get the same three.
    shared = np.tile(np.eye(data.nu), (data.ny, 1))
    return StateSpace(separate.A, separate.B @ shared, separate.C, separate.D @ shared, None, data.dt)


def _alone(data: IOData) -> StateSpace:
    """The OKID model of each joint from its own command and angle, side by side: no coupling."""
    models = []
    for joint in range(data.ny):
        models.append(sysid.okid(IOData(data.u[:, joint], data.y[:, joint], data.dt), 2, p=5).model)
    return block_diagonal(models)


METHODS: dict[str, Callable[[IOData], StateSpace]] = {
    # Two states a joint and p = 5, as in the thesis [Morris1996, sec. V.2].
    ALONE: _alone,
    FULL_OKID: lambda data: sysid.okid(data, 6, p=5).model,
    "N4SID, 6 states": lambda data: sysid.n4sid(data, 6).model,
    "ARX 5/5 for each output": _arx,
}
"""Methods by name, with the number of states of the OKID model of three joints; the ARX model needs no such choice."""
