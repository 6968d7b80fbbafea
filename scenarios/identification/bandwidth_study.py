"""The 1 Hz finding alone: joints, methods, tests and seeds, each bandwidth beside every truth."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hmtb_twin import Arm, JointLog, Truth, linearize, simulate
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.experiments.campaign import SINGLE_JOINT, Condition, campaign_scenario, single_joint_test
from scenarios.experiments.log_review import SETTLING, prepared
from scenarios.experiments.logged_arm import logged_arm
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.scenario import Scenario
from scenarios.experiments.waveform import WINDOW
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.one_hertz import (
    METHODS,
    best_linear_in_words,
    coverage_in_words,
    look,
    published_in_words,
    recovered_in_words,
    true_bandwidths,
    truth_in_words,
    verdict,
)
from scenarios.identification.recovered_bandwidth import Place, RecoveredBandwidth, check_joint, check_method, recover
from scenarios.truth.bla_of_record import BestLinearOfTest, best_linear_of_test
from scenarios.truth.published import published
from sysid import IOData
from sysid.models.bandwidth import half_power_hz

SHORTEST = 2 * SETTLING + WINDOW
"""Shortest test, s: what settles is cut off where more than as much again is left."""

ENOUGH = (
    f"expected {SHORTEST:g} s or more: the arm settles for {SETTLING:g} s, and a file of {WINDOW:g} s is to be "
    "seen some times after that"
)
"""What is expected of the length of a test, for messages."""

NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")
"""A number in a reason."""

FULL = 240.0
"""Length of the thesis' tests, s."""

Stage = Callable[[str], AbstractContextManager[Callable[[int, int], None]]]
"""Opens a stage by its name; gives what is told of work done and work in all."""


@dataclass(frozen=True, eq=False)
class BandwidthStudy:
    """Every recovered bandwidth, and what is true.

    Attributes:
        condition: The arm in words.
        rows: What was recovered.
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

    def refusals(self) -> tuple[str, ...]:
        """Why bandwidths are not claimed, each reason once, with the methods and how often."""
        found: dict[str, list[RecoveredBandwidth]] = {}
        for row in self.rows:
            if row.refused:
                # What a reason says in numbers differs from row to row.
                found.setdefault(NUMBER.sub("#", row.reasons[0]), []).append(row)
        return tuple(
            f"{len(rows)} of {len(self.rows)} ({', '.join(dict.fromkeys(METHODS[row.method] for row in rows))}), "
            f"{'e.g. ' if len(rows) > 1 else ''}{rows[0].scenario}: {rows[0].reasons[0]}"
            for rows in found.values()
        )

    def answers(self) -> tuple[str, ...]:
        """Whether the 1 Hz finding stands: the verdict, then what it rests on."""
        short = () if self.duration is None or self.duration >= FULL else (f"{look(self.duration)}.",)
        printed = published_in_words(self.joints)
        said = (
            verdict(self.rows),
            truth_in_words(true_bandwidths(self.rows)),
            best_linear_in_words(self.rows),
            recovered_in_words(self.rows),
            coverage_in_words(self.rows),
            f"Published: {printed}" if printed else "",
        )
        return (*short, *filter(None, said))

    def record(self) -> dict[str, object]:
        """What `hmtb bandwidth --json` prints."""
        return {
            "rows": [row.record() for row in self.rows],
            "answer": " ".join(self.answers()),
            "condition": self.condition,
            "true": {
                joint: {"hz": one.bandwidth_hz, "half_power_hz": half_power_hz(one.model)}
                for joint, one in ((joint, self.truth.joint(joint)) for joint in self.joints)
            },
            "best_linear": [{**vars(one), "excitation": one.described} for one in self.best_linear.values()],
            "published": {joint: {one.label: one.bandwidth_hz for one in published(joint)} for joint in self.joints},
            "failed": dict(self.failed),
            "duration": self.duration,
        }


@dataclass(frozen=True, eq=False)
class _Recording:
    """A record with where it comes from."""

    joint: str
    test: str
    seed: int | None
    setting: Scenario
    data: IOData


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
        joints: Of the studied ones.
        methods: Keys of `scenarios.identification.one_hertz.METHODS`.
        tests: Numbers of single-joint tests, 1 to 8.
        seeds: Each draws noise and binary sequences anew, None are the scenarios' own.
        condition: The arm; nominal with friction when not given.
        duration: Length of the tests instead of 240 s, s.
        best_linear: Whether to measure the best linear approximation for every joint and test.
        threads: Threads for the physics.
        stage: Told of the work.

    Returns:
        The bandwidths.

    Raises:
        ScenarioError: An unknown joint, method or test, no seed, tests too short, or every experiment failed.
    """
    for what, given in (("joints", joints), ("tests", tests), ("seeds", seeds)):
        if not given:
            raise ScenarioError(f"no {what} given, expected one or more")
    _check(joints, methods)
    _check_tests(tests)
    if duration is not None and not duration >= SHORTEST:
        raise ScenarioError(f"a duration of {duration:g} s given, {ENOUGH}")
    condition = condition or Condition()
    arm, recordings, failed = condition.arm(), list[_Recording](), dict[str, str]()
    names = [(test, joint) for test in dict.fromkeys(tests) for joint in dict.fromkeys(joints)]
    with stage("simulate") as told:
        for number, seed in enumerate(seeds):
            plan = {
                (test, joint): condition.applied(
                    campaign_scenario(single_joint_test(test, joint), seed=seed, duration=duration)
                )
                for test, joint in names
            }
            done = simulate(
                list(plan.values()),
                threads=threads,
                progress=lambda part, whole, before=number: told(before * whole + part, len(seeds) * whole),  # type: ignore[misc]
            )
            logs = {log.name: log for log in done.logs}
            failed |= {f"{name}, seed {seed}": why for name, why in done.failed.items()}
            recordings += [
                _Recording(joint, str(test), seed, setting, prepared(logs[setting.name], joint))
                for (test, joint), setting in plan.items()
                if setting.name in logs
            ]
    first = next((seed for seed in seeds if seed is not None), 0)
    return _concluded(
        str(condition), arm, OPERATING_POSE, recordings, methods, failed, duration, best_linear, first, threads, stage
    )


def from_logs(
    logs: Sequence[JointLog],
    methods: Sequence[str],
    *,
    best_linear: bool = True,
    seed: int = 0,
    threads: int | None = None,
    stage: Stage,
) -> BandwidthStudy:
    """Recover the bandwidths from records that are there; the truth is that of the arm that they tell of.

    Args:
        logs: Logs of single-joint experiments on one arm.
        methods: Keys of `scenarios.identification.one_hertz.METHODS`.
        best_linear: Whether to measure the best linear approximation for every joint and test.
        seed: Of the best linear approximation.
        threads: Threads for the physics.
        stage: Told of the work.

    Raises:
        ScenarioError: A log that excites several axes or a joint that was not studied, one that is too short, the same
            record twice, or logs of several arms.
    """
    _check((), methods)
    recordings = list[_Recording]()
    arms: dict[tuple[object, ...], tuple[Arm, JointLog]] = {}
    for log in logs:
        if len(log.axes) != 1:
            raise ScenarioError(f"{log.name} excites {', '.join(log.axes)}; expected a log that excites one joint")
        (joint,) = log.axes
        check_joint(joint)
        if round(len(log) * log.dt, 9) < SHORTEST:
            raise ScenarioError(f"{log.name}: a log of {len(log) * log.dt:g} s given, {ENOUGH}")
        arm, setting = logged_arm(log), _setting(log)
        arms.setdefault(
            (arm.variant, arm.payload, *vars(arm.plant).values(), arm.specimen, arm.friction, setting.pose), (arm, log)
        )
        recordings.append(_Recording(joint, _test(log), log.seed, setting, prepared(log, joint)))
    if len(arms) > 1:
        raise ScenarioError(
            f"the logs are of {len(arms)} arms or conditions ({', '.join(log.name for _, log in arms.values())}); "
            "expected one, whose truth they are held against"
        )
    _check_twice(logs)
    (arm, _), pose = next(iter(arms.values())), recordings[0].setting.pose
    condition = str(Condition(arm.variant, arm.friction))
    shortest = min(len(one) * one.dt for one in logs)
    return _concluded(
        condition,
        arm,
        pose,
        recordings,
        methods,
        {},
        shortest if shortest < FULL else None,
        best_linear,
        seed,
        threads,
        stage,
    )


def _concluded(
    condition: str,
    arm: Arm,
    pose: str,
    recordings: Sequence[_Recording],
    methods: Sequence[str],
    failed: Mapping[str, str],
    duration: float | None,
    wanted: bool,
    seed: int,
    threads: int | None,
    stage: Stage,
) -> BandwidthStudy:
    if not recordings:
        raise ScenarioError(f"every experiment failed: {'; '.join(f'{name}: {why}' for name, why in failed.items())}")
    truth = linearize(arm, pose, amplitudes=())
    places: dict[tuple[str, str], list[_Recording]] = {}
    for one in recordings:
        places.setdefault((one.joint, one.test), []).append(one)
    approximations = {}
    if wanted:
        with stage("best linear approximation") as told:
            for number, ((joint, test), found) in enumerate(places.items()):
                told(number, len(places))
                approximations[joint, test] = best_linear_of_test(
                    found[0].setting, arm, [one.data for one in found], test=test, seed=seed, threads=threads
                )
    rows, chosen = [], list(dict.fromkeys(methods))
    with stage("identify") as told:
        for one in _in_order(places):
            bla = approximations.get((one.joint, one.test))
            place = Place(
                one.joint,
                one.test,
                one.data.name,
                one.seed,
                truth.joint(one.joint).bandwidth_hz,
                None if bla is None else (bla.hz, *bla.ci95),
            )
            for method in chosen:
                rows.append(recover(one.data, method, place))
                told(len(rows), len(recordings) * len(chosen))
    return BandwidthStudy(
        condition, tuple(rows), truth, MappingProxyType(approximations), MappingProxyType(dict(failed)), duration
    )


def _in_order(places: Mapping[tuple[str, str], Sequence[_Recording]]) -> Iterable[_Recording]:
    """Records joint by joint in the thesis' order, then test by test, then seed by seed."""
    for wanted in STRUCTURES:
        for (joint, _), found in places.items():
            yield from found if joint == wanted else ()


def _check(joints: Sequence[str], methods: Sequence[str]) -> None:
    for joint in joints:
        check_joint(joint)
    for method in methods:
        check_method(method)
    if not methods:
        raise ScenarioError("no methods given, expected one or more")


def _check_tests(tests: Sequence[int]) -> None:
    for test in tests:
        if test not in SINGLE_JOINT:
            raise ScenarioError(unknown("test", test, map(str, SINGLE_JOINT)))


def _check_twice(logs: Sequence[JointLog]) -> None:
    """Refuse a record that is given twice, under its own name or another: it would count as two."""
    for number, log in enumerate(logs):
        for other in logs[:number]:
            if (log.name, log.seed) == (other.name, other.seed) or _same(log, other):
                raise ScenarioError(
                    f"the log of {log.name}, seed {log.seed}, is given twice"
                    + (f", also as {other.name}, seed {other.seed}" if log.name != other.name else "")
                    + "; expected every record once"
                )


def _same(log: JointLog, other: JointLog) -> bool:
    """Whether one record is the other or its beginning."""
    common = min(len(log), len(other))
    return np.array_equal(log.measured[:common], other.measured[:common])


def _setting(log: JointLog) -> Scenario:
    """The experiment of a log, which says on what arm and by which chain a multisine is to be played."""
    if "scenario" not in log.provenance:
        raise ScenarioError(f"{log.name}: its provenance lacks scenario; expected a log of hmtb simulate")
    return Scenario.from_toml(log.provenance["scenario"], source=f"{log.name}, its scenario")


def _test(log: JointLog) -> str:
    """Number of the test where the log is of one of the thesis, else its name."""
    names = {single_joint_test(number, joint): str(number) for joint in log.axes for number in SINGLE_JOINT}
    return names.get(log.name, log.name)
