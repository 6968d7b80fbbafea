"""Study of the 1 Hz finding: bandwidths of joints, methods, tests and seeds beside every truth."""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from types import MappingProxyType

import numpy as np

from hmtb_twin import Arm, JointLog, Truth, linearize, simulate
from hmtb_twin.parameters.values import OPERATING_POSE
from hmtb_twin.truth.logged_arm import logged_arm
from scenarios.experiments.campaign import SINGLE_JOINT, Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import SETTLING, prepared
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.scenario import Scenario
from scenarios.experiments.waveform import WINDOW
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.one_hertz import (
    best_linear_in_words,
    coverage_in_words,
    grouped,
    published_in_words,
    recovered_in_words,
    verdict,
)
from scenarios.identification.recovered_bandwidth import METHODS, Recording, RecoveredBandwidth, recover, structure
from scenarios.truth.bla_of_test import BestLinearOfTest, best_linear_of_test
from scenarios.truth.maps import Stage
from scenarios.truth.published import published
from sysid.models.bandwidth import half_power_hz

SHORTEST = 2 * SETTLING + WINDOW
"""Shortest test, s: the start is cut off, and more than as much again must be left."""

ENOUGH = (
    f"expected {SHORTEST:g} s or more: the arm settles for {SETTLING:g} s, and a file of {WINDOW:g} s is to be "
    "seen some times after that"
)
"""Expected length of a test, for messages."""

FULL = 240.0
"""Length of the thesis' tests, s."""


@dataclass(frozen=True, eq=False)
class BandwidthStudy:
    """Every recovered bandwidth, and the truth.

    Attributes:
        condition: The arm in words.
        rows: The recovered bandwidths.
        truth: Small-signal truth of the arm.
        best_linear: Best linear approximations by joint and test; none where they were left out.
        failed: Experiments that failed, with the reason.
        duration: Length of the tests where it was shortened, s.
    """

    condition: str
    rows: tuple[RecoveredBandwidth, ...]
    truth: Truth
    best_linear: Mapping[tuple[str, str], BestLinearOfTest]
    failed: Mapping[str, str]
    duration: float | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints, in the order of the rows."""
        return tuple(dict.fromkeys(row.joint for row in self.rows))

    def groups(self, joint: str) -> list[list[RecoveredBandwidth]]:
        """Return the rows of a joint by method and test, the seeds of each together."""
        rows = (row for row in self.rows if row.joint == joint)
        return list(grouped(rows, attrgetter("method", "test")).values())

    def refusals(self) -> tuple[str, ...]:
        """Say why bandwidths are not claimed: each reason once, with the methods and how often."""

        def reason(row: RecoveredBandwidth) -> str:
            """The numbers in a reason differ from row to row."""
            return re.sub(r"\d+(\.\d+)?(e[+-]?\d+)?", "#", row.reasons[0])

        by_reason = grouped((row for row in self.rows if row.refused), reason)
        return tuple(
            f"{len(rows)} of {len(self.rows)} ({', '.join(dict.fromkeys(METHODS[row.method] for row in rows))}), "
            f"{'e.g. ' if len(rows) > 1 else ''}{rows[0].scenario}: {rows[0].reasons[0]}"
            for rows in by_reason.values()
        )

    def answers(self) -> tuple[str, ...]:
        """Say whether the 1 Hz finding holds: the verdict, then what it rests on."""
        printed = published_in_words(self.joints)
        texts = (
            ""
            if self.duration is None or self.duration >= FULL
            else f"This is a look, not a result: the records are {self.duration:g} s long instead of 240 s.",
            verdict(self.rows),
            best_linear_in_words(self.rows),
            recovered_in_words(self.rows),
            coverage_in_words(self.rows),
            f"Published: {printed}" if printed else "",
        )
        return tuple(filter(None, texts))

    def record(self) -> dict[str, object]:
        """Return what `hmtb bandwidth --json` prints."""
        truths = {joint: self.truth.joint(joint) for joint in self.joints}
        return {
            "rows": [row.record() for row in self.rows],
            "answer": " ".join(self.answers()),
            "condition": self.condition,
            "true": {
                joint: {"hz": truth.bandwidth_hz, "half_power_hz": half_power_hz(truth.model)}
                for joint, truth in truths.items()
            },
            "best_linear": [
                {
                    **{name: value for name, value in vars(one).items() if name != "response"},
                    "excitation": one.described,
                }
                for one in self.best_linear.values()
            ],
            "published": {joint: {one.label: one.bandwidth_hz for one in published(joint)} for joint in self.joints},
            "failed": dict(self.failed),
            "duration": self.duration,
        }


def from_simulation(
    joints: Sequence[str],
    methods: Sequence[str],
    tests: Sequence[int],
    *,
    seeds: Sequence[int | None] = (None,),
    condition: Condition | None = None,
    duration: float | None = None,
    best_linear: bool = True,
    threads: int | None = None,
    stage: Stage,
) -> BandwidthStudy:
    """Simulate tests and recover the bandwidths from them.

    Args:
        joints: Studied joints.
        methods: Keys of `scenarios.identification.one_hertz.METHODS`.
        tests: Numbers of single-joint tests, 1 to 8.
        seeds: Each draws noise and binary sequences anew; None are the scenarios' own.
        condition: The arm; nominal with friction when not given.
        duration: Length of the tests instead of 240 s, s.
        best_linear: Whether to measure the best linear approximation for every joint and test.
        threads: Threads for the physics.
        stage: Opens a progress bar.

    Raises:
        ScenarioError: An unknown joint, method or test, no seed, tests too short, or every experiment failed.
    """
    for what, values in (("joints", joints), ("methods", methods), ("tests", tests), ("seeds", seeds)):
        if not values:
            raise ScenarioError(f"no {what} given, expected one or more")
    for joint, method in itertools.product(joints, methods):
        structure(joint, method)  # refuses unknown names before any work begins
    for test in tests:
        if test not in SINGLE_JOINT:
            raise ScenarioError(unknown("test", test, map(str, SINGLE_JOINT)))
    if duration is not None and not duration >= SHORTEST:
        raise ScenarioError(f"a duration of {duration:g} s given, {ENOUGH}")
    condition = condition or Condition()
    recordings, failed = list[Recording](), dict[str, str]()
    names = [(test, joint) for test in dict.fromkeys(tests) for joint in dict.fromkeys(joints)]
    with stage("simulate") as step:
        for number, seed in enumerate(seeds):
            plan = {
                (test, joint): condition.applied(
                    campaign_scenario(single_joint_test(test, joint), seed=seed, duration=duration)
                )
                for test, joint in names
            }
            simulated = simulate(
                list(plan.values()),
                threads=threads,
                progress=lambda part, whole, before=number: step(before * whole + part, len(seeds) * whole),  # type: ignore[misc]
            )
            logs = {log.name: log for log in simulated.logs}
            failed |= {f"{name}, seed {seed}": why for name, why in simulated.failed.items()}
            recordings += [
                Recording(joint, str(test), seed, prepared(logs[setting.name], joint), setting)
                for (test, joint), setting in plan.items()
                if setting.name in logs
            ]
    if not recordings:
        raise ScenarioError(f"every experiment failed: {'; '.join(f'{name}: {why}' for name, why in failed.items())}")
    first = next((seed for seed in seeds if seed is not None), 0) if best_linear else None
    known = (str(condition), condition.arm(), OPERATING_POSE)
    return _study(recordings, methods, known, first, threads, stage, failed=failed, duration=duration)


def from_logs(
    logs: Sequence[JointLog],
    methods: Sequence[str],
    *,
    best_linear: bool = True,
    seed: int = 0,
    threads: int | None = None,
    stage: Stage,
) -> BandwidthStudy:
    """Recover the bandwidths from logs; the truth is that of their arm.

    Args:
        logs: Logs of single-joint experiments on one arm.
        methods: Keys of `scenarios.identification.one_hertz.METHODS`.
        best_linear: Whether to measure the best linear approximation for every joint and test.
        seed: Of the best linear approximation.
        threads: Threads for the physics.
        stage: Opens a progress bar.

    Raises:
        ScenarioError: A log that excites several axes or a joint that was not studied, one that is too short, the same
            record twice, or logs of several arms.
    """
    if not methods:
        raise ScenarioError("no methods given, expected one or more")
    recordings = list[Recording]()
    arms: dict[tuple[object, ...], tuple[Arm, str, str]] = {}
    for log in logs:
        if len(log.axes) != 1:
            raise ScenarioError(f"{log.name} excites {', '.join(log.axes)}; expected a log that excites one joint")
        (joint,) = log.axes
        for method in methods:
            structure(joint, method)
        if round(len(log) * log.dt, 9) < SHORTEST:
            raise ScenarioError(f"{log.name}: a log of {len(log) * log.dt:g} s given, {ENOUGH}")
        if "scenario" not in log.provenance:
            raise ScenarioError(f"{log.name}: its provenance lacks scenario; expected a log of hmtb simulate")
        arm = logged_arm(log)
        setting = Scenario.from_toml(log.provenance["scenario"], source=f"{log.name}, its scenario")
        key = (arm.variant, arm.payload, *vars(arm.plant).values(), arm.specimen, arm.friction, setting.pose)
        arms.setdefault(key, (arm, setting.pose, log.name))
        # The thesis' tests go by number, others by name.
        numbers = {single_joint_test(number, joint): str(number) for number in SINGLE_JOINT}
        recordings.append(Recording(joint, numbers.get(log.name, log.name), log.seed, prepared(log, joint), setting))
    if len(arms) > 1:
        raise ScenarioError(
            f"the logs are of {len(arms)} arms or conditions ({', '.join(name for *_, name in arms.values())}); "
            "expected one, whose truth they are compared with"
        )
    for log, other in itertools.combinations(logs, 2):
        # A record that comes twice, under its own name or another, whole or cut, would count as two.
        common = min(len(log), len(other))
        same = np.array_equal(log.measured[:common], other.measured[:common])
        if same or (log.name, log.seed) == (other.name, other.seed):
            raise ScenarioError(
                f"the log of {other.name}, seed {other.seed}, is given twice"
                + (f", also as {log.name}, seed {log.seed}" if log.name != other.name else "")
                + "; expected every record once"
            )
    ((arm, pose, _),) = arms.values()
    shortest = min(len(log) * log.dt for log in logs)
    known = (str(Condition(arm.variant, arm.friction)), arm, pose)
    duration = shortest if shortest < FULL else None
    return _study(recordings, methods, known, seed if best_linear else None, threads, stage, duration=duration)


def _study(
    recordings: Sequence[Recording],
    methods: Sequence[str],
    known: tuple[str, Arm, str],
    seed: int | None,
    threads: int | None,
    stage: Stage,
    *,
    failed: Mapping[str, str] = MappingProxyType({}),
    duration: float | None,
) -> BandwidthStudy:
    """Recover bandwidths joint by joint in the thesis' order, then test by test, then seed by seed.

    `known` has the condition in words, the arm and its pose; without a seed, best linear approximations are left out.
    """
    condition, arm, pose = known
    truth = linearize(arm, pose, amplitudes=())
    in_order = sorted(recordings, key=lambda one: list(STRUCTURES).index(one.joint))
    groups = grouped(in_order, attrgetter("joint", "test"))
    approximations, rows = dict[tuple[str, str], BestLinearOfTest](), list[RecoveredBandwidth]()
    if seed is not None:
        with stage("best linear approximation") as step:
            for (joint, test), group in groups.items():
                step(len(approximations), len(groups))
                records = [one.data for one in group]
                approximations[joint, test] = best_linear_of_test(
                    group[0].setting, records, test=test, seed=seed, threads=threads
                )
    chosen = list(dict.fromkeys(methods))
    with stage("identify") as step:
        for (joint, test), group in groups.items():
            bla = approximations.get((joint, test))
            interval = None if bla is None else (bla.hz, *bla.ci95)
            for one, method in itertools.product(group, chosen):
                rows.append(recover(one, method, truth.joint(joint).bandwidth_hz, interval))
                step(len(rows), len(recordings) * len(chosen))
    return BandwidthStudy(condition, tuple(rows), truth, approximations, failed, duration)
