"""Tables of a bandwidth study: recovered, true and printed bandwidths of a joint, a row for each method and test."""

from collections.abc import Iterable, Sequence

import numpy as np

from scenarios.files.result_table import ResultTable
from scenarios.identification.bandwidth_study import BandwidthStudy
from scenarios.identification.one_hertz import between
from scenarios.identification.recovered_bandwidth import RecoveredBandwidth
from scenarios.truth.published import published
from sysid.models.bandwidth import half_power_hz


def bandwidth_table(study: BandwidthStudy, joint: str) -> ResultTable:
    """Table of a joint: what was recovered, then both truths, then what the thesis prints."""
    with_best_linear = bool(study.best_linear)
    columns = [
        "method",
        "test",
        "bandwidth\n/ Hz",
        "95 % interval of\nparameters / Hz",
        "with distortion\nand order / Hz",
        "near\n1 Hz",
        "holds small-\nsignal truth",
    ]
    if with_best_linear:
        columns.append("agrees with\nbest linear")
    columns += ["gain 0.707\nat / Hz", "gain\nat 0 Hz"]
    rows = []
    for group in study.groups(joint):
        rows.append(_recovered_row(group, with_best_linear=with_best_linear))
    # True and printed bandwidths are not judged.
    unjudged = ["", "", ""] if with_best_linear else ["", ""]
    truth = study.truth.joint(joint)
    levels = [f"{half_power_hz(truth.model):.3f}", f"{truth.dc_gain:.3f}"]
    rows.append(["small-signal truth", "", f"{truth.bandwidth_hz:.3f}", "", "", *unjudged, *levels])
    for approximation in study.best_linear.values():
        if approximation.joint != joint:
            continue
        hz = f"{approximation.hz:.3f}" if np.isfinite(approximation.hz) else "none shows"
        interval = f"{approximation.ci95[0]:.3f} to {approximation.ci95[1]:.3f}"
        level = f"{approximation.half_power_hz:.3f}"
        rows.append(["best linear truth", approximation.test, hz, interval, "", *unjudged, level, ""])
    for printed in published(joint):
        rows.append([f"published {printed.label}", "", f"{printed.bandwidth_hz:.3f}", "", "", *unjudged, "", ""])
    return ResultTable(f"{joint}, {study.condition}", tuple(columns), tuple(map(tuple, rows)))


def _recovered_row(group: Sequence[RecoveredBandwidth], *, with_best_linear: bool) -> list[str]:
    """The row of one method and test; for several seeds it shows the middle bandwidth."""
    first = group[0]
    row = [first.label, first.test, *_bandwidth_cells(group)]
    row += [_counted(recovered.near for recovered in group), _counted(recovered.covers for recovered in group)]
    if with_best_linear:
        row.append(_counted(recovered.covers_best_linear for recovered in group))
    row.append(_median(recovered.half_power_hz for recovered in group))
    row.append(_median(recovered.dc_gain for recovered in group))
    return row


def _bandwidth_cells(group: Sequence[RecoveredBandwidth]) -> tuple[str, str, str]:
    """Middle bandwidth with the range over seeds, and its intervals; what the models say where none is claimed."""
    claimed = sorted((recovered for recovered in group if np.isfinite(recovered.hz)), key=lambda claim: claim.hz)
    if claimed:
        # One of the claims, so that the interval beside it is its own.
        middle = claimed[(len(claimed) - 1) // 2]
        seeds = f" ({claimed[0].hz:.3f}..{claimed[-1].hz:.3f})" if len(group) > 1 else ""
        return f"{middle.hz:.3f}{seeds}", _interval(middle.ci95), _interval(middle.distorted_ci95)
    models = [recovered.model_hz for recovered in group if recovered.refused and np.isfinite(recovered.model_hz)]
    remark = f" (model: {between(models)})" if models else ""
    return f"not claimed{remark}", "—", "—"


def _interval(ends: tuple[float, float]) -> str:
    """Ends of an interval; where the record does not tell an end, the other one."""
    low, high = ends
    if not np.isfinite(low):
        return "—"
    if not np.isfinite(high):
        return f"{low:.3f} or more" if low > 0.0 else "unknown"
    return f"{low:.3f} to {high:.3f}" if low > 0.0 else f"up to {high:.3f}"


def _counted(judgements: Iterable[bool | None]) -> str:
    """How many of several judgements are positive, or yes or no of a single one; those that are None do not count."""
    judgements = list(judgements)
    judged = [judgement for judgement in judgements if judgement is not None]
    if not judged:
        return "—"
    if len(judgements) > 1:
        return f"{sum(judged)} of {len(judged)}"
    return "yes" if judged[0] else "no"


def _median(values: Iterable[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.3f}" if finite else "—"


def table_notes(study: BandwidthStudy) -> list[str]:
    """Lines that explain the tables: several seeds, reasons against bandwidths, and the best linear truth."""
    notes = []
    if any(len(group) > 1 for joint in study.joints for group in study.groups(joint)):
        notes.append(
            "Of several seeds: the middle bandwidth with its own interval, the range in brackets, and how many of all"
        )
    notes += [f"not claimed: {reason}" for reason in study.refusals()]
    approximations = list(study.best_linear.values())
    for approximation in approximations:
        subject = f"{approximation.joint}, test {approximation.test}: its best linear bandwidth has little meaning"
        notes += [f"{subject}: {caution}" for caution in approximation.cautions]
    if approximations:
        first = approximations[0]
        notes.append(
            f"Best linear truth, e.g. {first.joint}, test {first.test}: {first.described}; friction as in the test"
        )
    return notes
