"""Bandwidth: what an estimator recovers for each joint of the arm, beside what is true and the 1 Hz of the thesis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from scenarios.bench.interval_of_mean import exact_interval_of_share
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, Part
from scenarios.bench.twin_trials import multisine_trials, sequence_trials
from scenarios.bench.worst_part import unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import MODEL
from scenarios.identification.one_hertz import ABOUT_1_HZ, near_1_hz
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

NAN = float("nan")

WIDEST = 100.0
"""An interval whose ends differ by more than this factor says nothing; as `sysid.models.bandwidth_claim` has it."""

WHY = (
    "half-power bandwidth: the median over records, its expected value the best linear truth, the interval what holds "
    "95 % of the records; told, not judged. It answers whether the thesis' finding, about 1 Hz in each joint "
    "[Morris1996, sec. VI.6], is what this estimator finds, and whether that is true: near 1 Hz and right are two "
    "questions. Friction and the velocity limit lower the best linear truth below that of small signals"
)


@dataclass(frozen=True)
class TrueBandwidths:
    """What is true of a class of excitation.

    Attributes:
        small_signal: Of the linearised arm, without dry friction, Hz.
        best_linear: Of the best linear approximation, Hz; NaN where none shows.
        best_linear_ci95: Its 95 % interval, Hz.
        lowest: Lowest frequency that is excited, Hz.
        published: Of the models that the thesis prints, Hz, by name.
    """

    small_signal: float
    best_linear: float
    best_linear_ci95: tuple[float, float]
    lowest: float
    published: tuple[tuple[str, float], ...] = ()


@lru_cache(maxsize=64)
def true_bandwidths(excitation_class: str) -> TrueBandwidths:
    """Look them up.

    Args:
        excitation_class: Name of a problem of the twin.
    """
    # it loads the physics
    from scenarios.problems.twin_problem import twin_problem
    from scenarios.truth.published import published

    problem = twin_problem(excitation_class)
    best = problem.best_linear
    return TrueBandwidths(
        problem.joint_truth.bandwidth_hz,
        best.bandwidth_hz,
        best.bandwidth_ci95,
        float(problem.frequencies[0]),
        tuple((one.label, one.bandwidth_hz) for one in published(problem.parsed.joint)),
    )


@dataclass(frozen=True)
class Bandwidth:
    """The headline: the distribution of the recovered bandwidth, by joint, amplitude and excitation.

    Joints differ, and a number over all of them would be that of none. The figure's own is that of the joint that is
    furthest from its best linear truth under the thesis' binary sequences, its largest amplitude; the parts have all.

    A bandwidth is claimed where the model has one, not below the lowest frequency that is excited, and not with an
    interval that spans more than a factor of a hundred. Models without one count all the same, as not near 1 Hz.

    Attributes:
        truths: What is true of a class of excitation.
    """

    truths: Callable[[str], TrueBandwidths] = true_bandwidths
    name: str = field(default="bandwidth", init=False)
    title: str = field(default="Recovered bandwidth", init=False)

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The multisines of the split over amplitude, and binary sequences like the thesis' test 5."""
        return (*multisine_trials(effort), *sequence_trials(effort))

    def verdicts(self) -> int:
        """None."""
        return 0

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Median, 95 % range and share near 1 Hz of each class; all values in the curves."""
        del contestant, false_alarm, referee
        groups: dict[str, list[Measured]] = {}
        for m in measured:
            if m.kind == MODEL:
                groups.setdefault(_class(m.trial.problem), []).append(m)
        rows = [self._row(name, found) for name, found in groups.items()]
        near = sum(row["near"] for row in rows)
        models = sum(row["models"] for row in rows)
        parts = tuple(map(_part, rows)) or (unjudged("all joints", "no record has a model"),)
        told = _furthest(rows, parts)
        return Figure(
            name=self.name,
            title=self.title,
            unit="Hz",
            value=told.value,
            expected=told.expected,
            interval=told.interval,
            passed=None,
            false_alarm=0.0,
            why=f"{WHY}. {_told_of(told, len(rows))}All joints together: {_share(near, models)}",
            parts=parts,
            curves={"about_1_hz": list(ABOUT_1_HZ), "classes": rows, "near": near, "models": models},
        )

    def _row(self, name: str, found: Sequence[Measured]) -> dict[str, Any]:
        truth = self.truths(name)
        _, variant, joint, excitation, amplitude = name.split("-")
        claimed = [hz for m in found if np.isfinite(hz := _claimed(m, truth.lowest))]
        mrad = float(amplitude.removesuffix("mrad"))
        return {
            "label": f"{joint} {excitation} {mrad:g} mrad",
            "variant": variant,
            "joint": joint,
            "excitation": excitation,
            "mrad": mrad,
            "hz": claimed,
            "models": len(found),
            "near": sum(map(near_1_hz, claimed)),
            "small_signal": truth.small_signal,
            "best_linear": truth.best_linear,
            "best_linear_ci95": list(truth.best_linear_ci95),
            "published": dict(truth.published),
        }


def _class(problem: str) -> str:
    """Name of a problem without the number of its waveform and the length of its records."""
    return "-".join(problem.partition("@")[0].split("-")[:5])


def _claimed(m: Measured, lowest: float) -> float:
    if m.bandwidth_hz is None:
        return NAN
    hz = float(m.bandwidth_hz[0, 0])
    if not hz >= lowest:
        return NAN
    if m.bandwidth_ci95 is not None:
        low, high = (float(end) for end in m.bandwidth_ci95[:, 0, 0])
        if np.isfinite(low) and not high <= WIDEST * low:
            return NAN
    return hz


def _part(row: dict[str, Any]) -> Part:
    values = np.array(row["hz"])
    return Part(
        label=row["label"],
        value=_median(values),
        expected=row["best_linear"],
        interval=_range(values),
        limits=(-np.inf, np.inf),
        passed=None,
        why=f"{_share(row['near'], row['models'])}; small signals {row['small_signal']:.3g} Hz",
        draws=row["models"],
    )


def _told_of(part: Part, classes: int) -> str:
    return f"The number is that of {part.label}: {part.why}. " if classes else ""


def _furthest(rows: Sequence[dict[str, Any]], parts: Sequence[Part]) -> Part:
    """The part whose median is furthest from its truth, as a ratio, of those with the largest amplitude."""
    largest = max((row["mrad"] for row in rows if row["hz"]), default=NAN)
    found = [part for row, part in zip(rows, parts, strict=False) if row["hz"] and row["mrad"] == largest]
    # where no best linear truth shows there is nothing to be far from
    return max(found, key=lambda part: np.nan_to_num(abs(np.log(part.value / part.expected))), default=parts[0])


def _share(near: int, models: int) -> str:
    """In words, with the exact binomial interval, as if records were independent."""
    if models == 0:
        return "no record has a model"
    least, most = exact_interval_of_share(near, models)
    low, high = ABOUT_1_HZ
    return f"{near} of {models} near 1 Hz ({low:g} to {high:g} Hz), a share of {100 * least:.0f} to {100 * most:.0f} %"


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else NAN


def _range(values: FloatArray) -> tuple[float, float]:
    """What holds 95 % of the values; all of fewer than forty."""
    if not len(values):
        return (NAN, NAN)
    low, high = np.quantile(values, [0.025, 0.975], method="inverted_cdf") if len(values) >= 40 else _ends(values)
    return (float(low), float(high))


def _ends(values: FloatArray) -> tuple[float, float]:
    return (float(values.min()), float(values.max()))
