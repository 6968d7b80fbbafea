"""Model following: a plant answers like a reference model, by a design from identified models only."""

from dataclasses import dataclass

import numpy as np
import scipy

from sysid.control.controller import Controller, check_pair
from sysid.models.state_space import StateSpace
from sysid.polynomial.orthonormal_basis import stein
from sysid.records.arguments import real_number
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

HALVINGS = 12
"""Number of disturbances that are tried, each half the one before."""

SOFTEST = 1e4
"""Largest weight on the moves of the feedback, relative to the output: practically none is left."""

RETURN = 1.0, 200.0
"""Weights on the moves of command and output while the plan is regained after a limit, relative to the output."""


@dataclass(frozen=True, eq=False)
class FollowingDesign:
    """Design of a model-following controller.

    Attributes:
        controller: The controller.
        sensitivity: Largest singular value of the sensitivity at the plant's input over frequency, of the model.
        feedback_effort: Weight on the moves of the feedback that gives it.
        disturbance: Step of the disturbance in the observer, as in `model_following`.
    """

    controller: Controller
    sensitivity: float
    feedback_effort: float
    disturbance: float


def model_following(
    plant: StateSpace,
    reference: StateSpace,
    *,
    effort: float = 1e-3,
    sensitivity: float = 2.0,
    disturbance: float = 1.0,
    noise: float = 0.5,
    correction: FloatArray | None = None,
) -> FollowingDesign:
    """Design a controller by which a plant answers like a reference model.

    Four parts: a feedforward, which solves the linear-quadratic problem of following the reference model [Tyler1964;
    AndersonMoore1990, sec. 4.3] and drives a copy of the plant's model; an observer of state and input disturbance,
    the Kalman predictor of the innovations model with a random walk added to its input [PannocchiaRawlings2003]; a
    feedback of the difference between both states, less the estimated disturbance: integral action without windup; and
    a way back after limits. What they leave of the command moves the copy [WestonPostlethwaite2000], so the feedback
    does not fight them, and a gentle regulator of its own leads the copy back to the plan.

    The cost of feedforward and feedback is the sum of |y - yr|^2 + effort |u(t) - u(t-1)|^2. The feedback's effort is
    the least one whose largest singular value of the sensitivity stays within `sensitivity`; where none does, the
    disturbance is halved until one does.

    Args:
        plant: Model of the plant in innovations form, m inputs and m outputs, no direct term.
        reference: Stable model from m requests to the m outputs that are wanted, no direct term.
        effort: Weight on the moves of the feedforward, relative to that on the outputs.
        sensitivity: Largest peak of the sensitivity, above 1; 2 keeps gain margins of 2 and phase margins of 29 degrees
            [AstromHagglund2006, sec. 4.6].
        disturbance: Step of the random walk at the input per sample, in standard deviations of the innovations over the
            gain of the plant at 0 Hz. Larger ones reject friction and unknown loads faster.
        noise: Part of the innovation gain K that the observer takes for noise of the state, from 0 to 1. In a record
            with dry friction most of it is distortion that the input causes, and a full K makes a slow observer.
        correction: Largest differences between commands and feedforward (m,), see `Controller`; None for no bound.

    Returns:
        The controller, and the peak of the sensitivity that its design reached.

    Raises:
        SysidError: Models of other sizes or sampling intervals, a direct term, no innovation covariance, an unstable
            model, or no feedback that keeps the sensitivity.
    """
    check_pair(plant, reference)
    if not np.diag(plant.dc_gain()).all():
        raise SysidError("plant: expected a gain at 0 Hz from every input to its own output, got 0")
    positive = "be above 0", lambda x: 0.0 < x < np.inf
    effort = real_number("effort", effort, *positive)
    disturbance = real_number("disturbance", disturbance, *positive)
    bound = real_number("sensitivity", sensitivity, "be above 1", lambda x: 1.0 < x < np.inf)
    noise = real_number("noise", noise, "lie from 0 to 1", lambda x: 0.0 <= x <= 1.0)
    feedforward = _feedforward(plant, reference, effort)
    back, _, _ = _regulator(plant, *RETURN)
    ends = np.log10([effort, SOFTEST])

    def design(log_effort: float, observer: FloatArray) -> Controller:
        feedback, _, _ = _regulator(plant, 10.0**log_effort)
        return _combined(plant, reference, observer, feedforward, feedback, back, correction)

    def excess(log_effort: float, observer: FloatArray) -> float:
        return design(log_effort, observer).sensitivity(plant) - bound

    for halving in range(HALVINGS):
        walk = disturbance / 2.0**halving
        observer = _observer(plant, walk, noise)
        firmest, softest = excess(ends[0], observer), excess(ends[1], observer)
        if min(firmest, softest) > 0.0:
            continue
        chosen = ends[0]
        if firmest > 0.0:
            # the peak falls with the effort: 1e-3 in its logarithm is 0.2 % of the effort
            chosen = scipy.optimize.brentq(excess, *ends, args=(observer,), xtol=1e-3)
        controller = design(chosen, observer)
        if not controller.closed_loop(plant).is_stable():
            raise SysidError("plant: rounding makes its loop unstable: scale inputs and outputs to like size")
        return FollowingDesign(controller, controller.sensitivity(plant), float(10.0**chosen), walk)
    raise SysidError(f"no disturbance down to {walk:.3g} keeps sensitivity {bound:g}: allow more, or record for longer")


def _observer(plant: StateSpace, disturbance: float, noise: float) -> FloatArray:
    """Return the gain (n + m, m) of the predictor of the state and of the disturbance at the input."""
    n, m, K = plant.order, plant.nu, noise * plant.gain
    R = np.asarray(plant.innovation_covariance)
    # The disturbance is a state that acts as a command does, and stays as it is but for its random walk.
    A = np.block([[plant.A, plant.B], [np.zeros((m, n)), np.eye(m)]])
    C = np.hstack([plant.C, np.zeros((m, m))])
    walk = disturbance * np.sqrt(np.diag(R)) / np.abs(np.diag(plant.dc_gain()))
    # Q and S: covariance of the noise of the states, and with the innovation.
    Q = scipy.linalg.block_diag(K @ R @ K.T, np.diag(walk**2))
    S = np.vstack([K @ R, np.zeros((m, m))])
    # The Riccati equation needs noise on every state: a trace of it.
    Q[np.diag_indices(n)] += 1e-9 * walk.min() ** 2
    try:
        P = scipy.linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SysidError(f"plant: its observer has no solution: {error}") from error
    return np.asarray(np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T + S.T).T)


def _regulator(plant: StateSpace, effort: float, damping: float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Regulator of [x, u(t-1)]: its gain (m, n + m), the closed loop, and the gain from the next state's cost."""
    n, m = plant.order, plant.nu
    # The last command is a state, so that the cost of its moves is quadratic in state and command.
    A, B = scipy.linalg.block_diag(plant.A, np.zeros((m, m))), np.vstack([plant.B, np.eye(m)])
    C = np.hstack([plant.C, np.zeros((m, m))])
    move = plant.C @ np.hstack([plant.A - np.eye(n), plant.B])
    # Damping weights the next move of the output under a held command.
    Q, R = C.T @ C + damping * move.T @ move, effort * np.eye(m)
    # effort |u(t) - u(t-1)|^2 has a part in the state, one in the command, and N between both.
    Q[n:, n:] += R
    N = np.vstack([np.zeros((n, m)), -effort * np.eye(m)])
    try:
        P = scipy.linalg.solve_discrete_are(A, B, Q, R, s=N)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SysidError(f"plant: its regulator has no solution: {error}") from error
    H = np.linalg.inv(R + B.T @ P @ B) @ B.T
    F = H @ P @ A + np.linalg.solve(R + B.T @ P @ B, N.T)
    return F, A - B @ F, H


def _feedforward(plant: StateSpace, reference: StateSpace, effort: float) -> tuple[FloatArray, FloatArray]:
    """Gains from [x, u(t-1)] (m, n + m) and [xr, r] (m, nr + m): requests are taken to stay as they are."""
    m, k = plant.nu, reference.order
    F, closed, H = _regulator(plant, effort)
    exogenous = np.block([[reference.A, reference.B], [np.zeros((m, k)), np.eye(m)]])
    C = np.hstack([plant.C, np.zeros((m, m))])
    weight = np.hstack([-C.T @ reference.C, np.zeros((plant.order + m, m))])
    # The cross term of the cost obeys X = weight + closed' X exogenous; the unit roots of the requests, which nothing
    # controls, keep it out of the Riccati equation.
    return F, H @ stein(closed.T, exogenous.T, weight) @ exogenous


def _combined(
    plant: StateSpace,
    reference: StateSpace,
    observer: FloatArray,
    feedforward: tuple[FloatArray, FloatArray],
    feedback: FloatArray,
    back: FloatArray,
    correction: FloatArray | None,
) -> Controller:
    """Controller of feedforward, way back from limits, and feedback; its signals are rows over state, r, y and ua."""
    n, m, k = plant.order, plant.nu, reference.order
    A, B = plant.A, plant.B
    Lx, Ld = observer[:n], observer[n:]
    of_plan, of_reference = feedforward
    sizes = (n, m, n, m, n, m, m, k, m, m, m)
    # The plant's state is taken for xm + xl + xe: the plan, the departure from it that limits cause, and the error that
    # the feedback corrects. uf, ul and ue are their commands at the sample before, ue less that against d.
    xm, uf, xl, ul, xe, ue, d, xr, r, y, ua = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])
    planned = -of_plan @ np.vstack([xm, uf]) - of_reference @ np.vstack([xr, r])
    # The innovation e of this sample moves the next state by Lx: feedback sees it at once, through the state that would
    # give the same next state. Of the disturbance the newest estimate is used, d + Ld e.
    e = y - plant.C @ (xm + xl + xe)
    same_next_state = np.linalg.lstsq(A, Lx - B @ Ld, rcond=None)[0]
    newest = feedback[:, :n] @ same_next_state + Ld
    corrected = -feedback @ np.vstack([xe, ue]) - d - newest @ e
    command = planned - back @ np.vstack([xl, ul]) + corrected
    # What limits leave of the command, but for plan and correction, moves the departure.
    departed = ua - planned - corrected
    next_plan = A @ xm + B @ planned
    next_departure = A @ xl + B @ departed
    next_error = A @ xe + B @ (d + corrected) + Lx @ e
    next_reference = reference.A @ xr + reference.B @ r
    plan_and_departure = [next_plan, planned, next_departure, departed]
    error_and_reference = [next_error, d + corrected, d + Ld @ e, next_reference]
    ends = np.cumsum(sizes)[-4:-1]
    C, Dr, Dy, _ = np.split(command, ends, axis=1)
    state, Br, By, Bu = np.split(np.vstack(plan_and_departure + error_and_reference), ends, axis=1)
    return Controller(state, Br, By, Bu, C, Dr, Dy, plant.dt, planned[:, : ends[1]], correction)
