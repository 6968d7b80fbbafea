"""Report sections on chapters II to VI and on published values: variables of the templates, taken from the study."""

from collections.abc import Callable, Iterable
from math import degrees
from typing import NamedTuple

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Status
from hmtb_twin.parameters.values import GAINS, HAND_CONTROLLER, SAMPLE_RATE
from hmtb_twin.parameters.variants import ACTUATORS, BUS, MOTIONS, SERVOS
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
from scenarios.thesis.multivariable import EXCITED, FAST_CHIRP, Multivariable, off_diagonal, pushed_by_others
from scenarios.thesis.number_text import p_value, root
from scenarios.thesis.observer_analysis import P, hankel_share, observer_poles
from scenarios.thesis.order_search import IMPROVES
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL, NOISELESS
from scenarios.thesis.robustness import COMPARABLE, MARGIN, PART, Robustness, sysid_method, tolerance
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
    slewing_shares: list[float] = []
    for result in study.joints.values():
        slewing_shares += result.slewing.values()
    # Tests of one number play the same waveform on every joint: the rows are those of any joint.
    joint, any_result = next(iter(study.joints.items()))
    return {
        "limit": degrees(max(MOTIONS[name].velocity_limit for name in study.joints)),
        "gain": MRAD * HAND_CONTROLLER.gain,
        "slewing": 100 * max(slewing_shares),
        "single": {test: _waveform(single_joint_test(test, joint)) for test in any_result.data},
        "several": {name: _waveform(name) for name in study.logs if name.startswith("mimo-")},
    }


def _waveform(name: str) -> str:
    """What a registered test plays: its description without the words before the colon."""
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
    """Variables of chapter IV on one joint."""
    result, sets, searches = study.joints[joint], study.data_sets[joint], study.searches.get(joint)
    # Orders are searched in thorough studies alone.
    criteria: dict[str, object] = {}
    if searches:
        criteria = {name: searches.arx.best(name) for name in ("aic", "bic", "mdl", "validation")}
    return {
        "result": result,
        "coefficients": _coefficients(result),
        "sets": sets,
        "shown": {name: name.removesuffix(f"-{joint}").replace("siso-", "test ") for name in sets.excited},
        "apart": {method: _distances(sets, method) for method in METHODS},
        "search": searches,
        "criteria": criteria,
    }


def _coefficients(result: JointResult) -> list[tuple[str, StateSpace]]:
    """ARMAX and OE models of a joint with their labels, the identified ones first: those with printed polynomials."""
    labelled = [(result.models[method].label, result.models[method].estimate.model) for method in ("armax", "oe")]
    for printed in result.published:
        if printed.method in ("armax", "oe"):
            labelled.append((f"published {printed.label}", printed.model))
    return labelled


def _distances(sets: DataSets, method: str) -> dict[str, float]:
    """How far models of one method from sufficiently exciting data sets lie apart, and how many there are."""
    # A record that excites too little fixes no model: the spread of such models is no property of the method.
    models = sets.singles(method, enough=True)
    pairs = distances(models)
    # A single model is at no distance from others.
    spread = {"median": np.nan, "largest": np.nan}
    if len(pairs):
        spread = {"median": float(np.median(pairs)), "largest": float(pairs.max())}
    unstable = sum(not model.stable for model in models)
    return {"models": len(models), "unstable": unstable, **spread}


def chapter_5(study: Comparison) -> dict[str, object]:
    """Chapter V: observers, and the realised models beside the printed ones."""
    joints = []
    for joint, result in study.joints.items():
        whiteness = result.models["okid"].residual_test.whiteness_p[0]
        joints.append(
            {
                "result": result,
                "observer": study.observers[joint],
                "whiteness": p_value(whiteness),
                "realisation": realisation(result),
            }
        )
    return {"p": P, "printed_percent": PERCENT_DESCRIBED, "joints": joints}


def realisation(entry: JointResult) -> list[tuple[str, ...]]:
    """Matrices and coordinate-free quantities of a joint's identified and printed model: name, and both as text."""
    observer = entry.models["okid"].estimate
    printed = next(model.model for model in entry.published if model.method == "okid")
    rows: list[tuple[str, ...]] = []
    for name, as_text in QUANTITIES.items():
        rows.append((name, as_text(observer.model), as_text(printed)))
    identified_percent = hankel_share(observer, observer.model.order)
    printed_percent = PERCENT_DESCRIBED[entry.joint]
    # The thesis' percentage is a share of Hankel singular values, no fit to the output.
    rows.append(("described by two states, %", f"{identified_percent:.4f}", f"{printed_percent:.4f}"))
    return rows


def _matrix(values: np.ndarray) -> str:
    """Matrix as text: rows separated by semicolons, five digits as in the thesis."""
    rows = []
    for row in np.atleast_2d(values):
        rows.append(" ".join(f"{value:.5g}" for value in row))
    return "; ".join(rows)


def _roots(roots: Iterable[complex]) -> str:
    """Poles or zeros as text."""
    return ", ".join(map(root, roots)) or "none"


QUANTITIES: dict[str, Callable[[StateSpace], str]] = {
    "A": lambda model: _matrix(model.A),
    "B": lambda model: _matrix(model.B.T),
    "C": lambda model: _matrix(model.C),
    "D": lambda model: _matrix(model.D),
    # The thesis' observer gain: K = -G [Morris1996, eq. 5.7].
    "G": lambda model: _matrix(-model.gain.T),
    "CB, CAB": lambda model: ", ".join(f"{value:.5f}" for value in model.markov(3)[1:, 0, 0]),
    "poles": lambda model: _roots(model.poles()),
    "zeros": lambda model: _roots(model.zeros()),
    "eigenvalues of A + G C": lambda model: _roots(observer_poles(model)),
    "gain at 0 Hz": lambda model: f"{model.dc_gain()[0, 0]:.4f}",
    "bandwidth, Hz": lambda model: f"{model.bandwidth()[0, 0]:.3f}",
}
"""Functions that give the listed quantities of a realisation as text, by name.

Its matrices depend on the coordinates of the state and cannot be compared one by one; what follows them can.
"""


def chapter_6(study: Comparison) -> dict[str, object]:
    """Chapter VI: models of three joints, their coupling, the exchange and the categories."""
    multivariable = study.multivariable
    exchange = _exchange(study) if RPCM in multivariable.records else {}
    return {
        "joints": STUDIED_JOINTS,
        "models": multivariable.models,
        "full": multivariable.full,
        "true_coupling": off_diagonal(multivariable.truth, band=EXCITED),
        "pushes": [(hz, pushed_by_others(multivariable.truth, band=(hz, hz))) for hz in PUSHED],
        "exchange": exchange,
        "reach": _fast_chirp_references(multivariable),
        "same": [name for name in multivariable.records if plays_identified_sequence(name)],
        "records": multivariable.records,
        "categories": categories(study),
    }


def _fast_chirp_references(multivariable: Multivariable) -> dict[str, list[float]]:
    """Fits to the fast chirp of the truth without coupling, of that with coupling and of the true angles, by joint."""
    if FAST_CHIRP not in multivariable.records:
        return {}
    references = [multivariable.reference(reference, FAST_CHIRP) for reference in (DIAGONAL, COUPLED, NOISELESS)]
    return {joint: [fits_by_joint[joint] for fits_by_joint in references] for joint in STUDIED_JOINTS}


def _exchange(study: Comparison) -> dict[str, object]:
    """Largest distance of each joint from the operating point once settled, deg, and time with the unit, percent."""
    log = study.campaign.log(RPCM)
    # The part of the record that models are compared with.
    settled = slice(round(SETTLING / log.dt), None)
    distance = np.degrees(np.abs(log.true_angles[settled] - study.truth.angles).max(axis=0))
    unit_held = (log.status[settled] & Status.UNIT_HELD) > 0
    return {
        "away": dict(zip(JOINTS, distance, strict=True)),
        "loaded": 100.0 * float(unit_held.mean()),
    }


def robustness(study: Comparison) -> dict[str, object]:
    """Section VI.6: tolerated degrees of disturbances, orders needed, intervals that hold the truth."""
    results = study.robustness
    # Disturbances with their treatments in the order in which they were tried, each pair once.
    pairs = dict.fromkeys((outcome.disturbance, outcome.treatment) for outcome in results.outcomes)
    judging_tests: set[int] = set()
    for tests in results.judged_by.values():
        judging_tests.update(tests)
    statements = bias_and_outliers(study).parts if results.judged_by else {}
    return {
        "joints": tuple(results.judged_by),
        "judged_by": sorted(judging_tests),
        "seconds": PART / SAMPLE_RATE,
        "comparable": COMPARABLE,
        "order_margin": MARGIN,
        "tolerances": [_tolerated(study, *pair) for pair in pairs],
        "orders": results.orders,
        "statements": statements,
        "coverage": _coverage(results),
    }


def _coverage(results: Robustness) -> list[tuple[str, list[bool]]]:
    """Whether each interval of the thesis' structures agrees with the best linear truth: SysID's, then OKID's."""
    chosen = [outcome for outcome in results.outcomes if outcome.chosen]
    sysid_covers = [outcome.covers for outcome in chosen if outcome.method != "okid"]
    okid_covers = [outcome.covers for outcome in chosen if outcome.method == "okid"]
    return [("SysID", sysid_covers), ("OKID", okid_covers)]


def _tolerated(study: Comparison, key: str, treatment: str) -> tuple[str, str, list[str]]:
    """Describe how much of a disturbance SysID and OKID tolerate on each joint."""
    disturbance = DISTURBANCES[key]
    label = disturbance.label
    # A disturbance that is tried without detrending alone needs no word of it.
    if disturbance.treatments != AS_IT_IS:
        label = f"{label}; {treatment}"
    tolerances = []
    for joint in study.robustness.judged_by:
        for method in (sysid_method(joint), "okid"):
            tolerances.append(tolerance(study.robustness, key, joint, method, treatment))
    return label, disturbance.unit, tolerances


class AssumedValue(NamedTuple):
    """A value of the twin that comes from the thesis, its origin with what follows, and the findings it affects."""

    what: str
    why: str
    findings: tuple[str, ...]


def assumed_values() -> tuple[AssumedValue, ...]:
    """Return every value of the nominal arm that comes from the thesis."""
    frictions = [ACTUATORS[name].coulomb_torque / ACTUATORS[name].rated_torque for name in STUDIED_JOINTS]
    fields = {
        "slow": _span(SERVOS[name].slow_pole for name in STUDIED_JOINTS),
        "printed": sum(len(published(name)) for name in STUDIED_JOINTS),
        "delays": _span(BUS[name].delay for name in STUDIED_JOINTS),
        "friction": _span(100 * friction for friction in frictions),
        "gain": HAND_CONTROLLER.gain,
        "limits": _span(degrees(MOTIONS[name].velocity_limit) for name in STUDIED_JOINTS),
        "readings": _span(GAINS.values()),
    }
    assumed = []
    for row in package_table("assumed_values.toml")["value"]:
        what, why = row["what"].format(**fields), row["why"].format(**fields)
        assumed.append(AssumedValue(what, why, tuple(row["findings"])))
    return tuple(assumed)


def _span(values: Iterable[float]) -> str:
    """The value as text, or the ends of the range, smallest magnitude first."""
    labels = [f"{value:g}".replace("-", "−") for value in sorted(set(values), key=abs)]
    return labels[0] if len(labels) == 1 else f"{labels[0]} to {labels[-1]}"


class PrintedRow(NamedTuple):
    """A printed model and how well it fits each record of its joint: single-joint tests by number, others by name."""

    printed: PublishedModel
    singles: dict[int, Fits]
    several: dict[str, Fits]


def published_section(study: Comparison) -> dict[str, object]:
    """Variables of the section on published values: how every printed model fits the records of the twin."""
    records = [name for name in (*names("table2"), RPCM) if name in study.logs]
    # Yaw's ARMAX is printed twice, as (4.7) and (4.9); the last row has of every number the print with more digits.
    rows = [printed_row(study, printed, records) for printed in (*PUBLISHED, EQUATIONS["4.7+4.9"])]
    # By joint as the thesis treats them; the sort keeps the printed order within a method.
    rows.sort(key=lambda row: (STUDIED_JOINTS.index(row.printed.joint), row.printed.method))
    return {"rows": rows, "records": records, "draws": DRAWS, "systems": SYSTEMS}


def printed_row(study: Comparison, printed: PublishedModel, records: Iterable[str]) -> PrintedRow:
    """Row of a printed model, with its fits to the single-joint tests and to records of several joints."""
    model, joint = printed.model, printed.joint
    singles = {test: fits(model, record) for test, record in study.joints[joint].data.items()}
    several = {name: fits(model, study.campaign.record(name, joint)) for name in records}
    return PrintedRow(printed, singles, several)
