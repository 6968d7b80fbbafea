"""What the maps of an arm say, in words."""

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.truth.amplitude_maps import LEVEL_AMPLITUDE, LargeSignal, LargeSignals
from scenarios.truth.condition_maps import Conditions
from scenarios.truth.local_dynamics import MOVING
from scenarios.truth.maps import REACH, Maps
from scenarios.truth.pose_maps import STUDIED, TOLERANCE, change, reach

SLIGHT = 0.01
"""A condition that changes no bandwidth by more than this part is not dwelt upon."""

PERCENT = f"{100 * TOLERANCE:.0f} %"
"""The tolerance in words."""


def findings(maps: Maps) -> tuple[str, ...]:
    """Return one sentence or two for each thing that the maps were made to answer, all numbers computed from them."""
    return (
        _neighbourhood(maps),
        _one_joint(maps),
        _everywhere(maps),
        _shape(maps),
        _coupling(maps),
        *(_condition(maps, varied) for varied in maps.conditions),
        *(_large(maps, maps.large) if maps.large else ()),
    )


def linear_range(points: list[LargeSignal], hz: float) -> tuple[float, float] | None:
    """Return between which amplitudes the bandwidth is within the tolerance of the small-signal one.

    Args:
        points: One joint's points, amplitudes rising.
        hz: Its small-signal bandwidth, Hz.

    Returns:
        Smallest and largest amplitude of the longest run of such points, rad; None where there is none.
    """
    runs: list[list[float]] = [[]]
    for point in points:
        if np.isfinite(point.hz) and abs(point.hz / hz - 1.0) <= TOLERANCE:
            runs[-1].append(point.amplitude)
        elif runs[-1]:
            runs.append([])
    longest = max(runs, key=len)
    return (longest[0], longest[-1]) if longest else None


def words(joint: str) -> str:
    """Return a joint's name for a sentence."""
    return joint.replace("_", " ")


def listed(parts: list[str]) -> str:
    """Join words with commas and an "and"."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _neighbourhood(maps: Maps) -> str:
    worst = np.abs(change(maps.near.dynamics, maps.here)[:, STUDIED]).max(axis=1)
    outside = ~(worst <= TOLERANCE)
    first = maps.near.distance[outside].min(initial=np.inf)
    looked = f"{len(worst)} random poses up to {np.degrees(REACH):.0f}° away"
    if not np.isfinite(first):
        return f"Near the pose: of {looked} no studied bandwidth differs by more than {PERCENT} from that at the pose."
    inside = int((maps.near.distance < first).sum())
    return (
        f"Near the pose: turn every joint at once by up to {np.degrees(first):.0f}° and no studied bandwidth differs "
        f"by more than {PERCENT} from that at the pose ({inside} random poses); of {looked}, "
        f"{100 * outside.mean():.0f} % do."
    )


def _one_joint(maps: Maps) -> str:
    limited, free = [], []
    for cut in maps.cuts:
        start = maps.truth.angles[JOINTS.index(cut.joint)]
        down, up = reach(cut, maps.here, start)
        ways = [f"{np.degrees(turn):.0f}° {way}" for turn, way in ((down, "down"), (up, "up")) if np.isfinite(turn)]
        if ways:
            limited.append(f"{words(cut.joint)} {' or '.join(ways)}")
        else:
            free.append(words(cut.joint))
    if not limited:
        return f"One joint alone, anywhere in its range, changes no studied bandwidth by more than {PERCENT}."
    kept = f"; {listed(free)} may go anywhere in {'its' if len(free) == 1 else 'their'} range" if free else ""
    return f"One joint alone takes a studied bandwidth beyond {PERCENT} when it turns: {', '.join(limited)}{kept}."


def _everywhere(maps: Maps) -> str:
    dynamics = maps.anywhere.dynamics
    parts = []
    for joint in STUDIED_JOINTS:
        low, high = np.nanquantile(dynamics.of(joint), [0.05, 0.95])
        within = np.abs(dynamics.of(joint) / maps.here.of(joint) - 1.0) <= TOLERANCE
        parts.append(
            f"{words(joint)} {low:.2f} to {high:.2f} Hz ({100 * within.mean():.0f} % of poses within {PERCENT} of its "
            f"{maps.here.of(joint)[0]:.3f} Hz)"
        )
    heavy = 1.0 - float(dynamics.held.mean())
    lost = f"; at {100 * heavy:.1f} % of poses the drives cannot hold the arm" if heavy else ""
    return f"Anywhere, 90 % of {len(dynamics)} random poses: {', '.join(parts)}{lost}."


def _shape(maps: Maps) -> str:
    everything = [maps.here, maps.plane.dynamics, maps.anywhere.dynamics, maps.near.dynamics]
    everything += [cut.dynamics for cut in maps.cuts]
    damping = min(float(np.nanmin(part.damping[:, STUDIED], initial=1.0)) for part in everything)
    gain = max(float(np.abs(part.gain[part.stable] - 1.0).max(initial=0.0)) for part in everything)
    heavy = sum(int((~part.held).sum()) for part in everything)
    unstable = sum(int((part.held & ~part.stable).sum()) for part in everything)
    count = sum(map(len, everything))
    real = "the dominant poles stay real" if damping >= 1.0 else f"damping ratios go down to {damping:.2f}"
    stays = "the arm is stable" if not unstable else f"the arm is stable but for {unstable} of them, where it is not"
    said = f"{stays}, {real}, and the gain at 0 Hz differs from one by at most {gain:.1g}."
    if not heavy:
        return f"At all {count} poses {said}"
    return (
        f"At {heavy} of all {count} poses ({100 * heavy / count:.1f} %) the drives cannot hold the arm; at the others "
        f"{said}"
    )


def _coupling(maps: Maps) -> str:
    cross = maps.here.cross[0]
    i, j = np.unravel_index(np.argmax(cross), cross.shape)
    studied = np.ix_(STUDIED, STUDIED)
    k, m = np.unravel_index(np.argmax(cross[studied]), (len(STUDIED), len(STUDIED)))
    dynamics = maps.anywhere.dynamics
    often = np.nanquantile(dynamics.cross[:, studied[0], studied[1]].max(axis=(1, 2)), 0.95)
    most = float(np.nanmax(dynamics.interaction[:, STUDIED]))
    alone = ": for a bandwidth, joints may be identified one by one" if most <= TOLERANCE else ""
    return (
        f"Coupling up to 5 Hz: at the pose a command to the {words(MOVING[j])} moves the {words(MOVING[i])} by up to "
        f"{100 * cross[i, j]:.0f} % of itself, the most there is; between the studied joints it is "
        f"{100 * cross[studied][k, m]:.0f} % at the pose ({words(STUDIED_JOINTS[m])} to {words(STUDIED_JOINTS[k])}) "
        f"and below {100 * often:.0f} % at 95 % of all poses. At a joint's own bandwidth the relative gain differs "
        f"from one by at most {np.nanmax(maps.here.interaction[:, STUDIED]):.2g} at the pose and "
        f"{most:.2g} anywhere{alone}."
    )


def _condition(maps: Maps, varied: Conditions) -> str:
    works = varied.dynamics.stable & np.isfinite(varied.dynamics.bandwidth).all(axis=1)
    if not works.any():
        return f"{varied.name.capitalize()}: at none of the values does the arm stand."
    values = [value for value, fine in zip(varied.values, works, strict=True) if fine]
    changes = []
    for name in MOVING:
        hz = varied.dynamics.of(name)[works]
        changes.append((float(np.ptp(hz)) / float(maps.here.of(name)[0]), name, float(hz[0]), float(hz[-1])))
    most, name, first, last = max(changes)
    studied = max(part for part, joint, *_ in changes if joint in STUDIED_JOINTS)
    unit = f" {varied.unit}" if varied.unit else ""
    shown = [_value(value) for value in (values[0], values[-1])]
    held = varied.dynamics.held
    fails = ""
    for lost, what in ((~held, "the drives cannot hold the arm"), (held & ~works, "a joint has no stable bandwidth")):
        if lost.any():
            at = ", ".join(f"{_value(value)}{unit}" for value, so in zip(varied.values, lost, strict=True) if so)
            fails += f" At {at} {what}."
    if most < SLIGHT:
        slightly = f"no bandwidth changes by more than {100 * most:.1f} %."
        return f"{varied.name.capitalize()} from {shown[0]} to {shown[1]}{unit}: {slightly}{fails}"
    most_studied = name in STUDIED_JOINTS
    rest = (
        f", the {words(name)}'s most, from {first:.2f} to {last:.2f} Hz"
        if most_studied
        else f"; of the other joints the {words(name)}'s changes most, from {first:.2f} to {last:.2f} Hz "
        f"({100 * most:.0f} % of {maps.here.of(name)[0]:.3f} Hz)"
    )
    return (
        f"{varied.name.capitalize()} from {shown[0]} to {shown[1]}{unit}: studied bandwidths change by up to "
        f"{100 * studied:.1f} %{rest}.{fails}"
    )


def _large(maps: Maps, large: LargeSignals) -> tuple[str, ...]:
    said = [_amplitude(maps, large)]
    if large.over_level:
        said.append(_level(maps, large))
    return tuple(said)


def _amplitude(maps: Maps, large: LargeSignals) -> str:
    parts = []
    for joint in STUDIED_JOINTS:
        points = [point for point in large.over_amplitude if point.joint == joint]
        found = linear_range(points, float(maps.here.of(joint)[0]))
        if found is None:
            span = "nowhere"
        elif found[0] == found[1]:
            span = f"at {found[0]:g} rad alone"
        else:
            span = f"from {found[0]:g} to {found[1]:g} rad"
        parts.append(f"{words(joint)} {span}")
    smallest, largest = large.over_amplitude[0], large.over_amplitude[-1]
    last = large.over_amplitude[-1]
    return (
        f"Amplitude (root mean square, {smallest.amplitude:g} to {largest.amplitude:g} rad): the bandwidth from "
        f"commanded to measured angle is within {PERCENT} of the small-signal one: {', '.join(parts)}. At "
        f"{smallest.amplitude:g} rad the {words(smallest.joint)} follows {100 * smallest.gain:.0f} % of a slow command "
        f"with {smallest.distortion_percent:.0f} % distortion. At {last.amplitude:g} rad commands move at the velocity "
        f"limit {100 * last.slewing:.0f} % of the time: from the stick the {words(last.joint)} has "
        f"{_hz(last.asked_hz)} left."
    )


def _level(maps: Maps, large: LargeSignals) -> str:
    parts = []
    for joint in STUDIED_JOINTS:
        points = [point for point in large.over_level if point.joint == joint]
        rows = [f"{_hz(point.hz)}{_interval(point)} at {point.level:g}" for point in (points[0], points[-1])]
        parts.append(f"{words(joint)} {rows[0]}, {rows[1]}")
    return (
        f"Dry friction in multiples of the arm's, at {LEVEL_AMPLITUDE:g} rad: bandwidths (95 %) {'; '.join(parts)}. "
        "The small-signal truth knows nothing of it."
    )


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _hz(value: float) -> str:
    return f"{value:.2f} Hz" if np.isfinite(value) else "no bandwidth that shows"


def _interval(point: LargeSignal) -> str:
    """The interval where it is wider than the rounding of the bandwidth."""
    low, high = (f"{end:.2f}" for end in point.ci95)
    return f" ({low} to {high})" if np.isfinite(point.hz) and low != high else ""
