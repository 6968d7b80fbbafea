"""Campaigns: the tests of the thesis played on one arm, and their records."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from types import MappingProxyType

from hmtb_twin import STUDIED_JOINTS, JointLog, Truth, linearize, simulate
from hmtb_twin.run.simulation import Progress
from scenarios.experiments.campaign import NOMINAL, RPCM, SINGLE_JOINT, Condition, single_joint_test
from scenarios.experiments.log_review import prepared
from scenarios.experiments.registry import load, names
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import MissingRecordError, ScenarioError
from sysid import IOData

ESTIMATION_TEST = 5
"""Models are identified from the PRBS of 1 V and judged on the tests of other waveforms [Morris1996, ch. IV and V]."""

SAME_SEQUENCE = (5, 6)
"""Numbers of the single-joint tests that play the same binary sequence.

The velocity limit turns the larger amplitude into nearly the same command: neither can validate a model of the other.
"""

OTHER_WAVEFORMS = tuple(test for test in SINGLE_JOINT if test not in SAME_SEQUENCE)
"""Numbers of the single-joint tests of other waveforms, which validate models of a binary sequence."""

CONDITIONS = (NOMINAL, Condition(friction=False), Condition("published"), Condition("published", friction=False))
"""The arms that the study compares; the first is its subject."""

EVERY_TEST = (*names("thesis"), *names("mimo"), RPCM)
"""Every record of the thesis: both tables, the independent waveforms and the exchange of the replacement unit."""

FAIRNESS_TESTS = (*names("thesis"), "mimo-10", "mimo-12", RPCM)
"""Tests played on the other arms: table 1, the slow and the fast chirp of table 2 and the exchange."""


@dataclass(frozen=True, eq=False)
class Campaign:
    """Logs of the tests on one arm, and the truth about the arm.

    Attributes:
        condition: The arm.
        truth: Its small-signal truth at the operating point, with its payload.
        logs: Logs by name of the scenario, in the requested order.
        failed: Names of those that failed, with the reason.
        seed: Seed of other noise and binary sequences; None for the scenarios' own.
        duration: Shortened length of the tests, s; None for the thesis' 240 s.
        physics_s: Wall time inside the physics engine, s.
        simulation_s: Wall time of the whole simulation, s.
    """

    condition: Condition
    truth: Truth
    logs: Mapping[str, JointLog]
    failed: Mapping[str, str]
    seed: int | None = None
    duration: float | None = None
    physics_s: float = 0.0
    simulation_s: float = 0.0
    # One object for each record, because estimates are kept by it; a changed campaign starts without.
    _prepared: dict[object, IOData] = field(init=False, default_factory=dict, repr=False)

    def log(self, name: str) -> JointLog:
        """Return the log of a scenario; raises `MissingRecordError` if it failed or was not played."""
        if name not in self.logs:
            reason = self.failed.get(name, "it was not played in this campaign")
            raise MissingRecordError(f"there is no record of {name}: {reason}")
        return self.logs[name]

    def single(self, number: int, joint: str) -> IOData:
        """Return the `prepared` record of the excited joint in a single-joint test, 1 to 8, rad; see `log`."""
        return self.record(single_joint_test(number, joint), joint)

    def singles(self, joint: str) -> dict[int, IOData]:
        """Return the `prepared` records of all single-joint tests of a joint that did not fail, by number."""
        available = [number for number in SINGLE_JOINT if single_joint_test(number, joint) in self.logs]
        return {number: self.single(number, joint) for number in available}

    def own(self, joint: str) -> IOData:
        """Return the record that models of a joint are identified from; see `single`."""
        return self.single(ESTIMATION_TEST, joint)

    def several(self, name: str) -> IOData:
        """Return the `prepared` record of the studied joints, one input and one output each, rad; see `log`."""
        return self.record(name, STUDIED_JOINTS)

    def record(self, name: str, joints: str | tuple[str, ...]) -> IOData:
        """Return the `prepared` record of a scenario, always the same object; see `log`."""
        key = (name, joints)
        if key not in self._prepared:
            self._prepared[key] = prepared(self.log(name), joints)
        return self._prepared[key]


def plays_identified_sequence(name: str) -> bool:
    """Return whether a registered test plays, on any axis, the binary sequence that models are identified from.

    Such a record does not validate those models, whatever its amplitude and number of axes: single-joint tests 5 and 6
    and tests 7 and 8 of several joints, independent axes included.
    """
    return any(waveform.kind == "prbs" for waveform in load(name).excitation)


def run_campaign(
    condition: Condition,
    scenarios: Sequence[Scenario],
    *,
    seed: int | None = None,
    duration: float | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Campaign:
    """Play scenarios as they are, but on one arm, all side by side, and return the records in their order.

    The campaign remembers the seed and the shortened length, s, that the scenarios were made with.

    Raises:
        ScenarioError: Nothing to play, or the same name twice; nothing is played then.
    """
    if not scenarios:
        raise ScenarioError("no tests given: a campaign plays at least one")
    uses = Counter(scenario.name for scenario in scenarios)
    repeated = [name for name, count in uses.items() if count > 1]
    if repeated:
        raise ScenarioError(f"given more than once: {', '.join(repeated)}; a campaign has one record of each name")
    on_this_arm = [condition.applied(scenario) for scenario in scenarios]
    # One call for all tests: Python then runs once per tick for the whole campaign.
    started = perf_counter()
    result = simulate(on_this_arm, threads=threads, progress=progress)
    simulation_s = perf_counter() - started
    logs = {log.name: log for log in result.logs}
    return Campaign(
        condition=condition,
        truth=linearize(condition.arm()),
        logs=MappingProxyType(logs),
        failed=result.failed,
        seed=seed,
        duration=duration,
        physics_s=result.physics_seconds,
        simulation_s=simulation_s,
    )
