"""Models of the study compared with the truth and with held-out data."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from hmtb_twin import JointLog, JointTruth, Truth
from scenarios.identification.every_joint import SevenJoints
from scenarios.thesis.attribution import Attributions
from scenarios.thesis.campaign import ESTIMATION_TEST, Campaign
from scenarios.thesis.estimates import IdentifiedModel
from scenarios.thesis.every_data_set import DataSets
from scenarios.thesis.fairness_table import ArmFairness
from scenarios.thesis.multivariable import Multivariable
from scenarios.thesis.nonparametric import Nonparametric
from scenarios.thesis.observer_analysis import JointObserver
from scenarios.thesis.order_search import MorePoles, Searches
from scenarios.thesis.robustness import Robustness
from scenarios.truth.bla_of_test import BestLinearOfTest
from scenarios.truth.published import PublishedModel
from sysid import FrequencyResponse, IOData


@dataclass(frozen=True, eq=False)
class ModelResult(IdentifiedModel):
    """A model identified from the estimation test, with fits to all eight tests by number.

    Attributes:
        covers: Whether it agrees with the bandwidth of the best linear truth, both intervals together.
    """

    covers: bool


@dataclass(frozen=True, eq=False)
class JointResult:
    """Records, models and truth of one joint.

    Attributes:
        joint: Name.
        truth: Small-signal truth, without friction.
        best_linear: Best linear truth under a command as strong as that of the estimation test, with friction.
        data: Detrended records by number of the test.
        models: Identified models by method.
        spa: Spectral estimate from the data of estimation.
        published: The thesis' models of this joint.
        slewing: By number of the test, the share of samples in which the command moves at its velocity limit.
        swing: By number of the test, half of the command's range, rad.
    """

    joint: str
    truth: JointTruth
    best_linear: BestLinearOfTest
    data: Mapping[int, IOData]
    models: Mapping[str, ModelResult]
    spa: FrequencyResponse
    published: tuple[PublishedModel, ...]
    slewing: Mapping[int, float]
    swing: Mapping[int, float]

    @property
    def chosen(self) -> ModelResult:
        """The prediction-error model that the thesis chose for this joint."""
        # OKID's model is `chosen` too, as the joint's block of the thesis' OKID model.
        return next(model for model in self.models.values() if model.chosen and model.method != "okid")


@dataclass(frozen=True)
class Cost:
    """Time spent in each part of the study.

    Attributes:
        physics_s: Inside the physics engine, s.
        simulation_s: Simulation as a whole, s.
        total_s: The study, with what was added to it by `later`, s.
        report_s: Of that, drawing and writing the report, s.
    """

    physics_s: float
    simulation_s: float
    total_s: float
    report_s: float = 0.0

    def later(self, seconds: float, *, report: bool = False) -> "Cost":
        """Cost including the seconds of a later step: findings or the report."""
        report_s = self.report_s + seconds if report else self.report_s
        return replace(self, total_s=self.total_s + seconds, report_s=report_s)

    @property
    def times_physics(self) -> float:
        """Ratio of the total time to the time of the physics; infinite without simulation."""
        return self.total_s / self.physics_s if self.physics_s else float("inf")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of the study, the input of the report.

    Attributes:
        campaigns: All tests on the arm that the study is about; then tests on it without friction and on other arms.
        joints: Records, models and truth by joint.
        multivariable: The thesis' three-joint models, re-identified and as printed, on records of several joints.
        attribution: Bandwidths with friction and large amplitude switched off in turn, by joint.
        orders: Output-error models of several orders, by joint: the effect of the order on the bandwidth.
        nonparametric: Nonparametric analysis of the records, by joint.
        data_sets: The thesis' structures identified from every data set, by joint.
        frictionless: The structures from the estimation test on the arm without friction, by joint.
        more_poles: Output-error models of yaw with more poles, which the thesis calls unstable.
        searches: Searches for orders, by joint; none unless the study is thorough.
        observers: OKID's observers by joint [Morris1996, ch. V].
        robustness: Models from disturbed records; all of it only when thorough.
        fairness: The same table of fits for every arm; empty where the study is not thorough.
        every_joint: The seven-joint model; None where the study is not thorough.
        cost: Time spent.
        provenance: Versions of what was used.
    """

    campaigns: tuple[Campaign, ...]
    joints: Mapping[str, JointResult]
    multivariable: Multivariable
    attribution: Mapping[str, Attributions]
    orders: Mapping[str, tuple[IdentifiedModel, ...]]
    nonparametric: Mapping[str, Nonparametric]
    data_sets: Mapping[str, DataSets]
    frictionless: Mapping[str, DataSets]
    more_poles: tuple[MorePoles, ...]
    searches: Mapping[str, Searches]
    observers: Mapping[str, JointObserver]
    robustness: Robustness
    fairness: tuple[ArmFairness, ...]
    every_joint: SevenJoints | None
    cost: Cost
    provenance: Mapping[str, str]

    # Without an annotation it is no field of the dataclass: templates and findings read it of the study.
    estimation_test = ESTIMATION_TEST

    @property
    def campaign(self) -> Campaign:
        """The campaign on the arm that the study is about."""
        return self.campaigns[0]

    @property
    def truth(self) -> Truth:
        """The small-signal truth of the arm that the study is about."""
        return self.campaign.truth

    @property
    def logs(self) -> Mapping[str, JointLog]:
        """Logs of all its tests by scenario name."""
        return self.campaign.logs

    @property
    def failed(self) -> Mapping[str, str]:
        """Failed experiments and their reasons; names from other arms than the study's include the arm."""
        reasons = dict(self.campaign.failed)
        for campaign in self.campaigns[1:]:
            # Every arm plays scenarios of the same names.
            for name, reason in campaign.failed.items():
                reasons[f"{name} ({campaign.condition})"] = reason
        return reasons

    @property
    def seed(self) -> int | None:
        """Seed of the study, None for the scenarios' own seeds."""
        return self.campaign.seed

    @property
    def duration(self) -> float | None:
        """Length of every record where it was shortened, s; None for the thesis' 240 s."""
        return self.campaign.duration
