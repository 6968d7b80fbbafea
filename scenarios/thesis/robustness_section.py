"""Report section on robustness to disturbances: tolerated degrees, orders needed, intervals that hold the truth."""

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
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


def _tolerances(study: Comparison) -> list[tuple[str, str, list[tuple[str, ...]]]]:
    """By disturbance and treatment: unit, and for each joint what SysID and OKID tolerate, in words."""
    results, rows = study.robustness, []
    for key, treatment in dict.fromkeys((entry.disturbance, entry.treatment) for entry in results.outcomes):
        kind = DISTURBANCES[key]
        methods = {joint: (sysid_method(joint), "okid") for joint in results.judged_by}
        cells = [
            tuple(tolerance(results, key, joint, one, treatment) for one in pair) for joint, pair in methods.items()
        ]
        rows.append((kind.label if kind.treatments == AS_IT_IS else f"{kind.label}; {treatment}", kind.unit, cells))
    return rows


def _coverage(study: Comparison) -> list[tuple[str, int, int]]:
    """Count the intervals that hold the truth, by method, over every record."""
    held: dict[str, list[bool]] = {"SysID": [], "OKID": []}
    for entry in study.robustness.outcomes:
        if entry.chosen:
            held["OKID" if entry.method == "okid" else "SysID"].append(entry.covers)
    return [(name, sum(covers), len(covers)) for name, covers in held.items()]
