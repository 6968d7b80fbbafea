"""Results of the study as a JSON record."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import campaign_scenario, single_joint_test
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.files.errors import DAMAGE, ScenarioError
from scenarios.files.result_table import ResultTable
from scenarios.thesis.attribution import AS_IT_IS, SMOOTH, Attributions
from scenarios.thesis.categories import Category, categories
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.estimates import IdentifiedModel
from scenarios.thesis.every_joint_section import every_joint_record
from scenarios.thesis.finding import CLAIMS, Finding
from scenarios.thesis.frequencies import finding_record, frequency_in_words, seeds_record
from scenarios.thesis.monte_carlo import Tally
from scenarios.thesis.multivariable import WAYS, ThreeJointModel
from sysid.models.bandwidth import half_power_hz

RESULTS = "results.json"
"""Name of the file that holds the results of a study."""

BANDWIDTH = "hz=bandwidth_hz ci95 covers half_power_hz"
"""Attributes of a bandwidth and the names that they have in the record."""

ERRORS = "relative_error=error relative_error_diagonal=diagonal_error"


def results(
    study: Comparison, findings: Sequence[Finding], report: Path, tally: Tally | None = None
) -> dict[str, object]:
    """Conclusions of the study, which `results.json` and `--json` hold: bandwidths, findings, fits and models.

    Also where the report was written, and with the conclusions of many seeds how often each verdict came out.
    """
    models = study.multivariable
    full_model_fields = f"record condition method {ERRORS} off_diagonal=coupling"
    seeds = None if tally is None else seeds_record(tally)
    return {
        "report": str(report),
        "bandwidth": {joint: _bandwidth_record(result) for joint, result in study.joints.items()},
        "findings": {finding.key: _finding_record(finding, tally) for finding in findings},
        "velocity_limited_share": {joint: dict(result.slewing) for joint, result in study.joints.items()},
        "fits": {joint: _fits_record(result) for joint, result in study.joints.items()},
        "attribution": {joint: _attribution_record(causes) for joint, causes in study.attribution.items()},
        "attribution_missing": {joint: dict(causes.missing) for joint, causes in study.attribution.items()},
        "orders": {joint: _orders_record(models_of_orders) for joint, models_of_orders in study.orders.items()},
        "three_joint_models": {model.name: _three_joint_record(model) for model in models.models},
        "references": dict(models.references),
        "full_models": [_picked(model, full_model_fields) for model in models.full],
        "categories": {category.name: _category_record(category) for category in categories(study)},
        "every_joint": every_joint_record(study),
        "cost": _picked(study.cost, "physics_s simulation_s report_s total_s times_physics"),
        "seeds": seeds,
        "failed": dict(study.failed),
        "seed": study.seed,
        "duration": study.duration,
        "versions": dict(study.provenance),
    }


def _bandwidth_record(result: JointResult) -> dict[str, object]:
    """Bandwidths of one joint: true, recovered by each method, and of the printed models."""
    return {
        "true_hz": result.truth.bandwidth_hz,
        "true_half_power_hz": half_power_hz(result.truth.model),
        "best_linear": _picked(result.best_linear, "hz ci95 half_power_hz command_rms distortion_percent"),
        "recovered": {method: _picked(model, f"{BANDWIDTH} dc_gain") for method, model in result.models.items()},
        "published": {model.label: model.bandwidth_hz for model in result.published},
        "published_half_power_hz": {model.label: half_power_hz(model.model) for model in result.published},
    }


def _finding_record(finding: Finding, tally: Tally | None) -> dict[str, object]:
    """Verdict, numbers and reason of a finding, and how often other seeds reach the verdict."""
    return {
        **_picked(finding, "verdict value parts why"),
        **_picked(finding.about, "unit thesis"),
        **finding_record(finding, tally),
    }


def _fits_record(result: JointResult) -> dict[str, object]:
    """Fits of the models of one joint to its tests, by method and number of the test."""
    record: dict[str, object] = {}
    for method, model in result.models.items():
        record[method] = {test: _picked(fit, "simulation one_step") for test, fit in model.fits.items()}
    return record


def _attribution_record(causes: Attributions) -> list[dict[str, object]]:
    return [_picked(model, "condition=label hz=bandwidth_hz ci95 half_power_hz") for model in causes.parts]


def _orders_record(models: Sequence[IdentifiedModel]) -> list[dict[str, object]]:
    return [_picked(model, "orders hz=bandwidth_hz ci95 dc_gain half_power_hz residual") for model in models]


def _three_joint_record(model: ThreeJointModel) -> dict[str, object]:
    """States, errors and fits of a model of three joints, by record and kind of fit."""
    fits_by_record = {}
    for record, fits in model.fits.items():
        fits_by_record[record] = {way: dict(fits.of(way)) for way in WAYS}
    return {"states": model.model.order, **_picked(model, f"largest_pole {ERRORS}"), "fits": fits_by_record}


def _category_record(category: Category) -> dict[str, object]:
    """A category of the thesis' comparison with its measures."""
    measures = [_picked(measure, "what values ahead") for measure in category.measures]
    return {**_picked(category, "thesis ahead"), "measures": measures}


def read_results(folder: Path) -> Mapping[str, Any]:
    """Read the conclusions of a study from its folder.

    Raises:
        ScenarioError: There are none, or the file is damaged or of another version.
    """
    path = folder / RESULTS
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        # Everything is made of it once, so that a damaged file is refused here and not where it is shown.
        result_tables(record)
        if not (isinstance(record["answer"], str) and isinstance(record["certainty"], str)):
            raise TypeError("the answer is no text")
        test = single_joint_test(1, STUDIED_JOINTS[0])
        # `opened` simulates parts of the study again: seed and duration must be such as a scenario takes.
        campaign_scenario(test, seed=record["seed"], duration=record["duration"])
        return dict(record)
    except DAMAGE as error:
        raise ScenarioError(f"{path} is no result of hmtb thesis, or a damaged one: {error!r}") from error


def result_tables(record: Mapping[str, Any]) -> list[ResultTable]:
    """Return the bandwidths of each joint and the findings as tables, from a record of `results` or its file.

    Raises:
        LookupError, TypeError, ValueError: The record is another.
    """
    tables = [_bandwidth_table(joint, bandwidths) for joint, bandwidths in record["bandwidth"].items()]
    rows = []
    for key, finding in record["findings"].items():
        # Studies without the conclusions of many seeds have no frequencies.
        seeds = finding.get("frequency", {"verdicts": {}, "depends_on_seed": False})
        frequency = frequency_in_words(seeds["verdicts"], depends=seeds["depends_on_seed"])
        rows.append((key, str(finding["verdict"]), frequency, CLAIMS[key].claim))
    return [*tables, ResultTable("Findings", ("", "verdict", "seeds", "claim"), rows)]


def _bandwidth_table(joint: str, bandwidths: Mapping[str, Any]) -> ResultTable:
    """Bandwidths of one joint: of the identified models, then of the printed ones."""
    rows = []
    for structure in STRUCTURES[joint]:
        model = bandwidths["recovered"].get(structure.method)
        if not model:
            continue
        label = f"{structure.label} *" if structure.chosen else structure.label
        agrees = "yes" if model["covers"] else "no"
        rows.append((label, _hz(model["hz"]), f"{_hz(model['ci95'][0])} to {_hz(model['ci95'][1])}", agrees))
    rows += [(f"published {label}", _hz(hz), "", "") for label, hz in bandwidths["published"].items()]
    best_linear, small_signal = _hz(bandwidths["best_linear"]["hz"]), _hz(bandwidths["true_hz"])
    title = f"{joint}: bandwidth of the best linear truth {best_linear} Hz, small-signal {small_signal} Hz"
    return ResultTable(
        title, ("model (* chosen by the thesis)", "Hz", "95 % interval", "agrees with best linear"), rows
    )


def _hz(value: float | None) -> str:
    """A frequency, Hz; the file has null where there is none, since JSON has no NaN."""
    return "nan" if value is None else f"{value:.3f}"


def _picked(record: object, names: str) -> dict[str, object]:
    """Attributes of a record by name; `name=attribute` gives one another name."""
    fields: dict[str, object] = {}
    for field in names.split():
        name, _, attribute = field.partition("=")
        fields[name] = getattr(record, attribute or name)
    return fields


def friction_in_words(study: Comparison) -> str:
    """Describe the effect of friction on the frequency at which the gain is 0.707."""
    changes = []
    for causes in study.attribution.values():
        with_friction, without = causes.find(AS_IT_IS), causes.find(SMOOTH)
        if not with_friction or not without:
            continue
        hz, frictionless_hz = with_friction.half_power_hz, without.half_power_hz
        if np.isfinite([hz, frictionless_hz]).all():
            changes.append(100 * (hz / frictionless_hz - 1))
    if not changes:
        return (
            "The effect of friction on the frequency at which the gain is 0.707 is unknown: no joint has a model that "
            "reaches it both with friction and without."
        )
    all_joints = len(study.attribution)
    joints = "" if len(changes) == all_joints else f" (on {len(changes)} of {all_joints} joints)"
    change_range = f"{min(changes):+.1f} to {max(changes):+.1f} %".replace("-", "−")
    return f"Friction moves the frequency at which the gain is 0.707 by {change_range}{joints}."
