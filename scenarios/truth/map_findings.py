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

CONDITIONS = ("payload", "supply pressure", "oil temperature")
"""What varies at the operating pose, small signals."""

STUDIED = [MOVING.index(name) for name in STUDIED_JOINTS]
"""Columns of the studied joints among the moving ones."""


def findings(maps: Maps) -> tuple[str, ...]:
    """Return a sentence or two for each question that the maps answer."""
    table = maps.table
    near, anywhere = table.rows("near"), table.rows("anywhere")
    all_poses = table.rows("operating pose", "workspace", "near", "anywhere", *MOVING)
    sentences = [
        _neighbourhood(maps, near),
        _one_joint(maps),
        _everywhere(maps, anywhere),
        _stability(all_poses),
        _coupling(maps, anywhere),
    ]
    # Electric drives have no oil; the large signals are left out on demand, dry friction where the arm has none.
    for condition in CONDITIONS:
        if condition in table.varied:
            sentences.append(_condition(maps, table.rows(condition)))
    if "amplitude" in table.varied:
        sentences.append(_amplitude(maps, table.rows("amplitude")))
    if "friction" in table.varied:
        sentences.append(_friction(table.rows("friction")))
    return tuple(sentences)


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
    largest_changes = np.abs(maps.change(rows)[:, STUDIED]).max(axis=1)
    down, up = np.flatnonzero(turns < 0.0)[::-1], np.flatnonzero(turns > 0.0)
    return _first_beyond(-turns[down], largest_changes[down]), _first_beyond(turns[up], largest_changes[up])


def _first_beyond(turns: np.ndarray, changes: np.ndarray) -> float:
    """Return the turn at which a change first leaves the tolerance, deg; see `turns_within`.

    Args:
        turns: Rising turns in one direction (n,), deg, > 0.
        changes: Largest relative change of a studied bandwidth at these (n,).
    """
    # At the operating pose itself nothing has changed.
    turns, changes = np.concatenate([[0.0], turns]), np.concatenate([[0.0], changes])
    # Written so that NaN, a pose without a bandwidth, counts as beyond.
    beyond = np.flatnonzero(~(changes <= TOLERANCE))
    if not len(beyond):
        return float("inf")
    k = beyond[0]
    if not np.isfinite(changes[k]):
        return float(turns[k - 1])
    fraction = (TOLERANCE - changes[k - 1]) / (changes[k] - changes[k - 1])
    return float(turns[k - 1] + fraction * (turns[k] - turns[k - 1]))


def linear_range(amplitudes: np.ndarray, bandwidths: np.ndarray, hz: float) -> tuple[float, float] | None:
    """Return between which amplitudes the bandwidth is within the tolerance of the small-signal one.

    Args:
        amplitudes: Rising amplitudes (n,), rad.
        bandwidths: Bandwidths of a joint at these (n,), Hz.
        hz: Its small-signal bandwidth, Hz.

    Returns:
        Smallest and largest amplitude of the longest run of such points, rad; None where there is none.
    """
    # A point that does not count at either end, so that every run of points within begins and ends.
    within = np.concatenate([[False], np.abs(bandwidths / hz - 1.0) <= TOLERANCE, [False]])
    starts, ends = np.flatnonzero(np.diff(within)).reshape(-1, 2).T
    if not len(starts):
        return None
    longest = np.argmax(ends - starts)
    return float(amplitudes[starts[longest]]), float(amplitudes[ends[longest] - 1])


def _neighbourhood(maps: Maps, near: MapTable) -> str:
    """How far all joints may turn at once before a studied bandwidth changes."""
    # Written so that NaN, a pose without a bandwidth, counts as outside.
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
    """How far each joint may turn alone."""
    limited, free = [], []
    for joint in MOVING:
        turns = zip(turns_within(maps, joint), ("down", "up"), strict=True)
        limits = [f"{turn:.0f}° {direction}" for turn, direction in turns if np.isfinite(turn)]
        if limits:
            limited.append(f"{short(joint)} {' or '.join(limits)}")
        else:
            free.append(short(joint))
    if not limited:
        return f"One joint alone, anywhere in its range, changes no studied bandwidth by more than {PERCENT}."
    sentence = f"One joint alone takes a studied bandwidth beyond {PERCENT} when it turns: {', '.join(limited)}"
    if not free:
        return f"{sentence}."
    return f"{sentence}; free in the whole range: {', '.join(free)}."


def _everywhere(maps: Maps, anywhere: MapTable) -> str:
    """How the studied bandwidths spread over the whole joint space."""
    within = np.abs(maps.change(anywhere)) <= TOLERANCE
    ranges = []
    for joint, k in zip(STUDIED_JOINTS, STUDIED, strict=True):
        low, high = np.nanquantile(anywhere.of(joint), [0.05, 0.95])
        share, hz = 100 * within[:, k].mean(), maps.here.of(joint)[0]
        similar = f"{share:.0f} % of poses within {PERCENT} of its {hz:.3f} Hz"
        ranges.append(f"{short(joint)} {low:.2f} to {high:.2f} Hz ({similar})")
    heavy = 1.0 - float(anywhere.held.mean())
    gaps = f"; at {100 * heavy:.1f} % of poses the drives cannot hold the arm" if heavy else ""
    return f"Anywhere, 90 % of {len(anywhere)} random poses: {', '.join(ranges)}{gaps}."


def _stability(poses: MapTable) -> str:
    """Whether the drives hold the arm, whether it is stable, and how well damped it is, at all poses."""
    damping = float(np.nanmin(poses.damping[:, STUDIED], initial=1.0))
    gain = float(np.abs(poses.gain[poses.stable] - 1.0).max(initial=0.0))
    heavy, unstable = int((~poses.held).sum()), int((poses.held & ~poses.stable).sum())
    poles = "the dominant poles stay real" if damping >= 1.0 else f"damping ratios go down to {damping:.2f}"
    stable = f"the arm is stable but for {unstable} of them" if unstable else "the arm is stable"
    where = f"At all {len(poses)} poses"
    if heavy:
        share = 100 * heavy / len(poses)
        where = f"At {heavy} of all {len(poses)} poses ({share:.1f} %) the drives cannot hold the arm; at the others"
    return f"{where} {stable}, {poles}, and the gain at 0 Hz differs from one by at most {gain:.1g}."


def _coupling(maps: Maps, anywhere: MapTable) -> str:
    """How much a command to one joint moves another, and whether that matters for bandwidths."""
    cross = maps.here.cross[0]
    moved, commanded = np.unravel_index(np.argmax(cross), cross.shape)
    studied = cross[np.ix_(STUDIED, STUDIED)]
    studied_moved, studied_commanded = np.unravel_index(np.argmax(studied), studied.shape)
    pair = f"{short(STUDIED_JOINTS[studied_commanded])} to {short(STUDIED_JOINTS[studied_moved])}"
    often = np.nanquantile(anywhere.cross[:, STUDIED][:, :, STUDIED].max(axis=(1, 2)), 0.95)
    # Poses that the drives cannot hold have no gains; the nan functions leave them out.
    interaction_here = np.nanmax(maps.here.interaction[:, STUDIED])
    largest = float(np.nanmax(anywhere.interaction[:, STUDIED]))
    alone = ": for a bandwidth, joints may be identified one by one" if largest <= TOLERANCE else ""
    gain = 100 * cross[moved, commanded]
    return (
        f"Coupling up to 5 Hz: at the pose a command to the {short(MOVING[commanded])} moves the "
        f"{short(MOVING[moved])} by up to {gain:.0f} % of itself, the largest of all pairs; "
        f"between the studied joints it is {100 * studied.max():.0f} % at the pose ({pair}) and below "
        f"{100 * often:.0f} % at 95 % of all poses. At a joint's own bandwidth the relative gain differs from one by "
        f"at most {interaction_here:.2g} at the pose and {largest:.2g} anywhere{alone}."
    )


def _condition(maps: Maps, rows: MapTable) -> str:
    """How the bandwidths change with payload, supply pressure or oil temperature."""
    name = str(rows.varied[0])
    unit = f" {UNITS[name]}" if name in UNITS else ""
    values = np.array([_value_in_words(value) for value in rows.value])
    works = rows.stable & np.isfinite(rows.bandwidth).all(axis=1)
    if not works.any():
        return f"{name.capitalize()}: the arm stands at none of the values."
    gaps = ""
    reasons = ((~rows.held, "the drives cannot hold the arm"), (rows.held & ~works, "the arm is unstable"))
    for missing, reason in reasons:
        if missing.any():
            gap_values = ", ".join(value + unit for value in values[missing])
            gaps += f" At {gap_values} {reason}."
    span = f"{name.capitalize()} from {values[works][0]} to {values[works][-1]}{unit}"
    hz = rows.bandwidth[works]
    # Range over the values: a bandwidth need not rise or fall all the way.
    changes = np.ptp(hz, axis=0) / maps.here.bandwidth[0]
    k = int(np.argmax(changes))
    if changes[k] < SLIGHT:
        return f"{span}: no bandwidth changes by more than {100 * changes[k]:.1f} %.{gaps}"
    studied_change = 100 * changes[STUDIED].max()
    largest_change = f"the {short(MOVING[k])}'s changes most, from {hz[0, k]:.2f} to {hz[-1, k]:.2f} Hz"
    return f"{span}: studied bandwidths change by up to {studied_change:.1f} %; of all joints {largest_change}.{gaps}"


def _value_in_words(value: float | str) -> str:
    """Return the name of a payload, or a number."""
    return value if isinstance(value, str) else f"{value:g}"


def _amplitude(maps: Maps, rows: MapTable) -> str:
    """Between which amplitudes the arm is linear, and what ends that range on either side."""
    amplitudes = rows.value.astype(float)
    ranges = []
    for joint in STUDIED_JOINTS:
        ends = linear_range(amplitudes, rows.of(joint), float(maps.here.of(joint)[0]))
        span = "nowhere" if ends is None else f"from {ends[0]:g} to {ends[1]:g} rad"
        ranges.append(f"{short(joint)} {span}")
    smallest, largest = f"{amplitudes[0]:g}", f"{amplitudes[-1]:g} rad"
    # Friction affects the yaw most.
    sticking, limited = STUDIED_JOINTS[0], STUDIED_JOINTS[-1]
    gain, distortion = 100 * rows.of(sticking, "gain")[0], rows.of(sticking, "distortion")[0]
    slewing, stick_hz = 100 * rows.of(limited, "slewing")[-1], rows.of(limited, "stick_bandwidth")[-1]
    return (
        f"Amplitude (root mean square, {smallest} to {largest}): the bandwidth from commanded to measured angle is "
        f"within {PERCENT} of the small-signal one: {', '.join(ranges)}. At {smallest} rad the {short(sticking)} "
        f"follows {gain:.0f} % of a slow command with {distortion:.0f} % distortion. At {largest} commands move at "
        f"the velocity limit {slewing:.0f} % of the time: from the stick, the bandwidth of the {short(limited)} is "
        f"{_hz(stick_hz)}."
    )


def _friction(rows: MapTable) -> str:
    """How the studied bandwidths fall from the lowest to the highest level of dry friction."""
    falls = []
    for joint in STUDIED_JOINTS:
        lowest, highest = (_bandwidth_with_interval(rows, joint, k) for k in (0, -1))
        falls.append(f"{short(joint)} {lowest} at {rows.value[0]:g}, {highest} at {rows.value[-1]:g}")
    return (
        f"Dry friction in multiples of the arm's, at {LEVEL_AMPLITUDE:g} rad: bandwidths (95 %) {'; '.join(falls)}. "
        "The small-signal truth leaves dry friction out."
    )


def _bandwidth_with_interval(rows: MapTable, joint: str, k: int) -> str:
    """Return a bandwidth in row k with its 95 % interval, in words."""
    hz = rows.of(joint)[k]
    low, high = (f"{end:.2f}" for end in rows.of(joint, "interval")[k])
    # An interval narrower than the rounding of the bandwidth says nothing more.
    if not np.isfinite(hz) or low == high:
        return _hz(hz)
    return f"{_hz(hz)} ({low} to {high})"


def _hz(value: float) -> str:
    """Return a bandwidth in words."""
    return f"{value:.2f} Hz" if np.isfinite(value) else "not visible"
