"""Causes of the bandwidth error: sensitivity to order and delay, and attribution to parts of the plant."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import cast

from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from scenarios.experiments.campaign import Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.model_structures import Structure
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import MissingRecordError, ScenarioError
from scenarios.thesis.campaign import ESTIMATION_TEST, Campaign
from scenarios.thesis.estimates import IdentifiedModel, identified
from scenarios.truth.bla_of_test import BestLinearOfTest, best_linear_of_test, joint_command
from sysid import IOData, SysidError

ORDERS = ((2, 2), (3, 3), (3, 4), (4, 3), (5, 3), (4, 4), (5, 4), (6, 5))
"""nb, nf of the output-error models that are compared, the sufficient one included."""

AS_IT_IS, SMOOTH = "as on the arm", "seal friction off"

GENTLE = "seal friction off, three tenths of the amplitude"

CONDITIONS = (AS_IT_IS, SMOOTH, GENTLE)
"""Conditions of one experiment, each with one effect less than the one before.

First friction is switched off, then what changes with the pose: the arm's geometry, inertia and gravity load, whose
share falls with the square of the amplitude. Noise and rounding stay on.
"""

SMALL = 0.3
"""The smaller amplitude, as a fraction of the test's own."""


@cache
def best_linear_of(condition: Condition, joint: str, *, load_flow_slope: float = 1.0) -> BestLinearOfTest:
    """Best linear approximation of a joint under a multisine as strong as the command of the estimation test.

    It is the truth that a linear model of the test's record can find: friction and velocity limit are in it. Measured
    once in a process, for it depends on the arm and the test, not on the seed of a record. `load_flow_slope` is that of
    the valves, over the straight line's.
    """
    scenario = condition.applied(campaign_scenario(single_joint_test(ESTIMATION_TEST, joint)))
    scenario = replace(scenario, plant=replace(scenario.plant, load_flow_slope=load_flow_slope))
    # The strength of the multisine is taken from the command as a study's records have it: settled, without its mean.
    command = joint_command(scenario)[round(SETTLING * SAMPLE_RATE) :]
    record = IOData(command - command.mean(), command, SAMPLE_TIME)
    return best_linear_of_test(scenario, [record], test=scenario.name)


def order_effects(data: IOData, nk: int) -> tuple[IdentifiedModel, ...]:
    """Identify output-error models of every order in `ORDERS` that gives one, with a delay of nk samples.

    Raises:
        ScenarioError: There is no model of any order.
    """
    effects: list[IdentifiedModel] = []
    refused: list[str] = []
    for nb, nf in ORDERS:
        try:
            effects.append(_output_error(data, (nb, nf, nk), AS_IT_IS))
        except SysidError as error:
            # Large orders may have no model of a poor record; the others still show the effect of the order.
            refused.append(f"{nb}, {nf}, {nk}: {error}")
    if not effects:
        raise ScenarioError(f"{data.name} gives no output-error model of any order: {'; '.join(refused)}")
    return tuple(effects)


def _output_error(data: IOData, orders: tuple[int, int, int], condition: str) -> IdentifiedModel:
    """The output-error model of these nb, nf, nk, labelled with its condition."""
    # No record judges it: its bandwidth alone is compared.
    return identified(data, Structure("oe", "oe", orders, chosen=False, label=condition), {})


@dataclass(frozen=True)
class Attributions:
    """Bandwidths of one joint under every condition.

    Attributes:
        parts: Output-error models whose order suffices without friction, labelled with and in the order of
            `CONDITIONS`.
        missing: Conditions without a model, with the reason.
    """

    parts: tuple[IdentifiedModel, ...]
    missing: Mapping[str, str] = field(default_factory=dict)

    def find(self, condition: str) -> IdentifiedModel | None:
        """Return the model under a condition; None where it is missing."""
        return next((model for model in self.parts if model.label == condition), None)


def scaled(scenario: Scenario) -> Scenario:
    """The experiment at three tenths of its amplitude, with its noise."""
    # The waveform alone: noise and rounding stay as large as they are.
    excitation = []
    for waveform in scenario.excitation:
        amplitude = SMALL * cast(float, waveform.parameters["amplitude"])
        excitation.append(replace(waveform, parameters={**waveform.parameters, "amplitude": amplitude}))
    return replace(scenario, name=f"{scenario.name}-small", excitation=tuple(excitation))


def attribute(joint: str, main: Campaign, smooth: Campaign, orders: tuple[int, int, int]) -> Attributions:
    """Estimate the bandwidth of a joint under every condition from output-error models of one order (nb, nf, nk).

    Conditions whose experiment failed or gave no model are listed with the reason. The arm without friction (`smooth`)
    has the estimation test also at three tenths of its amplitude.
    """
    name = single_joint_test(ESTIMATION_TEST, joint)
    sources = {AS_IT_IS: (main, name), SMOOTH: (smooth, name), GENTLE: (smooth, f"{name}-small")}
    models: list[IdentifiedModel] = []
    missing: dict[str, str] = {}
    for condition, (campaign, scenario_name) in sources.items():
        try:
            models.append(_output_error(campaign.record(scenario_name, joint), orders, condition))
        except (MissingRecordError, SysidError) as error:
            # One condition less does not hide what the others show.
            missing[condition] = str(error)
    return Attributions(tuple(models), MappingProxyType(missing))
