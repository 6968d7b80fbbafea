"""State-space models from frequency responses, by maximum likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sysid.continuous.rational_grid import mirrored_poles, unstable
from sysid.continuous.response_estimate import FittedParameters, likelihood_of, response_estimate
from sysid.continuous.response_likelihood import Maximum, greatest
from sysid.frequency.vector_fit import fitted, starting_poles
from sysid.models.continuous import Resampled
from sysid.models.continuous_model import ContinuousModel
from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd
from sysid.subspace.predictor import Predictor, Scales
from sysid.subspace.predictor_estimate import RealiseLocally

RELOCATIONS = 10  # of the poles by vector fitting
GRAMIAN_FLOOR = 1e-12  # eigenvalues of Gramians, relative to the largest, that a singular one is lifted to


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
    order = whole_number("order", order, 1)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    direct, stable = truth_value("direct", direct), truth_value("stable", stable)
    data, continuous, summary = likelihood_of(response, continuous, known_variance)
    dt = 0.0 if continuous else response.dt
    hz, g = data.response.frequencies, data.response.response
    _, ny, nu = g.shape
    # n^2 of the entries of A, B and C only choose the basis of the state
    unknown = order * (ny + nu) + direct * ny * nu
    if data.rows <= unknown:
        raise SysidError(
            f"{unknown} parameters from {data.rows:.4g} independent values of the response: lower the order"
        )
    pole_counts = (order, order + 2, 2 * order)
    starts = states_by_vector_fitting(data.x, hz, g, data.weights(), pole_counts, direct, stable, dt)
    best = greatest(data, starts, max_iterations)
    local = _local_coordinates(best, data.scale, summary)
    in_time = InContinuousTime(local) if continuous else None
    parameters = FittedParameters(
        values=local.parameters,
        # a local coordinate is a standard deviation, and each is independent of the others
        directions=np.eye(best.rank),
        names=tuple(f"local{i + 1}" for i in range(best.rank)),
        orders={"order": order},
        realise=local if in_time is None else Resampled(in_time),
        realise_continuous=in_time,
    )
    return response_estimate("fit_response_ss", data, summary, best, parameters)


def _local_coordinates(best: Maximum["GridStates"], scale: float, summary: DataSummary) -> RealiseLocally:
    """Coordinates along the directions that the response determines, in standard deviations from the best model.

    The search runs in s / scale; the state is scaled too, so that A, B and C take factors scale, its root and its root.
    """
    matrices, root = best.model.matrices, np.sqrt(scale)
    origin = Predictor(scale * matrices.A, root * matrices.M, root * matrices.C, matrices.D)
    sizes = [matrices.A.size, matrices.M.size, matrices.C.size, matrices.D.size]
    units = np.repeat([scale, root, root, 1.0], sizes)
    ny, nu = matrices.D.shape
    at_origin, unscaled = np.zeros(best.rank), Scales(np.ones(nu), np.ones(ny))
    return RealiseLocally(origin, units[:, None] * best.directions, at_origin, unscaled, summary, None)


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
        """From inputs to states, (xI - A)^-1 B (nf, n, nu), and from states to outputs, C (xI - A)^-1 (nf, ny, n)."""
        A, B, C = self.matrices.A, self.matrices.M, self.matrices.C
        inverse = np.linalg.inv(self.x[:, None, None] * np.eye(len(A)) - A)
        return inverse @ B, C @ inverse

    def response(self) -> ComplexArray:
        """Response (nf, ny, nu)."""
        from_inputs, _ = self._transfers()
        return np.asarray(self.matrices.C @ from_inputs + self.matrices.D)

    def columns(self) -> ComplexArray:
        """Derivatives in the entries of A, B, C, D, row by row (nf, ny, nu, p)."""
        from_inputs, to_outputs = self._transfers()
        ny, nu = self.matrices.D.shape
        has_direct = np.full(len(to_outputs), float(self.direct))
        by_A = np.einsum("fyi,fju->fyuij", to_outputs, from_inputs)
        by_B = np.einsum("fyi,uv->fyuiv", to_outputs, np.eye(nu))
        by_C = np.einsum("yz,fju->fyuzj", np.eye(ny), from_inputs)
        by_D = np.einsum("f,yz,uv->fyuzv", has_direct, np.eye(ny), np.eye(nu))
        derivatives = (by_A, by_B, by_C, by_D)
        return np.concatenate([table.reshape(*table.shape[:3], -1) for table in derivatives], axis=-1)

    def moved(self, step: FloatArray) -> Self | None:
        """After a step in these entries, unstable poles mirrored; None if a value is infinite."""
        moved = replace(self, matrices=self.matrices.moved(step))
        if not np.isfinite(moved.matrices.vector()).all():
            return None
        return moved.stabilised() if self.stable else moved

    def stabilised(self) -> Self | None:
        """With unstable poles mirrored into the stable region; None if that fails."""
        poles, vectors = (part.astype(complex) for part in np.linalg.eig(self.matrices.A))
        if not unstable(poles, self.discrete).any():
            return self
        try:
            A = np.linalg.solve(vectors.T, (vectors * mirrored_poles(poles, self.discrete)).T).T.real
        except np.linalg.LinAlgError:
            return None
        # eigenvectors that are nearly dependent, as of multiple poles, move the poles by rounding
        if not np.isfinite(A).all() or unstable(np.linalg.eigvals(A).astype(complex), self.discrete).any():
            return None
        return replace(self, matrices=replace(self.matrices, A=A))

    def reduced(self, order: int, weights: FloatArray) -> "GridStates":
        """Fewer states: those with the largest Gramians, summed over the grid with weights of the outputs (nf, ny).

        Balanced truncation [Moore1981] on the grid: sums over its frequencies instead of integrals, so that the states
        that count are those which show there, and unstable poles do no harm.
        """
        from_inputs, to_outputs = self._transfers()
        weighted = to_outputs * weights[:, :, None]
        controllability = _root(np.einsum("fiu,fju->ij", from_inputs, from_inputs.conj()).real)
        observability = _root(np.einsum("fyi,fyj->ij", weighted.conj(), weighted).real)
        left, values, right = svd(observability.T @ controllability)
        size = np.sqrt(values[:order])
        to_reduced = (left[:, :order] / size).T @ observability.T
        from_reduced = controllability @ (right[:order].T / size)
        full = self.matrices
        A, B, C = to_reduced @ full.A @ from_reduced, to_reduced @ full.M, full.C @ from_reduced
        return replace(self, matrices=Predictor(A, B, C, full.D))


def _root(gramian: FloatArray) -> FloatArray:
    """A matrix R with R R' the Gramian, whose eigenvalues rounding may have made negative."""
    values, vectors = np.linalg.eigh(gramian)
    return np.asarray(vectors * np.sqrt(np.maximum(values, GRAMIAN_FLOOR * values[-1])))


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

    Args:
        x: Points of the grid (nf,), s or z.
        hz: Their frequencies (nf,), Hz.
        g: Response (nf, ny, nu).
        weights: Inverse standard deviations of its entries (nf, ny, nu).
        counts: Numbers of common poles to fit; the first is the order of the models.
        direct: Whether D is fitted.
        stable: Whether poles must be stable.
        dt: Sampling interval, s; 0 in continuous time.
    """
    if not g.any():
        raise SysidError("a response that is zero at all frequencies has no poles: leave the path out by select")
    models = []
    order = counts[0]
    for count in counts:
        try:
            fractions = fitted(x, g, weights, starting_poles(hz, count, dt), direct, stable, dt, RELOCATIONS)
        except SysidError:
            # the data may be too few for more poles than the order has
            if count == order:
                raise
            continue
        if count == order:
            # rank one gives the order at once, but wants residues that are products of vectors
            rank_one = Predictor(*fractions.matrices(1))
            models.append(GridStates(x, rank_one, direct, stable, bool(dt)))
        full_rank = GridStates(x, Predictor(*fractions.matrices()), direct, stable, bool(dt))
        # one weight for each output: the mean over the inputs
        output_weights = np.sqrt(np.mean(weights**2, axis=2))
        models.append(full_rank.reduced(order, output_weights))
    if not stable:
        return models
    stabilised = (model.stabilised() for model in models)
    return [model for model in stabilised if model is not None]
