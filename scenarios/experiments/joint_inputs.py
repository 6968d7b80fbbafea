"""Independence of the commands of several joints: whether a model of each response to each command is identifiable.

A common waveform in Cartesian mode turns one signal into the commands of several joints. They are then nearly multiples
of each other, and their effects on a joint cannot be separated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hmtb_twin import JOINTS, STUDIED_JOINTS, Experiment
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.experiments.log_review import SETTLING
from sysid import IOData, order_of_excitation

LAGS = 8
"""Past samples that enter the models of the study: na + nb of the largest."""

LIMIT = 30.0
"""Condition index from which regressors count as too dependent [Belsley1980, sec. 3.2].

Responses to the weakest combination of inputs then have 30 / sqrt(3) = 17 times the standard deviation that independent
inputs of the same size would leave: the record would have to be 300 times as long. The tests lie far from it on either
side, as docs/tests.md shows: above 100 where the axes share a waveform, 3 where they have one each.
"""

STILL = 1e-9
"""Motion of a command up to which its joint stands still, rad: rounding of the kinematics."""

NUMERICAL_RANK = 1e-6
"""Singular values below it, relative to the largest, count as zero, as in `sysid`."""


@dataclass(frozen=True)
class JointInputs:
    """Measures of how independently the commands of several joints move.

    Attributes:
        joints: The joints.
        lags: Number of compared samples of each command, the present one included.
        condition: Condition index between the joints: ratio of the extreme singular values of the lagged commands,
            those of each joint made orthonormal first, so that the spectrum of a single command does not count; 1 is
            best.
        covariance_condition: Condition number of the block-Toeplitz covariance matrix of the commands, each of unit
            variance, the spectrum of each included.
        orders: Order of persistent excitation of each joint's command, at most `lags`.
    """

    joints: tuple[str, ...]
    lags: int
    condition: float
    covariance_condition: float
    orders: tuple[int, ...]

    @property
    def full(self) -> bool:
        """Whether a model of every response to every command can be identified."""
        return self.block_diagonal and self.condition <= LIMIT

    @property
    def block_diagonal(self) -> bool:
        """Whether a model of each joint's response to its own command can be identified."""
        return min(self.orders) >= self.lags

    def summary(self) -> dict[str, object]:
        """Return all measures by name, for JSON."""
        return {
            "joints": self.joints,
            "lags": self.lags,
            "condition": self.condition,
            "limit": LIMIT,
            "covariance_condition": self.covariance_condition,
            "orders": self.orders,
            "full_model": self.full,
            "block_diagonal_model": self.block_diagonal,
        }

    def warning(self) -> str | None:
        """Return one line if a full model cannot be identified, else None."""
        if self.full:
            return None
        which = f"the commands of {', '.join(self.joints)}"
        if not self.block_diagonal:
            orders = ", ".join(map(str, self.orders))
            return f"{which} excite to the orders {orders}, expected {self.lags} for the models of the study"
        return (
            f"{which} move together (condition {self.condition:.3g} between them, limit {LIMIT:g}): no full model of "
            "several inputs can be identified, at best one of each joint by its own command; independent_channels helps"
        )


def moved_joints(experiment: Experiment) -> tuple[str, ...]:
    """Return the joints that an experiment can identify: its axes, or in Cartesian mode the three of the thesis.

    The wrist moves too, to hold the orientation, but three translations move at most three joints independently.
    """
    return STUDIED_JOINTS if experiment.mode.startswith("cartesian") else tuple(experiment.axes)


def joint_inputs(commands: np.ndarray, joints: tuple[str, ...], *, lags: int = LAGS) -> JointInputs | None:
    """Measure how independently the commands of several joints move.

    Args:
        commands: Commanded angles (N, 7), rad.
        joints: The joints.
        lags: Number of compared samples of each command.

    Returns:
        The measures of those that move; None if fewer than two do, or the record is too short for so many lags.
    """
    joints = tuple(joint for joint in joints if np.ptp(commands[:, JOINTS.index(joint)]) > STILL)
    return _measure(joints, [commands[:, JOINTS.index(joint)] for joint in joints], lags)


def dependence_warning(record: IOData) -> str | None:
    """Return one line if the inputs of a record, of any robot, move together; else None, as for short records."""
    names = record.input_names or tuple(f"u{k}" for k in range(1, record.nu + 1))
    u = record.scored.u
    inputs = _measure(tuple(names), [u[:, k] for k in range(record.nu)], LAGS)
    if inputs is None or inputs.condition <= LIMIT:
        return None
    return (
        f"the inputs {', '.join(names)} move together (condition {inputs.condition:.3g} between them, limit {LIMIT:g})"
        ": their effects on the outputs cannot be separated"
    )


def _measure(joints: tuple[str, ...], signals: list[np.ndarray], lags: int) -> JointInputs | None:
    if len(joints) < 2:
        return None
    signals = [signal - signal.mean() for signal in signals]
    if len(signals[0]) - lags + 1 < 2 * lags * len(joints) or not all(signal.any() for signal in signals):
        return None
    # The newest sample first, as in a regressor.
    blocks = [sliding_window_view(signal, lags)[:, ::-1] / signal.std() for signal in signals]
    # Orthonormal bases remove the spectrum of each signal: their joint condition measures the dependence alone.
    bases = []
    for block in blocks:
        basis, values, _ = np.linalg.svd(block, full_matrices=False)
        bases.append(basis[:, values > NUMERICAL_RANK * values[0]])
    return JointInputs(
        joints=joints,
        lags=lags,
        condition=_condition(bases),
        covariance_condition=_condition(blocks) ** 2,
        orders=tuple(order_of_excitation(signal, max_order=lags) for signal in signals),
    )


def settled_inputs(commands: np.ndarray, experiment: Experiment) -> JointInputs | None:
    """Return `joint_inputs` of the settled part of the commands (N, 7), rad; None also with an operator."""
    if experiment.operator() is not None:
        return None
    start = round(SETTLING / SAMPLE_TIME)
    return joint_inputs(commands[start if len(commands) > 2 * start else 0 :], moved_joints(experiment))


def _condition(blocks: list[np.ndarray]) -> float:
    return float(np.linalg.cond(np.hstack(blocks)))
