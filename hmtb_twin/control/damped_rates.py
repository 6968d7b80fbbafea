"""Resolved rates by damped least squares: joint commands toward a wanted tool pose, for an arm of any chain.

The step of the joints solves the linearised motion of the tool in the least squares sense, of an arm with more than
six joints with the smallest motion of the joints [Whitney1969]. Near singular poses, where joints turn fast for a slow
tool, it is damped [NakamuraHanafusa1986; Wampler1986], the more so the smaller the least singular value of the
Jacobian [Chiaverini1997], and the tool lags. Newton's method repeats the step within a tick until the tool is where it
is wanted, so that nothing drifts.

- **Joint ranges**: a joint at the end of its range stays there, and the others are solved for again with what is left
  of the motion.
- **Velocity limits**: the whole step is shortened until every joint keeps its limit. The tool slows down, and keeps its
  direction but for the curvature of its path.

Limits leave no memory: each tick starts from the last command alone. The test bed has a closed form of its own chain,
`ResolvedRate`.
"""

import numpy as np
import pinocchio as pin

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
"""Largest number of steps of Newton's method in a tick; two are usual."""

HALVINGS = 12
"""Largest number of halvings of a step that takes the tool away: beyond its reach a whole step would swing the arm."""

ARRIVED = 1e-9
"""Error of the tool at which it has arrived, m, and rad times `TURN`."""

AT_REST = 1e-10
"""Motion of the joints below which a further step changes nothing, rad."""


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
        angles, held, damped, slowed = previous, False, False, False
        error = self._error(angles, position, rotation)
        for _ in range(STRIDES if self._unlimited else CORRECTIONS):
            if np.abs(error).max() <= ARRIVED:
                break
            change, held, damped = self._change(angles, error, lower, upper)
            wanted = angles + change
            ratio = float((np.abs(wanted - previous) / self._step).max())
            slowed = ratio > 1.0
            if slowed:
                # A joint is too fast: the same way, shorter.
                wanted = previous + (wanted - previous) / ratio
            nearer, wanted = self._nearer(angles, wanted, error, position, rotation)
            if nearer is None:
                # Out of reach: no way along the step brings the tool nearer, and the arm rests.
                slowed, damped = False, True
                break
            motion = float(np.abs(wanted - angles).max())
            angles, error = wanted, nearer
            if slowed or motion <= AT_REST:
                break
        angles = np.clip(angles, lower, upper)
        left = bool(np.abs(error).max() > ARRIVED)
        # What neither a limit of speed nor an end of a range explains, the pose or too few joints do.
        singular = left and (damped or not (slowed or held))
        return CartesianStep(angles, slowed, held and left, singular)

    def _nearer(
        self, angles: np.ndarray, wanted: np.ndarray, error: np.ndarray, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Return the error and the angles after a step that is halved until it brings the tool nearer; None if none."""
        size = float(error @ error)
        for _ in range(HALVINGS):
            left = self._error(wanted, position, rotation)
            if left @ left < size:
                return left, wanted
            wanted = angles + 0.5 * (wanted - angles)
        return None, angles

    def _error(self, angles: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Return what the tool is off (6,), along its own axes, weighed."""
        reached, turned = self._controller.tool_pose(angles)
        error = np.concatenate([turned.T @ (position - reached), pin.log3(turned.T @ rotation)])
        return np.asarray(self._weights * error)

    def _change(
        self, angles: np.ndarray, error: np.ndarray, lower: np.ndarray, upper: np.ndarray
    ) -> tuple[np.ndarray, bool, bool]:
        """Return one step of the joints (n,), rad, whether a range holds one of them, and whether it is damped."""
        jacobian = self._weights[:, None] * self._controller.tool_jacobian(angles)
        change = np.zeros(len(angles))
        free = np.ones(len(angles), dtype=bool)
        damped = False
        # Each round holds another joint at least.
        for _ in range(len(angles)):
            left = error - jacobian[:, ~free] @ change[~free]
            change[free], damped = damped_step(jacobian[:, free], left)
            largest = float(np.abs(change[free]).max(initial=0.0))
            if largest > STRIDE:
                # Far from the target the linearisation leads astray.
                change[free] *= STRIDE / largest
            beyond = free & ((angles + change > upper) | (angles + change < lower))
            if not beyond.any():
                break
            ends = np.where(change > 0.0, upper, lower)
            change[beyond] = (ends - angles)[beyond]
            free &= ~beyond
        return change, not free.all(), damped


def damped_step(jacobian: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, bool]:
    """Solve for the smallest motion of the joints that takes up an error, damped near a singular pose.

    It minimises |J x - e|^2 + d^2 |x|^2 [NakamuraHanafusa1986; Wampler1986]. With s the least singular value of J over
    its largest S, d^2 = (DAMPING S)^2 (1 - (s / SINGULAR)^2) where s is below SINGULAR, else 0 [Chiaverini1997].

    Args:
        jacobian: J (6, n), m/rad.
        error: e (6,), m.

    Returns:
        The step x (n,), rad, and whether it is damped.
    """
    if jacobian.shape[1] == 0:
        return np.zeros(0), False
    left, values, right = np.linalg.svd(jacobian, full_matrices=False)
    largest = float(values[0])
    if largest == 0.0:
        return np.zeros(jacobian.shape[1]), True
    least = float(values[-1]) / largest
    damping = (DAMPING * largest) ** 2 * max(1.0 - (least / SINGULAR) ** 2, 0.0)
    gains = 1.0 / values if damping == 0.0 else values / (values**2 + damping)
    return right.T @ (gains * (left.T @ error)), damping > 0.0
