"""One table for every arm: each model's fits, in simulation and one step ahead, estimation and validation apart.

Every arm's models are identified from its own PRBS test and meet its own records and its own truth.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, Condition, single_joint_test
from scenarios.experiments.model_structures import STRUCTURES, every_structure
from scenarios.thesis.campaign import ESTIMATION_TEST, SAME_SEQUENCE, Campaign
from scenarios.thesis.estimates import Fits, fits, identified
from scenarios.thesis.steps import NO_REPORT, Part
from scenarios.truth.published import published
from sysid import StateSpace, SysidError

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
        others = [fit for number, fit in self.fits.items() if number not in SAME_SEQUENCE]
        if not others:
            return None
        return Fits(median(fit.simulation for fit in others), median(fit.one_step for fit in others))


@dataclass(frozen=True, eq=False)
class ArmFairness:
    """The table of one arm.

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
        return next((entry for entry in self.joints.get(joint, ()) if entry.label == label), None)

    def fits(self, name: str, printed: bool, record: str) -> Mapping[str, Fits] | None:
        """Fits of a three-joint model to a record by joint, if there are any."""
        return self.three_joint.get((name, printed), {}).get(record)


def chosen(models: Iterable[FairModel], *, okid: bool, printed: bool = False) -> FairModel:
    """The model that the thesis' SysID or OKID model has for a joint, identified anew or as printed."""
    taken = (entry for entry in models if entry.chosen and entry.printed == printed)
    return next(entry for entry in taken if (entry.method == "okid") == okid)


def fairness(campaigns: Sequence[Campaign], part: Part = NO_REPORT) -> tuple[ArmFairness, ...]:
    """Identify every model from the estimation test of every arm, and judge it on the arm's other records."""
    return tuple(_arm(campaign) for campaign, _ in part.split(campaigns))


def _arm(campaign: Campaign) -> ArmFairness:
    there = [joint for joint in STUDIED_JOINTS if single_joint_test(ESTIMATION_TEST, joint) in campaign.logs]
    joints = {joint: _models(joint, campaign) for joint in there}
    return ArmFairness(
        campaign.condition,
        {joint: campaign.truth.joint(joint).bandwidth_hz for joint in STUDIED_JOINTS},
        joints,
        _three_joints(joints, campaign) if len(there) == len(STUDIED_JOINTS) else {},
    )


def _models(joint: str, campaign: Campaign) -> tuple[FairModel, ...]:
    models, data, truth = [], campaign.singles(joint), campaign.truth.joint(joint).bandwidth_hz
    for one in (*every_structure(joint), STRUCTURES[joint][-1]):
        about = (one.method, one.label, one.chosen, False)
        try:
            own = identified(campaign.own(joint), one, data)
        except SysidError as error:
            models.append(FairModel(*about, refused=str(error)))
            continue
        covers = own.ci95[0] <= truth <= own.ci95[1]
        models.append(FairModel(*about, own.estimate.model, own.bandwidth_hz, own.ci95, covers, own.fits))
    for known in published(joint):
        about = (known.method, f"printed {known.label}", known.chosen, True)
        followed = {number: fits(known.model, record) for number, record in data.items()}
        models.append(FairModel(*about, known.model, known.bandwidth_hz, fits=followed))
    return tuple(models)


def _three_joints(joints: Mapping[str, Sequence[FairModel]], campaign: Campaign) -> SeveralFits:
    """A block-diagonal model follows each joint as that joint's block does; the hybrid has SysID's yaw."""
    yaw = STUDIED_JOINTS[0]
    rows = {}
    for printed in (False, True):
        own, okid = (
            {joint: chosen(models, okid=which, printed=printed).model for joint, models in joints.items()}
            for which in (False, True)
        )
        for name, blocks in {"SysID": own, "OKID": okid, "hybrid": {**okid, yaw: own[yaw]}}.items():
            known = {joint: model for joint, model in blocks.items() if model is not None}
            if len(known) == len(blocks):
                rows[name, printed] = {
                    record: {joint: fits(model, campaign.record(record, joint)) for joint, model in known.items()}
                    for record in RECORDS
                    if record in campaign.logs
                }
    return rows
