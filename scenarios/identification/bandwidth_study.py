"""Study of the 1 Hz finding: bandwidths of joints, methods, tests and seeds beside every truth."""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hmtb_twin import Arm, JointLog, Truth, linearize, simulate
from hmtb_twin.parameters.variants import OPERATING_POSE
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

        refused = [row for row in self.rows if row.refused]
        lines = []
        for rows in grouped(refused, reason).values():
            methods = ", ".join(dict.fromkeys(METHODS[row.method] for row in rows))
            example = "e.g. " if len(rows) > 1 else ""
            lines.append(
                f"{len(rows)} of {len(self.rows)} ({methods}), {example}{rows[0].scenario}: {rows[0].reasons[0]}"
            )
        return tuple(lines)

    def answers(self) -> tuple[str, ...]:
        """Say whether the 1 Hz finding holds: the verdict, then what it rests on."""
        sentences = [
            verdict(self.rows),
            best_linear_in_words(self.rows),
            recovered_in_words(self.rows),
            coverage_in_words(self.rows),
        ]
        if self.duration is not None and self.duration < FULL:
            look = f"This is a look, not a result: the records are {self.duration:g} s long instead of 240 s."
            sentences.insert(0, look)
        printed = published_in_words(self.joints)
        if printed:
            sentences.append(f"Published: {printed}")
        return tuple(filter(None, sentences))

    def record(self) -> dict[str, object]:
        """Return what `hmtb bandwidth --json` prints."""
        true, printed = {}, {}
        for joint in self.joints:
            truth = self.truth.joint(joint)
            true[joint] = {"hz": truth.bandwidth_hz, "half_power_hz": half_power_hz(truth.model)}
            printed[joint] = {model.label: model.bandwidth_hz for model in published(joint)}
        best_linear = []
        for approximation in self.best_linear.values():
            numbers = {name: value for name, value in vars(approximation).items() if name != "response"}
            best_linear.append({**numbers, "excitation": approximation.described})
        return {
            "rows": [row.record() for row in self.rows],
            "answer": " ".join(self.answers()),
            "condition": self.condition,
            "true": true,
            "best_linear": best_linear,
            "published": printed,
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
    for name, values in (("joints", joints), ("methods", methods), ("tests", tests), ("seeds", seeds)):
        if not values:
            raise ScenarioError(f"no {name} given, expected one or more")
    for joint, method in itertools.product(joints, methods):
        structure(joint, method)  # refuses unknown names before any work begins
    for test in tests:
        if test not in SINGLE_JOINT:
            raise ScenarioError(unknown("test", test, map(str, SINGLE_JOINT)))
    if duration is not None and not duration >= SHORTEST:
        raise ScenarioError(f"a duration of {duration:g} s given, {ENOUGH}")
    condition = condition or Condition()
    pairs = [(test, joint) for test in dict.fromkeys(tests) for joint in dict.fromkeys(joints)]
    recordings, failed = _simulated(pairs, seeds, condition, duration, threads, stage)
    if not recordings:
        reasons = "; ".join(f"{name}: {why}" for name, why in failed.items())
        raise ScenarioError(f"every experiment failed: {reasons}")
    first_seed = None
    if best_linear:
        first_seed = next((seed for seed in seeds if seed is not None), 0)
    arm = _StudiedArm(str(condition), condition.arm(), OPERATING_POSE)
    return _study(recordings, methods, arm, first_seed, threads, stage, failed=failed, duration=duration)


def _simulated(
    pairs: Sequence[tuple[int, str]],
    seeds: Sequence[int | None],
    condition: Condition,
    duration: float | None,
    threads: int | None,
    stage: Stage,
) -> tuple[list[Recording], dict[str, str]]:
    """Records of tests and joints for all seeds, and the reasons of experiments that failed."""
    recordings: list[Recording] = []
    failed: dict[str, str] = {}
    with stage("simulate") as step:
        for k, seed in enumerate(seeds):
            plan = {}
            for test, joint in pairs:
                scenario = campaign_scenario(single_joint_test(test, joint), seed=seed, duration=duration)
                plan[test, joint] = condition.applied(scenario)
            simulated = simulate(
                list(plan.values()),
                threads=threads,
                progress=lambda done, total, before=k: step(before * total + done, len(seeds) * total),  # type: ignore[misc]
            )
            logs = {log.name: log for log in simulated.logs}
            failed |= {f"{name}, seed {seed}": why for name, why in simulated.failed.items()}
            for (test, joint), setting in plan.items():
                if setting.name in logs:
                    data = prepared(logs[setting.name], joint)
                    recordings.append(Recording(joint, str(test), seed, data, setting))
    return recordings, failed


class _StudiedArm(NamedTuple):
    """Arm of a study: its conditions in words, the arm, and its pose."""

    condition: str
    arm: Arm
    pose: str


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
    recordings = [_recording_of(log, methods) for log in logs]
    arm = _common_arm(logs, recordings)
    _check_distinct(logs)
    shortest = min(len(log) * log.dt for log in logs)
    duration = shortest if shortest < FULL else None
    return _study(recordings, methods, arm, seed if best_linear else None, threads, stage, duration=duration)


def _recording_of(log: JointLog, methods: Sequence[str]) -> Recording:
    """The record of a log that excites one joint, long enough to settle."""
    if len(log.axes) != 1:
        raise ScenarioError(f"{log.name} excites {', '.join(log.axes)}; expected a log that excites one joint")
    (joint,) = log.axes
    for method in methods:
        structure(joint, method)  # refuses joints and methods that are not studied
    # Rounded: the product may miss a length by its last digit.
    if round(len(log) * log.dt, 9) < SHORTEST:
        raise ScenarioError(f"{log.name}: a log of {len(log) * log.dt:g} s given, {ENOUGH}")
    if "scenario" not in log.provenance:
        raise ScenarioError(f"{log.name}: its provenance lacks scenario; expected a log of hmtb simulate")
    setting = Scenario.from_toml(log.provenance["scenario"], source=f"{log.name}, its scenario")
    # The thesis' tests go by number, others by name.
    numbers = {single_joint_test(number, joint): str(number) for number in SINGLE_JOINT}
    return Recording(joint, numbers.get(log.name, log.name), log.seed, prepared(log, joint), setting)


def _common_arm(logs: Sequence[JointLog], recordings: Sequence[Recording]) -> _StudiedArm:
    """The one arm that all logs are of; logs of different arms, which have no common truth, are refused."""
    arms: dict[tuple[object, ...], tuple[Arm, str, str]] = {}
    for log, recording in zip(logs, recordings, strict=True):
        arm, pose = logged_arm(log), recording.setting.pose
        key = (arm.variant, arm.payload, *vars(arm.plant).values(), arm.specimen, arm.friction, pose)
        arms.setdefault(key, (arm, pose, log.name))
    if len(arms) > 1:
        names = ", ".join(name for *_, name in arms.values())
        raise ScenarioError(
            f"the logs are of {len(arms)} arms or conditions ({names}); "
            "expected one, whose truth they are compared with"
        )
    ((arm, pose, _),) = arms.values()
    return _StudiedArm(str(Condition(arm.variant, arm.friction)), arm, pose)


def _check_distinct(logs: Sequence[JointLog]) -> None:
    """Refuse a record that comes twice, under its own name or another, whole or cut: it would count as two."""
    for log, other in itertools.combinations(logs, 2):
        common = min(len(log), len(other))
        is_same = np.array_equal(log.measured[:common], other.measured[:common])
        if is_same or (log.name, log.seed) == (other.name, other.seed):
            second_name = f", also as {log.name}, seed {log.seed}" if log.name != other.name else ""
            raise ScenarioError(
                f"the log of {other.name}, seed {other.seed}, is given twice{second_name}; expected every record once"
            )


def _study(
    recordings: Sequence[Recording],
    methods: Sequence[str],
    arm: _StudiedArm,
    seed: int | None,
    threads: int | None,
    stage: Stage,
    *,
    failed: Mapping[str, str] = MappingProxyType({}),
    duration: float | None,
) -> BandwidthStudy:
    """Recover bandwidths joint by joint in the thesis' order, then test by test, then seed by seed.

    Without a seed, best linear approximations are left out.
    """
    truth = linearize(arm.arm, arm.pose, amplitudes=())
    joints = list(STRUCTURES)
    in_order = sorted(recordings, key=lambda recording: joints.index(recording.joint))
    groups = grouped(in_order, attrgetter("joint", "test"))
    approximations: dict[tuple[str, str], BestLinearOfTest] = {}
    if seed is not None:
        with stage("best linear approximation") as step:
            for (joint, test), group in groups.items():
                step(len(approximations), len(groups))
                records = [recording.data for recording in group]
                approximations[joint, test] = best_linear_of_test(
                    group[0].setting, records, test=test, seed=seed, threads=threads
                )
    chosen = list(dict.fromkeys(methods))
    rows: list[RecoveredBandwidth] = []
    with stage("identify") as step:
        for (joint, test), group in groups.items():
            bla = approximations.get((joint, test))
            interval = None if bla is None else (bla.hz, *bla.ci95)
            for recording, method in itertools.product(group, chosen):
                rows.append(recover(recording, method, truth.joint(joint).bandwidth_hz, interval))
                step(len(rows), len(recordings) * len(chosen))
    return BandwidthStudy(arm.condition, tuple(rows), truth, approximations, failed, duration)
