"""An estimator's error on the arm by amplitude: systematic error, noise and nonlinear distortion."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import product
from typing import Any

import numpy as np

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.theory import Expectation, expectation
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray
from sysid.validation.mean_error import MeanError
from sysid.validation.systematic_error import FEWEST_REALISATIONS, scatter_of, systematic_of

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

WHY = (
    "root mean square over the lines, in percent of the linear part: mean over random-phase multisines of the "
    "difference from the nonparametric best linear approximation of the same records; 5 % are allowed at 5 mrad, "
    "where friction dominates, 2 % from 40 mrad on. Noise and nonlinear distortion are shown beside it, not judged; "
    "expected is what the response without a model has"
)


def multisine_class(joint: str, mrad: int) -> str:
    """Name of the class of excitation of a joint at an amplitude."""
    return f"twin-nominal-{joint}-multisine-{mrad}mrad"


class AmplitudeSplit(MetricDefinition):
    """The identified response of the arm's joints, over waveforms and repeats, against amplitude.

    The truth is the best linear approximation, which the records' own nonparametric responses estimate without bias;
    taking differences record by record leaves out the noise and distortion that both share, and the uncertainty of
    the truth is in the scatter of the differences.
    """

    name = "amplitude_split"
    title = "Error on the arm by amplitude: systematic, noise, distortion"
    unit = "%"
    verdicts = len(JOINTS) * len(AMPLITUDES["full"])

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Multisines of each joint and amplitude: waveforms, some of them repeated."""
        trials = []
        for joint, mrad in product(JOINTS, AMPLITUDES[effort]):
            for waveform in range(WAVEFORMS[effort]):
                records = 2 if waveform < REPEATED[effort] else 1
                name = f"{multisine_class(joint, mrad)}-w{waveform}"
                trials += [Trial(name, draw) for draw in range(records)]
        return tuple(trials)

    def evaluate(self, evidence: Evidence) -> Metric:
        """A part for each joint, amplitude and kind of error; a verdict on the systematic one."""
        # No structure holds the arm with its friction: the method alone decides what theory expects.
        theory = expectation(evidence.estimator, "twin", self.name)
        classes: dict[str, list[Measurement]] = {}
        for m in evidence.measurements:
            classes.setdefault(m.trial.problem.rpartition("-w")[0], []).append(m)
        metric_parts: list[Part] = []
        curves: dict[str, dict[str, list[Any]]] = {}
        for joint, (mrad, allowed) in product(JOINTS, ALLOWED.items()):
            measurements = classes.get(multisine_class(joint, mrad))
            if not measurements:
                continue
            label = f"{joint} {mrad} mrad"
            parts_of_class, row = _split(label, measurements, allowed, evidence.false_alarm, theory)
            metric_parts += parts_of_class
            if row:
                for key, value in {"mrad": mrad, **row}.items():
                    curves.setdefault(joint, {}).setdefault(key, []).append(value)
        # a part whose limit is too wide to pass may still fail
        limited = sum(bool(np.isfinite(part.limits[1])) for part in metric_parts)
        return self.of_parts(metric_parts, limited * evidence.false_alarm, WHY, curves)


def _split(
    label: str, measurements: Sequence[Measurement], allowed: float, false_alarm: float, theory: Expectation
) -> tuple[list[Part], dict[str, Any]]:
    """Parts of one joint and amplitude, and the numbers of its row for drawing."""
    # The name of a problem has the number of its waveform.
    run = len({m.trial.problem for m in measurements})
    identified, nonparametric = _by_waveform(measurements)
    count = len(identified)
    if count < max(FEWEST_REALISATIONS, (run + 1) // 2):
        return [unjudged(label, f"no verdict: {count} of {run} waveforms have a response", count)], {}
    # One record of each waveform: the repeats of some would give these a larger weight.
    first = np.array([repeats[0] for repeats in nonparametric])
    errors = np.array([repeats[0] for repeats in identified]) - first
    # Of the linear part: the mean over waveforms, whose scatter is distortion and noise.
    power = float(np.sum(np.abs(first.mean(axis=0)) ** 2))
    error = systematic_of(errors, power, allowed=allowed, false_alarm=false_alarm)
    systematic = _systematic_part(label, error, allowed, theory, count)
    scatter, expected = scatter_of(identified, power), scatter_of(nonparametric, power)
    row = {
        "systematic": error.size,
        "systematic_interval": list(error.interval),
        "systematic_limit": error.limit,
        **asdict(scatter),
        "expected_noise": expected.noise,
        "expected_distortion": expected.distortion,
    }
    records = sum(map(len, identified))
    noise = (records, scatter.noise, expected.noise, scatter.noise_interval)
    distortion = (records, scatter.distortion, expected.distortion, scatter.distortion_interval)
    return [
        systematic,
        unjudged(f"{label}, noise", "not judged", *noise),
        unjudged(f"{label}, distortion", "not judged", *distortion),
    ], row


def _by_waveform(measurements: Sequence[Measurement]) -> tuple[list[ComplexArray], list[ComplexArray]]:
    """Identified and nonparametric responses (repeats, nf) of each waveform that has any."""
    groups: dict[str, list[tuple[ComplexArray, ComplexArray]]] = {}
    for m in sorted(measurements, key=lambda m: m.trial):
        if m.response is not None and m.nonparametric is not None and np.isfinite(m.response).all():
            responses = (m.response[:, 0, 0], m.nonparametric[:, 0, 0])
            groups.setdefault(m.trial.problem, []).append(responses)
    pairs = [np.array(group).swapaxes(0, 1) for group in groups.values()]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def _systematic_part(label: str, error: MeanError, allowed: float, theory: Expectation, count: int) -> Part:
    """The part of the systematic error; no verdict where its own scatter makes the limit too wide."""
    why = theory.why or f"at most {error.limit:.3g} %: {allowed:g} % allowed, and the chance of its own scatter"
    expected = Expectation(theory.passes, why)
    limits = (-np.inf, error.limit)
    systematic = Part.judged(f"{label}, systematic", error.size, 0.0, error.interval, limits, expected, count)
    if not systematic.passed or error.limit <= BLIND * allowed:
        return systematic
    why = (
        f"no verdict: the estimates scatter too much: the limit would be {error.limit:.3g} %, and one above "
        f"{BLIND * allowed:g} % would let faults pass"
    )
    return replace(systematic, passed=None, why=why)
