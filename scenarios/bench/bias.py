"""Bias of the response in closed loop, and where two inputs share their waveform."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.bench.accuracy_records import needed
from scenarios.bench.mean_error import mean_error
from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS, Figure, Part
from scenarios.bench.perfect_records import bound_for
from scenarios.bench.theory import expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import MODEL
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

PROBLEMS = ("feedback", "feedback-arx", "shared")
RECORDS = 40
ALONE = "shared-alone"
"""One of two inputs that share their waveform: what everyone finds there has the other path in it, and is told."""

RECORDS_ALONE = 20
DIRECTIONS = 4
"""In which the mean error is looked for: those in which the record says least of the response, by the bound."""

ALLOWED = 0.2
"""Bias that is no fault, in standard deviations of the estimator's own error.

Estimates that are unbiased in the limit have one of the order of 1/N, a fraction of a deviation on a short record.
"""


@dataclass(frozen=True)
class Bias:
    """Mean error of the response, in standard deviations of one record's error.

    The scatter is the estimator's own, so that one that is inefficient and unbiased passes. A mean over errors of many
    frequencies lives in as many directions as there are parameters; it is judged in the few in which the bound is
    largest, which are chosen without the data.
    """

    name: str = "bias"
    title: str = "Bias under feedback and under a shared waveform"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records in closed loop, and with a shared waveform."""
        counts = {**dict.fromkeys(PROBLEMS, RECORDS), ALONE: RECORDS_ALONE}
        return tuple(Trial(name, draw) for name, count in counts.items() for draw in range(count * DRAWS[effort]))

    def verdicts(self) -> int:
        """One per problem."""
        return len(PROBLEMS)

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Test the mean error on each problem."""
        del referee
        parts, curves = [], {}
        for name in PROBLEMS:
            asked = [m for m in measured if m.trial.problem == name and m.trial.ask == "fit"]
            part, curve = _part(name, asked, contestant, false_alarm)
            parts.append(part)
            curves[name] = curve
        alone = [m for m in measured if m.trial.problem == ALONE and m.trial.ask == "fit"]
        if alone:
            parts.append(_alone(alone, contestant))
        told = ", ".join(f"{curve['percent']:.2g} % on {name}" for name, curve in curves.items() if curve)
        return figure_of_parts(
            self.name,
            self.title,
            "deviations of one record",
            parts,
            self.verdicts() * false_alarm,
            f"mean error in {DIRECTIONS} directions against the estimator's own scatter, {ALLOWED:g} deviations allowed"
            + (f"; mean error of the response at its worst {told}" if told else ""),
            curves,
        )


def _part(
    name: str, asked: Sequence[Measured], contestant: Contestant, false_alarm: float
) -> tuple[Part, dict[str, Any]]:
    bound = bound_for(name, contestant.structure)
    if bound is None:
        return unjudged(name, "no bound is known, which says where to look"), {}
    found = [m.response for m in asked if m.kind == MODEL and m.response is not None]
    found = [response for response in found if response.shape == bound.response.shape]
    axes = directions(bound)
    if too_few := _too_few(len(found), max(fewest(axes), needed(len(asked))), len(asked)):
        return unjudged(name, too_few, len(found)), {}
    errors = np.array(found) - bound.response
    judged = mean_error(_flat(errors) @ axes, false_alarm, ALLOWED)
    theory = expectation(contestant, name, "bias")
    mean = errors.mean(axis=0)
    size = np.sqrt(np.mean(np.abs(bound.response) ** 2, axis=0))
    curve: dict[str, Any] = {
        "percent": float(np.max(100.0 * np.abs(mean) / size)),
        "frequencies": bound.frequencies.tolist(),
        "mean_error": np.abs(mean).reshape(len(mean), -1).T.tolist(),
        "deviation_of_mean": (errors.std(axis=0, ddof=1) / np.sqrt(len(errors))).reshape(len(mean), -1).T.tolist(),
    }
    part = Part(
        label=name,
        value=judged.size,
        expected=0.0,
        interval=judged.interval,
        limits=(0.0, judged.limit),
        passed=bool(judged.size <= judged.limit),
        theory=theory.passes,
        why=theory.why,
        draws=len(found),
    )
    return part, curve


def _alone(asked: Sequence[Measured], contestant: Contestant) -> Part:
    """What an estimator finds that is not given the other input, beside what it must find."""
    found = problem(ALONE)
    own = found.first.bound(contestant.structure) if isinstance(found, SharedAlone) else None
    own = found.first.bound(None) if isinstance(found, SharedAlone) and own is None else own
    if not isinstance(found, SharedAlone) or own is None:
        return unjudged(ALONE, "no bias is predicted")
    axes = directions(own)
    responses = [m.response for m in asked if m.kind == MODEL and m.response is not None]
    responses = [response for response in responses if response.shape == own.response.shape]
    if too_few := _too_few(len(responses), fewest(axes), len(asked)):
        return unjudged(ALONE, too_few, len(responses))
    errors = np.array(responses) - own.response
    predicted = found.expected_bias()
    judged = mean_error(_flat(errors) @ axes, 0.5)
    shifted = mean_error(_flat(errors - errors.mean(axis=0) + predicted) @ axes, 0.5)
    if not np.isfinite(shifted.size):
        return unjudged(ALONE, "the same error on all records: there is no scatter to tell it by", len(responses))
    scale = float(np.sqrt(np.mean(np.abs(own.response) ** 2)))
    size, expected = (100.0 * float(np.sqrt(np.mean(np.abs(b) ** 2))) / scale for b in (errors.mean(axis=0), predicted))
    return Part(
        label=ALONE,
        value=judged.size,
        expected=shifted.size,
        interval=judged.interval,
        limits=(-np.inf, np.inf),
        passed=None,
        theory=False,
        why=f"told, not judged: without the other input the response is {size:.3g} % off; output error without noise "
        f"is {expected:.3g} % off",
        draws=len(responses),
    )


def fewest(axes: FloatArray) -> int:
    """Records with a model that are needed to judge the mean error by its own scatter.

    Args:
        axes: Directions in which it is looked for, one per column.
    """
    return 2 * axes.shape[1] + 3


def _too_few(found: int, least: int, asked: int) -> str:
    """Why there is no verdict; empty where there are enough."""
    return f"{found} of {asked} records gave a model: too few, at least {least} are needed" if found < least else ""


def _flat(errors: ComplexArray) -> FloatArray:
    """Real and imaginary parts side by side (records, nf ny nu 2)."""
    return np.stack((errors.real, errors.imag), axis=-1).reshape(len(errors), -1)


def directions(bound: Bound) -> FloatArray:
    """Combinations of real and imaginary parts of the response that the record says least of.

    Each response is told in its own deviations first, so that small ones count as large ones do.

    Returns:
        One column per direction (nf ny nu 2, q); a perfect estimate's errors have variance 1 along each.
    """
    flat = bound.response_directions.reshape(len(bound.response_directions), -1, 2)
    deviation = np.sqrt(np.sum(flat**2, axis=(0, 2)))
    weight = np.where(deviation > 0.0, 1.0 / np.where(deviation > 0.0, deviation, 1.0), 0.0)
    scaled = (flat * weight[:, None]).reshape(len(flat), -1)
    _, values, right = np.linalg.svd(scaled, full_matrices=False)
    q = min(DIRECTIONS, int(np.count_nonzero(values > 1e-6 * values[0])))
    return np.asarray((right[:q] / values[:q, None]).T * np.repeat(weight, 2)[:, None])
