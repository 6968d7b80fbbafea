"""Whether the commands of several joints move independently enough to tell which of them moved what.

A shared waveform in Cartesian mode turns one signal into the commands of several joints. They are then nearly multiples
of each other: what one of them does to a joint cannot be told from what another does.
"""

from dataclasses import dataclass

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Experiment, JointLog
from scenarios.experiments.log_review import SETTLING
from sysid import IOData, order_of_excitation

LAGS = 8
"""Samples of the past that models of the study look back, na + nb of the largest."""

LIMIT = 30.0
"""Condition index from which regressors count as too dependent [Belsley1980, sec. 3.2].

Responses to the weakest combination of inputs then have 30 / sqrt(3) = 17 times the standard deviation that independent
inputs of the same size would leave: the record would have to be 300 times as long. The tests lie far from it on either
side, as docs/tests.md shows: above 100 where the axes share a waveform, 3 where they have one each.
"""

STILL = 1e-9
"""A joint whose command moves by no more than this stands still, rad: rounding of the kinematics."""

NUMERICAL_RANK = 1e-6
"""Singular values below it, relative to the largest, count as zero, as in `sysid`."""


@dataclass(frozen=True)
class JointInputs:
    """How independently the commands of several joints move.

    Attributes:
        joints: The joints.
        lags: Samples of each command that are compared, the present one included.
        condition: Condition index between the joints: ratio of the extreme singular values of the lagged commands,
            those of each joint made orthonormal first, so that the colour of a single command does not count. The best
            is 1.
        covariance_condition: Condition number of the block-Toeplitz covariance matrix of the commands, each of unit
            variance, the colour of each included.
        orders: Order of persistent excitation of each joint's command, `lags` meaning at least that.
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
        """Whether models of each joint's response to its own command can be."""
        return min(self.orders) >= self.lags

    def summary(self) -> dict[str, object]:
        """All of it by name, for JSON."""
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
        """One line where a full model cannot be identified, else None."""
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
    """Joints whose model an experiment is for: those that the stick moves; in Cartesian mode the three of the thesis.

    The wrist then moves too, to hold the orientation, but three translations cannot move more than three joints
    independently.
    """
    return STUDIED_JOINTS if experiment.mode.startswith("cartesian") else tuple(experiment.axes)


def joint_inputs(commands: np.ndarray, joints: tuple[str, ...], *, lags: int = LAGS) -> JointInputs | None:
    """Look at the commands of several joints.

    Args:
        commands: Commanded angles (N, 7), rad.
        joints: The joints.
        lags: Samples of each command that are compared.

    Returns:
        What was found of those that move; None where fewer than two do, or the record is too short for so many lags.
    """
    joints = tuple(joint for joint in joints if np.ptp(commands[:, JOINTS.index(joint)]) > STILL)
    return _compared(joints, [commands[:, JOINTS.index(joint)] for joint in joints], lags)


def dependence_warning(record: IOData) -> str | None:
    """Say that the inputs of a record of any robot move together.

    Args:
        record: The record.

    Returns:
        One line, or None where they are independent enough, or the record is too short to tell.
    """
    names = record.input_names or tuple(f"u{k}" for k in range(1, record.nu + 1))
    u = record.scored.u
    found = _compared(tuple(names), [u[:, k] for k in range(record.nu)], LAGS)
    if found is None or found.condition <= LIMIT:
        return None
    return (
        f"the inputs {', '.join(names)} move together (condition {found.condition:.3g} between them, limit {LIMIT:g}): "
        "what one of them does to an output cannot be told from what another does"
    )


def _compared(joints: tuple[str, ...], signals: list[np.ndarray], lags: int) -> JointInputs | None:
    if len(joints) < 2:
        return None
    signals = [signal - signal.mean() for signal in signals]
    rows = len(signals[0]) - lags + 1
    if rows < 2 * lags * len(joints) or not all(signal.any() for signal in signals):
        return None
    blocks = [
        np.column_stack([signal[lags - 1 - lag : lags - 1 - lag + rows] for lag in range(lags)]) / signal.std()
        for signal in signals
    ]
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


def logged_inputs(log: JointLog, experiment: Experiment) -> JointInputs | None:
    """Look at the settled part of an experiment's log.

    Args:
        log: The log.
        experiment: The experiment.

    Returns:
        As `joint_inputs`; None also where it is for one joint only, or an operator moves the stick.
    """
    joints = moved_joints(experiment)
    if len(joints) == 1 or experiment.operator() is not None:
        return None
    start = round(SETTLING / log.dt)
    return joint_inputs(log.commanded[start:] if len(log) > 2 * start else log.commanded, joints)


def _condition(blocks: list[np.ndarray]) -> float:
    values = np.linalg.svd(np.hstack(blocks), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")
