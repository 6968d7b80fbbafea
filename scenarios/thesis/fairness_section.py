"""Fairness in the report: the same table for every arm."""

from scenarios.report.figures import Gallery
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.fair_conclusions import RECORDS, conclusions, said
from scenarios.thesis.fairness_table import ArmFairness, BothFits, FairModel, Fairness
from scenarios.thesis.figures_fairness import dumbbells

WORST = -1000.0
"""Fits below this are printed as such: a simulation that grows without bound has any number."""


def fairness_section(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figure, tables and conclusions of the section.

    Args:
        study: The study.
        gallery: Takes the figure.

    Returns:
        What the template shows.
    """
    fairness = study.fairness
    if fairness is None or not any(arm.joints for arm in fairness.arms):
        return {"arms": ()}
    found = conclusions(fairness)
    return {
        "arms": [(str(arm.condition), arm.truth_hz) for arm in fairness.arms],
        "joints": _joints(fairness),
        "three": _three(fairness),
        "conclusions": [
            (entry.question, [entry.answers.get(arm.condition) for arm in fairness.arms], entry.changes())
            for entry in found
        ],
        "said": said(found),
        "estimation_test": fairness.estimation_test,
        "figure": gallery.add(
            dumbbells(fairness),
            "What every model leaves unexplained on single-joint tests of other waveforms: in simulation (filled) "
            "and one step ahead (open); one mark in the other where a model has no noise model. Stars: structures of "
            "the thesis' three-joint models. Every arm's models are identified from its own PRBS test; the printed "
            "ones are the thesis' own, on the same records.",
            name="fairness",
        ),
    }


def percent(value: float) -> str:
    """A fit as text."""
    return f"{value:.1f}" if value >= WORST else f"< {WORST:g}".replace("-", "−")


def _both(fit: BothFits | None) -> str:
    return "–" if fit is None else f"{percent(fit.simulation)} / {percent(fit.one_step)}"


def _joints(fairness: Fairness) -> list[tuple[str, list[str], list[tuple[str, bool, list[dict[str, object] | None]]]]]:
    """By joint: the truth of every arm, and a row for each model with a cell for each arm."""
    groups = []
    names = dict.fromkeys(joint for arm in fairness.arms for joint in arm.joints)
    for joint in names:
        labels = dict.fromkeys(
            (entry.label, entry.chosen) for arm in fairness.arms for entry in arm.joints.get(joint, ())
        )
        rows = [
            (label, chosen, [_cell(arm, joint, label, fairness) for arm in fairness.arms]) for label, chosen in labels
        ]
        groups.append((joint, [f"{arm.truth_hz[joint]:.3f}" for arm in fairness.arms], rows))
    return groups


def _cell(arm: ArmFairness, joint: str, label: str, fairness: Fairness) -> dict[str, object] | None:
    model = next((entry for entry in arm.joints.get(joint, ()) if entry.label == label), None)
    if model is None:
        return None
    own = fairness.estimation_test
    return {
        "estimation": _both(model.fits.get(own)),
        "validation": _both(model.validation(own)),
        "band": _band(model),
        "covers": model.covers,
        "stable": model.stable,
        "refused": model.refused,
    }


def _band(model: FairModel) -> str:
    if model.bandwidth_hz != model.bandwidth_hz:
        return "no bandwidth"
    text = f"{model.bandwidth_hz:.3f} Hz"
    return text if model.ci95 is None else f"{text} ({model.ci95[0]:.3f} – {model.ci95[1]:.3f})"


def _three(fairness: Fairness) -> list[tuple[str, list[tuple[str, list[str]]]]]:
    """By record: a row for each three-joint model, a cell for each arm with the mean over the joints."""
    groups = []
    for record, name in RECORDS.items():
        names = dict.fromkeys((entry.name, entry.printed) for arm in fairness.arms for entry in arm.three_joint)
        rows = []
        for kind, printed in names:
            cells = []
            for arm in fairness.arms:
                model = next((e for e in arm.three_joint if (e.name, e.printed) == (kind, printed)), None)
                fits = None if model is None or record not in model.fits else list(model.fits[record].values())
                cells.append(
                    "–"
                    if fits is None
                    else _both(
                        BothFits(
                            sum(fit.simulation for fit in fits) / len(fits),
                            sum(fit.one_step for fit in fits) / len(fits),
                        )
                    )
                )
            rows.append((f"{'printed ' if printed else ''}{kind} model", cells))
        if any(cell != "–" for _, cells in rows for cell in cells):
            groups.append((name, rows))
    return groups
