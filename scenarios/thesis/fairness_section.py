"""Report section on the fair comparison of the methods: conclusions and tables."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, combinations
from typing import NamedTuple

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import Condition
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import Fits
from scenarios.thesis.fairness_table import RECORDS, ArmFairness, FairModel, chosen
from scenarios.thesis.verdicts import MARGIN, WORDS, tied

NAMES = {"shoulder_yaw": "yaw", "shoulder_pitch": "shoulder", "elbow_pitch": "elbow"}
"""Short names of the joints for table cells."""

WORST = -1000.0
"""Fits below this, percent, are printed as "< -1000": how far a simulation without bound got has no meaning."""


class Answer(NamedTuple):
    """Conclusion on one arm, in words that are compared between arms, and the number behind it, or nothing."""

    words: str
    # Numbers differ from arm to arm even where the conclusion is the same: they are not compared.
    detail: str = ""


@dataclass(frozen=True)
class Conclusion:
    """One question with its answer on every arm, in their order; None for an arm without the record."""

    question: str
    answers: Mapping[Condition, Answer | None]

    @property
    def changes(self) -> set[str]:
        """What arms of unlike answers differ in: `friction`, the `arm` or `both`; empty where all are alike."""
        words = {condition: answer.words for condition, answer in self.answers.items() if answer is not None}
        differences = set()
        for first, second in combinations(words, 2):
            if words[first] == words[second]:
                continue
            if first.variant == second.variant:
                differences.add("friction")
            elif first.friction == second.friction:
                differences.add("arm")
            else:
                differences.add("both")
        return differences


def conclusions(arms: Sequence[ArmFairness]) -> tuple[Conclusion, ...]:
    """Answer the questions of the thesis' comparison on every arm that has the records."""
    questions: dict[str, Callable[[ArmFairness], Answer | None]] = {
        "Joints whose identified models are, for the most part, near 1 Hz": _joints_near_1_hz,
        "Whether most 95 % intervals hold the truth": _most_intervals_hold,
        "Whether every identified model is stable": _all_stable,
    }
    records = {"": "single-joint tests not seen", **{record: f"the {name}" for record, name in RECORDS.items()}}
    for way, words in WORDS.items():
        for record, name in records.items():
            questions[f"SysID or OKID better on {name}, {words}"] = partial(_better_method, record=record, way=way)
    # An arm without the models of a joint would answer about fewer joints: no answer can be compared with that.
    complete_arms = [arm for arm in arms if len(arm.joints) == len(STUDIED_JOINTS)]
    concluded = []
    for question, answer_on in questions.items():
        concluded.append(Conclusion(question, {arm.condition: answer_on(arm) for arm in complete_arms}))
    return tuple(concluded)


def _identified(models: Iterable[FairModel]) -> list[FairModel]:
    """The models identified from the arm's own test: the printed ones are the same on every arm."""
    return [model for model in models if not model.printed]


def _joints_near_1_hz(arm: ArmFairness) -> Answer:
    """Name the joints of which more than half of the models are near 1 Hz, and count all such models."""
    near_joints = []
    near_models = 0
    all_models = 0
    for joint, joint_models in arm.joints.items():
        models = _identified(joint_models)
        near = sum(near_1_hz(model.bandwidth_hz) for model in models)
        if 2 * near > len(models):
            near_joints.append(joint)
        near_models += near
        all_models += len(models)
    return Answer(_list_text(near_joints), f"{near_models} of {all_models} models")


def _most_intervals_hold(arm: ArmFairness) -> Answer:
    """Whether most intervals hold the truth, with the count; a model without an interval counts as one that misses."""
    covers: list[bool] = []
    for models in arm.joints.values():
        covers += [bool(model.covers) for model in _identified(models)]
    word = "yes" if 2 * sum(covers) > len(covers) else "no"
    return Answer(word, f"{sum(covers)} of {len(covers)}")


def _all_stable(arm: ArmFairness) -> Answer:
    """Whether every model is stable; name those that are not."""
    unstable = []
    for joint, models in arm.joints.items():
        for model in _identified(models):
            if not model.stable:
                # Of "OE 2/2, delay 1" and "OKID order 2, p = 5", what stands before the comma is enough to tell them.
                structure, *_ = model.label.split(",")
                unstable.append(f"{structure} of {NAMES[joint]}")
    if unstable:
        return Answer("no", "not " + ", ".join(unstable))
    return Answer("yes")


def _better_method(arm: ArmFairness, record: str, way: str) -> Answer | None:
    """Compare SysID with OKID on a record of three joints; without one, on single-joint tests not used to identify."""
    if record:
        sysid_fits: Mapping[str, Fits | None] = arm.fits("SysID", False, record) or {}
        okid_fits: Mapping[str, Fits | None] = arm.fits("OKID", False, record) or {}
    else:
        sysid_fits = {joint: chosen(models, okid=False).validation for joint, models in arm.joints.items()}
        okid_fits = {joint: chosen(models, okid=True).validation for joint, models in arm.joints.items()}
    gaps: dict[str, float] = {}
    for joint in arm.joints:
        sysid_fit, okid_fit = sysid_fits.get(joint), okid_fits.get(joint)
        if sysid_fit is None or okid_fit is None:
            return None
        # Positive where OKID is ahead.
        gaps[joint] = getattr(okid_fit, way) - getattr(sysid_fit, way)
    points = ", ".join(f"{gap:+.1f}".replace("-", "−") for gap in gaps.values())
    return Answer(_winners_text(gaps), f"OKID {points} points")


def _winners_text(gaps: Mapping[str, float]) -> str:
    """List the joints on which OKID fits better, those on which SysID does and the ties, from OKID's lead on each."""
    winners: dict[str, list[str]] = {"OKID": [], "SysID": [], "equal": []}
    for joint, gap in gaps.items():
        if tied(gap):
            winners["equal"].append(joint)
        elif gap > 0:
            winners["OKID"].append(joint)
        else:
            winners["SysID"].append(joint)
    return "; ".join(f"{winner}: {_list_text(joints)}" for winner, joints in winners.items() if joints)


def _list_text(joints: Iterable[str]) -> str:
    """Short names of joints, separated by commas."""
    return ", ".join(NAMES[joint] for joint in joints) or "none"


def percent(value: float) -> str:
    """A fit as text."""
    if value >= WORST:
        return f"{value:.1f}"
    return f"< {WORST:g}".replace("-", "−")


def fairness_section(study: Comparison) -> dict[str, object]:
    """Template variables of the section on the fair comparison of the methods."""
    arms = study.fairness
    concluded = conclusions(arms)
    models: dict[str, tuple[FairModel, ...]] = {}
    # Every arm has the same models of a joint. Backwards, so that those of the first arm that has the joint stay.
    for arm in reversed(arms):
        models.update(arm.joints)
    changed: Counter[str] = Counter()
    for conclusion in concluded:
        changed.update(conclusion.changes)
    return {
        "models": models,
        "arms": arms,
        "kinds": dict.fromkeys(chain.from_iterable(arm.three_joint for arm in arms)),
        "records": _records_with_fits(arms),
        "conclusions": concluded,
        "changed": changed,
        "ways": {words: _changes_of_comparisons(concluded, words) for words in WORDS.values()},
        "margin": MARGIN,
        "percent": percent,
    }


def _records_with_fits(arms: Sequence[ArmFairness]) -> dict[str, str]:
    """Records to which three-joint models of any arm have fits, with their names for people."""
    available: set[str] = set()
    for arm in arms:
        for fits_by_record in arm.three_joint.values():
            available.update(fits_by_record)
    return {record: name for record, name in RECORDS.items() if record in available}


def _changes_of_comparisons(concluded: Iterable[Conclusion], words: str) -> list[bool]:
    """For each comparison of SysID with OKID in one kind of fit, whether its outcome changes between the arms."""
    # Questions on fits end with the words of the kind; no other question does.
    return [bool(conclusion.changes) for conclusion in concluded if conclusion.question.endswith(words)]
