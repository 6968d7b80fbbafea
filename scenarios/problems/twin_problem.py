"""The arm as a family of problems: joints, excitations and amplitudes, with noise, friction and limits."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hmtb_twin import JointTruth, load_arm
from scenarios.datasets.arm_truth import arm_truth
from scenarios.estimators.task import Task
from scenarios.problems.problem import Problem, common_frequencies
from scenarios.problems.twin_best_linear import BestLinear, scattered_model, twin_best_linear
from scenarios.problems.twin_name import TwinName
from scenarios.problems.twin_records import draw_record
from sysid import IOData, StateSpace
from sysid.polynomial.structures import STRUCTURES
from sysid.records.arrays import ComplexArray, FloatArray

ORDER = 4
"""Order of a `fit` task.

The commanded joint's true small-signal model has eight states or more. Four follow the best linear truth up to 5 Hz to
within 1 % on every joint; three leave 3 % on the shoulder pitch and 5 % on the elbow pitch, whose poles of position and
oil are complex.
"""

NOISE_ORDER = 2
"""Order of the model of the noise where a structure has one of its own: what friction leaves is slow and coloured."""

MOST_ORDER = 10


@dataclass(frozen=True)
class TwinProblem(Problem):
    """One joint of the arm under one excitation: commanded to measured angle about the operating point, 50 Hz.

    A draw has new noise, and another waveform unless the name states one (`-w3`). Draws of one waveform scatter by
    noise alone, those of different waveforms by noise and nonlinear distortion. Records begin at rest, with an
    initialisation window, and then have whole periods.

    Two truths: `truth` is that of small signals, exact and without friction; `best_linear` is the linear system nearest
    to the arm under this excitation at this amplitude, measured, which estimates tend to. There is no bound: no linear
    model is the truth of an arm with friction.

    Attributes:
        parsed: The name, read.
    """

    parsed: TwinName

    @cached_property
    def name(self) -> str:
        """Name in the registry."""
        return str(self.parsed)

    @property
    def joint_truth(self) -> JointTruth:
        """Small-signal truth of the joint: model, bandwidth, poles, delay."""
        return _joint_truth(self.parsed.variant, self.parsed.joint)

    @cached_property
    def truth(self) -> StateSpace:
        """The small-signal truth, with its noise."""
        return self.joint_truth.model

    @property
    def best_linear(self) -> BestLinear:
        """The best linear truth of the excitation class."""
        return twin_best_linear(self.parsed)

    @cached_property
    def frequencies(self) -> FloatArray:
        """Lines of the excitation up to 5 Hz (nf,), Hz."""
        return self.parsed.frequencies

    def draw(self, seed: int) -> IOData:
        """One record; `twin_records.prepare` simulates many at once."""
        return draw_record(self.parsed, seed)

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """See `Problem.task`.

        None becomes `armax`: friction and drive torques enter the joint where the command does, so that input and
        disturbance share their poles; the residuals of `armax` are white where those of `oe` are far from it.
        """
        structure = structure or "armax"
        # A state-space model holds the delay beyond one sample in states of its own.
        delay = self.joint_truth.delay_samples
        order = {"fit": ORDER, "underfit": ORDER - 1, "select": 0}[ask]
        values = {"na": order, "nb": order, "nf": order, "nk": delay, "order": order + delay - 1}
        # In ARMAX the disturbance shares the poles of the dynamics, so C has their order.
        values |= {"nc": order if structure == "armax" else NOISE_ORDER, "nd": NOISE_ORDER}
        orders = {}
        if order:
            orders = {name: values[name] for name in STRUCTURES[structure]}
        return Task(structure, orders, MOST_ORDER, common_frequencies(self.truth.dt))

    def nonparametric(self, record: IOData) -> ComplexArray:
        """Response that a record shows without any model: output over input, line by line (nf, 1, 1).

        Over whole periods of a periodic record this is free of leakage; its mean over waveforms is the best linear
        approximation [Pintelon2012, sec. 4.3].
        """
        scored = record.scored
        # Of P periods every P-th line of the spectrum is one of the excitation.
        lines = np.arange(1, len(self.frequencies) + 1) * (len(scored) // self.parsed.period)
        u = np.fft.rfft(scored.u, axis=0)[lines, 0]
        y = np.fft.rfft(scored.y, axis=0)[lines, 0]
        return (y / u)[:, None, None]

    def scattered(self, seed: int) -> StateSpace:
        """The best linear truth with the scatter of a measured response: as good as any estimate."""
        return scattered_model(self.parsed, self.truth, self.best_linear, seed)


@lru_cache(maxsize=32)
def _joint_truth(variant: str, joint: str) -> JointTruth:
    arm = load_arm(variant)
    return arm_truth(arm, arm.description.operating_pose).joint(joint)
