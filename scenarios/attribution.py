"""Why an interval misses the truth: the same experiment again, with what is not linear or not known switched off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import sysid
from hmtb_twin import JointLog
from scenarios.crossing import half_power_hz
from scenarios.excitation_computer import Excitation
from scenarios.preparation import prepared
from scenarios.scenario import Scenario


@dataclass(frozen=True)
class Attribution:
    """The recovered bandwidth under one condition.

    Attributes:
        condition: What was switched off, in words.
        bandwidth_hz: Recovered bandwidth of the output-error model whose order suffices without friction, Hz.
        ci95: Its 95 % interval, Hz.
        covers: Whether the interval holds the small-signal truth.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
    """

    condition: str
    bandwidth_hz: float
    ci95: tuple[float, float]
    covers: bool
    half_power_hz: float


CONDITIONS = (
    "as on the arm",
    "seal friction off",
    "seal friction off, three tenths of the amplitude",
)
"""What is switched off, one thing more each time: friction, then the arm's geometry, its inertia and gravity load that
change with the pose; their share falls with the square of the amplitude. Noise and rounding stay on."""

COVERAGE = (
    ((0, 0.8386), (0, 0.9058), (0, 1.0236)),
    ((18, 1.0259), (0, 1.0287), (5, 1.0865)),
    ((20, 1.0257), (20, 1.0302), (20, 1.0859)),
)
"""By condition and joint, over twenty seeds: intervals that hold the truth, and mean bandwidth, Hz.

`make bench` (`tests/benchmarks/test_coverage.py`) measures them; it takes too long for every study.
"""


def conditions(scenario: Scenario) -> tuple[Scenario, ...]:
    """The experiment under every condition but the first, which is the experiment itself.

    Args:
        scenario: The experiment that models are identified from.

    Returns:
        Scenarios in the order of `CONDITIONS[1:]`, with the noise of the original.
    """
    smooth = replace(scenario, name=f"{scenario.name}-no-friction", chain=replace(scenario.chain, friction=False))
    small = replace(
        smooth, name=f"{scenario.name}-small", excitation=tuple(_scaled(entry, 0.3) for entry in scenario.excitation)
    )
    return smooth, small


def _scaled(excitation: Excitation, factor: float) -> Excitation:
    amplitude = cast(float, excitation.parameters["amplitude"])
    return replace(excitation, parameters={**excitation.parameters, "amplitude": factor * amplitude})


def attribute(
    scenario: Scenario, joint: str, logs: Mapping[str, JointLog], true_hz: float, orders: Sequence[int]
) -> tuple[Attribution, ...]:
    """Recover the bandwidth under every condition.

    Args:
        scenario: The experiment itself.
        joint: The joint.
        logs: Logs by scenario name; conditions without a log are left out.
        true_hz: Small-signal bandwidth, Hz.
        orders: nb, nf, nk of the output-error model.

    Returns:
        One record for each condition.
    """
    names = [scenario.name, *(entry.name for entry in conditions(scenario))]
    found = []
    for condition, name in zip(CONDITIONS, names, strict=True):
        if name in logs:
            model = sysid.oe(prepared(logs[name], joint), orders[0], orders[1], orders[2])
            band = model.bandwidth()
            hz, ci95 = float(band.hz[0, 0]), (float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0]))
            covers = bool(band.covers(true_hz)[0, 0])
            found.append(Attribution(condition, hz, ci95, covers, half_power_hz(model.model)))
    return tuple(found)
