"""Split over amplitude: an estimator's error on the arm, parted into systematic error, noise and distortion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.bench.error_split import (
    FEWEST,
    Repeats,
    Scatter,
    Systematic,
    linear_power,
    scatter_of,
    systematic_of,
)
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, Part
from scenarios.bench.theory import Expectation
from scenarios.bench.twin_trials import AMPLITUDES, JOINTS, multisine_class, multisine_trials
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray

ALLOWED = {5: 5.0, 10: 5.0, 20: 3.0, 40: 2.0, 80: 2.0}
"""Systematic error that is no fault, percent of the linear part, by amplitude in mrad.

Where friction rules, no model of low order is the best linear approximation, and the best are a few percent from it.
"""

BLIND = 4.0
"""Times what is allowed: where the limit lies beyond, scatter hides what should fail, and to pass says nothing."""

WHY = (
    "root mean square over the lines, in percent of the linear part: mean over random-phase multisines of the "
    "difference from the nonparametric best linear approximation of the same records; 5 % are allowed at 5 mrad, "
    "where friction rules, 2 % from 40 mrad on. Noise and nonlinear distortion beside it are told, not judged; "
    "expected is what the response without a model has"
)

NOT_CONSISTENT = {
    "least_squares": "least squares are biased unless the disturbance is white equation error; that of the arm is "
    "resolver noise and what friction leaves [Ljung1999, sec. 7.3]",
    "observer": "an observer with few Markov parameters is biased at low order [Juang1993]",
}
"""Methods of which theory expects a systematic error on the arm."""


@dataclass(frozen=True)
class AmplitudeSplit:
    """The identified response of the arm's joints, over waveforms and repeats, against amplitude.

    The truth is the best linear approximation, which the records' own nonparametric responses estimate without bias;
    taking differences record by record leaves out the noise and distortion that both share, and what is uncertain of
    the truth is in the scatter of the differences.
    """

    name: str = "amplitude_split"
    title: str = "Split over amplitude"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Multisines of each joint and amplitude: waveforms, some of them repeated."""
        return multisine_trials(effort)

    def verdicts(self) -> int:
        """One for each joint and amplitude, of the full effort."""
        return len(JOINTS) * max(map(len, AMPLITUDES.values()))

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """A part for each joint, amplitude and kind of error; a verdict on the systematic one."""
        del referee
        why = NOT_CONSISTENT.get(contestant.method or "")
        theory = Expectation(why is None, why or "")
        parts: list[Part] = []
        rows: dict[str, list[dict[str, Any]]] = {}
        for joint in JOINTS:
            for mrad in sorted({mrad for some in AMPLITUDES.values() for mrad in some}):
                mine = [m for m in measured if m.trial.problem.startswith(f"{multisine_class(joint, mrad)}-w")]
                if not mine:
                    continue
                found, row = _parts(f"{joint} {mrad} mrad", mine, ALLOWED[mrad], false_alarm, theory)
                parts += found
                if row is not None:
                    rows.setdefault(joint, []).append({"mrad": mrad, **row})
        if not parts:
            parts = [unjudged("all joints", "no verdict: no record was run")]
        # one whose limit is too wide to pass may still fail
        limited = sum(bool(np.isfinite(part.limits[1])) for part in parts)
        return figure_of_parts(self.name, self.title, "%", parts, limited * false_alarm, WHY, _curves(rows))


def _parts(
    label: str, measured: Sequence[Measured], allowed: float, false_alarm: float, theory: Expectation
) -> tuple[list[Part], dict[str, Any] | None]:
    groups, run = _groups(measured)
    if len(groups) < max(FEWEST, (run + 1) // 2):
        return [unjudged(label, f"no verdict: {len(groups)} of {run} waveforms have a response", len(groups))], None
    errors = np.array([group.estimated[0] - group.measured[0] for group in groups])
    power = linear_power(np.array([group.measured[0] for group in groups]))
    systematic = systematic_of(errors, power, allowed=allowed, false_alarm=false_alarm)
    estimated = scatter_of([group.estimated for group in groups], power)
    without = scatter_of([group.measured for group in groups], power)
    row = _row(systematic, estimated, without)
    records = sum(len(group.estimated) for group in groups)
    told = [
        Part(
            f"{label}, {kind}",
            getattr(estimated, kind),
            getattr(without, kind),
            getattr(estimated, f"{kind}_interval"),
            (-np.inf, np.inf),
            None,
            why="told, not judged",
            draws=records,
        )
        for kind in ("noise", "distortion")
    ]
    passed: bool | None = systematic.percent <= systematic.limit
    why = theory.why or f"at most {systematic.limit:.3g} %: {allowed:g} % allowed, and the chance of its own scatter"
    if passed and systematic.limit > BLIND * allowed:
        passed = None
        why = (
            f"no verdict: its scatter is too large to tell: at most {systematic.limit:.3g} % would pass, "
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
    return [judged, *told], row


def _groups(measured: Sequence[Measured]) -> tuple[list[Repeats], int]:
    """Records with a response by waveform, in the sequence of their draws, and how many waveforms were run."""
    found: dict[str, list[tuple[ComplexArray, ComplexArray]]] = {}
    for m in sorted(measured, key=lambda m: m.trial):
        here = found.setdefault(m.trial.problem, [])
        if m.response is not None and m.nonparametric is not None and np.isfinite(m.response).all():
            here.append((m.response[:, 0, 0], m.nonparametric[:, 0, 0]))
    groups = [
        Repeats(np.array([one for one, _ in here]), np.array([other for _, other in here]))
        for here in found.values()
        if here
    ]
    return groups, len(found)


def _row(systematic: Systematic, estimated: Scatter, without: Scatter) -> dict[str, Any]:
    return {
        "systematic": systematic.percent,
        "systematic_interval": list(systematic.interval),
        "systematic_limit": systematic.limit,
        "noise": estimated.noise,
        "noise_interval": list(estimated.noise_interval),
        "expected_noise": without.noise,
        "distortion": estimated.distortion,
        "distortion_interval": list(estimated.distortion_interval),
        "expected_distortion": without.distortion,
    }


def _curves(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """By joint: `mrad` and each kind of error as lists over amplitude."""
    return {joint: {key: [row[key] for row in found] for key in found[0]} for joint, found in rows.items()}
