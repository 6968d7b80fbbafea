"""True noise model: from noise of drives and resolvers to the innovations form of the measurements."""

from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin.files.errors import TwinError
from sysid import StateSpace

RESIDUAL = 1e-9
"""Largest residual of the Riccati equation that a solution may leave, relative to the solution."""

DOUBLINGS = 50
"""Doublings after which the Riccati equation counts as unsolvable: 2^50 ticks of the Kalman recursion."""


@dataclass(frozen=True)
class Disturbances:
    """Noise of the small-signal arm, independent from tick to tick and between drives and resolvers.

    Attributes:
        drives: Effect on the state of one standard deviation of each drive's noise held over a tick (n, 7).
        resolvers: Covariance of the noise of the measured angles (7, 7), rad^2. Rounding counts as uniform and
            independent noise of variance step^2/12: with resolver noise of half a step or more ahead of it, it is that
            to 3 %, of a whole step to 1e-8 [Widrow2008, ch. 19]. Behind the nominal noise of a fifth of a step it is
            that for a joint that moves by steps from tick to tick; a joint at rest reads a constant.
    """

    drives: np.ndarray
    resolvers: np.ndarray

    def __post_init__(self) -> None:
        for name in ("drives", "resolvers"):
            locked = np.array(getattr(self, name), dtype=float)
            locked.setflags(write=False)
            object.__setattr__(self, name, locked)


def innovations_form(model: StateSpace, drives: np.ndarray, resolvers: np.ndarray) -> StateSpace:
    """Return a model with the noise model that its disturbances make: the steady Kalman predictor.

    The state obeys x+ = A x + B u + G w, the outputs are y = C x + D u + v, with w of unit and v of covariance R. The
    predictor of least variance has the gain K = A P C' S^-1 and innovations of covariance S = C P C' + R, where the
    covariance P of the predicted state solves P = A P A' + G G' - K S K' [AndersonMoore1979, sec. 4.4].

    Args:
        model: The path from commands to outputs.
        drives: G (n, nw).
        resolvers: R (ny, ny), rad^2, positive definite.

    Returns:
        The model with K and innovation covariance; without noise in the drives K is None, the covariance R.

    Raises:
        TwinError: The Riccati equation has no solution to working precision, or its predictor is not stable.
    """
    if not drives.any():
        return replace(model, K=None, innovation_covariance=resolvers)
    A, C = model.A, model.C
    P = _predicted_covariance(model, drives, resolvers)
    S = C @ P @ C.T + resolvers
    K = np.linalg.solve(S, C @ P @ A.T).T
    # Checked by the equation itself: the doubling may settle on something that does not solve it.
    imbalance = A @ P @ A.T + drives @ drives.T - K @ S @ K.T - P
    residual = np.abs(imbalance).max() / np.abs(P).max()
    radius = np.abs(np.linalg.eigvals(A - K @ C)).max()
    if not (residual <= RESIDUAL and radius < 1.0):
        raise TwinError(
            f"the Riccati equation of the noise is solved to {residual:.1e} with a predictor of spectral radius "
            f"{radius:.6g}; expected {RESIDUAL:g} and below 1"
        )
    return replace(model, K=K, innovation_covariance=_symmetric(S))


def _predicted_covariance(model: StateSpace, drives: np.ndarray, resolvers: np.ndarray) -> np.ndarray:
    """Solve the Riccati equation by the doubling algorithm [AndersonMoore1979, sec. 6.7].

    The k-th doubling gives the covariance after 2^k ticks of the Kalman recursion from a known state. All that it adds
    up is positive semidefinite, so that noise far below that of the resolvers costs no digits, as it does in the
    eigenvectors of the symplectic pencil; measurements count in standard deviations of their noise.

    Returns:
        P (n, n), symmetric.
    """
    # Outputs in standard deviations of their noise: R becomes the identity.
    try:
        C = np.linalg.solve(np.linalg.cholesky(resolvers), model.C)
    except np.linalg.LinAlgError as error:
        raise TwinError(f"resolver noise given whose covariance is not positive definite: {error}") from error
    # From a known state: after one tick the covariance is that of the drives' noise alone.
    transition, information, covariance = model.A.T, C.T @ C, drives @ drives.T
    # Noise that grows without bound overflows; the error below reports it.
    with np.errstate(all="ignore"):
        for _ in range(DOUBLINGS):
            try:
                weight = np.linalg.inv(np.eye(model.order) + information @ covariance)
            except np.linalg.LinAlgError:
                break
            shared = transition @ weight
            added = transition.T @ covariance @ weight @ transition
            information = _symmetric(information + shared @ information @ transition.T)
            transition, covariance = shared @ transition, _symmetric(covariance + added)
            if not np.isfinite(covariance).all():
                break
            if np.abs(added).max() <= np.finfo(float).eps * np.abs(covariance).max():
                return covariance
    raise TwinError(
        f"the Riccati equation of the noise has no solution: the covariance does not settle within 2^{DOUBLINGS} ticks "
        "(the measurements do not tell of a state that grows)"
    )


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)


def minimal_innovations_form(model: StateSpace, tolerance: float) -> StateSpace:
    """Drop the states that neither command nor innovation shares with the outputs, by balanced truncation.

    Args:
        model: A model in innovations form.
        tolerance: States with a Hankel singular value below `tolerance` times the largest are dropped; command and
            innovation count alike, both are angles.

    Returns:
        The smaller model, with its noise model.
    """
    if not np.any(model.gain):
        return model.minimal(tolerance)
    # Innovations as further inputs, which reach the outputs directly: truncation then keeps K with B.
    inputs = np.hstack([model.B, model.gain])
    feedthrough = np.hstack([model.D, np.eye(model.ny)])
    joined = StateSpace(model.A, inputs, model.C, feedthrough, None, model.dt).minimal(tolerance)
    return replace(model, A=joined.A, B=joined.B[:, : model.nu], C=joined.C, K=joined.B[:, model.nu :])
