"""Does the 1 Hz finding hold? The answer in words for the arm, for recovered models and for the printed ones."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, METHODS, RecoveredBandwidth, near_1_hz
from scenarios.truth.published import published
from sysid.models.bandwidth import half_power_hz

Rows = Sequence[RecoveredBandwidth]


def verdict(rows: Rows) -> str:
    """Answer in one sentence: for the arm, by method, for the printed models."""
    truths = true_bandwidths(rows)
    stands = all(map(near_1_hz, truths.values()))
    arm = "stands for the arm itself" if stands else f"does not stand for the arm itself: {_outside(truths)}"
    kept, partly, none = list[str](), list[str](), list[str]()
    for method, group in by_method(rows).items():
        near = sum(row.near for row in group)
        if near == len(group):
            kept.append(METHODS[method])
        elif any(np.isfinite(row.hz) for row in group):
            partly.append(f"{METHODS[method]} ({near} of {len(group)})")
        else:
            none.append(METHODS[method])
    clauses = [f"The 1 Hz finding, read as {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz, {arm}"]
    clauses += [f"every bandwidth recovered by {joined(kept)} keeps to it"] if kept else []
    clauses += [f"not every bandwidth recovered by {joined(partly)} does"] if partly else []
    clauses += [f"{joined(none)} can claim none"] if none else []
    printed = {joint: published(joint) for joint in truths if published(joint)}
    counts = [
        f"{sum(near_1_hz(one.bandwidth_hz) for one in models)} of {len(models)} ({joint.replace('_', ' ')})"
        for joint, models in printed.items()
    ]
    clauses += [f"of the models that the thesis prints {joined(counts)} keep to it"] if counts else []
    return "; ".join(clauses) + "."


def truth_in_words(truths: Mapping[str, float]) -> str:
    """Describe the small-signal bandwidths (Hz) by joint."""
    near = sum(map(near_1_hz, truths.values()))
    return (
        f"Truth: the small-signal bandwidths are {_of_joints(truths)}; {near} of {len(truths)} "
        f"{'is' if len(truths) == 1 else 'are'} about 1 Hz."
    )


def best_linear_in_words(rows: Rows) -> str:
    """Describe the best linear bandwidths under commands as strong as the tests'; empty where not measured."""
    tests = {(row.joint, row.test): row for row in rows if row.best_linear is not None}
    if not tests:
        return ""
    shown, near, shifts = [], 0, []
    for (joint, test), row in tests.items():
        hz, low, high = row.best_linear or (np.nan,) * 3
        name = joint.replace("_", " ") + (f", test {test}" if len({test for _, test in tests}) > 1 else "")
        shown.append(f"{hz:.2f} ({low:.2f} to {high:.2f}, {name})" if np.isfinite(hz) else f"none shows ({name})")
        near += near_1_hz(hz)
        shifts.append(100.0 * (hz / row.true_hz - 1.0))
    moved = [shift for shift in shifts if np.isfinite(shift)]
    return (
        "Best linear: commands as strong as the tests', with all that the arm is not linear in, make it "
        f"{', '.join(shown)} Hz; {near} of {len(tests)} {'is' if len(tests) == 1 else 'are'} about 1 Hz"
        + (f", {min(moved):+.1f} to {max(moved):+.1f} % from the small-signal ones." if moved else ".")
    )


def recovered_in_words(rows: Rows) -> str:
    """Count the recovered bandwidths that are about 1 Hz, by method, test, joint and seed."""
    parts = []
    for method, group in by_method(rows).items():
        values = [row.hz for row in group if np.isfinite(row.hz)]
        text = f"{METHODS[method]} {sum(row.near for row in group)} of {len(group)}"
        notes = [f"{between(values)} Hz" if values else "none claimed"]
        if values and not all(row.near for row in group):
            notes += _where(group)
        parts.append(f"{text} ({'; '.join(notes)})")
    near = sum(row.near for row in rows)
    levels = [row.half_power_hz for row in rows]
    known = [level for level in levels if np.isfinite(level)]
    return (
        f"Recovered: {near} of {len(rows)} bandwidths are about 1 Hz: {', '.join(parts)}. "
        f"By where the gain is 0.707, whatever it is at 0 Hz, which is how spectra are read, it is "
        f"{sum(map(near_1_hz, levels))} of {len(levels)}" + (f" ({between(known)} Hz)." if known else ".")
    )


def _where(rows: Rows) -> list[str]:
    """Count the bandwidths of one method that are about 1 Hz, by test, joint and seed."""
    notes = []
    for of, prefix in (("test", "test "), ("joint", "")):
        groups: dict[str, list[RecoveredBandwidth]] = {}
        for row in rows:
            groups.setdefault(getattr(row, of), []).append(row)
        if len(groups) > 1:
            counts = [
                f"{prefix}{name.replace('_', ' ')} {sum(row.near for row in group)} of {len(group)}"
                for name, group in groups.items()
            ]
            notes.append(", ".join(counts))
    together: dict[int | None, list[bool]] = {}
    for row in rows:
        together.setdefault(row.seed, []).append(row.near)
    if len(together) > 1 and max(map(len, together.values())) > 1:
        notes.append(f"all of a seed in {sum(map(all, together.values()))} of {len(together)} seeds")
    return notes


def coverage_in_words(rows: Rows) -> str:
    """Count the intervals that hold the truth: another question than being near 1 Hz."""
    total, refused = len(rows), sum(not np.isfinite(row.hz) for row in rows)
    measured = [row for row in rows if row.covers_best_linear is not None]
    text = (
        "Near 1 Hz is not the same as right: "
        f"{held_in_words(sum(row.covers for row in rows), total)} the small-signal truth"
    )
    if measured:
        agree = sum(bool(row.covers_best_linear) for row in measured)
        text += f", and {agree} of {len(measured)} agree with the best linear bandwidth within both intervals"
    by = [
        f"{METHODS[method]} {sum(row.covers for row in group)}"
        + (f" and {sum(bool(row.covers_best_linear) for row in group)}" if measured else "")
        + f" of {len(group)}"
        for method, group in by_method(rows).items()
    ]
    text += f" ({', '.join(by)})."
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


def held_in_words(held: int, total: int) -> str:
    """Begin a sentence on how many intervals hold something."""
    return f"{held} of {total} intervals at 95 % hold"


def look(duration: float) -> str:
    """Warn of shortened records (s)."""
    return f"This is a look, not a result: the records are {duration:g} s long instead of 240 s"


def true_bandwidths(rows: Rows) -> dict[str, float]:
    """Return the small-signal truths by joint, in the order of the rows, Hz."""
    return {row.joint: row.true_hz for row in rows}


def by_method(rows: Rows) -> dict[str, list[RecoveredBandwidth]]:
    """Group rows by method, in the order in which methods come first."""
    groups: dict[str, list[RecoveredBandwidth]] = {}
    for row in rows:
        groups.setdefault(row.method, []).append(row)
    return groups


def between(values: Sequence[float]) -> str:
    """Return the smallest and largest value with two decimals, or one where they are equal."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def joined(parts: Sequence[str]) -> str:
    """Join words with commas and an "and"."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def _of_joints(values: Mapping[str, float]) -> str:
    return ", ".join(f"{hz:.2f} Hz ({joint.replace('_', ' ')})" for joint, hz in values.items())


def _outside(values: Mapping[str, float]) -> str:
    return _of_joints({joint: hz for joint, hz in values.items() if not near_1_hz(hz)})
