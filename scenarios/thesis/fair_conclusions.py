"""Conclusions of the thesis' comparison on each arm, and those that change with the arm."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import combinations

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, Condition
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.fairness_table import ArmFairness, BothFits, Fairness
from scenarios.thesis.margin import MARGIN, tied

RECORDS = {"mimo-10": "slow chirp, 0 to 1 Hz", "mimo-12": "fast chirp, 5 to 10 Hz", RPCM: "exchange"}
"""Records of three joints, for people."""

WAYS = {"simulation": "in simulation", "one_step": "one step ahead"}


@dataclass(frozen=True)
class Answer:
    """Conclusions on one arm.

    Attributes:
        words: The conclusion; what is compared between arms.
        detail: The number behind it, or nothing.
    """

    words: str
    detail: str = ""


@dataclass(frozen=True)
class Conclusion:
    """One question, answered on every arm.

    Attributes:
        question: What is asked.
        answers: By arm, in their order; nothing for an arm without the record.
    """

    question: str
    answers: dict[Condition, Answer | None]

    def changes(self, *, friction: bool | None = None) -> bool:
        """Whether two arms differ.

        Args:
            friction: Compare only arms that differ in friction alone (True) or in all but friction (False).
        """
        known = [(arm, answer.words) for arm, answer in self.answers.items() if answer is not None]
        return any(
            words != others
            for (arm, words), (other, others) in combinations(known, 2)
            if friction is None
            or (friction and arm.variant == other.variant)
            or (not friction and arm.friction == other.friction)
        )


def conclusions(fairness: Fairness) -> tuple[Conclusion, ...]:
    """Answer the questions of the thesis' comparison on every arm that has the records.

    Args:
        fairness: The tables.

    Returns:
        One entry for each question.
    """
    own = fairness.estimation_test
    arms = [arm for arm in fairness.arms if len(arm.joints) == len(STUDIED_JOINTS)]
    asked: list[tuple[str, Callable[[ArmFairness], Answer | None]]] = [
        ("Joints whose identified models are, for the most part, near 1 Hz", _near),
        ("Whether most 95 % intervals hold the truth", _held),
        ("Whether every identified model is stable", _stable),
    ]
    for way, words in WAYS.items():
        question = f"SysID or OKID better on single-joint tests not seen, {words}"
        asked.append((question, partial(_single, own=own, way=way)))
        for record, name in RECORDS.items():
            question = f"SysID or OKID better on the {name}, {words}"
            asked.append((question, partial(_several, record=record, way=way)))
    return tuple(Conclusion(question, {arm.condition: answer(arm) for arm in arms}) for question, answer in asked)


def said(found: tuple[Conclusion, ...]) -> str:
    """Describe the conclusions that change between arms; empty without two arms to compare."""
    if not found or max(sum(answer is not None for answer in entry.answers.values()) for entry in found) < 2:
        return ""
    changed = [entry for entry in found if entry.changes()]
    rubbed = sum(entry.changes(friction=True) for entry in found)
    other = sum(entry.changes(friction=False) for entry in found)
    ways = " and ".join(
        f"{sum(entry.changes() for entry in found if entry.question.endswith(words))} of "
        f"{sum(entry.question.endswith(words) for entry in found)} {words}"
        for words in WAYS.values()
    )
    return (
        f"Of {len(found)} conclusions {len(changed)} change between the arms: friction alone changes {rubbed}, the arm "
        f"alone {other}. Of the comparisons of SysID with OKID {ways} change. Fits closer than {MARGIN:g} points are "
        "called equal."
    )


def _near(arm: ArmFairness) -> Answer:
    found = {}
    for joint, models in arm.joints.items():
        hz = [entry.bandwidth_hz for entry in models if not entry.printed]
        found[joint] = 2 * sum(near_1_hz(value) for value in hz) > len(hz)
    every = arm.identified()
    near = sum(near_1_hz(entry.bandwidth_hz) for entry in every)
    return Answer(_listed(joint for joint, yes in found.items() if yes), f"{near} of {len(every)} models")


def _held(arm: ArmFairness) -> Answer:
    every = arm.identified()
    held = sum(bool(entry.covers) for entry in every)
    return Answer("yes" if 2 * held > len(every) else "no", f"{held} of {len(every)}")


def _stable(arm: ArmFairness) -> Answer:
    wild = [
        f"{entry.label.split(',')[0]} of {_name(joint)}"
        for joint, models in arm.joints.items()
        for entry in models
        if not entry.printed and not entry.stable
    ]
    return Answer("no", "not " + ", ".join(wild)) if wild else Answer("yes")


def _single(arm: ArmFairness, own: int, way: str) -> Answer | None:
    pairs = {}
    for joint in arm.joints:
        fits = [arm.chosen(joint, okid=okid).validation(own) for okid in (False, True)]
        if fits[0] is None or fits[1] is None:
            return None
        pairs[joint] = (fits[0], fits[1])
    return _winners(pairs, way)


def _several(arm: ArmFairness, record: str, way: str) -> Answer | None:
    models = {entry.name: entry for entry in arm.three_joint if not entry.printed}
    fits = [models[name].fits.get(record) for name in ("SysID", "OKID") if name in models]
    if len(fits) < 2 or fits[0] is None or fits[1] is None:
        return None
    first, second = fits[0], fits[1]
    return _winners({joint: (first[joint], second[joint]) for joint in first}, way)


def _winners(pairs: dict[str, tuple[BothFits, BothFits]], way: str) -> Answer:
    by_winner: dict[str, list[str]] = {}
    gaps = []
    for joint, (first, second) in pairs.items():
        gap = getattr(second, way) - getattr(first, way)
        winner = "equal" if tied(gap) else "OKID" if gap > 0 else "SysID"
        by_winner.setdefault(winner, []).append(joint)
        gaps.append(f"{gap:+.1f}".replace("-", "−"))
    words = "; ".join(
        f"{winner}: {_listed(by_winner[winner])}" for winner in ("OKID", "SysID", "equal") if winner in by_winner
    )
    return Answer(words, f"OKID {', '.join(gaps)} points")


def _listed(joints: Iterable[str]) -> str:
    names = [_name(joint) for joint in joints]
    return ", ".join(names) if names else "none"


def _name(joint: str) -> str:
    """Short, as a table has little room."""
    return {"shoulder_yaw": "yaw", "shoulder_pitch": "shoulder", "elbow_pitch": "elbow"}[joint]
