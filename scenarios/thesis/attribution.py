"""Causes of the bandwidth error: sensitivity to order and delay, and attribution to parts of the plant."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import cast

import numpy as np

from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from scenarios.experiments.campaign import Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import MissingRecordError, ScenarioError
from scenarios.thesis.campaign import ESTIMATION_TEST, Campaign
from scenarios.thesis.estimates import estimate
from scenarios.truth.bla_of_test import BestLinearOfTest, best_linear_of_test, joint_command
from sysid import IOData, SysidError, SysidWarning
from sysid.models.bandwidth import half_power_hz

ORDERS = ((2, 2), (3, 3), (3, 4), (4, 3), (5, 3), (4, 4), (5, 4))
"""nb, nf of the output-error models that are compared, the sufficient one included."""

AS_IT_IS, SMOOTH = "as on the arm", "seal friction off"

GENTLE = "seal friction off, three tenths of the amplitude"

CONDITIONS = (AS_IT_IS, SMOOTH, GENTLE)
"""Conditions, each switches off one more effect: friction, then what changes with the pose, the arm's geometry,
inertia and gravity load; their share falls with the square of the amplitude. Noise and rounding stay on."""

SMALL = 0.3
"""The smaller amplitude, as a part of the test's own."""


@cache
def best_linear_of(condition: Condition, joint: str, test: int) -> BestLinearOfTest:
    """Best linear approximation of a joint under a multisine as strong as the command of a single-joint test.

    It is the truth that a linear model of the test's record can find: friction and velocity limit are in it. Measured
    once in a process, for it depends on the arm and the test, not on the seed of a record.
    """
    scenario = condition.applied(campaign_scenario(single_joint_test(test, joint)))
    command = joint_command(scenario)[round(SETTLING * SAMPLE_RATE) :]
    record = IOData(command - command.mean(), command, SAMPLE_TIME)
    return best_linear_of_test(scenario, [record], test=scenario.name)


@dataclass(frozen=True)
class OutputErrorBandwidth:
    """Bandwidth of an output-error model.

    Attributes:
        orders: nb, nf, nk.
        bandwidth_hz: Recovered bandwidth, Hz.
        ci95: Its 95 % interval, Hz.
        dc_gain: Gain at 0 Hz, which the bandwidth is relative to.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
        residual: Standard deviation of the residuals, output units.
        condition: What was switched off, in words; one of `CONDITIONS`.
    """

    orders: tuple[int, int, int]
    bandwidth_hz: float
    ci95: tuple[float, float]
    dc_gain: float
    half_power_hz: float
    residual: float
    condition: str = AS_IT_IS

    def holds(self, hz: float) -> bool:
        """Whether its interval holds a frequency, Hz."""
        return self.ci95[0] <= hz <= self.ci95[1]


def order_effects(data: IOData, nk: int) -> tuple[OutputErrorBandwidth, ...]:
    """Identify output-error models of every order in `ORDERS` that gives one, with a delay of nk samples.

    Raises:
        ScenarioError: There is no model of any order.
    """
    effects: list[OutputErrorBandwidth] = []
    refused: list[str] = []
    for nb, nf in ORDERS:
        try:
            effects.append(_recovered(data, (nb, nf, nk)))
        except SysidError as error:
            refused.append(f"{nb}, {nf}, {nk}: {error}")
    if not effects:
        raise ScenarioError(f"{data.name} gives no output-error model of any order: {'; '.join(refused)}")
    return tuple(effects)


def _recovered(data: IOData, orders: tuple[int, int, int], condition: str = AS_IT_IS) -> OutputErrorBandwidth:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        model = estimate(data, "oe", orders)
        hz, *ci95 = model.bandwidth().path()
    residual = float(np.std(model.residuals))
    level, gain = half_power_hz(model.model), float(model.dc_gain()[0, 0])
    return OutputErrorBandwidth(orders, hz, (ci95[0], ci95[1]), gain, level, residual, condition)


@dataclass(frozen=True)
class Attributions:
    """Bandwidths of one joint under every condition.

    Attributes:
        parts: Of the output-error model whose order suffices without friction, in the order of `CONDITIONS`.
        missing: Conditions of which nothing is known, with the reason.
    """

    parts: tuple[OutputErrorBandwidth, ...]
    missing: Mapping[str, str] = field(default_factory=dict)

    def find(self, condition: str) -> OutputErrorBandwidth | None:
        """Return the result under a condition; None where it is missing."""
        return next((part for part in self.parts if part.condition == condition), None)


def conditions(scenario: Scenario) -> tuple[Scenario, ...]:
    """The experiment under every condition but the first, in the order of `CONDITIONS[1:]`, with its own noise."""
    smooth = replace(scenario, name=f"{scenario.name}-no-friction", chain=replace(scenario.chain, friction=False))
    return smooth, scaled(smooth)


def scaled(scenario: Scenario) -> Scenario:
    """The experiment at three tenths of its amplitude, with its noise."""
    excitation = tuple(
        replace(one, parameters={**one.parameters, "amplitude": SMALL * cast(float, one.parameters["amplitude"])})
        for one in scenario.excitation
    )
    return replace(scenario, name=f"{scenario.name}-small", excitation=excitation)


def attribute(joint: str, main: Campaign, smooth: Campaign, orders: tuple[int, int, int]) -> Attributions:
    """Estimate the bandwidth of a joint under every condition from output-error models of one order (nb, nf, nk).

    Conditions whose experiment failed or gave no model are listed with the reason. The arm without friction (`smooth`)
    has the estimation test also at three tenths of its amplitude.
    """
    name = single_joint_test(ESTIMATION_TEST, joint)
    sources = {AS_IT_IS: (main, name), SMOOTH: (smooth, name), GENTLE: (smooth, f"{name}-small")}
    parts: list[OutputErrorBandwidth] = []
    missing: dict[str, str] = {}
    for condition, (source, record) in sources.items():
        try:
            parts.append(_recovered(source.record(record, joint), orders, condition))
        except (MissingRecordError, SysidError) as error:
            missing[condition] = str(error)
    return Attributions(tuple(parts), MappingProxyType(missing))
