"""How much a data set tells of its truth, and with how much work: the table `[truth]` of a spec."""

from dataclasses import dataclass

from scenarios.errors import ScenarioError

LARGEST = 1.0
"""No trial amplitude of a small signal is larger, rad."""


@dataclass(frozen=True)
class TruthAsked:
    """What is told beyond matrices and noise floors, which every data set has.

    Attributes:
        amplitudes: At which the linear model of every arm is tried against simulation, rad; most of a second per arm.
        best_linear: Blocks of records for whose arm, joints and amplitude the best linear approximation is measured; it
            takes eight simulations of half a minute for each, and one more for every amplitude that is tried.
        floors: Records of each block of the test part, by arm and joints, all twins together, for which the floors of
            linear systems are searched; about a second each. What no model at all can foretell is told for every one.
    """

    amplitudes: tuple[float, ...] = ()
    best_linear: tuple[str, ...] = ()
    floors: int = 1

    def __post_init__(self) -> None:
        if not all(0.0 < amplitude <= LARGEST for amplitude in self.amplitudes):
            raise ScenarioError(
                f"truth: amplitudes = {self.amplitudes} given, expected above 0 and up to {LARGEST:g} rad"
            )
        for name in ("amplitudes", "best_linear"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ScenarioError(f"truth: {name} = {values} given, expected each once")
        if not 0 <= self.floors <= 10**6:
            raise ScenarioError(f"truth: floors = {self.floors} given, expected 0 or more")
