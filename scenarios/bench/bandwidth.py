"""Bandwidth: the value recovered for each joint of the arm, beside the truth and the 1 Hz of the thesis."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from scenarios.bench.amplitude_split import JOINTS, AmplitudeSplit
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import NAN, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.estimators.outcome import MODEL
from scenarios.files.codec import Extended, plain_numbers, structure
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz
from scenarios.problems.trial import Trial
from sysid.validation.monte_carlo import exact_interval_of_share

SEQUENCES = {"quick": 2, "full": 20}
"""Records of binary sequences of each joint, each with its own sequence."""

SEQUENCE_MRAD = 67
"""Amplitude of the thesis' test 5, mrad: 1 V."""

WIDEST = 100.0
"""Ratio of an interval's ends beyond which it is uninformative; as in `sysid.models.bandwidth_claim`."""

CLOSE = 1.1
"""A median within this factor of its truth is called close."""

WHY = (
    "half-power bandwidth: the median over records, its expected value the best linear truth, the interval the range "
    "of 95 % of the records; not judged. It answers whether this estimator finds what the thesis found, about 1 Hz in "
    "each joint [Morris1996, sec. VI.6], and whether that is true: near 1 Hz and right are two questions. Friction and "
    "the velocity limit lower the best linear truth below that of small signals"
)


@dataclass(frozen=True)
class BandwidthClass:
    """Bandwidths recovered from the records of one excitation of a joint, beside the true ones, all in Hz.

    Attributes:
        label: Joint, excitation and amplitude.
        variant: Of the twin.
        joint: Of the arm.
        excitation: Kind of the excitation.
        mrad: Its amplitude.
        hz: Claimed bandwidths.
        models: Number of records with a model.
        near: Number of records whose bandwidth is about 1 Hz.
        small_signal: Of the linearised arm, without dry friction.
        best_linear: Of the best linear approximation; NaN where it has none.
        best_linear_ci95: Its 95 % interval.
        published: Of the models that the thesis prints, by name.
    """

    label: str
    variant: str
    joint: str
    excitation: str
    mrad: float
    hz: tuple[Extended, ...]
    models: int
    near: int
    small_signal: Extended
    best_linear: Extended
    best_linear_ci95: tuple[Extended, Extended]
    published: Mapping[str, Extended]

    @property
    def median(self) -> float:
        """Median of the claimed bandwidths; NaN without any."""
        return float(np.median(self.hz)) if self.hz else NAN

    @property
    def range(self) -> tuple[float, float]:
        """Range of 95 % of the claimed bandwidths; of fewer than forty it is the whole range."""
        if not self.hz:
            return (NAN, NAN)
        # Order statistics: nothing is interpolated between so few records.
        low, high = np.quantile(self.hz, [0.025, 0.975], method="inverted_cdf")
        return float(low), float(high)

    def record(self) -> dict[str, Any]:
        """Return what `hmtb verify --json` prints of it."""
        keys = ("joint", "excitation", "mrad", "median", "range", "small_signal", "best_linear", "near", "models")
        return {key: getattr(self, key) for key in keys}


def bandwidth_classes(metrics: Mapping[str, Metric]) -> tuple[BandwidthClass, ...]:
    """Recovered bandwidths by joint, excitation and amplitude; none where the run has no bandwidths or no models.

    Raises:
        ScenarioError: The curves, which come from a file, are damaged.
    """
    metric = metrics.get("bandwidth")
    classes = () if metric is None else metric.curves.get("classes", ())
    # Of a run in this process they hold numbers of NumPy.
    read = structure(tuple[BandwidthClass, ...], plain_numbers(classes), "classes")
    return tuple(sorted(read, key=lambda known: (known.joint, known.excitation, known.mrad)))


def one_hertz_answer(recovered: Sequence[BandwidthClass]) -> str:
    """The answer on the thesis' 1 Hz: whether the estimator recovers it, and whether what it recovers is true."""
    low, high = ABOUT_1_HZ
    near, models = sum(row.near for row in recovered), sum(row.models for row in recovered)
    medians = sum(near_1_hz(row.median) for row in recovered)
    true = sum(near_1_hz(row.best_linear) for row in recovered)
    close = sum(1.0 / CLOSE <= row.median / row.best_linear <= CLOSE for row in recovered)
    return (
        f"The bandwidth is about 1 Hz ({low:g} to {high:g} Hz) in {near} of {models} records and in the median of "
        f"{medians} of {len(recovered)} rows; the best linear truth is about 1 Hz in {true} rows, and the median lies "
        f"within {100 * (CLOSE - 1):.0f} % of that truth in {close}."
    )


@lru_cache(maxsize=64)
def true_bandwidths(excitation_class: str) -> tuple[float, dict[str, Any]]:
    """Lowest frequency that a class of excitation contains, and the true bandwidths of the joint, all in Hz.

    Returns:
        The frequency, and a table: `small_signal` of the linearised arm, without dry friction; `best_linear` of the
        best linear approximation, NaN where it has none, with its 95 % interval; `published`, those of the models that
        the thesis prints, by name.
    """
    # Imported late: it loads the physics.
    from scenarios.problems.twin_name import twin_name
    from scenarios.problems.twin_problem import TwinProblem
    from scenarios.truth.published import published

    problem = TwinProblem(twin_name(excitation_class))
    best = problem.best_linear
    return float(problem.frequencies[0]), {
        "small_signal": problem.joint_truth.bandwidth_hz,
        "best_linear": best.bandwidth_hz,
        "best_linear_ci95": list(best.bandwidth_ci95),
        "published": {model.label: model.bandwidth_hz for model in published(problem.parsed.joint)},
    }


def sequence_class(joint: str) -> str:
    """Name of the problem of binary sequences of a joint."""
    return f"twin-nominal-{joint}-prbs-{SEQUENCE_MRAD}mrad"


class BandwidthMetric(MetricDefinition):
    """The distribution of the recovered bandwidth, by joint, amplitude and excitation.

    Joints differ, so a number over all of them would be that of none. The metric's own is that of the joint that is
    furthest from its best linear truth under the thesis' binary sequences, its largest amplitude; the parts have all.

    A bandwidth is claimed where the model has one, not below the lowest frequency that is excited, and not with an
    interval that spans more than a factor of a hundred. Models without one count all the same, as not near 1 Hz.
    """

    name = "bandwidth"
    title = "Recovered bandwidth"
    unit = "Hz"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The multisines of `AmplitudeSplit`, and binary sequences like the thesis' test 5."""
        draws = range(SEQUENCES[effort])
        sequences = [Trial(sequence_class(joint), draw) for joint, draw in product(JOINTS, draws)]
        return (*AmplitudeSplit().trials(effort), *sequences)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Median, 95 % range and share near 1 Hz of each class; all values in the curves."""
        groups: dict[str, list[Measurement]] = {}
        for m in evidence.measurements:
            if m.kind == MODEL:
                groups.setdefault(_excitation_class(m.trial.problem), []).append(m)
        rows = [_row(name, group) for name, group in groups.items()]
        metric_parts = [_part(row) for row in rows] or [unjudged("all joints", "no record has a model")]
        shown = _furthest_from_truth(rows, metric_parts)
        of_shown = f"The number is that of {shown.label}: {shown.why}. " if rows else ""
        near = sum(row.near for row in rows)
        models = sum(row.models for row in rows)
        why = f"{WHY}. {of_shown}All joints together: {_share_near_1_hz(near, models)}"
        classes = [asdict(row) for row in rows]
        curves = {"about_1_hz": list(ABOUT_1_HZ), "classes": classes, "near": near, "models": models}
        return replace(self.of_parts(metric_parts, 0.0, why, curves, shown=shown), why=why)


def _excitation_class(problem: str) -> str:
    """Name of a problem of the arm without the number of its waveform and the length of its records."""
    return "-".join(problem.partition("@")[0].split("-")[:5])


def _furthest_from_truth(rows: Sequence[BandwidthClass], metric_parts: Sequence[Part]) -> Part:
    """The part of the largest amplitude whose median is furthest, as a ratio, from its best linear truth."""
    largest = max((row.mrad for row in rows if row.hz), default=NAN)
    candidates = []
    # Without rows there is one part all the same, which says so.
    for row, part_of_row in zip(rows, metric_parts, strict=False):
        if row.hz and row.mrad == largest:
            # NaN where there is no best linear truth: no distance
            distance = np.nan_to_num(abs(np.log(part_of_row.value / part_of_row.expected)))
            candidates.append((distance, part_of_row))
    if not candidates:
        return metric_parts[0]
    return max(candidates, key=lambda candidate: candidate[0])[1]


def _row(name: str, group: Measurements) -> BandwidthClass:
    """Bandwidths claimed for one class of excitation, beside the true ones."""
    lowest, truths = true_bandwidths(name)
    # twin-VARIANT-JOINT-EXCITATION-AMPLITUDEmrad
    _, variant, joint, excitation, amplitude = name.split("-")
    bandwidths = [_claimed(m, lowest) for m in group]
    claimed = tuple(hz for hz in bandwidths if np.isfinite(hz))
    mrad = float(amplitude.removesuffix("mrad"))
    return BandwidthClass(
        label=f"{joint} {excitation} {mrad:g} mrad",
        variant=variant,
        joint=joint,
        excitation=excitation,
        mrad=mrad,
        hz=claimed,
        models=len(group),
        near=sum(map(near_1_hz, claimed)),
        **truths,
    )


def _claimed(m: Measurement, lowest: float) -> float:
    """The claimed bandwidth, Hz; NaN where there is none, or where the record or its interval cannot support it."""
    hz = NAN if m.bandwidth_hz is None else float(m.bandwidth_hz[0, 0])
    # Below the lowest line of the excitation a record says nothing; NaN fails the comparison too.
    if not hz >= lowest:
        return NAN
    if m.bandwidth_ci95 is not None:
        low, high = (float(end) for end in m.bandwidth_ci95[:, 0, 0])
        if np.isfinite(low) and not high <= WIDEST * low:
            return NAN
    return hz


def _part(row: BandwidthClass) -> Part:
    """The part of one class: median and 95 % range of its bandwidths."""
    why = f"{_share_near_1_hz(row.near, row.models)}; small signals {row.small_signal:.3g} Hz"
    return unjudged(row.label, why, row.models, row.median, row.best_linear, row.range)


def _share_near_1_hz(near: int, models: int) -> str:
    """The share of bandwidths near 1 Hz in words, with its exact binomial interval, as if records were independent."""
    if models == 0:
        return "no record has a model"
    lowest, highest = exact_interval_of_share(near, models, 100.0)
    low, high = ABOUT_1_HZ
    return f"{near} of {models} near 1 Hz ({low:g} to {high:g} Hz), a share of {lowest:.0f} to {highest:.0f} %"
