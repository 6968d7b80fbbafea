"""Tests of the thesis as campaigns play them: on which arm, with which seed and length."""

from dataclasses import dataclass, replace

from hmtb_twin import Arm, load_arm
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import Scenario
from scenarios.files import codec

SINGLE_JOINT = tuple(range(1, 9))
"""Numbers of the single-joint tests [Morris1996, table 1]."""

RPCM = "rpcm"
"""Name of the exchange of the replacement unit."""

REGISTER = 20
"""Bits of the register that other binary sequences are drawn from: a million start states, mostly far apart."""


@dataclass(frozen=True)
class Condition:
    """Arm of a campaign: its variant, and whether its joints have dry friction."""

    variant: str = "nominal"
    friction: bool = True

    def __str__(self) -> str:
        friction = "with friction" if self.friction else "without friction"
        return f"{self.variant}, {friction}"

    def arm(self) -> Arm:
        """Return the arm with its payload, in free space."""
        return load_arm(self.variant, friction=self.friction)

    def applied(self, scenario: Scenario) -> Scenario:
        """Return the same experiment on this arm."""
        return replace(scenario, variant=self.variant, chain=replace(scenario.chain, friction=self.friction))


NOMINAL = Condition()


def single_joint_test(number: int, joint: str) -> str:
    """Return the name of the scenario of a single-joint test."""
    return f"siso-{number}-{joint}"


def campaign_scenario(name: str, *, seed: int | None = None, duration: float | None = None) -> Scenario:
    """Return a registered scenario as a campaign plays it.

    Args:
        name: Its name.
        seed: Draws other noise, and another binary sequence, from a longer register, where the waveform is one: the
            thesis' own sequence is unknown. All tests of one campaign have the same sequence, as the registered ones
            do. Different sequences on several axes keep their seeds, which keep them different.
        duration: Length, s; the exchange of the replacement unit keeps its own.

    Raises:
        ScenarioError: No such scenario, or an invalid seed or duration.
    """
    if seed is not None:
        codec.structure(int, seed, "seed")
    if name == RPCM:
        duration = None  # the operator's task takes as long as it takes
    scenario = load(name, duration=duration, seed=seed)
    if seed is None or [signal.kind for signal in scenario.excitation] != ["prbs"]:
        return scenario
    (binary_sequence,) = scenario.excitation
    # The shortest register has few starts: two seeds would mostly give one sequence, shifted in time.
    parameters = {**binary_sequence.parameters, "seed": seed, "register": REGISTER}
    return replace(scenario, excitation=(replace(binary_sequence, parameters=parameters),))
