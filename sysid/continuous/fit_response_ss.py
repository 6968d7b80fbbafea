"""State-space models from frequency responses, by maximum likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sysid.continuous.rational_grid import mirrored_poles, unstable
from sysid.continuous.response_estimate import likelihood_of, response_estimate
from sysid.continuous.response_likelihood import greatest
from sysid.frequency.vector_fit import fitted, starting_poles
from sysid.models.continuous import Resampled
from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError
from sysid.subspace.predictor import Predictor, Scales
from sysid.subspace.predictor_estimate import RealiseLocally

RELOCATIONS = 10  # of the poles by vector fitting
FLOOR = 1e-12  # of the Gramians, relative to their trace


def fit_response_ss(
    response: FrequencyResponse,
    order: int,
    *,
    direct: bool = True,
    continuous: bool | None = None,
    stable: bool = True,
    known_variance: bool = True,
    max_iterations: int = 100,
) -> Estimate:
    """Fit a state-space model to a frequency response by maximum likelihood [Pintelon2012, ch. 9].

    Minimises the sum over frequencies of e* S^-1 e, e the errors of all entries and S their covariance, in all entries
    of A, B, C and D; steps do not go along changes of the basis of the state [McKelvey2004]. It starts from vector
    fitting with common poles: its residues of full rank, reduced to the order by Gramians summed over the frequencies,
    or residues of rank one.

    Args:
        response: Measured response, as for `fit_response`; any numbers of inputs and outputs.
        order: Number of states.
        direct: Whether D is fitted; otherwise it is zero.
        continuous: As for `fit_response`.
        stable: Whether all poles must be stable.
        known_variance: As for `fit_response`.
        max_iterations: Limit on the steps of the search.

    Returns:
        Estimate as of `fit_response`; its parameters are local coordinates, in standard deviations from the estimate.

    Raises:
        SysidError: A discrete-time model of a continuous-time response, an order too high for the data.

    Warns:
        SysidWarning: As `fit_response`.
    """
    order, max_iterations = whole_number("order", order, 1), whole_number("max_iterations", max_iterations, 1)
    direct, stable = truth_value("direct", direct), truth_value("stable", stable)
    data, continuous, summary = likelihood_of(response, continuous, known_variance)
    dt = 0.0 if continuous else response.dt
    hz, g = data.response.frequencies, data.response.response
    _, ny, nu = g.shape
    unknown = order * (ny + nu) + direct * ny * nu
    if data.rows <= unknown:
        raise SysidError(
            f"{unknown} parameters from {data.rows:.4g} independent values of the response: lower the order"
        )
    starts = states_by_vector_fitting(data.x, hz, g, data.weights(), (order, order + 2, 2 * order), direct, stable, dt)
    best = greatest(data, starts, max_iterations)
    at, root = best.model.matrices, np.sqrt(data.scale)
    origin = Predictor(data.scale * at.A, root * at.M, root * at.C, at.D)
    units = np.repeat([data.scale, root, root, 1.0], [at.A.size, at.M.size, at.C.size, at.D.size])
    local = RealiseLocally(
        origin, units[:, None] * best.directions, np.zeros(best.rank), Scales(np.ones(nu), np.ones(ny)), summary, None
    )
    return response_estimate(
        "fit_response_ss",
        data,
        summary,
        best,
        {"order": order},
        theta=local.parameters,
        directions=np.eye(best.rank),
        names=tuple(f"local{i + 1}" for i in range(best.rank)),
        realise=Resampled(InContinuousTime(local)) if continuous else local,
        realise_continuous=InContinuousTime(local) if continuous else None,
    )


@dataclass(frozen=True)
class InContinuousTime:
    """Pure function from local coordinates to a continuous-time model; a class, so that estimates can be pickled.

    Attributes:
        local: From local coordinates to its matrices.
    """

    local: RealiseLocally

    def __call__(self, theta: FloatArray) -> ContinuousModel:
        """Model for local coordinates (q,)."""
        states = self.local(theta)
        return ContinuousModel(states, np.zeros(states.D.shape))


@dataclass(frozen=True, eq=False)
class GridStates:
    """State-space model on the grid of a response, a candidate of the likelihood.

    Attributes:
        x: Points of the grid (nf,), s or z.
        matrices: A, B, C and D.
        direct: Whether D is a parameter.
        stable: Whether poles must be stable.
        discrete: Whether x is z.
    """

    x: ComplexArray
    matrices: Predictor
    direct: bool
    stable: bool
    discrete: bool

    @property
    def free(self) -> int:
        """Number of parameters that the response can determine."""
        ny, nu = self.matrices.D.shape
        return len(self.matrices.A) * (ny + nu) + self.direct * ny * nu

    def _transfers(self) -> tuple[ComplexArray, ComplexArray]:
        """(xI - A)^-1 B (nf, n, nu) and C (xI - A)^-1 (nf, ny, n)."""
        at = self.matrices
        inverse = np.linalg.inv(self.x[:, None, None] * np.eye(len(at.A)) - at.A)
        return inverse @ at.M, at.C @ inverse

    def response(self) -> ComplexArray:
        """Response (nf, ny, nu)."""
        return np.asarray(self.matrices.C @ self._transfers()[0] + self.matrices.D)

    def columns(self) -> ComplexArray:
        """Derivatives in the entries of A, B, C, D, row by row (nf, ny, nu, p)."""
        states, left = self._transfers()
        ny, nu = self.matrices.D.shape
        by_A = np.einsum("fyi,fju->fyuij", left, states)
        by_B = np.einsum("fyi,uv->fyuiv", left, np.eye(nu))
        by_C = np.einsum("yz,fju->fyuzj", np.eye(ny), states)
        by_D = np.einsum("f,yz,uv->fyuzv", np.full(len(left), float(self.direct)), np.eye(ny), np.eye(nu))
        return np.concatenate([one.reshape(*one.shape[:3], -1) for one in (by_A, by_B, by_C, by_D)], axis=-1)

    def moved(self, step: FloatArray) -> Self | None:
        """After a step in these entries, unstable poles mirrored; None if a value is infinite."""
        out = replace(self, matrices=self.matrices.moved(step))
        if not np.isfinite(out.matrices.vector()).all():
            return None
        return out.stabilised() if self.stable else out

    def stabilised(self) -> Self | None:
        """With unstable poles mirrored into the stable region; None if that fails."""
        poles, basis = (part.astype(complex) for part in np.linalg.eig(self.matrices.A))
        if not unstable(poles, self.discrete).any():
            return self
        try:
            A = np.linalg.solve(basis.T, (basis * mirrored_poles(poles, self.discrete)).T).T.real
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(A).all() or unstable(np.linalg.eigvals(A).astype(complex), self.discrete).any():
            return None
        return replace(self, matrices=replace(self.matrices, A=A))

    def reduced(self, order: int, weights: FloatArray) -> "GridStates":
        """Fewer states: those with the largest Gramians, summed over the grid with weights of the outputs (nf, ny)."""
        states, left = self._transfers()
        left = left * weights[:, :, None]
        at = self.matrices
        controllability = _root(np.einsum("fiu,fju->ij", states, states.conj()).real)
        observability = _root(np.einsum("fyi,fyj->ij", left.conj(), left).real)
        u, values, vt = np.linalg.svd(observability.T @ controllability)
        size = np.sqrt(values[:order])
        into, back = (u[:, :order] / size).T @ observability.T, controllability @ (vt[:order].T / size)
        return replace(self, matrices=Predictor(into @ at.A @ back, into @ at.M, at.C @ back, at.D))


def _root(gramian: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(gramian)
    return np.asarray(vectors * np.sqrt(np.maximum(values, FLOOR * values[-1])))


def states_by_vector_fitting(
    x: ComplexArray,
    hz: FloatArray,
    g: ComplexArray,
    weights: FloatArray,
    counts: Sequence[int],
    direct: bool,
    stable: bool,
    dt: float,
) -> list[GridStates]:
    """Vector fits with residues of rank one, and with residues of full rank and more poles, reduced to the order.

    More poles show resonances that rest on a few frequencies.
    """
    if not g.any():
        raise SysidError("a response that is zero at all frequencies has no poles: leave the path out by select")
    out = []
    order = counts[0]
    for count in counts:
        try:
            fractions = fitted(x, g, weights, starting_poles(hz, count, dt), direct, stable, dt, RELOCATIONS)
        except SysidError:
            if count == order:
                raise
            continue
        if count == order:
            out.append(GridStates(x, Predictor(*fractions.matrices(1)), direct, stable, bool(dt)))
        whole = GridStates(x, Predictor(*fractions.matrices()), direct, stable, bool(dt))
        out.append(whole.reduced(order, np.sqrt(np.mean(weights**2, axis=2))))
    return [one for one in (start.stabilised() for start in out) if one is not None] if stable else out
