"""Resolved rates by damped least squares: joint commands toward a wanted tool pose, for an arm of any chain.

The step of the joints solves the linearised motion of the tool in the least squares sense, of an arm with more than
six joints with the smallest motion of the joints [Whitney1969]. Near singular poses, where joints turn fast for a slow
tool, it is damped [NakamuraHanafusa1986; Wampler1986], the more so the smaller the least singular value of the
Jacobian [Chiaverini1997], and the tool lags. Within a tick the step is repeated until the tool is where it is wanted,
so that nothing drifts; where the tool comes less near than predicted, it is damped more [More1978].

- **Joint ranges**: where joints would go beyond their ends, the same least squares are solved within the ranges: the
  others take up what those at their ends cannot, as far as they can [StarkParker1995].
- **Velocity limits**: the tool goes as far on its straight line, with the shortest turn, as every joint keeps its
  limit. It slows down and stays on its line.

Limits leave no memory: each tick starts from the last command alone. Nothing plans ahead: the nearest pose within
reach is the nearest that can be come to without going away from the target first, which another posture may beat. The
test bed has a closed form of its own chain, `ResolvedRate`.
"""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
from scipy.optimize import lsq_linear

from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.control.resolved_rate import STRIDE, STRIDES, CartesianStep
from hmtb_twin.files.errors import TwinError

TURN = 0.3
"""Distance that counts as much as a turn of the tool by 1 rad, m: where both cannot be had, and in singular values."""

SINGULAR = 0.03
"""Least over largest singular value of the Jacobian below which a step is damped."""

DAMPING = 0.03
"""Damping at a singular pose over the largest singular value."""

CORRECTIONS = 12
"""Largest number of steps in a tick; two are usual."""

REFUSALS = 16
"""Largest number of steps refused as they take the tool away: beyond its reach a whole step would swing the arm."""

GOOD_GAIN, BEST_GAIN = 0.25, 0.75
"""Approach of the tool over the predicted one below which a step's damping grows, and above which it shrinks."""

LEAST_TRUST = 0.01
"""Damping over the largest singular value with which the steps that go astray begin."""

ARRIVED = 1e-9
"""Error of the tool at which it has arrived, m, and rad times `TURN`."""

AT_REST = 1e-10
"""Motion of the joints below which a further step changes nothing, rad."""

SHORTENINGS = 16
"""Largest number of shortenings of the tool's way before the command holds; three or four are usual."""

NEAR_LIMIT = 0.9
"""Motion of a joint over its velocity limit above which the limit counts as reached."""

RESERVE = 1e-3
"""Fraction of a velocity limit that a shortened way keeps in reserve for its curvature."""


class DampedRates:
    """Follows wanted tool poses, tick by tick, with all joints of an arm.

    Args:
        controller: The controller's own model.
        lower: Lower ends of the joint ranges (n,), rad.
        upper: Upper ends (n,), rad.
        step: Largest change of each joint's command in one tick (n,), rad; all infinite without velocity limits.

    Raises:
        TwinError: A limit has the wrong shape or sign.
    """

    def __init__(self, controller: ControllerModel, *, lower: np.ndarray, upper: np.ndarray, step: np.ndarray) -> None:
        count = np.shape(step)
        for name, limit in (("lower", lower), ("upper", upper), ("step", step)):
            if np.shape(limit) != count or len(count) != 1 or np.isnan(limit).any():
                raise TwinError(f"{name} of shape {np.shape(limit)} given, expected numbers, one per joint")
        if not (np.asarray(step) > 0.0).all() or not (np.asarray(lower) < upper).all():
            raise TwinError("expected steps above zero and lower ends of the ranges below the upper ones")
        self._controller = controller
        self._lower, self._upper = np.array(lower, float), np.array(upper, float)
        self._step = np.array(step, float)
        self._unlimited = bool(np.isinf(self._step).all())
        # Errors and Jacobians are weighed alike.
        self._weights = np.array([1.0, 1.0, 1.0, TURN, TURN, TURN])

    def follow(self, previous: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> CartesianStep:
        """Return the command of the next tick.

        Args:
            previous: The command of this tick (n,), rad. Where it exceeds a range it may stay, but goes no further.
            position: Wanted position of the tool (3,), m.
            rotation: Wanted rotation of the tool (3, 3).

        Returns:
            The command, with the tool as wanted or as near as limits, the pose and the number of joints let it come;
            and what was limited.

        Raises:
            TwinError: The wanted pose or the command is not finite.
        """
        if not (np.isfinite(previous).all() and np.isfinite(position).all() and np.isfinite(rotation).all()):
            raise TwinError(
                f"tool pose {position.tolist()}, {rotation.tolist()} wanted from command {previous.tolist()}, expected "
                "finite numbers"
            )
        # A command beyond its range may stay there.
        lower, upper = np.minimum(self._lower, previous), np.maximum(self._upper, previous)
        start, orientation = self._controller.tool_pose(previous)
        way, turn = position - start, pin.log3(orientation.T @ rotation)
        share = 1.0
        # Most ticks are slow enough for the whole way.
        for _ in range(SHORTENINGS):
            if share == 1.0:
                target = (position, rotation)
            else:
                target = (start + share * way, orientation @ pin.exp3(share * turn))
            step, ratio = self._toward(previous, target, lower, upper)
            if ratio <= 1.0:
                # Where the tool stops before the end of a shortened way, it is not the speed that holds it back.
                followed = not (step.singular or step.joint_limited)
                return replace(step, velocity_limited=share < 1.0 and (followed or ratio > NEAR_LIMIT))
            # A joint is too fast: the same way, shorter.
            share *= (1.0 - RESERVE) / ratio
        return CartesianStep(np.clip(previous, lower, upper), False, False, True)

    def _toward(
        self,
        previous: np.ndarray,
        target: tuple[np.ndarray, np.ndarray],
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> tuple[CartesianStep, float]:
        """Return the step to a position and rotation of the tool, and its fastest joint's motion over its limit.

        Where a joint is too fast, the step is left unfinished.
        """
        position, rotation = target
        angles, held, singular, ratio, trust = previous, False, False, 0.0, 0.0
        error = self._error(angles, position, rotation)
        for _ in range(STRIDES if self._unlimited else CORRECTIONS):
            if np.abs(error).max() <= ARRIVED:
                break
            jacobian = self._weights[:, None] * self._controller.tool_jacobian(angles)
            for _ in range(REFUSALS):
                change, held, singular = _change(jacobian, error, trust, lower - angles, upper - angles)
                left = self._error(angles + change, position, rotation)
                gain = _gain(error, left, error - jacobian @ change)
                # Far from its target the tool does not move as its Jacobian says: shorter steps, along the gradient.
                if gain < GOOD_GAIN:
                    trust = max(3.0 * trust, LEAST_TRUST * float(np.linalg.norm(jacobian, 2)))
                elif gain > BEST_GAIN:
                    trust = trust / 3.0
                if gain > 0.0:
                    break
            else:
                # Out of reach: no step brings the tool nearer, and the arm rests.
                break
            motion = float(np.abs(change).max())
            angles, error = angles + change, left
            ratio = float((np.abs(angles - previous) / self._step).max())
            if ratio > 1.0 or motion <= AT_REST:
                break
        angles = np.clip(angles, lower, upper)
        off = bool(np.abs(error).max() > ARRIVED)
        # What no end of a range explains, the pose or too few joints do.
        return CartesianStep(angles, False, held and off, off and (singular or not held)), ratio

    def _error(self, angles: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Return what the tool is off (6,), along its own axes, weighed."""
        reached, turned = self._controller.tool_pose(angles)
        error = np.concatenate([turned.T @ (position - reached), pin.log3(turned.T @ rotation)])
        return np.asarray(self._weights * error)


def _change(
    jacobian: np.ndarray, error: np.ndarray, trust: float, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, bool, bool]:
    """Return one step of the joints (n,), rad, whether a range holds one of them, and whether the pose is singular."""
    change, damping = damped_step(jacobian, error, trust)
    held = bool(((change > upper) | (change < lower)).any())
    if held:
        change, damping = step_within_bounds(jacobian, error, lower, upper, trust)
    largest = float(np.abs(change).max())
    if largest > STRIDE:
        # Far from the target the linearisation leads astray.
        change = change * (STRIDE / largest)
    return change, held, damping > trust


def _gain(before: np.ndarray, after: np.ndarray, predicted: np.ndarray) -> float:
    """Return how much smaller a sum of squares has become, over what the linearised motion predicts."""
    square = float(before @ before)
    hoped = square - float(predicted @ predicted)
    return (square - float(after @ after)) / hoped if hoped > 0.0 else 0.0


def damped_step(jacobian: np.ndarray, error: np.ndarray, least_damping: float = 0.0) -> tuple[np.ndarray, float]:
    """Solve for the smallest motion of the joints that takes up an error, damped near a singular pose.

    It minimises |J x - e|^2 + d^2 |x|^2 [NakamuraHanafusa1986; Wampler1986]. With s the least singular value of J over
    its largest S, d^2 = (DAMPING S)^2 (1 - (s / SINGULAR)^2) where s is below SINGULAR, else 0 [Chiaverini1997].

    Args:
        jacobian: J (6, n), m/rad.
        error: e (6,), m.
        least_damping: Least d, m/rad.

    Returns:
        The step x (n,), rad, and its damping d, m/rad; infinite where no joint moves the tool.
    """
    left, values, right = np.linalg.svd(jacobian, full_matrices=False)
    if values[0] == 0.0:
        return np.zeros(jacobian.shape[1]), np.inf
    damping = max(_damping(values), least_damping)
    gains = 1.0 / values if damping == 0.0 else values / (values**2 + damping**2)
    return right.T @ (gains * (left.T @ error)), damping


def step_within_bounds(
    jacobian: np.ndarray, error: np.ndarray, lower: np.ndarray, upper: np.ndarray, least_damping: float = 0.0
) -> tuple[np.ndarray, float]:
    """Solve the damped least squares of `damped_step` within bounds of each joint's motion [StarkParker1995].

    Args:
        jacobian: J (6, n), m/rad, not zero.
        error: e (6,), m.
        lower: Least motion of each joint (n,), rad.
        upper: Largest motion (n,), rad.
        least_damping: Least d, m/rad.

    Returns:
        The step x (n,), rad, and its damping d, m/rad.
    """
    values = np.linalg.svd(jacobian, compute_uv=False)
    damping = max(_damping(values), least_damping)
    # A trace of damping picks the smallest motion where several take up the error alike.
    trace = 1e-6 * float(values[0])
    step = _within(jacobian, error, max(damping, trace), lower, upper)
    free = (step > lower) & (step < upper)
    if free.any():
        # Without the joints at their ends the others may be nearer to a singular pose.
        alone = _damping(np.linalg.svd(jacobian[:, free], compute_uv=False))
        if alone > damping:
            damping = alone
            step = _within(jacobian, error, max(damping, trace), lower, upper)
    return step, damping


def _within(
    jacobian: np.ndarray, error: np.ndarray, damping: float, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Return the x within bounds that minimises |J x - e|^2 + d^2 |x|^2, those at their bounds exactly there."""
    count = jacobian.shape[1]
    rows = np.vstack([jacobian, damping * np.eye(count)])
    solution = lsq_linear(rows, np.concatenate([error, np.zeros(count)]), (lower, upper), method="bvls", tol=1e-14)
    step = np.where(solution.active_mask > 0, upper, solution.x)
    return np.where(solution.active_mask < 0, lower, step)


def _damping(values: np.ndarray) -> float:
    """Return the damping of a Jacobian with these singular values, largest first, m/rad."""
    largest, least = float(values[0]), float(values[-1])
    if least >= SINGULAR * largest:
        return 0.0
    return DAMPING * largest * math.sqrt(1.0 - (least / (SINGULAR * largest)) ** 2)
