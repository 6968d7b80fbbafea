"""Report section on robustness to disturbances: tolerated degrees, orders needed, intervals that hold the truth."""

from collections.abc import Sequence

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, TREATMENTS
from scenarios.thesis.findings_chapter_6 import bias_and_outliers
from scenarios.thesis.robustness import COMPARABLE, PART, sysid_method, tolerance
from scenarios.thesis.robustness import MARGIN as ORDER_MARGIN


def robustness(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section."""
    results = study.robustness
    return {
        "joints": tuple(results.judged_by),
        "judged_by": sorted({number for numbers in results.judged_by.values() for number in numbers}),
        "seconds": PART / SAMPLE_RATE,
        "comparable": COMPARABLE,
        "order_margin": ORDER_MARGIN,
        "tolerances": _tolerances(study),
        "orders": results.orders,
        "statements": bias_and_outliers(study).parts if results.judged_by else {},
        "coverage": _coverage(study),
    }


def _tolerances(study: Comparison) -> list[tuple[str, str, list[tuple[str, str]]]]:
    """By disturbance and treatment: unit, and for each joint what SysID and OKID tolerate, in words."""
    results, rows = study.robustness, []
    treatments = {(entry.disturbance, entry.treatment) for entry in results.outcomes}
    for key, disturbance in DISTURBANCES.items():
        for treatment in TREATMENTS:
            if (key, treatment) not in treatments:
                continue
            label = disturbance.label if disturbance.treatments == AS_IT_IS else f"{disturbance.label}; {treatment}"
            cells = [
                (
                    tolerance(results, key, joint, sysid_method(joint), treatment),
                    tolerance(results, key, joint, "okid", treatment),
                )
                for joint in results.judged_by
            ]
            rows.append((label, disturbance.unit, cells))
    return rows


def _coverage(study: Comparison) -> list[tuple[str, int, int]]:
    """Count the intervals that hold the truth, by method, over every record."""
    counts = []
    for name, okid in (("SysID", False), ("OKID", True)):
        entries: Sequence[bool] = [
            entry.covers for entry in study.robustness.outcomes if entry.chosen and (entry.method == "okid") == okid
        ]
        counts.append((name, sum(entries), len(entries)))
    return counts
