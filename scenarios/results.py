"""The study's result as one object, and in one sentence."""

from collections.abc import Sequence
from pathlib import Path

from scenarios.comparison import Comparison
from scenarios.finding import Finding
from scenarios.findings_models import ABOUT_1_HZ
from scenarios.sensitivity import spread


def results(study: Comparison, findings: Sequence[Finding], report: Path) -> dict[str, object]:
    """Everything that `hmtb thesis --json` prints.

    Args:
        study: The study.
        findings: The decided findings.
        report: Where the report was written.

    Returns:
        Plain mappings, numbers and texts.
    """
    return {
        "report": str(report),
        "answer": answer(study),
        "bandwidth": {
            name: {
                "true_hz": entry.truth.bandwidth_hz,
                "recovered": {
                    model.method: {"hz": model.bandwidth_hz, "ci95": list(model.ci95), "covers": model.covers}
                    for model in entry.models.values()
                },
                "published": {model.label: model.bandwidth_hz for model in entry.published},
            }
            for name, entry in study.joints.items()
        },
        "findings": {
            entry.key: {
                "verdict": entry.verdict,
                "value": entry.value,
                "unit": entry.unit,
                "thesis": entry.thesis,
                "why": entry.why,
            }
            for entry in findings
        },
        "fits": {
            name: {
                model.method: {
                    str(number): {"simulation": fit.simulation, "one_step": fit.one_step}
                    for number, fit in model.fits.items()
                }
                for model in entry.models.values()
            }
            for name, entry in study.joints.items()
        },
        "attribution": {
            name: [
                {"condition": part.condition, "hz": part.bandwidth_hz, "ci95": list(part.ci95), "covers": part.covers}
                for part in parts
            ]
            for name, parts in study.attribution.items()
        },
        "orders": {
            name: [
                {
                    "orders": list(part.orders),
                    "hz": part.bandwidth_hz,
                    "ci95": list(part.ci95),
                    "residual": part.residual,
                }
                for part in parts
            ]
            for name, parts in study.orders.items()
        },
        "three_joint_models": {
            entry.name: {
                "states": entry.model.order,
                "relative_error": entry.error,
                "relative_error_diagonal": entry.diagonal_error,
            }
            for entry in study.three_joint
        },
        "cost": {
            "physics_s": study.cost.physics_s,
            "simulation_s": study.cost.simulation_s,
            "total_s": study.cost.total_s,
        },
        "failed": dict(study.failed),
        "seed": study.seed,
        "versions": dict(study.provenance),
    }


def stands(study: Comparison) -> bool:
    """Whether every recovered bandwidth is about 1 Hz."""
    low, high = ABOUT_1_HZ
    return all(low <= model.bandwidth_hz <= high for entry in study.joints.values() for model in entry.models.values())


def departures(study: Comparison) -> tuple[float, ...]:
    """Largest departure of a bandwidth from the truth under each condition of the attribution, percent."""
    rows = [
        [100 * abs(part.bandwidth_hz / study.joints[name].truth.bandwidth_hz - 1) for part in parts]
        for name, parts in study.attribution.items()
    ]
    return tuple(max(column) for column in zip(*rows, strict=True))


def answer(study: Comparison) -> str:
    """Whether the thesis' 1 Hz finding stands, in words."""
    true = [entry.truth.bandwidth_hz for entry in study.joints.values()]
    models = [model for entry in study.joints.values() for model in entry.models.values()]
    own = [model.bandwidth_hz for model in models if model.method != "oe_high"]
    high = [model.bandwidth_hz for model in models if model.method == "oe_high"]
    covered = sum(model.covers for model in models)
    yaw = [model.bandwidth_hz for model in study.joints["shoulder_yaw"].published]
    others = [
        model.bandwidth_hz
        for name, entry in study.joints.items()
        if name != "shoulder_yaw"
        for model in entry.published
    ]
    shown = ", ".join(f"{value:.2f}" for value in true)
    verdict = (
        "The 1 Hz finding stands on the twin"
        if stands(study)
        else "The 1 Hz finding does not stand for every method on the twin"
    )
    first, last = departures(study)[0], departures(study)[-1]
    lowest = min(low for low, _ in (spread(effects) for effects in study.orders.values()))
    width = max(high - low for low, high in (spread(effects) for effects in study.orders.values()))
    return (
        f"{verdict}: the true small-signal bandwidths are {shown} Hz (yaw, shoulder pitch, elbow pitch), the "
        f"thesis' structures recover {min(own):.2f} to {max(own):.2f} Hz and an output-error model of higher order "
        f"{min(high):.2f} to {max(high):.2f} Hz. {covered} of {len(models)} 95 % intervals hold the small-signal "
        f"truth: that higher-order model is off by up to {first:.1f} %, by up to {last:.2f} % with friction off and a "
        f"small amplitude, and the choice of order alone moves one by up to {width:.2f} Hz, down to {lowest:.2f} Hz, "
        "which no interval knows of. "
        f"The thesis' own published models have it for the pitches ({min(others):.3g} to {max(others):.3g} Hz) but not "
        f"for the yaw joint ({min(yaw):.3g} to {max(yaw):.3g} Hz)."
    )
