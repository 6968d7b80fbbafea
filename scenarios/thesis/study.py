"""The study: excite, record, identify, compare with the truth [Morris1996]."""

import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TypeVar

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.campaign import Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import swing, velocity_limited_share
from scenarios.experiments.model_structures import STRUCTURES, SUFFICIENT, Structure
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.identification.every_joint import MULTISINES, SevenJoints, identify_every_joint
from scenarios.identification.identification import long_lag
from scenarios.identification.recovered_bandwidth import intervals_agree
from scenarios.thesis.attribution import attribute, best_linear_of, order_effects, scaled
from scenarios.thesis.campaign import CONDITIONS, ESTIMATION_TEST, EVERY_TEST, FAIRNESS_TESTS, Campaign, run_campaign
from scenarios.thesis.comparison import Comparison, Cost, JointResult, ModelResult
from scenarios.thesis.estimates import identified
from scenarios.thesis.every_data_set import DataSets, every_data_set
from scenarios.thesis.fairness_table import ArmFairness, fairness
from scenarios.thesis.multivariable import multivariable
from scenarios.thesis.nonparametric import nonparametric
from scenarios.thesis.observer_analysis import observe
from scenarios.thesis.order_search import MorePoles, Searches, more_poles, search_orders
from scenarios.thesis.robustness import robustness
from scenarios.thesis.steps import COSTS, TICK, Part, Report, Steps
from scenarios.truth.bla_of_test import BestLinearOfTest
from scenarios.truth.published import published
from sysid import IOData, SysidError, SysidWarning

SHORTEST = 20.0
"""Length of the shortest record that the study's estimators take, s."""

JUDGING = 64.0
"""Length of tests that only judge models, on other arms than that of the study, s: one minute after settling."""

ANALYSES = tuple(COSTS)[: list(COSTS).index("answer")]
"""Steps after the simulation; only a thorough study takes the last two."""

T = TypeVar("T")


def run_study(
    *,
    seed: int | None = None,
    duration: float | None = None,
    conditions: Sequence[Condition] = CONDITIONS,
    thorough: bool = True,
    threads: int | None = None,
    steps: Steps | None = None,
) -> Comparison:
    """Run the whole study: models beside the truth and beside held-out data.

    Args:
        seed: Draws the noise of every experiment and the binary sequences; the scenarios' own seeds when not given.
        duration: Length of every record instead of 240 s, s.
        conditions: The arms that are laid side by side, each once: first the one that the study is about, with
            friction. What explains its intervals is played on the same arm without friction, whether or not given.
        thorough: See `draw_conclusions`.
        threads: Threads of the simulation.
        steps: Those of `planned_steps`, which report the progress.

    Raises:
        ScenarioError: A seed, a duration or arms that the study cannot be made of, before anything is played; or an
            experiment that models are identified from has failed, or its record gives no model.
    """
    begin = perf_counter()
    _check(conditions, duration)
    steps = steps or planned_steps(conditions, duration, thorough=thorough)
    campaigns = []
    for condition, scenarios in plan(conditions, seed=seed, duration=duration):
        with steps.step(f"simulate the arm {condition}") as progress:
            campaign = run_campaign(
                condition, scenarios, seed=seed, duration=duration, threads=threads, progress=progress
            )
        campaigns.append(campaign)
    study = draw_conclusions(campaigns, thorough=thorough, steps=steps)
    return replace(study, cost=replace(study.cost, total_s=perf_counter() - begin))


def _check(conditions: Sequence[Condition], duration: float | None) -> None:
    """Refuse arms and durations that allow no study, before minutes of simulation are spent."""
    if not conditions:
        raise ScenarioError("no arms given: the study needs at least the one that it is about")
    if not conditions[0].friction:
        raise ScenarioError(
            f"the study cannot be about the arm {conditions[0]}: it lays the arm without friction beside the same one "
            "with friction, which comes first"
        )
    repeated = [str(condition) for condition, count in Counter(conditions).items() if count > 1]
    if repeated:
        raise ScenarioError(f"arms given more than once: {'; '.join(repeated)}")
    # Not `<`: NaN is refused too.
    if duration is not None and not duration >= SHORTEST:
        raise ScenarioError(f"duration = {duration} s given, the study needs records of {SHORTEST:g} s or more")


def plan(
    conditions: Sequence[Condition] = CONDITIONS, *, seed: int | None = None, duration: float | None = None
) -> tuple[tuple[Condition, tuple[Scenario, ...]], ...]:
    """Return the scenarios of each arm of a study.

    First the arm that the study is about, with all tests. Second the same without friction, with the tests that models
    are identified from, also at small amplitude. Then the others. Other arms play the tests that only judge models for
    `JUDGING` at most. Seed, duration and errors are those of `campaign_scenario`.
    """
    first, *others = conditions
    frictionless = replace(first, friction=False)
    estimation_tests = tuple(single_joint_test(ESTIMATION_TEST, joint) for joint in STUDIED_JOINTS)
    short = JUDGING if duration is None else min(duration, JUDGING)

    def scenarios_of(tests: Sequence[str], judging_duration: float | None) -> tuple[Scenario, ...]:
        """Scenarios of the tests; those that only judge models last `judging_duration`."""
        scenarios = []
        for test in tests:
            # Records that models are identified from keep their length: their intervals are compared.
            length = duration if test in estimation_tests else judging_duration
            scenarios.append(campaign_scenario(test, seed=seed, duration=length))
        return tuple(scenarios)

    # What changes with the pose falls with the square of the amplitude: small commands switch it off.
    small = tuple(scaled(scenario) for scenario in scenarios_of(estimation_tests, duration))
    # The arm without friction is always played, but compared with the others only where it was asked for.
    fairness_tests = FAIRNESS_TESTS if frictionless in others else ()
    # Estimation tests of table 1 are in both: each is played once.
    without_friction = tuple(dict.fromkeys((*estimation_tests, *fairness_tests)))
    planned = [
        (first, scenarios_of(EVERY_TEST, duration)),
        (frictionless, (*scenarios_of(without_friction, short), *small)),
    ]
    for condition in others:
        if condition != frictionless:
            planned.append((condition, scenarios_of(FAIRNESS_TESTS, short)))
    return tuple(planned)


def planned_steps(
    conditions: Sequence[Condition] = CONDITIONS,
    duration: float | None = None,
    *,
    thorough: bool = True,
    afterwards: Sequence[str] = (),
    report: Report | None = None,
) -> Steps:
    """Plan the steps of `run_study` by their measured costs, and those of `COSTS` that the caller takes afterwards."""
    arms = plan(conditions, duration=duration)
    costs = {}
    for condition, scenarios in arms:
        seconds = sum(scenario.duration for scenario in scenarios)
        # The cost of a simulation grows with its ticks, whatever is simulated.
        costs[f"simulate the arm {condition}"] = TICK * SAMPLE_RATE * seconds
    minutes = max(scenario.duration for scenario in arms[1][1]) / 60.0
    # The last two are those of other arms and of every joint.
    analyses = ANALYSES if thorough else ANALYSES[:-2]
    for name in (*analyses, *afterwards):
        fixed, per_minute, brief_share = COSTS[name]
        share = 1.0 if thorough else brief_share
        costs[name] = (fixed + minutes * per_minute) * share
    return Steps(costs, report)


def draw_conclusions(campaigns: Sequence[Campaign], *, thorough: bool = True, steps: Steps | None = None) -> Comparison:
    """Run the analyses of the study on existing campaigns.

    Args:
        campaigns: The arm that the study is about, whole, first; then the same arm without friction, and others.
        thorough: Whether to analyse too what no finding rests on and only the report shows; one seed of many does not.
        steps: Those of `planned_steps`, which report the progress.

    Raises:
        ScenarioError: The first two campaigns are not of one arm with and without friction; or a record that models
            are identified from is missing, or gives no model.
    """
    begin = perf_counter()
    arms = [campaign.condition for campaign in campaigns]
    if len(arms) < 2 or not arms[0].friction or arms[1] != replace(arms[0], friction=False):
        raise ScenarioError(
            "expected campaigns of an arm with friction, of the same without, and of others; given "
            + ("; ".join(map(str, arms)) or "none")
        )
    # Campaigns may come without `run_study`, which plans the steps of simulation too.
    steps = steps or planned_steps(arms, campaigns[0].duration, thorough=thorough)
    with warnings.catch_warnings():
        # The diagnostics of the estimates hold them, from where the report takes them.
        warnings.simplefilter("ignore", SysidWarning)
        study = _analyse(tuple(campaigns), steps, thorough=thorough)
    return replace(study, cost=replace(study.cost, total_s=perf_counter() - begin))


def _analyse(campaigns: tuple[Campaign, ...], steps: Steps, *, thorough: bool) -> Comparison:
    """Take every step after the simulation, in the order of `COSTS`."""
    main, without_friction = campaigns[:2]

    def of_joints(step: str, analysis: Callable[[str], T]) -> dict[str, T]:
        with steps.step(step) as progress:
            return {joint: analysis(joint) for joint, _ in progress.split(STUDIED_JOINTS)}

    joints = of_joints("identify", lambda joint: study_joint(joint, main))
    attribution = of_joints("causes", lambda joint: attribute(joint, main, without_friction, SUFFICIENT[joint]))
    orders = of_joints("orders", lambda joint: order_effects(main.own(joint), SUFFICIENT[joint][2]))
    spectra = of_joints("spectra", lambda joint: nonparametric(joint, main, summaries=thorough))
    with steps.step("data sets") as progress:
        data_sets, frictionless, larger, searches = _of_every_data_set(main, without_friction, progress, thorough)
    observers = of_joints("observers", lambda joint: observe(joint, main, thorough=thorough))
    with steps.step("three joints"):
        prediction_error = {joint: result.chosen.estimate.model for joint, result in joints.items()}
        okid = {joint: result.models["okid"].estimate.model for joint, result in joints.items()}
        three_joints = multivariable(prediction_error, okid, main)
    with steps.step("robustness") as progress:
        disturbed = robustness(main, thorough=thorough, part=progress)
    fairness_of_arms: tuple[ArmFairness, ...] = ()
    seven_joints: SevenJoints | None = None
    if thorough:
        with steps.step("other arms") as progress:
            fairness_of_arms = fairness(campaigns, progress)
        with steps.step("every joint") as progress:
            # A shortened study is a preview: it takes fewer realisations, and the report says so.
            multisines = MULTISINES if main.duration is None else replace(MULTISINES, realisations=2)
            seven_joints = identify_every_joint(multisines, seed=main.seed, progress=progress)
    physics_s = sum(campaign.physics_s for campaign in campaigns)
    simulation_s = sum(campaign.simulation_s for campaign in campaigns)
    return Comparison(
        campaigns=campaigns,
        joints=joints,
        multivariable=three_joints,
        attribution=attribution,
        orders=orders,
        nonparametric=spectra,
        data_sets=data_sets,
        frictionless=frictionless,
        more_poles=larger,
        searches=searches,
        observers=observers,
        robustness=disturbed,
        fairness=fairness_of_arms,
        every_joint=seven_joints,
        # `draw_conclusions` and `run_study` know the total.
        cost=Cost(physics_s, simulation_s, total_s=0.0),
        provenance=versions(),
    )


def _of_every_data_set(
    main: Campaign, without_friction: Campaign, progress: Part, thorough: bool
) -> tuple[dict[str, DataSets], dict[str, DataSets], tuple[MorePoles, ...], dict[str, Searches]]:
    """Models of every data set with and without friction, those of yaw with more poles, and the order searches."""
    # About the shares of the time that the three take.
    all_tests, estimation_test, search = progress.shares(0.6, 0.1, 0.3)
    data_sets, frictionless, searches = {}, {}, {}
    for joint, share in all_tests.split(STUDIED_JOINTS):
        data_sets[joint] = every_data_set(joint, main, thorough=thorough, part=share)
    for joint, share in estimation_test.split(STUDIED_JOINTS):
        frictionless[joint] = every_data_set(joint, without_friction, part=share)
    larger = more_poles(main.own("shoulder_yaw"), SUFFICIENT["shoulder_yaw"][2])
    if thorough:
        for joint, share in search.split(STUDIED_JOINTS):
            searches[joint] = search_orders(joint, main.singles(joint), share)
    return data_sets, frictionless, larger, searches


def study_joint(joint: str, campaign: Campaign) -> JointResult:
    """Identify one joint from the estimation test and validate on all others; all structures must give a model."""
    estimation, data = campaign.own(joint), campaign.singles(joint)
    logs = {test: campaign.log(single_joint_test(test, joint)) for test in data}
    best_linear = best_linear_of(campaign.condition, joint)
    # Between the lines of the held file there is nothing but noise and leakage.
    period = load(estimation.name).period
    lines = np.arange(1, period // 2) * SAMPLE_RATE / period
    return JointResult(
        joint=joint,
        truth=campaign.truth.joint(joint),
        best_linear=best_linear,
        data=data,
        models={structure.method: _identify(structure, data, best_linear) for structure in STRUCTURES[joint]},
        spa=sysid.spa(estimation, lag=long_lag(estimation), frequencies=lines),
        published=published(joint),
        slewing={test: velocity_limited_share(log) for test, log in logs.items()},
        swing={test: swing(log, joint) for test, log in logs.items()},
    )


def _identify(structure: Structure, data: Mapping[int, IOData], truth: BestLinearOfTest) -> ModelResult:
    """Identify one structure from the estimation test and say whether its bandwidth agrees with the truth's."""
    estimation = data[ESTIMATION_TEST]
    try:
        model = identified(estimation, structure, data)
    except SysidError as error:
        raise ScenarioError(
            f"{estimation.name} gives no model {structure.label}, which the study is about: {error}"
        ) from error
    agrees = intervals_agree((model.bandwidth_hz, *model.ci95), (truth.hz, *truth.ci95))
    return ModelResult(**vars(model), covers=agrees)
