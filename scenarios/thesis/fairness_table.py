"""One table for every arm: each model's fits, in simulation and one step ahead, estimation and validation apart.

Every arm's models are identified from its own PRBS test and meet its own records and its own truth.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, Condition, single_joint_test
from scenarios.experiments.model_structures import STRUCTURES, Structure, every_structure
from scenarios.thesis.campaign import ESTIMATION_TEST, SAME_SEQUENCE, Campaign
from scenarios.thesis.estimates import Fits, fits, identified
from scenarios.thesis.steps import NO_REPORT, Part
from scenarios.truth.published import PublishedModel, published
from sysid import IOData, StateSpace, SysidError

RECORDS = {"mimo-10": "slow chirp, 0 to 1 Hz", "mimo-12": "fast chirp, 5 to 10 Hz", RPCM: "exchange"}
"""Records of three joints that every arm has, with their names for people."""

SeveralFits = Mapping[tuple[str, bool], Mapping[str, Mapping[str, Fits]]]
"""Fits of three-joint models by `SysID`, `OKID` or `hybrid` and whether printed, then by record, then by joint."""


@dataclass(frozen=True, eq=False)
class FairModel:
    """One model of one joint on one arm: printed, with the thesis' own digits, or identified from this arm's PRBS test.

    Attributes:
        model: The model; None where the estimator refused, for the reason in `refused`.
        bandwidth_hz: Its bandwidth, Hz, with its 95 % interval; NaN and None where there is none.
        covers: Whether the interval holds this arm's truth.
        fits: By number of the test, the estimation test among them.
    """

    method: str
    label: str
    chosen: bool
    printed: bool
    model: StateSpace | None = None
    bandwidth_hz: float = float("nan")
    ci95: tuple[float, float] | None = None
    covers: bool | None = None
    fits: Mapping[int, Fits] = field(default_factory=dict)
    refused: str = ""

    @property
    def stable(self) -> bool:
        """Whether there is a model and it is stable."""
        return self.model is not None and self.model.is_stable()

    @property
    def validation(self) -> Fits | None:
        """Median over the tests of other sequences than that of the estimation test; None without any."""
        unseen = [fit for test, fit in self.fits.items() if test not in SAME_SEQUENCE]
        if not unseen:
            return None
        return Fits(median(fit.simulation for fit in unseen), median(fit.one_step for fit in unseen))


@dataclass(frozen=True, eq=False)
class ArmFairness:
    """Fits of all models on one arm.

    Attributes:
        condition: The arm.
        truth_hz: Its true bandwidths by joint, Hz.
        joints: Its models by joint, those of the thesis' structures first; joints without a PRBS record are left out.
        three_joint: Fits of models of three joints; those are left out of which a joint's model is missing.
    """

    condition: Condition
    truth_hz: Mapping[str, float]
    joints: Mapping[str, tuple[FairModel, ...]]
    three_joint: SeveralFits

    def model(self, joint: str, label: str) -> FairModel | None:
        """Its model of a joint with a label, if there is one."""
        return next((model for model in self.joints.get(joint, ()) if model.label == label), None)

    def fits(self, name: str, printed: bool, record: str) -> Mapping[str, Fits] | None:
        """Fits of a three-joint model to a record by joint, if there are any."""
        return self.three_joint.get((name, printed), {}).get(record)


def chosen(models: Iterable[FairModel], *, okid: bool, printed: bool = False) -> FairModel:
    """The model that the thesis' SysID or OKID model has for a joint, identified anew or as printed."""
    candidates = [model for model in models if model.chosen and model.printed == printed]
    if okid:
        return next(model for model in candidates if model.method == "okid")
    # SysID's model is ARMAX on one joint and OE on another: whichever prediction-error method the thesis chose.
    return next(model for model in candidates if model.method != "okid")


def fairness(campaigns: Sequence[Campaign], part: Part = NO_REPORT) -> tuple[ArmFairness, ...]:
    """Identify every model from the estimation test of every arm, and judge it on the arm's other records."""
    return tuple(_arm(campaign) for campaign, _ in part.split(campaigns))


def _arm(campaign: Campaign) -> ArmFairness:
    """The table of the arm of one campaign."""
    available = [joint for joint in STUDIED_JOINTS if single_joint_test(ESTIMATION_TEST, joint) in campaign.logs]
    models = {joint: _models(joint, campaign) for joint in available}
    truth_hz = {joint: campaign.truth.joint(joint).bandwidth_hz for joint in STUDIED_JOINTS}
    every_joint_available = len(available) == len(STUDIED_JOINTS)
    # A model of three joints needs a model of each.
    three_joint = _three_joints(models, campaign) if every_joint_available else {}
    return ArmFairness(campaign.condition, truth_hz, models, three_joint)


def _models(joint: str, campaign: Campaign) -> tuple[FairModel, ...]:
    """Models of a joint: identified from the arm's PRBS test, then printed."""
    structures = (*every_structure(joint), _sufficient_structure(joint))
    identified_models = [_identified_model(structure, joint, campaign) for structure in structures]
    judges = campaign.singles(joint)
    printed_models = [_printed_model(printed, judges) for printed in published(joint)]
    return (*identified_models, *printed_models)


def _sufficient_structure(joint: str) -> Structure:
    """Output-error structure whose order suffices for the arm without friction; the thesis does not use it."""
    # The study puts it behind those of the thesis.
    return STRUCTURES[joint][-1]


def _identified_model(structure: Structure, joint: str, campaign: Campaign) -> FairModel:
    """A structure identified from the arm's PRBS test and compared with its single-joint tests; see `FairModel`."""
    description = (structure.method, structure.label, structure.chosen, False)
    try:
        model = identified(campaign.own(joint), structure, campaign.singles(joint))
    except SysidError as error:
        return FairModel(*description, refused=str(error))
    truth_hz = campaign.truth.joint(joint).bandwidth_hz
    # The small-signal truth: on an arm with friction, an interval may well miss it.
    covers = model.ci95[0] <= truth_hz <= model.ci95[1]
    return FairModel(*description, model.estimate.model, model.bandwidth_hz, model.ci95, covers, model.fits)


def _printed_model(printed: PublishedModel, judges: Mapping[int, IOData]) -> FairModel:
    """A model with the thesis' own digits compared with single-joint tests; it has no interval."""
    description = (printed.method, f"printed {printed.label}", printed.chosen, True)
    fits_by_test = {test: fits(printed.model, record) for test, record in judges.items()}
    return FairModel(*description, printed.model, printed.bandwidth_hz, fits=fits_by_test)


def _three_joints(joints: Mapping[str, Sequence[FairModel]], campaign: Campaign) -> SeveralFits:
    """Fits of the SysID, the OKID and the hybrid model of three joints, identified and printed.

    A block-diagonal model follows each joint as that joint's block does. The hybrid has SysID's yaw and OKID's pitches.
    """
    yaw = STUDIED_JOINTS[0]
    table: dict[tuple[str, bool], Mapping[str, Mapping[str, Fits]]] = {}
    for printed in (False, True):
        sysid_blocks = {joint: chosen(models, okid=False, printed=printed).model for joint, models in joints.items()}
        okid_blocks = {joint: chosen(models, okid=True, printed=printed).model for joint, models in joints.items()}
        hybrid_blocks = {**okid_blocks, yaw: sysid_blocks[yaw]}
        for name, blocks in (("SysID", sysid_blocks), ("OKID", okid_blocks), ("hybrid", hybrid_blocks)):
            available = {joint: block for joint, block in blocks.items() if block is not None}
            # A joint whose model an estimator refused leaves no model of three joints.
            if len(available) == len(blocks):
                table[name, printed] = _fits_by_record(available, campaign)
    return table


def _fits_by_record(models: Mapping[str, StateSpace], campaign: Campaign) -> dict[str, dict[str, Fits]]:
    """Fits of each joint's model to the records of three joints that the arm has."""
    fits_by_record: dict[str, dict[str, Fits]] = {}
    for name in RECORDS:
        if name in campaign.logs:
            fits_by_record[name] = {joint: fits(model, campaign.record(name, joint)) for joint, model in models.items()}
    return fits_by_record
