"""Findings of the maps in words, all numbers computed from their table."""

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.report.figure_style import short
from scenarios.truth.map_table import MOVING, UNITS, MapTable
from scenarios.truth.maps import LEVEL_AMPLITUDE, REACH, Maps

TOLERANCE = 0.1
"""A bandwidth counts as unchanged within this part of that at the operating pose."""

PERCENT = f"{100 * TOLERANCE:.0f} %"

SLIGHT = 0.01
"""A condition that changes no bandwidth by more than this part gets no numbers of single joints."""

STUDIED = [MOVING.index(name) for name in STUDIED_JOINTS]
"""Columns of the studied joints among the moving ones."""


def findings(maps: Maps) -> tuple[str, ...]:
    """Return a sentence or two for each question that the maps answer."""
    table = maps.table
    conditions = [name for name in ("payload", "supply pressure", "oil temperature") if name in table.varied]
    return (
        _neighbourhood(maps, table.rows("near")),
        _one_joint(maps),
        _everywhere(maps, table.rows("anywhere")),
        _stability(table.rows("operating pose", "workspace", "near", "anywhere", *MOVING)),
        _coupling(maps, table.rows("anywhere")),
        *(_condition(maps, table.rows(name)) for name in conditions),
        *([_amplitude(maps, table.rows("amplitude"))] if "amplitude" in table.varied else []),
        *([_friction(table.rows("friction"))] if "friction" in table.varied else []),
    )


def turns_within(maps: Maps, joint: str) -> tuple[float, float]:
    """Return how far a joint may turn down and up before a studied bandwidth leaves the tolerance.

    Args:
        maps: The maps.
        joint: The joint that turns; the others stay at the operating pose.

    Returns:
        Largest turns, deg, by linear interpolation between the poses of the table, or up to the last pose before one
        that has no bandwidth; infinite where none leaves the tolerance.
    """
    rows = maps.table.rows(joint)
    turns = rows.value.astype(float) - np.degrees(maps.truth.angles[JOINTS.index(joint)])
    worst = np.abs(maps.change(rows)[:, STUDIED]).max(axis=1)

    def first_beyond(way: float) -> float:
        on_way = np.flatnonzero(way * turns > 0.0)[:: int(way)]
        # At the operating pose itself nothing has changed.
        away, changes = (np.concatenate([[0.0], part[on_way]]) for part in (way * turns, worst))
        beyond = np.flatnonzero(~(changes <= TOLERANCE))
        if not len(beyond):
            return float("inf")
        k = beyond[0]
        if not np.isfinite(changes[k]):
            return float(away[k - 1])
        part = (TOLERANCE - changes[k - 1]) / (changes[k] - changes[k - 1])
        return float(away[k - 1] + part * (away[k] - away[k - 1]))

    return first_beyond(-1.0), first_beyond(1.0)


def linear_range(amplitudes: np.ndarray, bandwidths: np.ndarray, hz: float) -> tuple[float, float] | None:
    """Return between which amplitudes the bandwidth is within the tolerance of the small-signal one.

    Args:
        amplitudes: Rising amplitudes (n,), rad.
        bandwidths: Bandwidths of a joint at these (n,), Hz.
        hz: Its small-signal bandwidth, Hz.

    Returns:
        Smallest and largest amplitude of the longest run of such points, rad; None where there is none.
    """
    within = np.concatenate([[False], np.abs(bandwidths / hz - 1.0) <= TOLERANCE, [False]])
    starts, ends = np.flatnonzero(np.diff(within)).reshape(-1, 2).T
    if not len(starts):
        return None
    longest = np.argmax(ends - starts)
    return float(amplitudes[starts[longest]]), float(amplitudes[ends[longest] - 1])


def _neighbourhood(maps: Maps, near: MapTable) -> str:
    outside = ~(np.abs(maps.change(near)[:, STUDIED]).max(axis=1) <= TOLERANCE)
    turns = near.value.astype(float)
    first = turns[outside].min(initial=np.inf)
    sample = f"{len(near)} random poses up to {np.degrees(REACH):.0f}° away"
    if not np.isfinite(first):
        return f"Near the pose: of {sample} no studied bandwidth differs by more than {PERCENT} from that at the pose."
    return (
        f"Near the pose: turn every joint at once by up to {first:.0f}° and no studied bandwidth differs by more than "
        f"{PERCENT} from that at the pose ({(turns < first).sum()} random poses); of {sample}, "
        f"{100 * outside.mean():.0f} % do."
    )


def _one_joint(maps: Maps) -> str:
    limits = {joint: zip(turns_within(maps, joint), ("down", "up"), strict=True) for joint in MOVING}
    ways = {joint: [f"{turn:.0f}° {way}" for turn, way in ends if np.isfinite(turn)] for joint, ends in limits.items()}
    limited = [f"{short(joint)} {' or '.join(texts)}" for joint, texts in ways.items() if texts]
    free = [short(joint) for joint, texts in ways.items() if not texts]
    if not limited:
        return f"One joint alone, anywhere in its range, changes no studied bandwidth by more than {PERCENT}."
    text = f"One joint alone takes a studied bandwidth beyond {PERCENT} when it turns: {', '.join(limited)}"
    return f"{text}; free in the whole range: {', '.join(free)}." if free else f"{text}."


def _everywhere(maps: Maps, anywhere: MapTable) -> str:
    within = np.abs(maps.change(anywhere)) <= TOLERANCE
    parts = []
    for joint, k in zip(STUDIED_JOINTS, STUDIED, strict=True):
        low, high = np.nanquantile(anywhere.of(joint), [0.05, 0.95])
        parts.append(
            f"{short(joint)} {low:.2f} to {high:.2f} Hz ({100 * within[:, k].mean():.0f} % of poses within {PERCENT} "
            f"of its {maps.here.of(joint)[0]:.3f} Hz)"
        )
    heavy = 1.0 - float(anywhere.held.mean())
    gaps = f"; at {100 * heavy:.1f} % of poses the drives cannot hold the arm" if heavy else ""
    return f"Anywhere, 90 % of {len(anywhere)} random poses: {', '.join(parts)}{gaps}."


def _stability(poses: MapTable) -> str:
    damping = float(np.nanmin(poses.damping[:, STUDIED], initial=1.0))
    gain = float(np.abs(poses.gain[poses.stable] - 1.0).max(initial=0.0))
    heavy, unstable = int((~poses.held).sum()), int((poses.held & ~poses.stable).sum())
    poles = "the dominant poles stay real" if damping >= 1.0 else f"damping ratios go down to {damping:.2f}"
    stable = "the arm is stable" + (f" but for {unstable} of them" if unstable else "")
    where = f"At all {len(poses)} poses"
    if heavy:
        share = 100 * heavy / len(poses)
        where = f"At {heavy} of all {len(poses)} poses ({share:.1f} %) the drives cannot hold the arm; at the others"
    return f"{where} {stable}, {poles}, and the gain at 0 Hz differs from one by at most {gain:.1g}."


def _coupling(maps: Maps, anywhere: MapTable) -> str:
    studied = np.ix_(STUDIED, STUDIED)
    cross = maps.here.cross[0]
    i, j = np.unravel_index(np.argmax(cross), cross.shape)
    k, m = np.unravel_index(np.argmax(cross[studied]), (len(STUDIED), len(STUDIED)))
    often = np.nanquantile(anywhere.cross[:, studied[0], studied[1]].max(axis=(1, 2)), 0.95)
    largest = float(np.nanmax(anywhere.interaction[:, STUDIED]))
    alone = ": for a bandwidth, joints may be identified one by one" if largest <= TOLERANCE else ""
    return (
        f"Coupling up to 5 Hz: at the pose a command to the {short(MOVING[j])} moves the {short(MOVING[i])} by up to "
        f"{100 * cross[i, j]:.0f} % of itself, the largest of all pairs; between the studied joints it is "
        f"{100 * cross[studied][k, m]:.0f} % at the pose ({short(STUDIED_JOINTS[m])} to {short(STUDIED_JOINTS[k])}) "
        f"and below {100 * often:.0f} % at 95 % of all poses. At a joint's own bandwidth the relative gain differs "
        f"from one by at most {np.nanmax(maps.here.interaction[:, STUDIED]):.2g} at the pose and "
        f"{largest:.2g} anywhere{alone}."
    )


def _condition(maps: Maps, rows: MapTable) -> str:
    name = str(rows.varied[0])
    unit = f" {UNITS[name]}" if name in UNITS else ""
    values = np.array([value if isinstance(value, str) else f"{value:g}" for value in rows.value])
    works = rows.stable & np.isfinite(rows.bandwidth).all(axis=1)
    if not works.any():
        return f"{name.capitalize()}: the arm stands at none of the values."
    gaps = ""
    for missing, why in ((~rows.held, "the drives cannot hold the arm"), (rows.held & ~works, "the arm is unstable")):
        if missing.any():
            gaps += f" At {', '.join(value + unit for value in values[missing])} {why}."
    span = f"{name.capitalize()} from {values[works][0]} to {values[works][-1]}{unit}"
    hz = rows.bandwidth[works]
    changes = np.ptp(hz, axis=0) / maps.here.bandwidth[0]
    k = int(np.argmax(changes))
    if changes[k] < SLIGHT:
        return f"{span}: no bandwidth changes by more than {100 * changes[k]:.1f} %.{gaps}"
    return (
        f"{span}: studied bandwidths change by up to {100 * changes[STUDIED].max():.1f} %; of all joints the "
        f"{short(MOVING[k])}'s changes most, from {hz[0, k]:.2f} to {hz[-1, k]:.2f} Hz.{gaps}"
    )


def _amplitude(maps: Maps, rows: MapTable) -> str:
    amplitudes, parts = rows.value.astype(float), []
    for joint in STUDIED_JOINTS:
        ends = linear_range(amplitudes, rows.of(joint), float(maps.here.of(joint)[0]))
        span = "nowhere" if ends is None else f"from {ends[0]:g} to {ends[1]:g} rad"
        parts.append(f"{short(joint)} {span}")
    first, last = STUDIED_JOINTS[0], STUDIED_JOINTS[-1]
    return (
        f"Amplitude (root mean square, {amplitudes[0]:g} to {amplitudes[-1]:g} rad): the bandwidth from commanded to "
        f"measured angle is within {PERCENT} of the small-signal one: {', '.join(parts)}. At {amplitudes[0]:g} rad the "
        f"{short(first)} follows {100 * rows.of(first, 'gain')[0]:.0f} % of a slow command with "
        f"{rows.of(first, 'distortion')[0]:.0f} % distortion. At {amplitudes[-1]:g} rad commands move at the velocity "
        f"limit {100 * rows.of(last, 'slewing')[-1]:.0f} % of the time: from the stick, the bandwidth of the "
        f"{short(last)} is {_hz(rows.of(last, 'stick_bandwidth')[-1])}."
    )


def _friction(rows: MapTable) -> str:
    parts = []
    for joint in STUDIED_JOINTS:
        ends = []
        for k in (0, -1):
            hz = rows.of(joint)[k]
            low, high = (f"{end:.2f}" for end in rows.of(joint, "interval")[k])
            # An interval narrower than the rounding of the bandwidth says nothing more.
            interval = f" ({low} to {high})" if np.isfinite(hz) and low != high else ""
            ends.append(f"{_hz(hz)}{interval} at {rows.value[k]:g}")
        parts.append(f"{short(joint)} {', '.join(ends)}")
    return (
        f"Dry friction in multiples of the arm's, at {LEVEL_AMPLITUDE:g} rad: bandwidths (95 %) {'; '.join(parts)}. "
        "The small-signal truth leaves dry friction out."
    )


def _hz(value: float) -> str:
    return f"{value:.2f} Hz" if np.isfinite(value) else "not visible"
