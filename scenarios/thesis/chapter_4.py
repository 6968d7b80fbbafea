"""Report section on chapter IV: tables of prediction-error models."""

from dataclasses import dataclass

import numpy as np

from scenarios.thesis.campaign import tests_of_same_sequence
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.every_data_set import AUDIBLE, DataSets, distances
from scenarios.thesis.model_charts import METHODS
from scenarios.thesis.number_text import p_value
from scenarios.thesis.order_search import IMPROVES
from sysid import StateSpace


@dataclass(frozen=True)
class Coefficients:
    """A model in the form in which the thesis prints its models.

    Attributes:
        label: Its name.
        rows: Power of 1/z, then its coefficient in the denominator, in the numerator, and K.
        printed: Whether the thesis prints it.
    """

    label: str
    rows: tuple[tuple[int, float, float, float], ...]
    printed: bool


def chapter_4(study: Comparison) -> dict[str, object]:
    """Numbers of the chapter.

    Args:
        study: The study.

    Returns:
        Variables of the template.
    """
    return {
        "joints": [_joint(study, joint) for joint in study.joints],
        "seen": tests_of_same_sequence(study.estimation_test),
        "audible": 100 * AUDIBLE,
        "improves": IMPROVES,
        "p_value": p_value,
        "thorough": bool(study.searches),
    }


def _joint(study: Comparison, joint: str) -> dict[str, object]:
    entry, sets, searches = study.joints[joint], study.data_sets[joint], study.searches.get(joint)
    return {
        "result": entry,
        "coefficients": coefficients(entry),
        "sets": sets,
        "shown": {name: name.removesuffix(f"-{joint}").replace("siso-", "test ") for name in sets.excited},
        "apart": {method: _distances(sets, method) for method in METHODS},
        "search": searches,
        "criteria": {name: searches.arx.best(name) for name in ("aic", "bic", "mdl", "validation")} if searches else {},
        "more_poles": study.prediction_errors[joint].more_poles,
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


def coefficients(entry: JointResult) -> tuple[Coefficients, ...]:
    """ARMAX and OE of the study and the printed ones of these kinds, coefficient by coefficient."""
    ours = [
        Coefficients(entry.models[method].label, _observer_form(entry.models[method].estimate.model), False)
        for method in ("armax", "oe")
    ]
    printed = [
        Coefficients(f"published {model.label}", _observer_form(model.model), True)
        for model in entry.published
        if model.method in ("armax", "oe")
    ]
    return (*ours, *printed)


def _observer_form(model: StateSpace) -> tuple[tuple[int, float, float, float], ...]:
    """Coefficients of a model in observer companion form, as our estimates and the prints are [Morris1996, eq. 4.9]."""
    return tuple(
        (k + 1, -float(model.A[k, 0]), float(model.B[k, 0]), float(model.gain[k, 0])) for k in range(model.order)
    )
