"""Does the 1 Hz finding hold? The answer in words for the arm, for recovered models and for the printed ones."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from itertools import chain
from operator import attrgetter
from typing import TypeVar

import numpy as np

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, METHODS, RecoveredBandwidth, near_1_hz
from scenarios.truth.published import published
from sysid.models.bandwidth import half_power_hz

Rows = Sequence[RecoveredBandwidth]
Item = TypeVar("Item")
Key = TypeVar("Key", bound=Hashable)


def verdict(rows: Rows) -> str:
    """Answer in one sentence: for the arm, by method, for the printed models."""
    truths = {row.joint: row.true_hz for row in rows}
    holds = all(map(near_1_hz, truths.values()))
    arm = f"{'stands' if holds else 'does not stand'} for the arm itself, {_of_joints(truths)}"
    all_near: list[str] = []
    none_claimed: list[str] = []
    not_all_near: list[str] = []
    for method, group in grouped(rows, attrgetter("method")).items():
        name = METHODS[method]
        if all(row.near for row in group):
            all_near.append(name)
        elif all(row.refused for row in group):
            none_claimed.append(name)
        else:
            not_all_near.append(f"{name} ({_near(group)})")
    clauses = [f"The 1 Hz finding, read as {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz, {arm}"]
    if all_near:
        clauses.append(f"every bandwidth recovered by {joined(all_near)} keeps to it")
    if not_all_near:
        clauses.append(f"not every bandwidth recovered by {joined(not_all_near)} does")
    if none_claimed:
        clauses.append(f"{joined(none_claimed)} can claim none")
    counts = _printed_counts(truths)
    if counts:
        clauses.append(f"of the models that the thesis prints {joined(counts)} keep to it")
    return "; ".join(clauses) + "."


def _printed_counts(joints: Iterable[str]) -> list[str]:
    """How many of the printed models of each joint are near 1 Hz; a joint without any is left out."""
    counts = []
    for joint in joints:
        printed = published(joint)
        if printed:
            near = sum(near_1_hz(model.bandwidth_hz) for model in printed)
            counts.append(f"{near} of {len(printed)} ({joint.replace('_', ' ')})")
    return counts


def best_linear_in_words(rows: Rows) -> str:
    """Describe the best linear bandwidths under commands as strong as the tests'; empty where not measured."""
    measured = {(row.joint, row.test): row.best_linear for row in rows if row.best_linear is not None}
    if not measured:
        return ""
    has_several_tests = len({test for _, test in measured}) > 1
    shown, near = [], 0
    for (joint, test), (hz, low, high) in measured.items():
        name = joint.replace("_", " ")
        if has_several_tests:
            name += f", test {test}"
        shown.append(f"{hz:.2f} ({low:.2f} to {high:.2f}, {name})" if np.isfinite(hz) else f"none shows ({name})")
        near += near_1_hz(hz)
    verb = "is" if len(measured) == 1 else "are"
    return (
        "Best linear: commands as strong as the tests', with all that the arm is not linear in, make it "
        f"{', '.join(shown)} Hz; {near} of {len(measured)} {verb} about 1 Hz."
    )


def recovered_in_words(rows: Rows) -> str:
    """Count the recovered bandwidths that are about 1 Hz, by method."""
    by_method = []
    for method, group in grouped(rows, attrgetter("method")).items():
        values = [row.hz for row in group if not row.refused]
        extent = f"{between(values)} Hz" if values else "none claimed"
        by_method.append(f"{METHODS[method]} {_near(group)} ({extent})")
    levels = [row.half_power_hz for row in rows]
    finite = [level for level in levels if np.isfinite(level)]
    extent = f" ({between(finite)} Hz)" if finite else ""
    return (
        f"Recovered: {_near(rows)} bandwidths are about 1 Hz: {', '.join(by_method)}. "
        f"By where the gain is 0.707, whatever it is at 0 Hz, which is how spectra are read, it is "
        f"{sum(map(near_1_hz, levels))} of {len(levels)}{extent}."
    )


def coverage_in_words(rows: Rows) -> str:
    """Sentences on how many intervals hold the truth, which is not the same as being near 1 Hz."""
    total, refused = len(rows), sum(row.refused for row in rows)
    covering = sum(row.covers for row in rows)
    of_total = f"{covering} of {total} intervals of parameters at 95 %"
    sentence = f"Near 1 Hz is not the same as right: {of_total} hold the small-signal truth"
    measured = [row for row in rows if row.covers_best_linear is not None]
    if measured:
        agreeing = sum(bool(row.covers_best_linear) for row in measured)
        sentence += f", and {agreeing} of {len(measured)} agree with the best linear bandwidth within both intervals"
    sentences = [f"{sentence}."]
    wrong = sum(row.near and not row.covers for row in rows)
    if wrong:
        sentences.append(
            f"{wrong} of those near 1 Hz are too sure of themselves: their intervals miss the small-signal truth."
        )
    if refused:
        sentences.append(
            f"{refused} of {total} are not claimed, because the record does not bear them; they count as misses."
        )
    return " ".join(sentences)


def published_in_words(joints: Iterable[str]) -> str:
    """Say whether the thesis' printed models keep to its own finding; empty where it prints none of these joints."""
    printed = {joint: published(joint) for joint in joints}
    models = list(chain.from_iterable(printed.values()))
    if not models:
        return ""
    by_bandwidth = sum(near_1_hz(model.bandwidth_hz) for model in models)
    by_level = sum(near_1_hz(half_power_hz(model.model)) for model in models)
    counts = (
        f"of the thesis' own {len(models)} printed models {by_bandwidth} are near 1 Hz by their bandwidth and "
        f"{by_level} by the gain 0.707"
    )
    yaw = printed.get("shoulder_yaw", ())
    if not yaw:
        return f"{counts}."
    # The yaw models are where both definitions of a bandwidth differ most.
    reaching = []
    for model in yaw:
        level = half_power_hz(model.model)
        if near_1_hz(level):
            reaching.append(f"{model.label} reaches 0.707 at {level:.2f} Hz")
    reached = f"only {joined(reaching)}" if reaching else "none reaches 0.707 near 1 Hz"
    bandwidths = between([model.bandwidth_hz for model in yaw])
    return f"{counts}; the yaw models have bandwidths of {bandwidths} Hz, and {reached}."


def grouped(rows: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Group rows by a key, groups in the order of their first rows."""
    groups: dict[Key, list[Item]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def between(values: Sequence[float]) -> str:
    """Return the smallest and largest value with two decimals, or one where they are equal."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def joined(words: Sequence[str]) -> str:
    """Join words with commas and an "and"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _near(rows: Rows) -> str:
    """How many bandwidths are near 1 Hz, of all, also those that are not claimed."""
    return f"{sum(row.near for row in rows)} of {len(rows)}"


def _of_joints(values: Mapping[str, float]) -> str:
    return ", ".join(f"{hz:.2f} Hz ({joint.replace('_', ' ')})" for joint, hz in values.items())
