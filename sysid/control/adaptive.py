"""Adaptive model following: a fixed design, and a feedforward that learns friction and stiffness from its errors."""

from dataclasses import dataclass

import numpy as np

from sysid.control.controller import Controller, check_pair
from sysid.models.state_space import StateSpace
from sysid.records.arguments import real_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.errors import SysidError

SLOWEST_HZ = 0.15
"""Frequency below which integral action rejects what the feedforward would learn: errors are high-passed here."""

NOISE = 4.0
"""Standard deviation of what the regressors leave unexplained, over that of the innovations: nonlinear, correlated."""

LARGEST = 12.0
"""Largest mean square of the errors, over that of `NOISE`, from which is learnt: free arms stay below it."""

PAUSE = 2.0
"""How long nothing is learnt after a larger error, s."""

PRIOR = 0.025
"""Standard deviation of the coefficients a priori, over their bounds."""

SMOOTHING = 1.0
"""Time constant with which the coefficients go to the solution, s."""

STRIDE = 5
"""Samples from one step of the adaptation to the next."""


@dataclass(frozen=True, eq=False)
class AdaptiveFollowing(Locked):
    """Controller u = uf + ua of a fixed design, uf, and an adaptive feedforward ua = -theta' phi.

    The plant that is controlled is taken for its model with a disturbance at the input, y = G(q) (u + d), and the
    disturbance of loop i for theta_i' phi_i, with the regressors phi_i = [v_i / sqrt(v_i^2 + velocity^2), yr]: dry
    friction, and a stiffness matrix, by which other payloads show at the frequencies of an operator. yr and its
    velocity v are those of the reference model, so no noise enters: desired compensation [SadeghHorowitz1990].

    theta minimises the sum over the past of lambda^(t-s) |H (y - G u) - (H G phi') theta|^2, divided by the variance of
    the innovations, plus the prior |theta|^2 about the fixed design [Gunnarsson1996]; H is a high-pass filter. Since G
    is driven by the command that was applied, limits of rate and range leave no trace in the error, and no augmentation
    as in [KarasonAnnaswamy1994] is needed. Directions that are not excited return to the fixed design. The larger an
    error, the faster it forgets [Fortescue1981]. Samples whose error lies in the dead zone neither add nor forget
    [GoodwinSin1984, sec. 3.6]; nor do those for a while after an error larger than those of a free arm, as when it
    meets an obstacle or a new payload makes it sag, and then the sums begin anew. theta is projected onto a box, and
    goes to the solution smoothly.
    Of theta_i that share enters the command by which theta has lowered the squared errors of loop i: where the
    regressors explain nothing, as the vibration of another payload, the fixed design remains.

    Boundedness, whatever the errors of the model and whatever theta does. The fixed design is told u - ua alone, so it
    takes ua for a disturbance at the plant's input; |ua_i| <= friction + stiffness |yr|_1, bounded for bounded requests
    because the reference is stable.
    1. Within the limits, and the correction of the fixed design: if its loop with the true plant is stable and linear,
       |y| is at most |y without ua| + |Sd|_1 max |ua|, with |Sd|_1 the l1 norm of the impulse response from the plant's
       input to y. A bounded disturbance at the input, such as dry friction, adds |Sd|_1 times its bound, and a
       nonlinearity from y to the input, of gain g, keeps y bounded if g |Sd|_1 < 1: small gain [IoannouFidan2006, sec.
       3.6].
    2. Beyond them: if the plant, and the fixed design between y, applied command and state, are stable (as those
       of `model_following` are), and the range of commands is bounded, then every signal is bounded.
    It proves no convergence. Where the true disturbance is theta' phi and phi is exciting, this is least squares; else
    theta is the best fit in the stated norm, which is not the norm of the tracking error.

    Attributes:
        fixed: The fixed design.
        plant: Stable model of the plant, with innovation covariance, no direct term.
        reference: Stable reference model, no direct term.
        friction: Bound of the coefficients of friction, in units of the command.
        stiffness: Bound of the coefficients of stiffness.
        memory: Time constant of forgetting, s.
        velocity: Velocity below which friction is taken as viscous, in units of the output per second.
        dead_zone: Error that counts as noise, in standard deviations of the innovations.

    Raises:
        SysidError: Models of other sizes or sampling intervals, a direct term, an unstable model, no innovation
            covariance, or an invalid number.
    """

    fixed: Controller
    plant: StateSpace
    reference: StateSpace
    friction: float = 0.02
    stiffness: float = 0.4
    memory: float = 12.0
    velocity: float = 0.005
    dead_zone: float = 2.0

    def __post_init__(self) -> None:
        """Check."""
        if not isinstance(self.fixed, Controller):
            raise SysidError(f"fixed: expected a Controller, got {type(self.fixed).__name__}")
        check_pair(self.plant, self.reference, self.fixed.loops, self.fixed.dt)
        for name in ("friction", "stiffness", "memory", "velocity", "dead_zone"):
            value = real_number(name, getattr(self, name), "be above 0", lambda x: 0.0 < x < np.inf)
            object.__setattr__(self, name, value)

    def start(self) -> "AdaptiveRun":
        """Return the controller at rest, with the coefficients of the fixed design: zeros."""
        return AdaptiveRun(self)


class AdaptiveRun:
    """An adaptive controller at work, sample by sample; see `AdaptiveFollowing`.

    Attributes:
        coefficients: Friction, then stiffness against each output, of each loop (m, 1 + m), as they enter the command.
        learnt: Number of samples from which was learnt.
    """

    coefficients: FloatArray
    learnt: int

    def __init__(self, design: AdaptiveFollowing) -> None:
        m, dt = design.fixed.loops, design.fixed.dt
        p, block = 1 + m, dt * STRIDE
        self._fixed = design.fixed.start()
        self._reference, self._dt, self._velocity = design.reference, dt, design.velocity
        self._xr, self._request = np.zeros(design.reference.order), np.zeros(m)
        # Regressors of this sample, friction and yr of each loop, and their sums over STRIDE samples.
        self._phi, self._sum = np.zeros((2, 2, m))
        self._plant, self._x = design.plant, np.zeros(design.plant.order)
        self._A, self._B = _plant_at_stride(design.plant)
        self._states, self._regressors = np.zeros((len(self._x), m * p)), np.zeros((m, m, p))
        # Column 0 is the error of the model, the others are its answers to each regressor at each input.
        self._raw, self._passed = np.zeros((m, 1 + m * p)), np.zeros((m, 1 + m * p))
        self._pole = float(np.exp(-2.0 * np.pi * SLOWEST_HZ * block))
        variances = np.diag(np.asarray(design.plant.innovation_covariance))
        self._scale = (1.0 / np.sqrt(variances))[:, None]
        bounds_of_loop = np.r_[design.friction, np.full(m, design.stiffness)]
        self._bounds = np.tile(bounds_of_loop, m)
        # Coefficients are scaled such that the prior's information is one.
        self._unit = PRIOR / NOISE * self._bounds
        self._forgetting, self._dead_zone = block / design.memory, design.dead_zone
        self._adaptive_command, self._tick, self._begun = np.zeros(m), 0, False
        self._gain = block / SMOOTHING
        # In steps of the adaptation: the length of a pause, and what is left of the present one.
        self._pause, self._waiting = round(PAUSE / block), 0
        self._theta, self.coefficients, self.learnt = np.zeros(m * p), np.zeros((m, p)), 0
        self._restart()

    def command(self, requested: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Return the command u(t) (m,) for the request (m,) and the measurement (m,) of this sample."""
        if self._tick == STRIDE:
            self._learn(measured)
            self._tick = 0
        yr = self._reference.C @ self._xr
        velocity = (yr - self._phi[1]) / self._dt
        # A sign that is smooth at rest, where the direction of dry friction is not known.
        friction = velocity / np.sqrt(velocity * velocity + self._velocity**2)
        self._phi, self._request = np.stack([friction, yr]), requested
        self._adaptive_command = -(self.coefficients[:, 0] * friction + self.coefficients[:, 1:] @ yr)
        return np.asarray(self._fixed.command(requested, measured) + self._adaptive_command)

    def applied(self, command: np.ndarray) -> None:
        """Tell the command (m,) that was applied at this sample, and advance to the next."""
        # To the fixed design the adaptive part is a disturbance at the input of the plant.
        self._fixed.applied(command - self._adaptive_command)
        self._xr = self._reference.A @ self._xr + self._reference.B @ self._request
        self._x = self._plant.A @ self._x + self._plant.B @ command
        self._sum += self._phi
        self._tick += 1

    def _restart(self) -> None:
        """Begin the sums; nothing is known then but the prior."""
        m, p = self.coefficients.shape
        self._information, self._evidence = np.eye(m * p), np.zeros(m * p)
        # Squared errors of each loop, without theta and with it.
        self._energy = np.zeros((2, m))

    def _learn(self, measured: np.ndarray) -> None:
        """Add the error of this sample to the sums, and solve for the coefficients."""
        error, regressors = self._scaled_error(measured)
        unexplained = error - regressors @ self._theta
        size = float(unexplained @ unexplained) / (len(measured) * NOISE**2)
        self._waiting = max(self._waiting - 1, 0)
        if size > LARGEST:
            self._waiting = self._pause
            self._restart()
        if self._waiting or np.abs(unexplained).max() <= self._dead_zone:
            return
        regressors *= self._unit
        self._add(error, unexplained, regressors, size)
        self._move_coefficients()
        self.learnt += 1

    def _scaled_error(self, measured: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Error of the model (m,) and its answers to the regressors (m, m p), high-passed, in standard deviations."""
        m, loops = len(measured), np.arange(len(measured))
        # Each regressor acts at the input of its own loop.
        self._regressors[loops, loops, 0], self._regressors[loops, loops, 1:] = self._sum
        self._sum = np.zeros((2, m))
        self._states = self._A @ self._states + self._B @ self._regressors.reshape(m, -1)
        raw = np.empty_like(self._raw)
        raw[:, 0] = measured - self._plant.C @ self._x
        raw[:, 1:] = self._plant.C @ self._states
        if not self._begun:
            # An offset at the start is no motion.
            self._raw, self._begun = raw, True
        # H(z) = (1 + pole)/2 (z - 1)/(z - pole), of gain 1 at half the sampling frequency.
        self._passed = self._pole * self._passed + 0.5 * (1.0 + self._pole) * (raw - self._raw)
        self._raw = raw
        scaled = self._scale * self._passed
        return scaled[:, 0], scaled[:, 1:]

    def _add(self, error: FloatArray, unexplained: FloatArray, regressors: FloatArray, size: float) -> None:
        """Forget, the faster the larger the error [Fortescue1981], then add error and regressors to the sums."""
        m = len(error)
        keep = np.exp(-self._forgetting * size)
        self._energy = keep * self._energy + np.square([error, unexplained])
        self._information *= keep
        # The prior is not forgotten: its information on the diagonal stays one.
        self._information.flat[:: m * m + m + 1] += 1.0 - keep
        self._information += regressors.T @ regressors
        self._evidence = keep * self._evidence + error @ regressors

    def _move_coefficients(self) -> None:
        """Move theta towards the solution within the box, and take over the share that has proved right."""
        m = len(self.coefficients)
        theta = self._unit * np.linalg.solve(self._information, self._evidence)
        self._theta = self._theta + self._gain * (np.clip(theta, -self._bounds, self._bounds) - self._theta)
        explained = 1.0 - self._energy[1] / self._energy[0]
        self.coefficients = np.clip(explained, 0.0, 1.0)[:, None] * self._theta.reshape(m, 1 + m)


def _plant_at_stride(plant: StateSpace) -> tuple[FloatArray, FloatArray]:
    """A and B of the plant at the rate of the adaptation, for sums of STRIDE inputs, which are held at their means."""
    powers = [np.linalg.matrix_power(plant.A, k) for k in range(STRIDE + 1)]
    return powers[-1], sum(powers[:-1]) @ plant.B / STRIDE
