"""Report section on the fair comparison of the methods: conclusions and tables."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import Condition
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import Fits
from scenarios.thesis.fairness_table import RECORDS, ArmFairness, chosen
from scenarios.thesis.verdicts import MARGIN, WORDS, tied

NAMES = {"shoulder_yaw": "yaw", "shoulder_pitch": "shoulder", "elbow_pitch": "elbow"}
"""Short names of the joints for table cells."""

WORST = -1000.0
"""Fits below this are printed as such: a simulation that grows without bound has any number."""


class Answer(NamedTuple):
    """Conclusion on one arm, in words that are compared between arms, and the number behind it, or nothing."""

    words: str
    detail: str = ""


@dataclass(frozen=True)
class Conclusion:
    """One question with its answer on every arm, in their order; nothing for an arm without the record."""

    question: str
    answers: Mapping[Condition, Answer | None]

    @property
    def changes(self) -> set[str]:
        """What arms of unlike answers differ in: `friction`, the `arm` or `both`; empty where all are alike."""
        known = ((arm, answer.words) for arm, answer in self.answers.items() if answer is not None)
        return {
            "friction" if arm.variant == other.variant else "arm" if arm.friction == other.friction else "both"
            for (arm, words), (other, others) in combinations(known, 2)
            if words != others
        }


def conclusions(arms: Sequence[ArmFairness]) -> tuple[Conclusion, ...]:
    """Answer the questions of the thesis' comparison on every arm that has the records."""
    questions: dict[str, Callable[[ArmFairness], Answer | None]] = {
        "Joints whose identified models are, for the most part, near 1 Hz": _near_1_hz,
        "Whether most 95 % intervals hold the truth": _held,
        "Whether every identified model is stable": _stable,
    }
    records = {"": "single-joint tests not seen", **{record: f"the {name}" for record, name in RECORDS.items()}}
    for way, words in WORDS.items():
        for record, name in records.items():
            questions[f"SysID or OKID better on {name}, {words}"] = partial(_better, record=record, way=way)
    whole = [arm for arm in arms if len(arm.joints) == len(STUDIED_JOINTS)]
    return tuple(Conclusion(text, {arm.condition: answer(arm) for arm in whole}) for text, answer in questions.items())


def _near_1_hz(arm: ArmFairness) -> Answer:
    near = {
        joint: [near_1_hz(entry.bandwidth_hz) for entry in models if not entry.printed]
        for joint, models in arm.joints.items()
    }
    every = [value for values in near.values() for value in values]
    most = (joint for joint, values in near.items() if 2 * sum(values) > len(values))
    return Answer(_list_text(most), f"{sum(every)} of {len(every)} models")


def _held(arm: ArmFairness) -> Answer:
    covered = [bool(entry.covers) for models in arm.joints.values() for entry in models if not entry.printed]
    return Answer("yes" if 2 * sum(covered) > len(covered) else "no", f"{sum(covered)} of {len(covered)}")


def _stable(arm: ArmFairness) -> Answer:
    wild = [
        f"{entry.label.split(',')[0]} of {NAMES[joint]}"
        for joint, models in arm.joints.items()
        for entry in models
        if not entry.printed and not entry.stable
    ]
    return Answer("no", "not " + ", ".join(wild)) if wild else Answer("yes")


def _better(arm: ArmFairness, record: str, way: str) -> Answer | None:
    """Compare SysID with OKID on a record of three joints; without one, on single-joint tests not used to identify."""
    fits: Iterable[Mapping[str, Fits | None]]
    if record:
        fits = (arm.fits(name, False, record) or {} for name in ("SysID", "OKID"))
    else:
        fits = (
            {joint: chosen(models, okid=which).validation for joint, models in arm.joints.items()}
            for which in (False, True)
        )
    own, okid = fits
    gaps = {}
    for joint in arm.joints:
        first, second = own.get(joint), okid.get(joint)
        if first is None or second is None:
            return None
        gaps[joint] = getattr(second, way) - getattr(first, way)
    winners = {joint: "equal" if tied(gap) else "OKID" if gap > 0 else "SysID" for joint, gap in gaps.items()}
    shared = {name: [joint for joint in gaps if winners[joint] == name] for name in ("OKID", "SysID", "equal")}
    words = "; ".join(f"{name}: {_list_text(joints)}" for name, joints in shared.items() if joints)
    points = ", ".join(f"{gap:+.1f}".replace("-", "−") for gap in gaps.values())
    return Answer(words, f"OKID {points} points")


def _list_text(joints: Iterable[str]) -> str:
    return ", ".join(NAMES[joint] for joint in joints) or "none"


def percent(value: float) -> str:
    """A fit as text."""
    return f"{value:.1f}" if value >= WORST else f"< {WORST:g}".replace("-", "−")


def fairness_section(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section."""
    arms = study.fairness
    entries = conclusions(arms)
    return {
        # Every arm has the same models of a joint.
        "models": {joint: models for arm in reversed(arms) for joint, models in arm.joints.items()},
        "arms": arms,
        "kinds": dict.fromkeys(kind for arm in arms for kind in arm.three_joint),
        "records": {
            record: name
            for record, name in RECORDS.items()
            if any(record in known for arm in arms for known in arm.three_joint.values())
        },
        "conclusions": entries,
        "changed": Counter(what for entry in entries for what in entry.changes),
        "ways": {
            words: [bool(entry.changes) for entry in entries if entry.question.endswith(words)]
            for words in WORDS.values()
        },
        "margin": MARGIN,
        "percent": percent,
    }
