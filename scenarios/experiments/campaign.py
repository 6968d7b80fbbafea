"""A campaign: the tests of the thesis played on one arm, and the records that came of them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from types import MappingProxyType

from hmtb_twin import STUDIED_JOINTS, Arm, JointLog, Truth, linearize, load_arm, simulate
from hmtb_twin.run.simulation import Progress
from scenarios.experiments.log_review import prepared
from scenarios.experiments.registry import load, names
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import MissingRecordError, ScenarioError, unknown
from sysid import IOData

SINGLE_JOINT = tuple(range(1, 9))
"""Numbers of the single-joint tests [Morris1996, table 1]."""

SEVERAL_JOINTS = tuple(range(1, 14))
"""Numbers of the tests of several joints [Morris1996, table 2]."""

RPCM = "rpcm"
"""Name of the exchange of the replacement unit."""

SAME_SEQUENCE = (5, 6)
"""Numbers of the single-joint tests that play one and the same binary sequence.

The velocity limit turns the larger amplitude into much the same command: to a model of one, the other is no new record.
"""

OTHER_WAVEFORMS = tuple(number for number in SINGLE_JOINT if number not in SAME_SEQUENCE)
"""Numbers of the single-joint tests of other waveforms: what a model of a binary sequence has not seen."""

REGISTER = 20
"""Bits of the register that other binary sequences are drawn from: a million starts, far apart as a rule."""


@dataclass(frozen=True)
class Condition:
    """On which arm a campaign is played.

    Attributes:
        variant: Arm variant.
        friction: Whether its joints have dry friction.
    """

    variant: str = "nominal"
    friction: bool = True

    def __str__(self) -> str:
        return f"{self.variant}, {'with' if self.friction else 'without'} friction"

    def arm(self) -> Arm:
        """The arm with its payload, away from the worksite."""
        return load_arm(self.variant, friction=self.friction)

    def applied(self, scenario: Scenario) -> Scenario:
        """The same experiment on this arm."""
        return replace(scenario, variant=self.variant, chain=replace(scenario.chain, friction=self.friction))


NOMINAL = Condition()

CONDITIONS = (NOMINAL, Condition(friction=False), Condition("published"), Condition("published", friction=False))
"""The arms that the study lays side by side; the first is the one that it is about."""

EVERY_TEST = (*names("thesis"), *names("mimo"), RPCM)
"""Every record of the thesis: both tables, the independent waveforms and the exchange of the replacement unit."""

FAIRNESS_TESTS = (*names("thesis"), "mimo-10", "mimo-12", RPCM)
"""What is played on the other arms: table 1, the slow and the fast chirp of table 2 and the exchange."""


@dataclass(frozen=True, eq=False)
class Campaign:
    """What was played on one arm, and what is known of the arm.

    Attributes:
        condition: The arm.
        truth: Its small-signal truth at the operating point, payload in hand.
        logs: Logs by name of the scenario, in the order in which they were asked for.
        failed: Names of those that failed, with the reason.
        seed: What other noise and binary sequences were drawn from; None for the scenarios' own.
        duration: Length of the tests where it was shortened, s; None for the thesis' 240 s.
        physics_s: Wall time inside the physics engine, s.
        simulation_s: Wall time of the simulation as a whole, s.
    """

    condition: Condition
    truth: Truth
    logs: Mapping[str, JointLog]
    failed: Mapping[str, str]
    seed: int | None = None
    duration: float | None = None
    physics_s: float = 0.0
    simulation_s: float = 0.0

    def log(self, name: str) -> JointLog:
        """The log of a scenario.

        Raises:
            MissingRecordError: It failed, or was not asked for.
        """
        if name not in self.logs:
            why = self.failed.get(name, "it was not played in this campaign")
            raise MissingRecordError(f"there is no record of {name}: {why}")
        return self.logs[name]

    def single(self, number: int, joint: str) -> IOData:
        """Settled record of a single-joint test without its means, rad; see `prepared`.

        Args:
            number: Of the test, 1 to 8.
            joint: The joint excited.

        Raises:
            MissingRecordError: There is no such record.
            ScenarioError: There is no such test in the thesis.
        """
        _check_joint(joint)
        if number not in SINGLE_JOINT:
            raise ScenarioError(f"single-joint test {number!r} given; there are tests 1 to {len(SINGLE_JOINT)}")
        return prepared(self.log(single_joint_test(number, joint)), joint)

    def singles(self, joint: str) -> dict[int, IOData]:
        """Records of all single-joint tests of a joint that did not fail, by number.

        Args:
            joint: The joint excited.

        Raises:
            ScenarioError: The thesis excites no such joint.
        """
        _check_joint(joint)
        return {n: self.single(n, joint) for n in SINGLE_JOINT if single_joint_test(n, joint) in self.logs}

    def several(self, name: str, joints: Sequence[str] = STUDIED_JOINTS) -> IOData:
        """Settled record of several joints without its means: commands in, measurements out, rad.

        Args:
            name: Of the scenario: `mimo-1` to `mimo-13`, `mimo-7-independent`, `rpcm`.
            joints: The joints, of which there is one input and one output each.

        Raises:
            MissingRecordError: There is no such record.
        """
        return prepared(self.log(name), joints)


def single_joint_test(number: int, joint: str) -> str:
    """Name of the scenario of a single-joint test."""
    return f"siso-{number}-{joint}"


def _check_joint(joint: str) -> None:
    if joint not in STUDIED_JOINTS:
        raise ScenarioError(unknown("joint of single-joint tests", joint, STUDIED_JOINTS))


def plays_identified_sequence(name: str) -> bool:
    """Whether a test plays the binary sequence that models are identified from, on one of its axes at least.

    Such a record is not held out from those models, whatever its amplitude and however many axes it moves.

    Args:
        name: Of the scenario, as registered.

    Returns:
        True for single-joint tests 5 and 6 and for tests 7 and 8 of several joints, independent axes included.
    """
    return any(entry.kind == "prbs" for entry in load(name).excitation)


def tests_of_same_sequence(number: int) -> tuple[int, ...]:
    """Numbers of the single-joint tests that are no new records to a model of one of them.

    Args:
        number: Of the test that it was identified from, 1 to 8.

    Returns:
        Its own, and the other that plays the same sequence where there is one.
    """
    return SAME_SEQUENCE if number in SAME_SEQUENCE else (number,)


def campaign_scenario(name: str, *, seed: int | None = None, duration: float | None = None) -> Scenario:
    """A registered scenario as a campaign plays it.

    Args:
        name: Its name.
        seed: Draws other noise, and another binary sequence where the waveform file holds one, of a longer register:
            nothing is known of the thesis' own sequence. All tests of one campaign have the same sequence, as the
            scenarios' own have. Sequences of several axes at once keep their seeds, which keep them apart.
        duration: Length, s; the exchange of the replacement unit keeps its own.

    Returns:
        The scenario.

    Raises:
        ScenarioError: No such scenario, or a seed or a duration that none can have.
    """
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or seed < 0):
        raise ScenarioError(f"seed = {seed!r} given, expected a whole number of 0 or more")
    scenario = load(name)
    if seed is not None:
        scenario = scenario.reseeded(seed)
        if len(scenario.excitation) == 1 and scenario.excitation[0].kind == "prbs":
            (entry,) = scenario.excitation
            other = {**entry.parameters, "seed": seed, "register": REGISTER}
            scenario = replace(scenario, excitation=(replace(entry, parameters=other),))
    return scenario if duration is None or name == RPCM else replace(scenario, duration=duration)


def run_campaign(
    condition: Condition = NOMINAL,
    tests: Sequence[str] = EVERY_TEST,
    *,
    extra: Sequence[Scenario] = (),
    seed: int | None = None,
    duration: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Campaign:
    """Play tests on one arm, all side by side.

    Args:
        condition: The arm.
        tests: Names of registered scenarios.
        extra: Further scenarios, played as they are but on this arm.
        seed: See `planned`.
        duration: See `planned`.
        threads: Threads for the physics.
        progress: Told of the ticks done and of those there are.

    Returns:
        The records, in the order of the tests.

    Raises:
        ScenarioError: Nothing to play, the same name twice, or see `planned`; nothing is played then.
    """
    scenarios = [*(campaign_scenario(name, seed=seed, duration=duration) for name in tests), *extra]
    if not scenarios:
        raise ScenarioError("no tests given: a campaign plays at least one")
    twice = [name for name, count in Counter(entry.name for entry in scenarios).items() if count > 1]
    if twice:
        raise ScenarioError(f"given more than once: {', '.join(twice)}; a campaign has one record of each name")
    started = perf_counter()
    result = simulate([condition.applied(entry) for entry in scenarios], threads=threads, progress=progress)
    taken = perf_counter() - started
    return Campaign(
        condition=condition,
        truth=linearize(condition.arm()),
        logs=MappingProxyType({log.name: log for log in result.logs}),
        failed=result.failed,
        seed=seed,
        duration=duration,
        physics_s=result.physics_seconds,
        simulation_s=taken,
    )
