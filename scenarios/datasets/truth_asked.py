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
        best_linear: Blocks of records for whose arm, joints and amplitude the best linear approximation is measured.
        floors: Records of each block of the test part, by arm and joints, all twins together, for which the floors of
            linear systems are searched. What no model at all can foretell is told for every one.
        search_steps: At most, of each search for the linear system of the truth's order behind such a floor; 0: to the
            end, which takes ten times as long and finds a few percent more at most.
        realisations: Of the multisine that each best linear approximation is measured with. Those that the data set's
            own records of its class have count; what is missing is simulated.
    """

    amplitudes: tuple[float, ...] = ()
    best_linear: tuple[str, ...] = ()
    floors: int = 1
    search_steps: int = 10
    realisations: int = 8

    def __post_init__(self) -> None:
        if not all(0.0 < amplitude <= LARGEST for amplitude in self.amplitudes):
            raise ScenarioError(
                f"truth: amplitudes = {self.amplitudes} given, expected above 0 and up to {LARGEST:g} rad"
            )
        for name in ("amplitudes", "best_linear"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ScenarioError(f"truth: {name} = {values} given, expected each once")
        for name, least, most in (("floors", 0, 10**6), ("search_steps", 0, 10**4), ("realisations", 2, 10**4)):
            if not least <= getattr(self, name) <= most:
                raise ScenarioError(
                    f"truth: {name} = {getattr(self, name)} given, expected {least} or more, up to {most}"
                )
