"""The true noise model against records of the twin, and against estimators on fresh data.

With twelve seeds it takes a few minutes.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import sysid
from hmtb_twin import IDEAL, JOINTS, Chain, Plant, linearize, load_arm, simulate
from sysid import Estimate, IOData
from tests.benchmarks.tables import heading, row
from tests.hmtb_twin.conftest import BinaryTest

MOVING = JOINTS[1:]
ELBOW = "elbow_pitch"

ESTIMATORS: dict[str, Callable[[IOData], Estimate]] = {
    "armax 2 2 2": lambda data: sysid.armax(data, 2, 2, 2, 2),
    "armax 4 4 4": lambda data: sysid.armax(data, 4, 4, 4, 2),
    "bj 2 2 2 2": lambda data: sysid.bj(data, 2, 2, 2, 2, 2),
    "n4sid 3": lambda data: sysid.n4sid(data, 3),
    "n4sid 8": lambda data: sysid.n4sid(data, 8),
    "pem_ss 4": lambda data: sysid.pem_ss(data, sysid.n4sid(data, 4).model),
}


@dataclass(frozen=True)
class Binary(BinaryTest):
    """Random binary commands of 3 mrad on each axis, small enough for the linear model."""

    chain: Chain = replace(IDEAL, friction=True, resolver=True)  # noqa: RUF009

    def volts(self):
        """Bits held over five ticks, of 0.05 V."""
        ticks = round(50 * self.duration)
        rng = np.random.default_rng([self.seed, 1])
        return 0.05 * np.repeat(rng.choice([-1.0, 1.0], (ticks // 5 + 1, len(self.axes))), 5, axis=0)[:ticks]


def records(logs, truth, joints):
    """Return deviations from the operating point, commands and measurements of some joints."""
    columns = [JOINTS.index(name) for name in joints]
    return [
        IOData((log.commanded - truth.angles)[:, columns], (log.measured - truth.angles)[:, columns], log.dt)
        for log in logs
    ]


def prediction_errors(model, data):
    """Return the one-step prediction errors behind the first second, experiments one after the other."""
    return np.vstack([sysid.residuals(model, record, x0=np.zeros(model.order))[50:] for record in data])


def floor(seeds):
    """Write whiteness and covariance of the innovations, of all joints together and of the elbow alone."""
    ratio = "mean square over the true one, yaw to wrist roll"
    heading("process noise", "friction", "rejected as not white at 5 %", ratio)
    for friction in ("viscous", "lugre"):
        for level in (0.002, 0.005, 0.01):
            plant = Plant(friction=friction, process_noise=level)
            truth = linearize(load_arm(plant=plant))
            model = truth.subset(MOVING, MOVING)
            logs = simulate([Binary(seed=seed, axes=MOVING, plant=plant, duration=30.0) for seed in range(seeds)])
            data = records(logs, truth, MOVING)
            rejected = np.mean([sysid.resid(model, record).whiteness_p < 0.05 for record in data])
            variance = np.mean(prediction_errors(model, data) ** 2, axis=0)
            ratios = variance / np.diag(np.asarray(model.innovation_covariance))
            row(f"{level:g}", friction, f"{100 * rejected:.1f} %", ", ".join(f"{r:.3f}" for r in ratios))
    print(f"\nOne standard error of a ratio: {np.sqrt(2 / (seeds * 1450)):.3f}.\n")


def contest(seeds, level=0.005):
    """Write how much worse than the true predictor each estimator predicts fresh records of the elbow."""
    plant = Plant(friction="viscous", process_noise=level)
    truth = linearize(load_arm(plant=plant))
    logs = simulate([Binary(seed=1000 + seed, axes=(ELBOW,), plant=plant, duration=60.0) for seed in range(2 * seeds)])
    data = records(logs, truth, (ELBOW,))
    model = truth.channel(ELBOW, ELBOW)
    excess_heading = "mean square above the true predictor's, %"
    heading("estimator", excess_heading, "standard error", "least of all, in its own errors")
    for name, estimator in ESTIMATORS.items():
        excess, score = [], []
        for train, fresh in zip(data[::2], data[1::2], strict=True):
            estimate = estimator(train)
            true = prediction_errors(model, [fresh])[:, 0] ** 2
            difference = sysid.residuals(estimate, fresh)[50:, 0] ** 2 - true
            excess.append(100 * difference.mean() / true.mean())
            score.append(difference.mean() / (difference.std() / np.sqrt(len(difference))))
        error = np.std(excess, ddof=1) / np.sqrt(len(excess))
        row(name, f"{np.mean(excess):.2f}", f"{error:.2f}", f"{min(score):.1f}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    floor(count)
    contest(count)
