"""Split over amplitude: an estimator's error on the arm as systematic error, noise and nonlinear distortion."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from scenarios.bench.measurement import Measurements
from scenarios.bench.metric import DRAWS, NAN, NO_RECORD, UNLIMITED, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.theory import Expectation
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
"""The joints that the thesis identified."""

AMPLITUDES = {"quick": (5, 10, 40), "full": (5, 10, 20, 40, 80)}
"""Root mean square of the commanded angle, mrad: from where friction dominates to where the velocity limit does."""

WAVEFORMS = {"quick": 8, "full": 80}
REPEATED = {"quick": 3, "full": 30}
"""So many waveforms have two records, which differ by noise alone."""

ALLOWED = {5: 5.0, 10: 5.0, 20: 3.0, 40: 2.0, 80: 2.0}
"""Systematic error that is no fault, percent of the linear part, by amplitude in mrad.

Where friction dominates, no model of low order is the best linear approximation, and the best are a few percent off.
"""

BLIND = 4.0
"""A limit beyond this multiple of the allowed error gives no pass: the scatter would hide what should fail."""

FEWEST = 4
"""Waveforms that a split needs."""

WHY = (
    "root mean square over the lines, in percent of the linear part: mean over random-phase multisines of the "
    "difference from the nonparametric best linear approximation of the same records; 5 % are allowed at 5 mrad, "
    "where friction dominates, 2 % from 40 mrad on. Noise and nonlinear distortion are shown beside it, not judged; "
    "expected is what the response without a model has"
)

NOT_CONSISTENT = {
    "least_squares": "least squares are biased unless the disturbance is white equation error; that of the arm is "
    "resolver noise and residual friction [Ljung1999, sec. 7.3]",
    "observer": "an observer with few Markov parameters is biased at low order [Juang1993]",
}
"""Methods for which theory expects a systematic error on the arm."""


def multisine_class(joint: str, mrad: int) -> str:
    """Name of the class of excitation of a joint at an amplitude."""
    return f"twin-nominal-{joint}-multisine-{mrad}mrad"


def multisine_trials(effort: str) -> tuple[Trial, ...]:
    """Multisines of all joints, amplitudes and waveforms, with repeats of some.

    Raises:
        ScenarioError: There is no such effort.
    """
    if effort not in DRAWS:
        raise ScenarioError(f"effort {effort!r} given, expected one of {', '.join(DRAWS)}")
    return tuple(
        Trial(f"{multisine_class(joint, mrad)}-w{waveform}", draw)
        for joint in JOINTS
        for mrad in AMPLITUDES[effort]
        for waveform in range(WAVEFORMS[effort])
        for draw in range(2 if waveform < REPEATED[effort] else 1)
    )


@dataclass(frozen=True)
class Scatter:
    """Scatter of a response over records, root mean squares over its lines in percent of the linear part.

    Attributes:
        noise: Between records of one waveform; NaN where none was repeated.
        noise_interval: Its 95 % interval, as wide as if all lines went together.
        distortion: Between waveforms, beyond the noise.
        distortion_interval: Its 95 % interval.
    """

    noise: float
    noise_interval: tuple[float, float]
    distortion: float
    distortion_interval: tuple[float, float]


@dataclass(frozen=True)
class SystematicError:
    """The error that is the same in all waveforms, in percent of the linear part.

    Attributes:
        percent: Root mean square over the lines, free of the part that scatter has in a mean; 0 where that is larger.
        interval: Its 95 % interval.
        limit: Value that `percent` exceeds with at most the given probability where the true error is as allowed.
        waveforms: Number of waveforms.
    """

    percent: float
    interval: tuple[float, float]
    limit: float
    waveforms: int


def scatter_of(groups: Sequence[ComplexArray], power: float) -> Scatter:
    """Divide the scatter of responses into noise and distortion [Pintelon2012, sec. 4.3].

    Of waveform w and repeat k the response is G + d_w + n_wk: repeats scatter by n alone, first records by both.

    Args:
        groups: Responses by waveform (k, nf), at least `FEWEST` of them.
        power: Of the linear part, summed over the lines.
    """
    first = np.array([group[0] for group in groups])
    total, jackknife = _variance(first), np.array([_variance(np.delete(first, w, 0)) for w in range(len(first))])
    freedom = sum(len(group) - 1 for group in groups)
    noise = NAN
    ends = (NAN, NAN)
    if freedom:
        noise = float(sum(np.sum(np.abs(group - group.mean(axis=0)) ** 2) for group in groups)) / freedom
        ends = (noise * freedom / chi2.ppf(0.975, freedom), noise * freedom / chi2.ppf(0.025, freedom))
    less = noise if freedom else 0.0
    distortion = _jackknife_interval(total - less, jackknife - less)
    return Scatter(
        _percent(noise, power),
        (_percent(ends[0], power), _percent(ends[1], power)),
        _percent(total - less, power),
        (_percent(distortion[0], power), _percent(distortion[1], power)),
    )


def systematic_of(errors: ComplexArray, power: float, *, allowed: float, false_alarm: float) -> SystematicError:
    """The mean of errors, judged by their own scatter.

    W |mean|^2 / s^2, both summed over the lines, is a ratio of two sums of squares in which the noise level cancels. Of
    Gaussian errors that spread alike in q directions it has an F distribution with q and q (W - 1) degrees of freedom;
    of others it is taken as if [Satterthwaite1946]. q is the sample's trace over largest eigenvalue, between 1 and
    W - 1: too few directions rather than too many, which widens the limit. Simulated at 5e-4, directions of equal
    spread, one to a hundred, give false alarms no more often than stated; mixtures in which one stands out of many
    others, whose share the largest eigenvalue does not show, 1.3 to 2.7 times as often. Where an error of size a is
    allowed, |mean| can be larger by a.

    Args:
        errors: Identified less nonparametric response of one record of each waveform (W, nf), W of at least `FEWEST`.
        power: Of the linear part, summed over the lines.
        allowed: Error that is no fault, percent of the linear part.
        false_alarm: Probability of a larger `percent` than `limit`.
    """
    count = len(errors)
    mean, variance = errors.mean(axis=0), _variance(errors)
    squared = float(np.sum(np.abs(mean) ** 2))
    ends = _jackknife_interval(
        squared - variance / count,
        np.array([_square_of_mean(np.delete(errors, w, 0)) for w in range(count)]),
    )
    directions = _directions(errors - mean)
    critical = float(f_distribution.isf(false_alarm, directions, directions * (count - 1)))
    most = (allowed / 100.0 * np.sqrt(power) + np.sqrt(critical * variance / count)) ** 2
    return SystematicError(
        _percent(squared - variance / count, power),
        (_percent(ends[0], power), _percent(ends[1], power)),
        _percent(most - variance / count, power),
        count,
    )


def _variance(values: ComplexArray) -> float:
    """Between rows, summed over the lines."""
    return float(np.sum(np.abs(values - values.mean(axis=0)) ** 2)) / (len(values) - 1)


def _square_of_mean(values: ComplexArray) -> float:
    """Square of the true mean, summed over the lines, free of what scatter adds."""
    return float(np.sum(np.abs(values.mean(axis=0)) ** 2)) - _variance(values) / len(values)


def _directions(deviations: ComplexArray) -> float:
    """Number of directions with the same sum of variances if each had the largest variance; 1 at least."""
    products = (deviations @ deviations.conj().T).real
    largest = float(np.linalg.eigvalsh(products)[-1])
    return max(1.0, float(np.trace(products)) / largest) if largest > 0.0 else 1.0


def _jackknife_interval(whole: float, without: FloatArray) -> tuple[float, float]:
    """95 % interval by Student's distribution of the jackknife's pseudo-values."""
    count = len(without)
    pseudo = count * whole - (count - 1) * without
    half = float(student.ppf(0.975, count - 1)) * float(np.std(pseudo, ddof=1)) / np.sqrt(count)
    return (whole - half, whole + half)


def _percent(squared: float, power: float) -> float:
    return 100.0 * float(np.sqrt(max(squared, 0.0) / power)) if np.isfinite(squared) else NAN


class AmplitudeSplit(MetricDefinition):
    """The identified response of the arm's joints, over waveforms and repeats, against amplitude.

    The truth is the best linear approximation, which the records' own nonparametric responses estimate without bias;
    taking differences record by record leaves out the noise and distortion that both share, and the uncertainty of
    the truth is in the scatter of the differences.
    """

    name = "amplitude_split"
    title = "Split over amplitude"
    unit = "%"
    verdicts = len(JOINTS) * len(AMPLITUDES["full"])

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Multisines of each joint and amplitude: waveforms, some of them repeated."""
        return multisine_trials(effort)

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """A part for each joint, amplitude and kind of error; a verdict on the systematic one."""
        why = NOT_CONSISTENT.get(estimator.method or "")
        theory = Expectation(why is None, why or "")
        parts: list[Part] = []
        rows: dict[str, list[dict[str, Any]]] = {}
        for joint in JOINTS:
            for mrad in ALLOWED:
                own = [m for m in measurements if m.trial.problem.startswith(f"{multisine_class(joint, mrad)}-w")]
                if not own:
                    continue
                some, row = _split(f"{joint} {mrad} mrad", own, ALLOWED[mrad], false_alarm, theory)
                parts += some
                if row is not None:
                    rows.setdefault(joint, []).append({"mrad": mrad, **row})
        parts = parts or [unjudged("all joints", NO_RECORD)]
        # a part whose limit is too wide to pass may still fail
        limited = sum(bool(np.isfinite(part.limits[1])) for part in parts)
        curves = {
            joint: {key: [row[key] for row in of_joint] for key in of_joint[0]} for joint, of_joint in rows.items()
        }
        return self.of_parts(parts, limited * false_alarm, WHY, curves)


def _split(
    label: str, measurements: Measurements, allowed: float, false_alarm: float, theory: Expectation
) -> tuple[list[Part], Mapping[str, Any] | None]:
    """Parts of one joint and amplitude, and the numbers of its row for drawing."""
    identified, nonparametric, run = _by_waveform(measurements)
    count = len(identified)
    if count < max(FEWEST, (run + 1) // 2):
        return [unjudged(label, f"no verdict: {count} of {run} waveforms have a response", count)], None
    first = np.array([group[0] for group in nonparametric])
    errors = np.array([group[0] for group in identified]) - first
    power = float(np.sum(np.abs(first.mean(axis=0)) ** 2))
    systematic = systematic_of(errors, power, allowed=allowed, false_alarm=false_alarm)
    estimated, without = scatter_of(identified, power), scatter_of(nonparametric, power)
    scatter_parts = [
        Part(
            f"{label}, {kind}",
            getattr(estimated, kind),
            getattr(without, kind),
            getattr(estimated, f"{kind}_interval"),
            UNLIMITED,
            None,
            why="not judged",
            draws=sum(map(len, identified)),
        )
        for kind in ("noise", "distortion")
    ]
    passed: bool | None = systematic.percent <= systematic.limit
    why = theory.why or f"at most {systematic.limit:.3g} %: {allowed:g} % allowed, and the chance of its own scatter"
    if passed and systematic.limit > BLIND * allowed:
        passed = None
        why = (
            f"no verdict: its scatter is too large: at most {systematic.limit:.3g} % would pass, "
            f"and more than {BLIND * allowed:g} % must not"
        )
    judged = Part(
        f"{label}, systematic",
        systematic.percent,
        0.0,
        systematic.interval,
        (-np.inf, systematic.limit),
        passed,
        theory.passes,
        why,
        systematic.waveforms,
    )
    return [judged, *scatter_parts], {
        "systematic": systematic.percent,
        "systematic_interval": list(systematic.interval),
        "systematic_limit": systematic.limit,
        **asdict(estimated),
        "expected_noise": without.noise,
        "expected_distortion": without.distortion,
    }


def _by_waveform(measurements: Measurements) -> tuple[list[ComplexArray], list[ComplexArray], int]:
    """Identified and nonparametric responses (k, nf) by waveform, in the order of draws, and the waveforms run."""
    groups: dict[str, list[tuple[ComplexArray, ComplexArray]]] = {}
    for m in sorted(measurements, key=lambda m: m.trial):
        group = groups.setdefault(m.trial.problem, [])
        if m.response is not None and m.nonparametric is not None and np.isfinite(m.response).all():
            group.append((m.response[:, 0, 0], m.nonparametric[:, 0, 0]))
    pairs = [np.array(group).swapaxes(0, 1) for group in groups.values() if group]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs], len(groups)
