"""Results of the study as a JSON record."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import campaign_scenario, single_joint_test
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.files.errors import DAMAGE, ScenarioError
from scenarios.thesis.attribution import AS_IT_IS, SMOOTH
from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.every_joint_section import every_joint_record
from scenarios.thesis.finding import CLAIMS, Finding
from scenarios.thesis.frequencies import finding_record, frequency_in_words, seeds_record
from scenarios.thesis.monte_carlo import Tally
from scenarios.thesis.multivariable import WAYS
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
    return {
        "report": str(report),
        "bandwidth": {
            name: {
                "true_hz": entry.truth.bandwidth_hz,
                "true_half_power_hz": half_power_hz(entry.truth.model),
                "best_linear": _picked(entry.best_linear, "hz ci95 half_power_hz command_rms distortion_percent"),
                "recovered": {key: _picked(model, f"{BANDWIDTH} dc_gain") for key, model in entry.models.items()},
                "published": {model.label: model.bandwidth_hz for model in entry.published},
                "published_half_power_hz": {model.label: half_power_hz(model.model) for model in entry.published},
            }
            for name, entry in study.joints.items()
        },
        "findings": {
            entry.key: {
                **_picked(entry, "verdict value parts why"),
                **_picked(entry.about, "unit thesis"),
                **finding_record(entry, tally),
            }
            for entry in findings
        },
        "velocity_limited_share": {name: dict(entry.slewing) for name, entry in study.joints.items()},
        "fits": {
            name: {
                key: {number: _picked(fit, "simulation one_step") for number, fit in model.fits.items()}
                for key, model in entry.models.items()
            }
            for name, entry in study.joints.items()
        },
        "attribution": {
            name: [_picked(part, "condition=label hz=bandwidth_hz ci95 half_power_hz") for part in entry.parts]
            for name, entry in study.attribution.items()
        },
        "attribution_missing": {name: dict(entry.missing) for name, entry in study.attribution.items()},
        "orders": {
            name: [_picked(part, "orders hz=bandwidth_hz ci95 dc_gain half_power_hz residual") for part in parts]
            for name, parts in study.orders.items()
        },
        "three_joint_models": {
            entry.name: {
                "states": entry.model.order,
                **_picked(entry, f"largest_pole {ERRORS}"),
                "fits": {name: {way: dict(fits.of(way)) for way in WAYS} for name, fits in entry.fits.items()},
            }
            for entry in models.models
        },
        "references": dict(models.references),
        "full_models": [
            _picked(entry, f"record condition method {ERRORS} off_diagonal=coupling") for entry in models.full
        ],
        "categories": {
            entry.name: _picked(entry, "thesis ahead")
            | {"measures": [_picked(measure, "what values ahead") for measure in entry.measures]}
            for entry in categories(study)
        },
        "every_joint": every_joint_record(study),
        "cost": _picked(study.cost, "physics_s simulation_s report_s total_s times_physics"),
        "seeds": None if tally is None else seeds_record(tally),
        "failed": dict(study.failed),
        "seed": study.seed,
        "duration": study.duration,
        "versions": dict(study.provenance),
    }


def read_results(folder: Path) -> Mapping[str, Any]:
    """Read the conclusions of a study from its folder.

    Raises:
        ScenarioError: There are none, or the file is damaged or of another version.
    """
    path = folder / RESULTS
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        result_tables(record)
        texts, seed, duration = (record["answer"], record["certainty"]), record["seed"], record["duration"]
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("the answer is no text")
        campaign_scenario(single_joint_test(1, STUDIED_JOINTS[0]), seed=seed, duration=duration)
        return dict(record)
    except DAMAGE as error:
        raise ScenarioError(f"{path} is no result of hmtb thesis, or a damaged one: {error!r}") from error


class ResultTable(NamedTuple):
    """A table of the results in words."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str]]


def result_tables(record: Mapping[str, Any]) -> list[ResultTable]:
    """Return the bandwidths of each joint and the findings as tables, from a record of `results` or its file.

    Raises:
        LookupError, TypeError, ValueError: The record is another.
    """
    tables = []
    for name, entry in record["bandwidth"].items():
        rows = [
            (
                own.label + (" *" if own.chosen else ""),
                _hz(model["hz"]),
                f"{_hz(model['ci95'][0])} to {_hz(model['ci95'][1])}",
                "yes" if model["covers"] else "no",
            )
            for own in STRUCTURES[name]
            if (model := entry["recovered"].get(own.method))
        ]
        rows += [(f"published {label}", _hz(hz), "", "") for label, hz in entry["published"].items()]
        true = f"best linear truth {_hz(entry['best_linear']['hz'])} Hz, small-signal {_hz(entry['true_hz'])} Hz"
        columns = ("model (* chosen by the thesis)", "Hz", "95 % interval", "agrees with best linear")
        tables.append(ResultTable(f"{name}: bandwidth of the {true}", columns, rows))
    lines = []
    for key, finding in record["findings"].items():
        seeds = finding.get("frequency", {"verdicts": {}, "depends_on_seed": False})
        words = frequency_in_words(seeds["verdicts"], depends=seeds["depends_on_seed"])
        lines.append((key, str(finding["verdict"]), words, CLAIMS[key].claim))
    return [*tables, ResultTable("Findings", ("", "verdict", "seeds", "claim"), lines)]


def _hz(value: float | None) -> str:
    return f"{np.nan if value is None else value:.3f}"


def _picked(entry: object, names: str) -> dict[str, object]:
    """Attributes of a record by name; `name=attribute` gives one another name."""
    pairs = (name.split("=") for name in names.split())
    return {name: getattr(entry, attribute[0] if attribute else name) for name, *attribute in pairs}


def friction_in_words(study: Comparison) -> str:
    """Describe the effect of friction on the frequency at which the gain is 0.707."""
    pairs = [(entry.find(AS_IT_IS), entry.find(SMOOTH)) for entry in study.attribution.values()]
    known = [(rough.half_power_hz, smooth.half_power_hz) for rough, smooth in pairs if rough and smooth]
    change = [100 * (rough / smooth - 1) for rough, smooth in known if np.isfinite([rough, smooth]).all()]
    if not change:
        return (
            "The effect of friction on the frequency at which the gain is 0.707 is unknown: no joint has a model that "
            "reaches it both with friction and without."
        )
    joints = "" if len(change) == len(pairs) else f" (on {len(change)} of {len(pairs)} joints)"
    moved = f"{min(change):+.1f} to {max(change):+.1f} %".replace("-", "−")
    return f"Friction moves the frequency at which the gain is 0.707 by {moved}{joints}."
