"""The study: excite, record, identify, compare with the truth [Morris1996]."""

import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, JointTruth
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.campaign import Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import swing, velocity_limited_share
from scenarios.experiments.model_structures import STRUCTURES, SUFFICIENT, Structure
from scenarios.experiments.scenario import Scenario
from scenarios.experiments.waveform import POINTS
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.thesis.attribution import attribute, order_effects, scaled
from scenarios.thesis.campaign import CONDITIONS, EVERY_TEST, FAIRNESS_TESTS, Campaign, run_campaign
from scenarios.thesis.comparison import (
    Comparison,
    Cost,
    JointResult,
    ModelResult,
)
from scenarios.thesis.estimates import estimate, fits
from scenarios.thesis.fairness_table import fairness
from scenarios.thesis.multivariable import multivariable
from scenarios.thesis.nonparametric import nonparametric
from scenarios.thesis.observer_analysis import observers
from scenarios.thesis.prediction_errors import prediction_errors
from scenarios.thesis.robustness import robustness
from scenarios.truth.published import published
from sysid import FrequencyResponse, IOData, SysidError, SysidWarning
from sysid.models.bandwidth import half_power_hz

ESTIMATION_TEST = 5
"""Models are identified from the PRBS of 1 V and judged on the tests of other waveforms [Morris1996, ch. IV and V]."""

SHORTEST = 20.0
"""Length of the shortest record that the study's estimators take, s."""

Progress = Callable[[str, int, int], None]
"""Called with the name of the step, what is done and what there is in all."""


def run_study(
    *,
    seed: int | None = None,
    duration: float | None = None,
    conditions: Sequence[Condition] = CONDITIONS,
    thorough: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Run the whole study.

    Args:
        seed: Draws the noise of every experiment and the binary sequences; the scenarios' own seeds when not given.
        duration: Length of every record instead of 240 s, s.
        conditions: The arms that are laid side by side, each once: first the one that the study is about, with
            friction. What explains its intervals is played on the same arm without friction, whether or not given.
        thorough: See `draw_conclusions`.
        threads: Threads of the simulation.
        progress: Told of every step.

    Returns:
        Models beside the truth and beside held-out data.

    Raises:
        ScenarioError: A seed, a duration or arms that the study cannot be made of, before anything is played; or an
            experiment that models are identified from has failed, or its record gives no model.
    """
    begin = perf_counter()
    _check(conditions, duration)
    report = progress or (lambda step, done, total: None)
    campaigns = _campaigns(conditions, seed, duration, threads, report)
    study = draw_conclusions(campaigns, thorough=thorough, progress=report)
    return replace(study, cost=replace(study.cost, total_s=perf_counter() - begin))


def _check(conditions: Sequence[Condition], duration: float | None) -> None:
    if not conditions:
        raise ScenarioError("no arms given: the study needs at least the one that it is about")
    if not conditions[0].friction:
        raise ScenarioError(
            f"the study cannot be about the arm {conditions[0]}: it lays the arm without friction beside the same one "
            "with friction, which comes first"
        )
    twice = [str(condition) for condition, count in Counter(conditions).items() if count > 1]
    if twice:
        raise ScenarioError(f"arms given more than once: {'; '.join(twice)}")
    if duration is not None and not duration >= SHORTEST:
        raise ScenarioError(f"duration = {duration} s given, the study needs records of {SHORTEST:g} s or more")


def plan(conditions: Sequence[Condition]) -> tuple[tuple[Condition, tuple[str, ...]], ...]:
    """Return the plan of a study: the campaigns in their order, with the tests of each arm.

    Args:
        conditions: The arms that are laid side by side, the one that the study is about first.

    Returns:
        Arms and names of the tests: the first arm with all, second the same without friction, then the others.
    """
    first, *others = conditions
    smooth = replace(first, friction=False)
    estimation = [single_joint_test(ESTIMATION_TEST, joint) for joint in STUDIED_JOINTS]
    beside = FAIRNESS_TESTS if smooth in others else ()
    return (
        (first, EVERY_TEST),
        (smooth, tuple(dict.fromkeys((*estimation, *beside)))),
        *((condition, FAIRNESS_TESTS) for condition in others if condition != smooth),
    )


def _campaigns(
    conditions: Sequence[Condition],
    seed: int | None,
    duration: float | None,
    threads: int | None,
    report: Progress,
) -> tuple[Campaign, ...]:
    """Simulate everything: the first arm's campaign whole, and the other arms' tests that it is compared with."""
    played = plan(conditions)
    estimation = [single_joint_test(ESTIMATION_TEST, joint) for joint in STUDIED_JOINTS]
    small = [scaled(campaign_scenario(name, seed=seed, duration=duration)) for name in estimation]
    # Those at small amplitude go with the arm without friction, the second.
    extras: list[list[Scenario]] = [small if number == 1 else [] for number in range(len(played))]
    lengths = [
        _ticks(tests, duration) + sum(round(entry.duration * SAMPLE_RATE) for entry in extra)
        for (_, tests), extra in zip(played, extras, strict=True)
    ]
    campaigns: list[Campaign] = []

    def report_step(part: int, whole: int) -> None:
        # A campaign counts by the length of its records: they cost what they are long.
        now = len(campaigns)
        step = f"simulate, arm {now + 1} of {len(lengths)}"
        report(step, sum(lengths[:now]) + round(lengths[now] * part / whole), sum(lengths))

    for (condition, tests), extra in zip(played, extras, strict=True):
        campaigns.append(
            run_campaign(
                condition, tests, extra=extra, seed=seed, duration=duration, threads=threads, progress=report_step
            )
        )
    return tuple(campaigns)


def _ticks(tests: Sequence[str], duration: float | None) -> int:
    """Samples of these tests together."""
    return sum(round(campaign_scenario(name, duration=duration).duration * SAMPLE_RATE) for name in tests)


def draw_conclusions(
    campaigns: Sequence[Campaign], *, thorough: bool = True, progress: Progress | None = None
) -> Comparison:
    """Run the analyses of the study on existing campaigns.

    Args:
        campaigns: The arm that the study is about, whole, first; then the same arm without friction, and others.
        thorough: Whether to analyse too what no finding rests on and only the report shows; one seed of many does not.
        progress: Told of every step.

    Returns:
        Models beside the truth and beside held-out data.

    Raises:
        ScenarioError: The first two campaigns are not of one arm with and without friction; or a record that models
            are identified from is missing, or gives no model.
    """
    begin = perf_counter()
    report = progress or (lambda step, done, total: None)
    arms = [entry.condition for entry in campaigns]
    if len(arms) < 2 or not arms[0].friction or arms[1] != replace(arms[0], friction=False):
        raise ScenarioError(
            "expected campaigns of an arm with friction, of the same without, and of others; given "
            + ("; ".join(map(str, arms)) or "none")
        )
    main, smooth = campaigns[0], campaigns[1]
    joints, attribution, orders = {}, {}, {}
    steps = len(STUDIED_JOINTS)
    for number, joint in enumerate(STUDIED_JOINTS):
        report("identify", number, steps)
        truth = main.truth.joint(joint)
        joints[joint] = study_joint(joint, main)
        attribution[joint] = attribute(
            single_joint_test(ESTIMATION_TEST, joint), joint, main, smooth, truth.bandwidth_hz, SUFFICIENT[joint]
        )
        orders[joint] = order_effects(joints[joint].data[ESTIMATION_TEST], SUFFICIENT[joint][2])
    report("identify", steps, steps)
    return Comparison(
        campaigns=tuple(campaigns),
        joints=joints,
        multivariable=multivariable(
            {name: entry.chosen.estimate.model for name, entry in joints.items()},
            {name: entry.models["okid"].estimate.model for name, entry in joints.items()},
            main,
        ),
        attribution=attribution,
        orders=orders,
        nonparametric={joint: nonparametric(joint, main, summaries=thorough) for joint in joints},
        prediction_errors={
            joint: prediction_errors(
                joint,
                entry.data,
                ESTIMATION_TEST,
                main,
                smooth,
                thorough=thorough,
            )
            for joint, entry in joints.items()
        },
        observers=observers(
            main,
            {joint: entry.models["okid"].estimate for joint, entry in joints.items()},
            ESTIMATION_TEST,
            thorough=thorough,
        ),
        robustness=robustness(main, ESTIMATION_TEST, thorough=thorough),
        fairness=fairness(campaigns, ESTIMATION_TEST) if thorough else None,
        cost=Cost(
            sum(entry.physics_s for entry in campaigns),
            sum(entry.simulation_s for entry in campaigns),
            perf_counter() - begin,
        ),
        estimation_test=ESTIMATION_TEST,
        provenance=versions(),
    )


def study_joint(joint: str, campaign: Campaign) -> JointResult:
    """Identify one joint from the estimation test and validate on all others.

    Args:
        joint: Name of the joint.
        campaign: The records.

    Returns:
        Models, spectra and fits.

    Raises:
        MissingRecordError: The record of the estimation test.
        ScenarioError: It gives no model of one of the structures that the study is about.
    """
    own, data, truth = campaign.single(ESTIMATION_TEST, joint), campaign.singles(joint), campaign.truth.joint(joint)
    logs = {number: campaign.log(single_joint_test(number, joint)) for number in data}
    models = {entry.method: _identify(entry, data, truth) for entry in STRUCTURES[joint]}
    spa, etfe = _nonparametric(own)
    return JointResult(
        joint,
        truth,
        data,
        models,
        spa,
        etfe,
        published(joint),
        slewing={number: velocity_limited_share(log) for number, log in logs.items()},
        swing={number: swing(log, joint) for number, log in logs.items()},
    )


def _identify(structure: Structure, data: Mapping[int, IOData], truth: JointTruth) -> ModelResult:
    own = data[ESTIMATION_TEST]
    with warnings.catch_warnings():
        # They stand in the estimate's diagnostics, from where the report takes them.
        warnings.simplefilter("ignore", SysidWarning)
        try:
            model = estimate(own, structure.estimator, structure.orders)
            band = model.bandwidth()
            test = sysid.resid(model, own)
        except SysidError as error:
            raise ScenarioError(
                f"{own.name} gives no model {structure.label}, which the study is about: {error}"
            ) from error
        followed = {number: fits(model, record) for number, record in data.items()}
    return ModelResult(
        method=structure.method,
        label=structure.label,
        estimate=model,
        chosen=structure.chosen,
        bandwidth_hz=float(band.hz[0, 0]),
        ci95=(float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0])),
        covers=bool(band.covers(truth.bandwidth_hz)[0, 0]),
        dc_gain=float(model.model.dc_gain()[0, 0]),
        half_power_hz=half_power_hz(model.model),
        fits=followed,
        residual_test=test,
    )


def _nonparametric(own: IOData) -> tuple[FrequencyResponse, FrequencyResponse]:
    """Spectral and empirical estimates where the periodic input has power: on the lines of the 2 s file.

    Between the lines there is nothing but noise and leakage, and a curve through it would mean nothing.
    """
    lines = np.arange(1, POINTS // 2) * SAMPLE_RATE / POINTS
    periods = [own[start : start + POINTS] for start in range(0, len(own) - POINTS + 1, POINTS)]
    return sysid.spa(own, frequencies=lines), sysid.etfe(periods)
