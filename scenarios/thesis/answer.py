"""Answer of the study in one chart and three sentences: best linear truth, recovered and printed responses."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from scipy.stats import binomtest

from hmtb_twin import simulate
from hmtb_twin.parameters.values import HAND_CONTROLLER
from scenarios.experiments.campaign import campaign_scenario
from scenarios.experiments.log_review import prepared
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import estimate
from scenarios.identification.one_hertz import between, joined
from scenarios.report.figure_style import MRAD, short
from scenarios.report.page import Page
from scenarios.thesis.chart import Chart, Panel, Series
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.motion import METHODS
from scenarios.truth.bla_of_test import BestLinearOfTest
from scenarios.truth.published import BREAK_FREQUENCY, PublishedModel, published
from sysid import StateSpace, SysidError, SysidWarning
from sysid.models.bandwidth import HALF_POWER, gain_crossing, half_power_hz
from sysid.plots import PALETTE, Style

SEEDS = (1, 2, 3, 4, 5)
"""Seeds of the records that the methods are tried on: noise and binary sequence differ."""

LENGTH = 60.0
"""Length of these records, s."""

CLOSE = 0.1
"""Largest difference of two frequencies of gain 0.707 that agree, as a fraction; more where they are known less."""

FREQUENCIES = np.geomspace(0.1, 10.0, 70)


@dataclass(frozen=True, eq=False)
class JointAnswer:
    """Responses of one joint.

    Attributes:
        best_linear: Best linear truth under a command as strong as the test's, friction included.
        small_signal: The small-signal truth.
        gains: Gain over `FREQUENCIES` of the models by method, a row for each seed that gave one (S, F).
        levels: Frequencies at which the gain of these models is 0.707, Hz; NaN where it never is.
    """

    joint: str
    best_linear: BestLinearOfTest
    small_signal: StateSpace
    gains: Mapping[str, np.ndarray]
    levels: Mapping[str, tuple[float, ...]]

    @property
    def small_signal_hz(self) -> float:
        """Where the gain of the small-signal truth is 0.707, Hz."""
        return half_power_hz(self.small_signal)

    def recovered_hz(self, method: str) -> float:
        """Median of a method's levels over the seeds, Hz; NaN where fewer than half of the models have one."""
        known = [level for level in self.levels[method] if np.isfinite(level)]
        return median(known) if known and 2 * len(known) >= len(self.levels[method]) else float("nan")

    @property
    def best_linear_range(self) -> tuple[float, float]:
        """Where the ends of the best linear response's 95 % band are 0.707, Hz; NaN where one never is."""
        truth = self.best_linear.response
        low, high = (
            gain_crossing(replace(truth, response=end.astype(complex)), HALF_POWER) for end in truth.magnitude_ci95()
        )
        return low, high

    def near(self, level: float) -> bool:
        """Whether a level (Hz) agrees with the best linear one, whose own uncertainty is allowed for."""
        low, high = self.best_linear_range
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
        return {
            "seeds": list(self.seeds),
            "record_s": self.length,
            "half_power_hz": {
                one.joint: {
                    "best_linear": one.best_linear.half_power_hz,
                    "small_signal": one.small_signal_hz,
                    **{method: list(levels) for method, levels in one.levels.items()},
                }
                for one in self.joints
            },
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
    length = min(LENGTH, study.duration or LENGTH)
    answers = []
    for number, (joint, entry) in enumerate(study.joints.items()):
        name, structures = entry.data[study.estimation_test].name, STRUCTURES[joint]
        models: dict[str, list[StateSpace]] = {method: [] for method in METHODS}
        for count, seed in enumerate(seeds, start=1):
            test = study.campaign.condition.applied(campaign_scenario(name, seed=seed, duration=length))
            result = simulate([test], threads=threads)
            for key, why in result.failed.items():
                raise ScenarioError(f"{key}: {why}")
            record = prepared(result.logs[0], joint)
            for one in (one for one in structures if one.method in METHODS):
                with warnings.catch_warnings(), suppress(SysidError):
                    warnings.simplefilter("ignore", SysidWarning)
                    models[one.method].append(estimate(record, one.estimator, one.orders).model)
            if progress is not None:
                progress(number * len(seeds) + count, len(study.joints) * len(seeds))
        gains = {method: np.array([_gain(model) for model in found]) for method, found in models.items()}
        levels = {method: tuple(half_power_hz(model) for model in found) for method, found in models.items()}
        answers.append(JointAnswer(joint, entry.best_linear, entry.truth.model, gains, levels))
    return Answer(tuple(answers), tuple(seeds), length)


def _gain(model: StateSpace) -> np.ndarray:
    return np.abs(model.frequency_response(FREQUENCIES)[:, 0, 0])


def drawn_models(joint: str) -> dict[str, PublishedModel]:
    """The printed models of a joint by method, the first print where there are two."""
    models: dict[str, PublishedModel] = {}
    for one in published(joint):
        models.setdefault(one.method, one)
    return models


def answer_chart(answer: Answer) -> Chart:
    """Gain of every joint over frequency: best linear truth, recovered over the seeds, printed in 1996."""
    panels = []
    for one in answer.joints:
        truth = one.best_linear.response
        low, high = (end[:, 0, 0] for end in truth.magnitude_ci95())
        gain = truth.magnitude[:, 0, 0]
        series = [Series("best linear truth (95 %)", truth.frequencies, gain, PALETTE["truth"], low, high)]
        dashed = Style(PALETTE["truth"].colour, "--", 1.2)
        series.append(Series("put in: without friction", FREQUENCIES, _gain(one.small_signal), dashed))
        for method, rows in one.gains.items():
            look, name = PALETTE[method], method.upper()
            if len(rows):
                ends = rows.min(axis=0), rows.max(axis=0)
                label = f"{name}, median and range over {len(answer.seeds)} records"
                series.append(Series(label, FREQUENCIES, np.median(rows, axis=0), Style(look.colour, "-", 2.0), *ends))
            model = drawn_models(one.joint).get(method)
            if model is not None:
                look = Style(look.colour, ":", 1.8)
                series.append(Series(f"{name} printed in 1996", FREQUENCIES, _gain(model.model), look))
        radians = BREAK_FREQUENCY[one.joint]
        marks = (("y", HALF_POWER, "0.707"), ("x", radians / (2 * np.pi), f"thesis: {radians:g} rad/s"))
        panels.append(
            Panel("frequency / Hz", "gain", tuple(series), short(one.joint), "x", (0.1, 10.0), (0.0, 1.8), marks)
        )
    return Chart({("",): tuple(panels)}, ("",), columns=3, height=330)


def answer_texts(answer: Answer, motion: Mapping[str, Any]) -> tuple[str, ...]:
    """Say in three sentences what was put in, what the methods recover and what the figures of 1996 can mean.

    A fourth says what so few records can show, by exact binomial limits; `motion` is the record of `hmtb motion`.
    """
    cases = [(one, method) for one in answer.joints for method in one.levels]
    recovered = [one.recovered_hz(method) for one, method in cases]
    ratios = [hz / one.best_linear.half_power_hz for hz, (one, _) in zip(recovered, cases, strict=True)]
    printed = [(one.joint, model) for one in answer.joints for model in drawn_models(one.joint).values()]
    truths, seeds = [one.best_linear for one in answer.joints], len(answer.seeds)
    agreeing = [sum(map(one.near, one.levels[method])) for one, method in cases]
    values = {
        "answer": answer,
        "truths": truths,
        "moved": f"{MRAD * np.mean([truth.command_rms for truth in truths]):.2g}",
        "test": f"{MRAD * np.mean([truth.wanted_rms for truth in truths]):.2g}",
        "cases": len(cases),
        "agree": sum(one.agrees(method) for one, method in cases),
        "by": [f"{sum(map(one.agrees, METHODS))} of 3 on the {short(one.joint)}" for one in answer.joints],
        "close": CLOSE,
        "gain": MRAD * HAND_CONTROLLER.gain,
        "departures": sorted(
            100 * (ratio - 1.0)
            for ratio, (one, method) in zip(ratios, cases, strict=True)
            if np.isfinite(ratio) and not one.agrees(method)
        ),
        "none_there": sum(not np.isfinite(hz) for hz in recovered),
        "printed": len(printed),
        "same": [
            f"{short(joint)} {model.label}"
            for joint, model in printed
            if abs(model.half_power_hz / (BREAK_FREQUENCY[joint] / (2 * np.pi)) - 1.0) <= CLOSE
        ],
        "motion": motion,
        "explained": [f"the {short(joint)}" for joint, one in motion["joints"].items() if one["explained"]],
        "unanimous": sum(count in (0, seeds) for count in agreeing),
        "least": 100 * binomtest(seeds, seeds, alternative="greater").proportion_ci(0.95, "exact").low,
    }
    page = Page({"short": short, "joined": joined, "between": between, "finite": np.isfinite})
    return tuple(" ".join(part.split()) for part in page.render("answer_text.j2", values).split("\n\n"))
