"""Results of the study as a JSON record."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from scenarios.identification.one_hertz import look, published_in_words
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz
from scenarios.thesis.attribution import AS_IT_IS, CONDITIONS, SMOOTH, half_power_spread, spread
from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.frequencies import finding_record, seeds_record
from scenarios.thesis.multivariable import WAYS
from scenarios.thesis.tally import Tally
from sysid.models.bandwidth import half_power_hz


def multivariable_record(study: Comparison) -> dict[str, object]:
    """The three-joint models with their fits, and the seven categories.

    Args:
        study: The study.

    Returns:
        `three_joint_models`, `references` (what the truth itself follows), `full_models` and `categories` by name.
    """
    models = study.multivariable
    return {
        "three_joint_models": {
            entry.name: {
                "states": entry.model.order,
                "largest_pole": entry.largest_pole,
                "relative_error": entry.error,
                "relative_error_diagonal": entry.diagonal_error,
                "fits": {name: {way: dict(fits.of(way)) for way in WAYS} for name, fits in entry.fits.items()},
            }
            for entry in models.models
        },
        "references": {
            entry.name: {name: dict(fits) for name, fits in entry.fits.items()} for entry in models.references
        },
        "full_models": [
            {
                "record": entry.record,
                "condition": entry.condition,
                "method": entry.method,
                "relative_error": entry.error,
                "relative_error_diagonal": entry.diagonal_error,
                "off_diagonal": entry.coupling,
            }
            for entry in models.full
        ],
        "categories": {
            entry.name: {
                "thesis": entry.thesis,
                "ahead": entry.ahead,
                "measures": [
                    {"what": measure.what, "values": dict(measure.values), "ahead": measure.ahead}
                    for measure in entry.measures
                ],
            }
            for entry in categories(study)
        },
    }


def results(
    study: Comparison, findings: Sequence[Finding], report: Path, tally: Tally | None = None
) -> dict[str, object]:
    """Conclusions of the study: bandwidths, findings, fits and models, which `results.json` and `--json` hold.

    Args:
        study: The study.
        findings: The decided findings.
        report: Where the report was written.
        tally: Conclusions of many seeds.

    Returns:
        Plain mappings, numbers and texts.
    """
    return {
        "report": str(report),
        "answer": answer(study),
        "bandwidth": {
            name: {
                "true_hz": entry.truth.bandwidth_hz,
                "best_linear_hz": entry.best_linear.hz,
                "best_linear_ci95": list(entry.best_linear.ci95),
                "true_half_power_hz": half_power_hz(entry.truth.model),
                "recovered": {
                    model.method: {
                        "hz": model.bandwidth_hz,
                        "ci95": list(model.ci95),
                        "covers": model.covers,
                        "dc_gain": model.dc_gain,
                        "half_power_hz": model.half_power_hz,
                    }
                    for model in entry.models.values()
                },
                "published": {model.label: model.bandwidth_hz for model in entry.published},
                "published_half_power_hz": {model.label: half_power_hz(model.model) for model in entry.published},
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
                **finding_record(entry, tally),
            }
            for entry in findings
        },
        "velocity_limited_share": {
            name: {str(number): share for number, share in entry.slewing.items()}
            for name, entry in study.joints.items()
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
                {
                    "condition": part.condition,
                    "hz": part.bandwidth_hz,
                    "ci95": list(part.ci95),
                    "covers": part.covers,
                    "half_power_hz": part.half_power_hz,
                }
                for part in entry.parts
            ]
            for name, entry in study.attribution.items()
        },
        "attribution_missing": {name: dict(entry.missing) for name, entry in study.attribution.items()},
        "orders": {
            name: [
                {
                    "orders": list(part.orders),
                    "hz": part.bandwidth_hz,
                    "ci95": list(part.ci95),
                    "dc_gain": part.dc_gain,
                    "half_power_hz": part.half_power_hz,
                    "residual": part.residual,
                }
                for part in parts
            ]
            for name, parts in study.orders.items()
        },
        **multivariable_record(study),
        "cost": {
            "physics_s": study.cost.physics_s,
            "simulation_s": study.cost.simulation_s,
            "report_s": study.cost.report_s,
            "total_s": study.cost.total_s,
            "times_physics": study.cost.times_physics,
        },
        "seeds": None if tally is None else seeds_record(tally),
        "failed": dict(study.failed),
        "seed": study.seed,
        "duration": study.duration,
        "versions": dict(study.provenance),
    }


def finding_stands(study: Comparison) -> bool:
    """Whether every recovered bandwidth is about 1 Hz."""
    return all(near_1_hz(model.bandwidth_hz) for entry in study.joints.values() for model in entry.models.values())


def departures(study: Comparison) -> dict[str, float]:
    """Largest departure of a bandwidth from the truth over the joints, percent, by condition of the attribution.

    Conditions of which nothing is known on any joint are left out.
    """
    values: dict[str, float] = {}
    for condition in CONDITIONS:
        parts = {name: entry.find(condition) for name, entry in study.attribution.items()}
        away = [
            100 * abs(part.bandwidth_hz / study.joints[name].truth.bandwidth_hz - 1)
            for name, part in parts.items()
            if part is not None
        ]
        if away:
            values[condition] = max(away)
    return values


def friction_effect(study: Comparison) -> tuple[float, float] | None:
    """Smallest and largest change over the joints that friction makes to where the gain is 0.707, percent.

    None where no joint has been identified both with friction and without.
    """
    change = []
    for entry in study.attribution.values():
        rough, smooth = entry.find(AS_IT_IS), entry.find(SMOOTH)
        if rough is not None and smooth is not None:
            change.append(100 * (rough.half_power_hz / smooth.half_power_hz - 1))
    return (min(change), max(change)) if change else None


def friction_in_words(study: Comparison) -> str:
    """Describe the effect of friction on the frequency at which the gain is 0.707."""
    effect = friction_effect(study)
    if effect is None:
        return (
            "The effect of friction on the frequency at which the gain is 0.707 is unknown: no joint has a model both "
            "with friction and without."
        )
    low, high = effect
    known = sum(
        entry.find(AS_IT_IS) is not None and entry.find(SMOOTH) is not None for entry in study.attribution.values()
    )
    joints = "" if known == len(study.attribution) else f" (on {known} of {len(study.attribution)} joints)"
    if high <= 0.0:
        moved = f"lowers the frequency at which the gain is 0.707 by {-high:.1f} to {-low:.1f} %"
    else:
        moved = f"moves the frequency at which the gain is 0.707 by {low:+.1f} to {high:+.1f} %".replace("-", "−")
    return f"Friction {moved}{joints}."


def headline(study: Comparison) -> str:
    """Short answer in two statements: near 1 Hz or not, and how many intervals contain the truth."""
    models = [model for entry in study.joints.values() for model in entry.models.values()]
    if study.duration is not None:
        return f"Records of {study.duration:g} s: a look, not a result"
    near = sum(near_1_hz(model.bandwidth_hz) for model in models)
    covered = sum(model.covers for model in models)
    low, high = ABOUT_1_HZ
    return (
        f"Near 1 Hz ({low:g} to {high:g} Hz): {near} of {len(models)} models. "
        f"Agrees with the best linear truth: {covered} of {len(models)}"
    )


def answer(study: Comparison) -> str:
    """Verdict on the thesis' 1 Hz finding, in words."""
    return " ".join(answers(study))


def answers(study: Comparison) -> tuple[str, ...]:
    """Statements of the answer: the band, the intervals, the published models."""
    if study.duration is not None:
        return (
            f"{look(study.duration)}, so no verdict on the 1 Hz finding is given. Run the study without a shorter "
            "duration for one.",
        )
    low, high = ABOUT_1_HZ
    entries = study.joints.values()
    models = [model for entry in entries for model in entry.models.values()]
    own = [model for model in models if model.method != "oe_high"]
    rich = [model for model in models if model.method == "oe_high"]
    orders = [part for effects in study.orders.values() for part in effects]
    first = (
        f"about 1 Hz, read as {low:g} to {high:g} Hz: "
        + ("the finding stands on the twin" if finding_stands(study) else "the finding does not stand for every method")
        + f". The true bandwidths are {_list_text(entry.truth.bandwidth_hz for entry in entries)} Hz (yaw, shoulder "
        f"pitch, elbow pitch); the thesis' structures recover {_range(model.bandwidth_hz for model in own)} Hz and "
        f"output-error models of higher order {_range(model.bandwidth_hz for model in rich)} Hz. Of "
        f"{len(orders)} output-error orders compared with them {sum(near_1_hz(part.bandwidth_hz) for part in orders)} "
        f"are near 1 Hz, {sum(near_1_hz(part.half_power_hz) for part in orders)} by where their gain is 0.707."
    )
    moved = max(high - low for low, high in (spread(effects) for effects in study.orders.values()))
    settled = max(high - low for low, high in (half_power_spread(effects) for effects in study.orders.values()))
    gains = [part.dc_gain for part in orders]
    second = (
        f"{sum(model.covers for model in models)} of {len(models)} bandwidths agree with the best linear truth. "
        f"{friction_in_words(study)} What "
        "models of higher order miss beyond that is extrapolation: the PRBS file repeats every 2 s, so nothing below "
        "0.5 Hz is excited, while the bandwidth is "
        f"relative to the gain at 0 Hz, which the models put at {min(gains):.2f} to {max(gains):.2f} (truth 1.00). "
        f"The choice of order alone moves the bandwidth of one joint by up to {moved:.2f} Hz, but the 0.707 frequency, "
        f"which is measured, by {settled:.2f} Hz."
    )
    third = published_in_words(study.joints)
    return f"First, {first}", f"Second, {second}", f"Third, {third}"


def _list_text(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def _range(values: Iterable[float]) -> str:
    numbers = list(values)
    return f"{min(numbers):.2f} to {max(numbers):.2f}"
