"""One table for every arm: each model's fits, in simulation and one step ahead, estimation and validation apart.

Every arm's models are identified from its own PRBS test and meet its own records and its own truth.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, Condition
from scenarios.experiments.model_structures import STRUCTURES, every_structure
from scenarios.thesis.campaign import Campaign, tests_of_same_sequence
from scenarios.thesis.estimates import Fits, estimate, fits
from scenarios.thesis.steps import NO_REPORT, Part
from scenarios.truth.published import published
from sysid import IOData, StateSpace, SysidError, SysidWarning

RECORDS = {"mimo-10": "slow chirp, 0 to 1 Hz", "mimo-12": "fast chirp, 5 to 10 Hz", RPCM: "exchange"}
"""Records of three joints that every arm has, with their names for people."""


@dataclass(frozen=True, eq=False)
class FairModel:
    """One model of one joint on one arm.

    Attributes:
        method: Key of the method.
        label: For tables; the same on every arm.
        chosen: Whether the thesis took it into a three-joint model.
        printed: Whether it has the thesis' own digits; otherwise it was identified from this arm's PRBS test.
        model: The model; None where the estimator refused.
        bandwidth_hz: Its bandwidth, Hz; NaN where there is none.
        ci95: 95 % interval, Hz; None for a printed model.
        covers: Whether that holds this arm's truth; None for a printed model.
        fits: By number of the test, the estimation test among them.
        refused: Why there is no model; empty where there is one.
    """

    method: str
    label: str
    chosen: bool
    printed: bool
    model: StateSpace | None
    bandwidth_hz: float
    ci95: tuple[float, float] | None
    covers: bool | None
    fits: Mapping[int, Fits]
    refused: str = ""

    @property
    def stable(self) -> bool:
        """Whether there is a model and it is stable."""
        return self.model is not None and self.model.is_stable()

    def validation(self, own: int) -> Fits | None:
        """Median over the tests of other sequences than that of the estimation test `own`; None without any."""
        same_sequence = tests_of_same_sequence(own)
        others = [fit for number, fit in self.fits.items() if number not in same_sequence]
        if not others:
            return None
        return Fits(median(fit.simulation for fit in others), median(fit.one_step for fit in others))


@dataclass(frozen=True, eq=False)
class ThreeJointFits:
    """One three-joint model on one arm.

    Attributes:
        name: `SysID`, `OKID` or `hybrid`.
        printed: Whether it has the thesis' own digits.
        fits: By record, then by joint.
    """

    name: str
    printed: bool
    fits: Mapping[str, Mapping[str, Fits]]


@dataclass(frozen=True, eq=False)
class ArmFairness:
    """The table of one arm.

    Attributes:
        condition: The arm.
        truth_hz: Its true bandwidths by joint, Hz.
        joints: Its models by joint, those of the thesis' structures first; joints without a PRBS record are left out.
        three_joint: Models of three joints; those are left out of which a joint's model is missing.
    """

    condition: Condition
    truth_hz: Mapping[str, float]
    joints: Mapping[str, tuple[FairModel, ...]]
    three_joint: tuple[ThreeJointFits, ...]

    def chosen(self, joint: str, *, okid: bool) -> FairModel:
        """The model that the thesis' SysID or OKID model has for a joint, identified anew."""
        return _chosen(self.joints[joint], printed=False, okid=okid)

    def model(self, joint: str, label: str) -> FairModel | None:
        """Its model of a joint with a label, if there is one."""
        return next((entry for entry in self.joints.get(joint, ()) if entry.label == label), None)

    def fits(self, name: str, printed: bool, record: str) -> Mapping[str, Fits] | None:
        """Fits of a three-joint model to a record by joint, if there are any."""
        models = (entry for entry in self.three_joint if (entry.name, entry.printed) == (name, printed))
        return next((entry.fits.get(record) for entry in models), None)

    def identified(self) -> tuple[FairModel, ...]:
        """All identified models of all joints."""
        return tuple(entry for models in self.joints.values() for entry in models if not entry.printed)


@dataclass(frozen=True, eq=False)
class Fairness:
    """The same table for every arm.

    Attributes:
        arms: In the order of the campaigns.
        estimation_test: Number of the test that models were identified from.
    """

    arms: tuple[ArmFairness, ...]
    estimation_test: int


def fairness(campaigns: Sequence[Campaign], estimation_test: int, part: Part = NO_REPORT) -> Fairness:
    """Identify every model from the estimation test of every arm, and judge it on the arm's other records."""
    with warnings.catch_warnings():
        # what is wrong with a model shows in its fits
        warnings.simplefilter("ignore", SysidWarning)
        arms = tuple(_arm(campaign, estimation_test) for campaign, _ in part.split(campaigns))
    return Fairness(arms, estimation_test)


def _arm(campaign: Campaign, own: int) -> ArmFairness:
    joints = {}
    for joint in STUDIED_JOINTS:
        data = campaign.singles(joint)
        if own in data:
            joints[joint] = _joint(joint, data, own, campaign)
    return ArmFairness(
        campaign.condition,
        {joint: campaign.truth.joint(joint).bandwidth_hz for joint in STUDIED_JOINTS},
        joints,
        _three_joints(joints, campaign) if len(joints) == len(STUDIED_JOINTS) else (),
    )


def _joint(joint: str, data: Mapping[int, IOData], own: int, campaign: Campaign) -> tuple[FairModel, ...]:
    sufficient = next(entry for entry in STRUCTURES[joint] if entry.method == "oe_high")
    true = campaign.truth.joint(joint).bandwidth_hz
    models = []
    for structure in (*every_structure(joint), sufficient):
        heading = (structure.method, structure.label, structure.chosen, False)
        try:
            model = estimate(data[own], structure.estimator, structure.orders)
            band = model.bandwidth()
        except SysidError as error:
            models.append(FairModel(*heading, None, float("nan"), None, False, {}, str(error)))
            continue
        ends = (float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0]))
        hz, covers = float(band.hz[0, 0]), bool(band.covers(true)[0, 0])
        models.append(FairModel(*heading, model.model, hz, ends, covers, _fits(model.model, data)))
    for printed in published(joint):
        heading = (printed.method, f"printed {printed.label}", printed.chosen, True)
        fits = _fits(printed.model, data)
        models.append(FairModel(*heading, printed.model, printed.bandwidth_hz, None, None, fits))
    return tuple(models)


def _fits(model: StateSpace, data: Mapping[int, IOData]) -> dict[int, Fits]:
    return {number: fits(model, record) for number, record in data.items()}


def _three_joints(joints: Mapping[str, tuple[FairModel, ...]], campaign: Campaign) -> tuple[ThreeJointFits, ...]:
    """A block-diagonal model follows each joint as that joint's block does; the hybrid has SysID's yaw."""
    rows = []
    for printed in (False, True):
        kinds: dict[str, dict[str, StateSpace]] = {}
        for name, okid in (("SysID", False), ("OKID", True)):
            models = {joint: _chosen(joints[joint], printed=printed, okid=okid).model for joint in STUDIED_JOINTS}
            blocks = {joint: model for joint, model in models.items() if model is not None}
            if len(blocks) == len(models):
                kinds[name] = blocks
        if len(kinds) == 2:
            yaw = STUDIED_JOINTS[0]
            kinds["hybrid"] = {**kinds["OKID"], yaw: kinds["SysID"][yaw]}
        for name, blocks in kinds.items():
            known = {
                record: {joint: fits(blocks[joint], campaign.record(record, joint)) for joint in STUDIED_JOINTS}
                for record in RECORDS
                if record in campaign.logs
            }
            rows.append(ThreeJointFits(name, printed, known))
    return tuple(rows)


def _chosen(models: Sequence[FairModel], *, printed: bool, okid: bool) -> FairModel:
    """The model that the thesis' SysID or OKID model has."""
    return next(
        entry for entry in models if entry.chosen and entry.printed == printed and (entry.method == "okid") == okid
    )
