"""Does the 1 Hz finding hold? The answer in words for the arm, for recovered models and for the printed ones."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
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
    stands = all(map(near_1_hz, truths.values()))
    arm = f"{'stands' if stands else 'does not stand'} for the arm itself, {_of_joints(truths)}"
    groups = {METHODS[method]: group for method, group in grouped(rows, attrgetter("method")).items()}
    kept = [name for name, group in groups.items() if all(row.near for row in group)]
    none = [name for name, group in groups.items() if all(row.refused for row in group)]
    partly = [f"{name} ({_near(group)})" for name, group in groups.items() if name not in (*kept, *none)]
    counts = [
        f"{sum(near_1_hz(one.bandwidth_hz) for one in printed)} of {len(printed)} ({joint.replace('_', ' ')})"
        for joint in truths
        if (printed := published(joint))
    ]
    clauses = [f"The 1 Hz finding, read as {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz, {arm}"]
    clauses += [f"every bandwidth recovered by {joined(kept)} keeps to it"] if kept else []
    clauses += [f"not every bandwidth recovered by {joined(partly)} does"] if partly else []
    clauses += [f"{joined(none)} can claim none"] if none else []
    clauses += [f"of the models that the thesis prints {joined(counts)} keep to it"] if counts else []
    return "; ".join(clauses) + "."


def best_linear_in_words(rows: Rows) -> str:
    """Describe the best linear bandwidths under commands as strong as the tests'; empty where not measured."""
    tests = {(row.joint, row.test): row for row in rows if row.best_linear is not None}
    if not tests:
        return ""
    shown, near = [], 0
    for (joint, test), row in tests.items():
        hz, low, high = row.best_linear or (np.nan,) * 3
        name = joint.replace("_", " ") + (f", test {test}" if len({test for _, test in tests}) > 1 else "")
        shown.append(f"{hz:.2f} ({low:.2f} to {high:.2f}, {name})" if np.isfinite(hz) else f"none shows ({name})")
        near += near_1_hz(hz)
    return (
        "Best linear: commands as strong as the tests', with all that the arm is not linear in, make it "
        f"{', '.join(shown)} Hz; {near} of {len(tests)} {'is' if len(tests) == 1 else 'are'} about 1 Hz."
    )


def recovered_in_words(rows: Rows) -> str:
    """Count the recovered bandwidths that are about 1 Hz, by method."""
    parts = []
    for method, group in grouped(rows, attrgetter("method")).items():
        values = [row.hz for row in group if not row.refused]
        parts.append(f"{METHODS[method]} {_near(group)} ({between(values) + ' Hz' if values else 'none claimed'})")
    levels = [row.half_power_hz for row in rows]
    known = [level for level in levels if np.isfinite(level)]
    return (
        f"Recovered: {_near(rows)} bandwidths are about 1 Hz: {', '.join(parts)}. "
        f"By where the gain is 0.707, whatever it is at 0 Hz, which is how spectra are read, it is "
        f"{sum(map(near_1_hz, levels))} of {len(levels)}" + (f" ({between(known)} Hz)." if known else ".")
    )


def coverage_in_words(rows: Rows) -> str:
    """Count the intervals that hold the truth: another question than being near 1 Hz."""
    total, refused = len(rows), sum(row.refused for row in rows)
    measured = [row for row in rows if row.covers_best_linear is not None]
    text = (
        "Near 1 Hz is not the same as right: "
        f"{sum(row.covers for row in rows)} of {total} intervals at 95 % hold the small-signal truth"
    )
    if measured:
        agree = sum(bool(row.covers_best_linear) for row in measured)
        text += f", and {agree} of {len(measured)} agree with the best linear bandwidth within both intervals"
    text += "."
    wrong = sum(row.near and not row.covers for row in rows)
    if wrong:
        text += f" {wrong} of those near 1 Hz are too sure of themselves: their intervals miss the small-signal truth."
    if refused:
        text += f" {refused} of {total} are not claimed, because the record does not bear them; they count as misses."
    return text


def published_in_words(joints: Iterable[str]) -> str:
    """Say whether the thesis' printed models keep to its own finding; empty where it prints none of these joints."""
    printed = {joint: published(joint) for joint in joints if published(joint)}
    every = [one for models in printed.values() for one in models]
    if not every:
        return ""
    by_bandwidth = sum(near_1_hz(one.bandwidth_hz) for one in every)
    by_level = sum(near_1_hz(half_power_hz(one.model)) for one in every)
    text = (
        f"of the thesis' own {len(every)} printed models {by_bandwidth} are near 1 Hz by their bandwidth and "
        f"{by_level} by the gain 0.707"
    )
    yaw = printed.get("shoulder_yaw", ())
    if not yaw:
        return text + "."
    levels = {one.label: half_power_hz(one.model) for one in yaw}
    reached = [f"{label} reaches 0.707 at {level:.2f} Hz" for label, level in levels.items() if near_1_hz(level)]
    return (
        f"{text}; the yaw models have bandwidths of {between([one.bandwidth_hz for one in yaw])} Hz, and "
        f"{f'only {joined(reached)}' if reached else 'none reaches 0.707 near 1 Hz'}."
    )


def grouped(rows: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Group rows by a key, its values in the order in which they come first."""
    groups: dict[Key, list[Item]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def between(values: Sequence[float]) -> str:
    """Return the smallest and largest value with two decimals, or one where they are equal."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def joined(parts: Sequence[str]) -> str:
    """Join words with commas and an "and"."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def _near(rows: Rows) -> str:
    return f"{sum(row.near for row in rows)} of {len(rows)}"


def _of_joints(values: Mapping[str, float]) -> str:
    return ", ".join(f"{hz:.2f} Hz ({joint.replace('_', ' ')})" for joint, hz in values.items())
