"""Report section on the fair comparison of the methods: conclusions and tables."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import Condition
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import Fits
from scenarios.thesis.fairness_table import RECORDS, ArmFairness, Fairness
from scenarios.thesis.verdicts import MARGIN, WORDS, tied


class Answer(NamedTuple):
    """Conclusion on one arm, in words that are compared between arms, and the number behind it, or nothing."""

    words: str
    detail: str = ""


@dataclass(frozen=True)
class Conclusion:
    """One question with its answer on every arm, in their order; nothing for an arm without the record."""

    question: str
    answers: dict[Condition, Answer | None]

    def changes(self, *, friction: bool | None = None) -> bool:
        """Whether arms differ: those that differ in friction alone (True), in all but friction (False), or any."""
        known = [(arm, answer.words) for arm, answer in self.answers.items() if answer is not None]
        return any(
            words != others
            for (arm, words), (other, others) in combinations(known, 2)
            if friction is None
            or (friction and arm.variant == other.variant)
            or (not friction and arm.friction == other.friction)
        )


def conclusions(fairness: Fairness) -> tuple[Conclusion, ...]:
    """Answer the questions of the thesis' comparison on every arm that has the records."""
    own = fairness.estimation_test
    arms = [arm for arm in fairness.arms if len(arm.joints) == len(STUDIED_JOINTS)]
    questions: list[tuple[str, Callable[[ArmFairness], Answer | None]]] = [
        ("Joints whose identified models are, for the most part, near 1 Hz", _near_1_hz),
        ("Whether most 95 % intervals hold the truth", _held),
        ("Whether every identified model is stable", _stable),
    ]
    for way, words in WORDS.items():
        question = f"SysID or OKID better on single-joint tests not seen, {words}"
        questions.append((question, partial(_single, own=own, way=way)))
        for record, name in RECORDS.items():
            question = f"SysID or OKID better on the {name}, {words}"
            questions.append((question, partial(_several, record=record, way=way)))
    return tuple(Conclusion(question, {arm.condition: answer(arm) for arm in arms}) for question, answer in questions)


def changes_text(conclusions: tuple[Conclusion, ...]) -> str:
    """Describe the conclusions that change between arms; empty without two arms to compare."""
    if (
        not conclusions
        or max(sum(answer is not None for answer in entry.answers.values()) for entry in conclusions) < 2
    ):
        return ""
    changed = [entry for entry in conclusions if entry.changes()]
    rubbed = sum(entry.changes(friction=True) for entry in conclusions)
    other = sum(entry.changes(friction=False) for entry in conclusions)
    ways = " and ".join(
        f"{sum(entry.changes() for entry in conclusions if entry.question.endswith(words))} of "
        f"{sum(entry.question.endswith(words) for entry in conclusions)} {words}"
        for words in WORDS.values()
    )
    return (
        f"Of {len(conclusions)} conclusions {len(changed)} change between the arms: friction alone changes {rubbed}, "
        f"the arm "
        f"alone {other}. Of the comparisons of SysID with OKID {ways} change. Fits closer than {MARGIN:g} points are "
        "called equal."
    )


def _near_1_hz(arm: ArmFairness) -> Answer:
    answers = {}
    for joint, models in arm.joints.items():
        hz = [entry.bandwidth_hz for entry in models if not entry.printed]
        answers[joint] = 2 * sum(near_1_hz(value) for value in hz) > len(hz)
    every = arm.identified()
    near = sum(near_1_hz(entry.bandwidth_hz) for entry in every)
    return Answer(_list_text(joint for joint, yes in answers.items() if yes), f"{near} of {len(every)} models")


def _held(arm: ArmFairness) -> Answer:
    every = arm.identified()
    covered = sum(bool(entry.covers) for entry in every)
    return Answer("yes" if 2 * covered > len(every) else "no", f"{covered} of {len(every)}")


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
    first, second = arm.fits("SysID", False, record), arm.fits("OKID", False, record)
    if first is None or second is None:
        return None
    return _winners({joint: (first[joint], second[joint]) for joint in first}, way)


def _winners(pairs: dict[str, tuple[Fits, Fits]], way: str) -> Answer:
    by_winner: dict[str, list[str]] = {}
    gaps = []
    for joint, (first, second) in pairs.items():
        gap = getattr(second, way) - getattr(first, way)
        winner = "equal" if tied(gap) else "OKID" if gap > 0 else "SysID"
        by_winner.setdefault(winner, []).append(joint)
        gaps.append(f"{gap:+.1f}".replace("-", "−"))
    words = "; ".join(
        f"{winner}: {_list_text(by_winner[winner])}" for winner in ("OKID", "SysID", "equal") if winner in by_winner
    )
    return Answer(words, f"OKID {', '.join(gaps)} points")


def _list_text(joints: Iterable[str]) -> str:
    names = [_name(joint) for joint in joints]
    return ", ".join(names) if names else "none"


def _name(joint: str) -> str:
    """Answer as short text for a table cell."""
    return {"shoulder_yaw": "yaw", "shoulder_pitch": "shoulder", "elbow_pitch": "elbow"}[joint]


WORST = -1000.0
"""Fits below this are printed as such: a simulation that grows without bound has any number."""


def fairness_section(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section."""
    fairness = study.fairness
    if fairness is None or not any(arm.joints for arm in fairness.arms):
        return {"arms": ()}
    entries = conclusions(fairness)
    return {
        "arms": fairness.arms,
        "labels": {
            joint: dict.fromkeys(
                (entry.label, entry.chosen) for arm in fairness.arms for entry in arm.joints.get(joint, ())
            )
            for joint in dict.fromkeys(joint for arm in fairness.arms for joint in arm.joints)
        },
        "kinds": dict.fromkeys((entry.name, entry.printed) for arm in fairness.arms for entry in arm.three_joint),
        "records": {
            record: name
            for record, name in RECORDS.items()
            if any(record in entry.fits for arm in fairness.arms for entry in arm.three_joint)
        },
        "conclusions": [
            (entry.question, [entry.answers.get(arm.condition) for arm in fairness.arms], entry.changes())
            for entry in entries
        ],
        "changes": changes_text(entries),
        "own": fairness.estimation_test,
        "percent": percent,
    }


def percent(value: float) -> str:
    """A fit as text."""
    return f"{value:.1f}" if value >= WORST else f"< {WORST:g}".replace("-", "−")
