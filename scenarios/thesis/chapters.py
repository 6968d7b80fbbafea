"""Report sections on chapters II to VI and on published values: variables of the templates, taken from the study."""

from collections.abc import Callable, Iterable
from math import degrees
from typing import NamedTuple

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Status
from hmtb_twin.parameters.drives import ACTUATORS
from hmtb_twin.parameters.values import BUS, GAINS, HAND_CONTROLLER, MOTIONS, SAMPLE_RATE, SERVOS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.registry import load, names
from scenarios.files.toml_file import package_table
from scenarios.report.figure_style import MRAD
from scenarios.thesis.campaign import SAME_SEQUENCE, plays_identified_sequence
from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES
from scenarios.thesis.estimates import Fits, fits
from scenarios.thesis.every_data_set import AUDIBLE, DataSets, distances
from scenarios.thesis.findings_chapter_6 import bias_and_outliers
from scenarios.thesis.model_charts import METHODS
from scenarios.thesis.multivariable import EXCITED, FAST_CHIRP, off_diagonal, pushed_by_others
from scenarios.thesis.number_text import p_value, root
from scenarios.thesis.observer_analysis import P, hankel_share, observer_poles
from scenarios.thesis.order_search import IMPROVES
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL, NOISELESS
from scenarios.thesis.robustness import COMPARABLE, MARGIN, PART, sysid_method, tolerance
from scenarios.truth.published import (
    DRAWS,
    EQUATIONS,
    PERCENT_DESCRIBED,
    PUBLISHED,
    SYSTEMS,
    PublishedModel,
    published,
)
from sysid import StateSpace

PUSHED = (0.5, 1.0, 2.5, 5.0, 10.0)
"""Frequencies at which the true coupling is listed, Hz."""


def chapter_3(study: Comparison) -> dict[str, object]:
    """Chapters II and III: limits of the commands, and a row of the tables for every test."""
    joint, entry = next(iter(study.joints.items()))
    return {
        "limit": degrees(max(MOTIONS[joint].velocity_limit for joint in study.joints)),
        "gain": MRAD * HAND_CONTROLLER.gain,
        "slewing": 100 * max(share for entry in study.joints.values() for share in entry.slewing.values()),
        "single": {number: _waveform(single_joint_test(number, joint)) for number in entry.data},
        "several": {name: _waveform(name) for name in study.logs if name.startswith("mimo-")},
    }


def _waveform(name: str) -> str:
    return load(name).description.split(": ", 1)[1]


def chapter_4(study: Comparison) -> dict[str, object]:
    """Chapter IV: prediction-error models, their coefficients, data sets and orders."""
    return {
        "joints": [_prediction_error_models(study, joint) for joint in study.joints],
        "seen": SAME_SEQUENCE,
        "audible": 100 * AUDIBLE,
        "improves": IMPROVES,
        "p_value": p_value,
        "more_poles": study.more_poles,
        "thorough": bool(study.searches),
    }


def _prediction_error_models(study: Comparison, joint: str) -> dict[str, object]:
    entry, sets, searches = study.joints[joint], study.data_sets[joint], study.searches.get(joint)
    return {
        "result": entry,
        "coefficients": [
            *((entry.models[method].label, entry.models[method].estimate.model) for method in ("armax", "oe")),
            *((f"published {one.label}", one.model) for one in entry.published if one.method in ("armax", "oe")),
        ],
        "sets": sets,
        "shown": {name: name.removesuffix(f"-{joint}").replace("siso-", "test ") for name in sets.excited},
        "apart": {method: _distances(sets, method) for method in METHODS},
        "search": searches,
        "criteria": {name: searches.arx.best(name) for name in ("aic", "bic", "mdl", "validation")} if searches else {},
    }


def _distances(sets: DataSets, method: str) -> dict[str, float]:
    models = sets.singles(method, enough=True)
    pairs = distances(models)
    return {
        "models": len(models),
        "unstable": sum(not model.stable for model in models),
        "median": float(np.median(pairs)) if len(pairs) else np.nan,
        "largest": float(pairs.max()) if len(pairs) else np.nan,
    }


def chapter_5(study: Comparison) -> dict[str, object]:
    """Chapter V: observers, and the realised models beside the printed ones."""
    return {
        "p": P,
        "printed_percent": PERCENT_DESCRIBED,
        "joints": [
            {
                "result": entry,
                "observer": study.observers[joint],
                "whiteness": p_value(entry.models["okid"].residual_test.whiteness_p[0]),
                "realisation": realisation(entry),
            }
            for joint, entry in study.joints.items()
        ],
    }


def realisation(entry: JointResult) -> list[tuple[str, ...]]:
    """Matrices and coordinate-free quantities of a joint's identified and printed model: name, and both as text."""
    observer = entry.models["okid"].estimate
    printed = next(model.model for model in entry.published if model.method == "okid")
    described = hankel_share(observer, observer.model.order), PERCENT_DESCRIBED[entry.joint]
    return [
        *((name, text(observer.model), text(printed)) for name, text in QUANTITIES.items()),
        ("described by two states, %", *(f"{percent:.4f}" for percent in described)),
    ]


def _matrix(values: np.ndarray) -> str:
    """Matrix as text: rows separated by semicolons, five digits as in the thesis."""
    return "; ".join(" ".join(f"{value:.5g}" for value in row) for row in np.atleast_2d(values))


def _roots(roots: Iterable[complex]) -> str:
    return ", ".join(map(root, roots)) or "none"


QUANTITIES: dict[str, Callable[[StateSpace], str]] = {
    "A": lambda model: _matrix(model.A),
    "B": lambda model: _matrix(model.B.T),
    "C": lambda model: _matrix(model.C),
    "D": lambda model: _matrix(model.D),
    "G": lambda model: _matrix(-model.gain.T),
    "CB, CAB": lambda model: ", ".join(f"{value:.5f}" for value in model.markov(3)[1:, 0, 0]),
    "poles": lambda model: _roots(model.poles()),
    "zeros": lambda model: _roots(model.zeros()),
    "eigenvalues of A + G C": lambda model: _roots(observer_poles(model)),
    "gain at 0 Hz": lambda model: f"{model.dc_gain()[0, 0]:.4f}",
    "bandwidth, Hz": lambda model: f"{model.bandwidth()[0, 0]:.3f}",
}
"""What is listed of a realisation, with its text."""


def chapter_6(study: Comparison) -> dict[str, object]:
    """Chapter VI: models of three joints, their coupling, the exchange and the categories."""
    several = study.multivariable
    return {
        "joints": STUDIED_JOINTS,
        "models": several.models,
        "full": several.full,
        "true_coupling": off_diagonal(several.truth, band=EXCITED),
        "pushes": [(hz, pushed_by_others(several.truth, band=(hz, hz))) for hz in PUSHED],
        "exchange": _exchange(study) if RPCM in several.records else {},
        # Truth without coupling, truth with coupling, true angles.
        "reach": {
            joint: [several.reference(kind, FAST_CHIRP)[joint] for kind in (DIAGONAL, COUPLED, NOISELESS)]
            for joint in STUDIED_JOINTS
            if FAST_CHIRP in several.records
        },
        "same": [name for name in several.records if plays_identified_sequence(name)],
        "records": several.records,
        "categories": categories(study),
    }


def _exchange(study: Comparison) -> dict[str, object]:
    """Largest distance of each joint from the operating point once settled, deg, and time with the unit, percent."""
    log = study.campaign.log(RPCM)
    settled = slice(round(SETTLING / log.dt), None)
    away = np.degrees(np.abs(log.true_angles[settled] - study.truth.angles).max(axis=0))
    return {
        "away": dict(zip(JOINTS, away, strict=True)),
        "loaded": 100.0 * float(((log.status[settled] & Status.UNIT_HELD) > 0).mean()),
    }


def robustness(study: Comparison) -> dict[str, object]:
    """Section VI.6: tolerated degrees of disturbances, orders needed, intervals that hold the truth."""
    results = study.robustness
    chosen = [entry for entry in results.outcomes if entry.chosen]
    tried = [(entry.disturbance, entry.treatment) for entry in results.outcomes]
    return {
        "joints": tuple(results.judged_by),
        "judged_by": sorted({number for numbers in results.judged_by.values() for number in numbers}),
        "seconds": PART / SAMPLE_RATE,
        "comparable": COMPARABLE,
        "order_margin": MARGIN,
        "tolerances": [_tolerated(study, *pair) for pair in dict.fromkeys(tried)],
        "orders": results.orders,
        "statements": bias_and_outliers(study).parts if results.judged_by else {},
        "coverage": [
            (name, [entry.covers for entry in chosen if (entry.method == "okid") is okid])
            for name, okid in (("SysID", False), ("OKID", True))
        ],
    }


def _tolerated(study: Comparison, key: str, treatment: str) -> tuple[str, str, list[str]]:
    """Describe how much of a disturbance SysID and OKID tolerate on each joint."""
    disturbance, results = DISTURBANCES[key], study.robustness
    label = disturbance.label if disturbance.treatments == AS_IT_IS else f"{disturbance.label}; {treatment}"
    cases = [(joint, method) for joint in results.judged_by for method in (sysid_method(joint), "okid")]
    return label, disturbance.unit, [tolerance(results, key, *case, treatment) for case in cases]


class AssumedValue(NamedTuple):
    """A value of the twin that comes from the thesis, its origin with what follows, and the findings it affects."""

    what: str
    why: str
    findings: tuple[str, ...]


def assumed_values() -> tuple[AssumedValue, ...]:
    """Return every value of the nominal arm that comes from the thesis."""
    frictions = [ACTUATORS[name].coulomb_torque / ACTUATORS[name].rated_torque for name in STUDIED_JOINTS]
    numbers = {
        "slow": _span(SERVOS[name].slow_pole for name in STUDIED_JOINTS),
        "printed": sum(len(published(name)) for name in STUDIED_JOINTS),
        "delays": _span(BUS[name].delay for name in STUDIED_JOINTS),
        "friction": _span(100 * friction for friction in frictions),
        "gain": HAND_CONTROLLER.gain,
        "limits": _span(degrees(MOTIONS[name].velocity_limit) for name in STUDIED_JOINTS),
        "readings": _span(GAINS.values()),
    }
    table = package_table("assumed_values.toml")
    return tuple(
        AssumedValue(row["what"].format(**numbers), row["why"].format(**numbers), tuple(row["findings"]))
        for row in table["value"]
    )


def _span(values: Iterable[float]) -> str:
    """The value as text, or the ends of the range, smallest magnitude first."""
    texts = [f"{value:g}".replace("-", "−") for value in sorted(set(values), key=abs)]
    return texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}"


class PrintedRow(NamedTuple):
    """A printed model and how well it fits each record of its joint: single-joint tests by number, others by name."""

    printed: PublishedModel
    singles: dict[int, Fits]
    several: dict[str, Fits]


def published_section(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section."""
    records = [name for name in (*names("table2"), RPCM) if name in study.logs]
    rows = [printed_row(study, printed, records) for printed in (*PUBLISHED, EQUATIONS["4.7+4.9"])]
    rows.sort(key=lambda row: (STUDIED_JOINTS.index(row.printed.joint), row.printed.method))
    return {"rows": rows, "records": records, "draws": DRAWS, "systems": SYSTEMS}


def printed_row(study: Comparison, printed: PublishedModel, records: Iterable[str]) -> PrintedRow:
    """Row of a printed model, with its fits to the single-joint tests and to records of several joints."""
    model, joint = printed.model, printed.joint
    return PrintedRow(
        printed,
        {number: fits(model, data) for number, data in study.joints[joint].data.items()},
        {name: fits(model, study.campaign.record(name, joint)) for name in records},
    )
