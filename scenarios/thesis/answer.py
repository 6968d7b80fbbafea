"""Answer of the study in one chart and three sentences: best linear truth, recovered and printed responses."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any

import numpy as np
from scipy.stats import binomtest

from hmtb_twin import simulate
from hmtb_twin.parameters.values import HAND_CONTROLLER
from scenarios.experiments.campaign import campaign_scenario
from scenarios.experiments.log_review import prepared
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import estimate
from scenarios.identification.one_hertz import between, joined
from scenarios.report.chart import Chart, Panel, Series
from scenarios.report.figure_style import MRAD, short
from scenarios.report.page import Page
from scenarios.thesis.answer_intervals import FIRST_SEED, SEQUENCES, HeldGains, held_gains
from scenarios.thesis.attribution import best_linear_of
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.motion import METHODS
from scenarios.truth.bla_of_test import BestLinearOfTest
from scenarios.truth.published import BREAK_FREQUENCY, PublishedModel, published
from sysid import Estimate, IOData, StateSpace, SysidError, SysidWarning
from sysid.models.bandwidth import HALF_POWER, gain_crossing, half_power_hz
from sysid.plots import PALETTE, Style

SEEDS = (1, 2, 3, 4, 5)
"""Seeds of the records that the methods are tried on: noise and binary sequence differ."""

LENGTH = 60.0
"""Length of these records, s."""

CLOSE = 0.1
"""Largest difference of two frequencies of gain 0.707 that agree, as a fraction; more where they are known less."""

SLOPES = (0.33, 0.1)
"""Slopes of the load-flow line, over that of the straight line, that the chart shows beside it."""

FREQUENCIES = np.geomspace(0.1, 10.0, 70)
"""Frequencies of the chart, Hz: a decade on either side of the thesis' 1 Hz."""


@dataclass(frozen=True, eq=False)
class JointAnswer:
    """Responses of one joint.

    Attributes:
        best_linear: Best linear truth under a command as strong as the test's, friction included.
        small_signal: The small-signal truth.
        gains: Gain over `FREQUENCIES` of the models by method, a row for each seed that gave one (S, F).
        levels: Frequencies at which the gain of these models is 0.707, Hz; NaN where it never is.
        held: How many of their intervals hold the best linear gain at 1 Hz.
        flatter: Best linear truths by slope of the load-flow line, over that of the straight line that is assumed.
    """

    joint: str
    best_linear: BestLinearOfTest
    small_signal: StateSpace
    gains: Mapping[str, np.ndarray]
    levels: Mapping[str, tuple[float, ...]]
    held: HeldGains
    flatter: Mapping[float, BestLinearOfTest] = field(default_factory=dict)

    @property
    def small_signal_hz(self) -> float:
        """Frequency at which the gain of the small-signal truth is 0.707, Hz."""
        return half_power_hz(self.small_signal)

    def recovered_hz(self, method: str) -> float:
        """Median of a method's levels over the seeds, Hz; NaN where fewer than half of the models have one."""
        levels = self.levels[method]
        crossings = [level for level in levels if np.isfinite(level)]
        # A median of a minority of the records would hide that the gain mostly never falls so far.
        if not crossings or 2 * len(crossings) < len(levels):
            return float("nan")
        return median(crossings)

    @property
    def best_linear_range(self) -> tuple[float, float]:
        """Where, in Hz, the ends of the best linear response's 95 % band are 0.707; NaN where they never are."""
        lower_gain, upper_gain = self.best_linear.response.magnitude_ci95()
        return self._crossing(lower_gain), self._crossing(upper_gain)

    def _crossing(self, gain: np.ndarray) -> float:
        """Frequency at which a gain over the frequencies of the best linear response is 0.707, Hz."""
        # `gain_crossing` takes a response and uses its magnitude alone: a gain is a response of phase zero.
        return gain_crossing(replace(self.best_linear.response, response=gain.astype(complex)), HALF_POWER)

    def near(self, level: float) -> bool:
        """Whether a frequency of gain 0.707, Hz, agrees with the best linear truth's, whose band is allowed for."""
        low, high = self.best_linear_range
        # Where the gain is flat near 0.707, a small error of the gain moves the crossing further than `CLOSE`.
        return low <= level <= high or abs(level / self.best_linear.half_power_hz - 1.0) <= CLOSE

    def agrees(self, method: str) -> bool:
        """Whether the median level of a method agrees with the best linear one."""
        return self.near(self.recovered_hz(method))


@dataclass(frozen=True, eq=False)
class Answer:
    """Responses of every studied joint, from records of some seeds and of one length, s."""

    joints: tuple[JointAnswer, ...]
    seeds: tuple[int, ...]
    length: float

    def record(self) -> dict[str, object]:
        """Frequencies at which the gain is 0.707, Hz, for results.json."""
        half_power_hz: dict[str, dict[str, object]] = {}
        held = {joint_answer.joint: vars(joint_answer.held) for joint_answer in self.joints}
        for joint_answer in self.joints:
            half_power_hz[joint_answer.joint] = {
                "best_linear": joint_answer.best_linear.half_power_hz,
                "small_signal": joint_answer.small_signal_hz,
                "by_load_flow_slope": {str(k): one.half_power_hz for k, one in joint_answer.flatter.items()},
                **{method: list(levels) for method, levels in joint_answer.levels.items()},
            }
        return {
            "seeds": list(self.seeds),
            "record_s": self.length,
            "half_power_hz": half_power_hz,
            "intervals_at_1_hz": held,
        }


def measure_answer(
    study: Comparison,
    *,
    seeds: Sequence[int] = SEEDS,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Answer:
    """Identify models of each joint of a study's arm from PRBS records of several seeds.

    `progress` is called with the records done and those in all.

    Raises:
        ScenarioError: A record could not be simulated.
    """
    # A study whose records are shortened has no longer ones here.
    length = min(LENGTH, study.duration or LENGTH)
    condition = study.campaign.condition
    # The records of other sequences, and of the truths by slope, count as one each.
    records_in_all = len(study.joints) * (len(seeds) + 1)
    records_done = 0
    answers = []
    for joint, result in study.joints.items():
        test = result.data[study.estimation_test].name
        models: dict[str, list[Estimate]] = {method: [] for method in METHODS}
        with_records: list[tuple[Estimate, IOData]] = []
        for seed in seeds:
            scenario = condition.applied(campaign_scenario(test, seed=seed, duration=length))
            (record,) = _simulated_records([scenario], joint, threads)
            for method, model in _identified_models(record, joint).items():
                models[method].append(model)
                with_records.append((model, record))
            records_done += 1
            if progress is not None:
                progress(records_done, records_in_all)
        others = []
        for seed in range(FIRST_SEED, FIRST_SEED + SEQUENCES):
            scenario = condition.applied(campaign_scenario(test, seed=seed, duration=length))
            others.append(replace(scenario, name=f"sequence-{seed}"))
        held = held_gains(_simulated_records(others, joint, threads), with_records)
        flatter = {slope: best_linear_of(condition, joint, load_flow_slope=slope) for slope in SLOPES}
        records_done += 1
        if progress is not None:
            progress(records_done, records_in_all)
        answers.append(_joint_answer(result, models, held, flatter))
    return Answer(tuple(answers), tuple(seeds), length)


def _simulated_records(tests: Sequence[Scenario], joint: str, threads: int | None) -> list[IOData]:
    """Simulate tests and prepare the records of their excited joint."""
    result = simulate(tests, threads=threads)
    for name, reason in result.failed.items():
        raise ScenarioError(f"{name}: {reason}")
    return [prepared(log, joint) for log in result.logs]


def _identified_models(record: IOData, joint: str) -> dict[str, Estimate]:
    """Models of a joint by method from one record; a method that the record gives no model of is left out."""
    models: dict[str, Estimate] = {}
    for structure in STRUCTURES[joint]:
        # The structure of sufficient order that the study adds is none of the thesis' methods.
        if structure.method not in METHODS:
            continue
        with warnings.catch_warnings(), suppress(SysidError):
            warnings.simplefilter("ignore", SysidWarning)
            models[structure.method] = estimate(record, structure.estimator, structure.orders)
    return models


def _joint_answer(
    result: JointResult,
    models: Mapping[str, Sequence[Estimate]],
    held: HeldGains,
    flatter: Mapping[float, BestLinearOfTest],
) -> JointAnswer:
    """Responses of a joint from its truths and the models by method, one for each seed that gave one."""
    gains: dict[str, np.ndarray] = {}
    levels: dict[str, tuple[float, ...]] = {}
    for method, method_models in models.items():
        gains[method] = np.array([_gain(found.model) for found in method_models])
        levels[method] = tuple(half_power_hz(found.model) for found in method_models)
    return JointAnswer(result.joint, result.best_linear, result.truth.model, gains, levels, held, flatter)


def _gain(model: StateSpace) -> np.ndarray:
    """Gain of a model over `FREQUENCIES` (F,)."""
    return np.abs(model.frequency_response(FREQUENCIES)[:, 0, 0])


def drawn_models(joint: str) -> dict[str, PublishedModel]:
    """The printed models of a joint by method, the first print where there are two."""
    models: dict[str, PublishedModel] = {}
    for printed in published(joint):
        # Yaw's ARMAX is printed twice, the same to within rounding.
        models.setdefault(printed.method, printed)
    return models


def answer_chart(answer: Answer) -> Chart:
    """Gain of every joint over frequency: best linear truth, recovered over the seeds, printed in 1996."""
    panels = tuple(_joint_panel(joint_answer, len(answer.seeds)) for joint_answer in answer.joints)
    return Chart({("",): panels}, ("",), columns=3, height=330)


def _joint_panel(joint_answer: JointAnswer, seed_count: int) -> Panel:
    """Gain of one joint over frequency, with lines across at 0.707 and at the thesis' break frequency."""
    series = _truth_series(joint_answer)
    for method in joint_answer.gains:
        series += _method_series(joint_answer, method, seed_count)
    break_radians = BREAK_FREQUENCY[joint_answer.joint]
    marks = (
        ("y", HALF_POWER, "0.707"),
        ("x", break_radians / (2 * np.pi), f"thesis: {break_radians:g} rad/s"),
    )
    # The same limits for every joint: gains are compared from panel to panel.
    return Panel(
        "frequency / Hz",
        "gain",
        tuple(series),
        short(joint_answer.joint),
        log="x",
        x_limits=(0.1, 10.0),
        y_limits=(0.0, 1.8),
        marks=marks,
    )


def _truth_series(joint_answer: JointAnswer) -> list[Series]:
    """Curves of a joint's two truths: the best linear one with its 95 % band, the small-signal one dashed."""
    response = joint_answer.best_linear.response
    lower_gain, upper_gain = (end[:, 0, 0] for end in response.magnitude_ci95())
    best_linear = Series(
        "best linear truth (95 %)",
        response.frequencies,
        response.magnitude[:, 0, 0],
        PALETTE["truth"],
        lower_gain,
        upper_gain,
    )
    dashed = Style(PALETTE["truth"].colour, "--", 1.2)
    small_signal = Series("put in: without friction", FREQUENCIES, _gain(joint_answer.small_signal), dashed)
    series = [best_linear, small_signal]
    for slope, weight in zip(joint_answer.flatter, (1.4, 0.8), strict=False):
        response = joint_answer.flatter[slope].response
        thin = Style(PALETTE["truth"].colour, "-.", weight)
        label = f"best linear truth, load-flow slope {slope:g} in place of 1"
        series.append(Series(label, response.frequencies, response.magnitude[:, 0, 0], thin))
    return series


def _method_series(joint_answer: JointAnswer, method: str, seed_count: int) -> list[Series]:
    """Curves of one method: median and range over the seeds, and the printed model, where there are any."""
    colour = PALETTE[method].colour
    gains = joint_answer.gains[method]
    series = []
    if len(gains):
        label = f"{method.upper()}, median and range over {seed_count} records"
        solid = Style(colour, "-", 2.0)
        series.append(Series(label, FREQUENCIES, np.median(gains, axis=0), solid, gains.min(axis=0), gains.max(axis=0)))
    printed = drawn_models(joint_answer.joint).get(method)
    if printed is not None:
        dotted = Style(colour, ":", 1.8)
        series.append(Series(f"{method.upper()} printed in 1996", FREQUENCIES, _gain(printed.model), dotted))
    return series


def answer_texts(answer: Answer, motion: Mapping[str, Any]) -> tuple[str, ...]:
    """Say in sentences what was put in, what the methods recover, what intervals hold and what 1996's figures can mean.

    The last one says what so few records can show, by exact binomial limits; `motion` is the record of `hmtb motion`.
    """
    page = Page({"short": short, "joined": joined, "between": between, "finite": np.isfinite})
    variables = {
        "answer": answer,
        **_simulated_facts(answer),
        **_recovered_facts(answer),
        **_interval_facts(answer),
        **_printed_facts(answer, motion),
        **_certainty_facts(answer),
    }
    # The template breaks its lines for its own sake; a blank line ends a sentence.
    paragraphs = page.render("answer_text.j2", variables).split("\n\n")
    return tuple(" ".join(paragraph.split()) for paragraph in paragraphs)


def _cases(answer: Answer) -> list[tuple[JointAnswer, str]]:
    """Every joint with every method."""
    return [(joint_answer, method) for joint_answer in answer.joints for method in joint_answer.levels]


def _simulated_facts(answer: Answer) -> dict[str, object]:
    """Variables of the first sentence: the truths, and the rms command that they belong to, mrad."""
    truths = [joint_answer.best_linear for joint_answer in answer.joints]
    # Two digits, and as text: where both commands read the same, the sentence says that it is that of the test.
    return {
        "truths": truths,
        "moved": f"{MRAD * np.mean([truth.command_rms for truth in truths]):.2g}",
        "test": f"{MRAD * np.mean([truth.wanted_rms for truth in truths]):.2g}",
        "gain": MRAD * HAND_CONTROLLER.gain,
    }


def _recovered_facts(answer: Answer) -> dict[str, object]:
    """Variables of the second sentence: the cases that agree with the best linear truth, and how the others miss it."""
    agreeing = 0
    without_crossing = 0
    departures = []
    for joint_answer, method in _cases(answer):
        hz = joint_answer.recovered_hz(method)
        ratio = hz / joint_answer.best_linear.half_power_hz
        if joint_answer.agrees(method):
            agreeing += 1
        elif np.isfinite(ratio):
            # Without a crossing, of the models or of the truth, there is no number by which a case misses.
            departures.append(100 * (ratio - 1.0))
        if not np.isfinite(hz):
            without_crossing += 1
    agreeing_by_joint = []
    for joint_answer in answer.joints:
        agreeing_methods = sum(map(joint_answer.agrees, METHODS))
        agreeing_by_joint.append(f"{agreeing_methods} of 3 on the {short(joint_answer.joint)}")
    return {
        "cases": len(_cases(answer)),
        "agree": agreeing,
        "by": agreeing_by_joint,
        "close": CLOSE,
        "departures": sorted(departures),
        "none_there": without_crossing,
    }


def _interval_facts(answer: Answer) -> dict[str, object]:
    """Variables of the sentences on intervals: how many hold the best linear gain, and gains at other slopes."""
    held = [joint_answer.held for joint_answer in answer.joints]
    return {
        "models": sum(one.models for one in held),
        "by_noise": sum(one.by_noise for one in held),
        "with_error": sum(one.with_error for one in held),
        "sequences": held[0].sequences,
        "slopes": {
            slope: [joint_answer.flatter[slope] for joint_answer in answer.joints] for slope in answer.joints[0].flatter
        },
    }


def _printed_facts(answer: Answer, motion: Mapping[str, Any]) -> dict[str, object]:
    """Variables of the third sentence: printed models that fall to 0.707 where the thesis says, and arms like it."""
    printed_count = 0
    at_the_break = []
    for joint_answer in answer.joints:
        break_hz = BREAK_FREQUENCY[joint_answer.joint] / (2 * np.pi)
        for printed in drawn_models(joint_answer.joint).values():
            printed_count += 1
            if abs(printed.half_power_hz / break_hz - 1.0) <= CLOSE:
                at_the_break.append(f"{short(joint_answer.joint)} {printed.label}")
    explained_joints = [joint for joint, outcome in motion["joints"].items() if outcome["explained"]]
    explained = [f"the {short(joint)}" for joint in explained_joints]
    return {"printed": printed_count, "same": at_the_break, "motion": motion, "explained": explained}


def _certainty_facts(answer: Answer) -> dict[str, object]:
    """Variables of the fourth sentence: cases in which all records agree or none, and what so many records show."""
    seed_count = len(answer.seeds)
    unanimous = 0
    for joint_answer, method in _cases(answer):
        agreeing_records = sum(map(joint_answer.near, joint_answer.levels[method]))
        if agreeing_records in (0, seed_count):
            unanimous += 1
    # Clopper and Pearson's lower limit: the share of which as many successes in a row still have a chance of 5 %.
    interval = binomtest(seed_count, seed_count, alternative="greater").proportion_ci(0.95, "exact")
    return {"unanimous": unanimous, "least": 100 * interval.low}
