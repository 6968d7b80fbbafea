"""The maps as tables: one CSV file each, units in the header."""

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np

from hmtb_twin import JOINTS
from scenarios.truth.local_dynamics import MOVING, LocalDynamics
from scenarios.truth.maps import Maps


def map_tables(maps: Maps) -> dict[str, str]:
    """Return the maps as CSV, by name of the file without its ending.

    Angles are in degrees, frequencies in Hz; a bandwidth that does not exist is an empty cell.
    """
    tables = {
        "workspace": _poses([("", maps.plane.dynamics)], ()),
        "cuts": _poses([(cut.joint, cut.dynamics) for cut in maps.cuts], ("turned",)),
        "random": _poses([("near", maps.near.dynamics), ("anywhere", maps.anywhere.dynamics)], ("drawn",)),
        "coupling": _coupling(maps),
        "conditions": _conditions(maps),
    }
    if maps.large:
        tables["amplitude"] = _large(maps)
    return tables


def _poses(parts: Iterable[tuple[str, LocalDynamics]], first: Sequence[str]) -> str:
    rows = []
    for label, dynamics in parts:
        for k in range(len(dynamics)):
            angles = [f"{angle:.4g}" for angle in np.degrees(dynamics.angles[k])]
            rows.append([*([label] if first else []), *angles, *_numbers(dynamics, k), int(dynamics.stable[k])])
    return _text([*first, *(f"{name}_deg" for name in JOINTS), *_columns(), "stable"], rows)


def _columns() -> list[str]:
    names = (
        ("bandwidth", "_hz"),
        ("gain", ""),
        ("damping_ratio", ""),
        ("largest_cross_gain", ""),
        ("relative_gain_distance", ""),
    )
    return [f"{joint}_{name}{unit}" for name, unit in names for joint in MOVING]


def _numbers(dynamics: LocalDynamics, k: int) -> list[str]:
    groups = (
        dynamics.bandwidth[k],
        dynamics.gain[k],
        dynamics.damping[k],
        dynamics.cross[k].max(axis=1),
        dynamics.interaction[k],
    )
    return [_number(value) for group in groups for value in group]


def _coupling(maps: Maps) -> str:
    often = np.nanquantile(maps.anywhere.dynamics.cross, 0.95, axis=0)
    rows = [
        [moved, commanded, _number(maps.here.cross[0, i, j]), _number(often[i, j])]
        for i, moved in enumerate(MOVING)
        for j, commanded in enumerate(MOVING)
        if i != j
    ]
    return _text(["moved", "commanded", "largest_gain_at_pose", "largest_gain_at_95_percent_of_poses"], rows)


def _conditions(maps: Maps) -> str:
    rows = [
        [varied.name, value, varied.unit, *_numbers(varied.dynamics, k), int(varied.dynamics.stable[k])]
        for varied in maps.conditions
        for k, value in enumerate(varied.values)
    ]
    return _text(["condition", "value", "unit", *_columns(), "stable"], rows)


def _large(maps: Maps) -> str:
    if maps.large is None:
        return ""
    rows = []
    for varied, points in (("amplitude", maps.large.over_amplitude), ("friction", maps.large.over_level)):
        for point in points:
            numbers = (point.hz, *point.ci95, point.asked_hz, point.gain, point.distortion_percent, point.slewing)
            rows.append([varied, point.joint, point.amplitude, point.level, *map(_number, numbers)])
    header = ["varied", "joint", "amplitude_rad_rms", "friction_level", "bandwidth_hz", "ci95_low_hz", "ci95_high_hz"]
    header += ["bandwidth_from_stick_hz", "gain_over_truth", "distortion_percent", "velocity_limited_share"]
    return _text(header, rows)


def _number(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""


def _text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return buffer.getvalue()
