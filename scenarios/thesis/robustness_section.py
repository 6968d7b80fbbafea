"""Robustness in the report: records spoilt by degree."""

from collections.abc import Sequence

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.report.figures import Gallery
from scenarios.thesis import figures_robustness as draw
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, TREATMENTS
from scenarios.thesis.findings_robustness import statements
from scenarios.thesis.orders_needed import MARGIN as ORDER_MARGIN
from scenarios.thesis.robustness import CORE, PART, sysid_method
from scenarios.thesis.tolerance import COMPARABLE, Tolerance, tolerance

READING = (
    "Blue: the thesis' prediction-error structure; green: OKID. Marks are medians over the draws, bars reach from the "
    "smallest to the largest; harm grows to the right. "
)

FAILED = "A cross stands for draws without a bandwidth (refused, unstable, or a gain that never falls by 3 dB)."


def robustness(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    found = study.robustness
    shown: dict[str, object] = {
        "joints": tuple(found.judged_by),
        "judged_by": sorted({number for numbers in found.judged_by.values() for number in numbers}),
        "seconds": PART / SAMPLE_RATE,
        "comparable": COMPARABLE,
        "order_margin": ORDER_MARGIN,
        "tolerances": _tolerances(study),
        "orders": found.orders,
        "statements": statements(study) if found.judged_by else (),
        "coverage": _coverage(study),
        "figures": (),
        "thorough": _thorough(study),
    }
    if not shown["thorough"]:
        return shown
    shown["figures"] = (
        gallery.add(
            draw.errors_and_detrending(found),
            "Constants and trends left in the output, and taken out again: error of the bandwidth. Full lines: nothing "
            "removed; dashed: mean removed; dotted: straight line removed. " + READING + FAILED,
            name="robustness-trends-bandwidth",
        ),
        gallery.add(
            draw.fits_and_detrending(found),
            "The same records: what the models leave unexplained in simulation of clean records of other waveforms. "
            + READING,
            name="robustness-trends-fit",
        ),
        gallery.add(
            draw.errors(found),
            "Outliers, lost samples, length of the record and added noise: error of the bandwidth. " + READING + FAILED,
            name="robustness-bandwidth",
        ),
        gallery.add(
            draw.fits(found),
            "The same records: what the models leave unexplained in simulation of clean records of other waveforms. "
            + READING,
            name="robustness-fit",
        ),
        gallery.add(
            draw.fits_of_structures(found),
            "Other structures beside the thesis' own: fits in simulation of clean records of other tests. ARX, like "
            "OKID, has the spoilt output among its regressors; OE has none of it. What the thesis did not choose "
            "is tried on one draw.",
            name="robustness-structures",
        ),
    )
    return shown


def _thorough(study: Comparison) -> bool:
    return any(entry.disturbance not in CORE for entry in study.robustness.outcomes)


def _tolerances(study: Comparison) -> list[tuple[str, str, list[tuple[str, str]]]]:
    """By disturbance and treatment: unit, and for each joint what SysID and OKID tolerate, in words."""
    found, rows = study.robustness, []
    tried = {(entry.disturbance, entry.treatment) for entry in found.outcomes}
    for key, disturbance in DISTURBANCES.items():
        for treatment in TREATMENTS:
            if (key, treatment) not in tried:
                continue
            label = disturbance.label if disturbance.treatments == AS_IT_IS else f"{disturbance.label}; {treatment}"
            cells = [
                (
                    _said(tolerance(found, key, joint, sysid_method(joint), treatment), disturbance.falling),
                    _said(tolerance(found, key, joint, "okid", treatment), disturbance.falling),
                )
                for joint in found.judged_by
            ]
            rows.append((label, disturbance.unit, cells))
    return rows


def _said(known: Tolerance | None, falling: bool) -> str:
    if known is None:
        return "–"
    if known.degree is None:
        return "none"
    word = "down to" if falling else "up to"
    return f"all, {word} {known.degree:g}" if known.everything else f"{word} {known.degree:g}"


def _coverage(study: Comparison) -> list[tuple[str, int, int]]:
    """Count the intervals that hold the truth, by method, over every record."""
    counts = []
    for name, okid in (("SysID", False), ("OKID", True)):
        entries: Sequence[bool] = [
            entry.covers for entry in study.robustness.outcomes if entry.chosen and (entry.method == "okid") == okid
        ]
        counts.append((name, sum(entries), len(entries)))
    return counts
