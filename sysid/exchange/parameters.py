"""How the parameters of an estimate enter its model, in a form that a file holds."""

from dataclasses import dataclass, replace

import numpy as np

from sysid.models.delta_method import spread, standard_directions
from sysid.models.estimate import Estimate
from sysid.models.state_space import StateSpace
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

TIED = 1e-8  # weight of the identity where outputs do not determine the change of basis


@dataclass(frozen=True, eq=False)
class LinearEntries:
    """Pure function from parameters to the model, to first order: they move the entries of its matrices.

    Attributes:
        model: The model at `parameters`.
        parameters: Estimated parameters (p,).
        derivatives: Of the entries of A, B, C, D, K, row by row (p, entries); None where the covariance is not known.
    """

    model: StateSpace
    parameters: FloatArray
    derivatives: FloatArray | None

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for parameters (p,)."""
        if np.array_equal(theta, self.parameters):
            return self.model
        if self.derivatives is None:
            raise SysidError("the model of other parameters is not known, since their covariance is not")
        return with_entries(self.model, entries(self.model) + (theta - self.parameters) @ self.derivatives)


def portable(estimate: Estimate) -> Realise | LinearEntries:
    """`estimate.realise` in one of the forms that a file holds: as it is, or to first order."""
    realise = estimate.realise
    if isinstance(realise, LinearEntries) or (
        isinstance(realise, Realise) and np.array_equal(entries(realise(estimate.parameters)), entries(estimate.model))
    ):
        return realise
    return LinearEntries(estimate.model, estimate.parameters, _derivatives(estimate))


def entries(model: StateSpace) -> FloatArray:
    """Entries of A, B, C, D, K, row by row."""
    matrices = (model.A, model.B, model.C, model.D, model.gain)
    return np.concatenate([matrix.ravel() for matrix in matrices])


def with_entries(model: StateSpace, values: FloatArray) -> StateSpace:
    """The model with other `entries`."""
    matrices = (model.A, model.B, model.C, model.D, model.gain)
    rows = np.split(values, np.cumsum([matrix.size for matrix in matrices])[:-1])
    A, B, C, D, K = [row.reshape(matrix.shape) for row, matrix in zip(rows, matrices, strict=True)]
    return replace(model, A=A, B=B, C=C, D=D, K=K)


def entry_moves(estimate: Estimate) -> FloatArray:
    """Change of `entries` per standard direction of the parameters (p, entries); NaN without a covariance.

    Estimators realise models in coordinates of their own choice, which a small step of a parameter may turn: every
    model is brought to the coordinates of the estimate first.
    """

    def aligned(theta: FloatArray) -> FloatArray:
        return entries(_in_coordinates_of(estimate.model, estimate.realise(theta)))

    return spread(aligned, estimate.parameters, estimate.covariance)


def _derivatives(estimate: Estimate) -> FloatArray | None:
    """Derivatives of `entries` by the parameters (p, entries); None without a covariance."""
    if not np.isfinite(estimate.covariance).all():
        return None
    scale = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0))
    scale[scale == 0.0] = 1.0
    scaled = standard_directions(estimate.covariance) / scale[:, None]
    return np.asarray(np.linalg.pinv(scaled.T) @ entry_moves(estimate) / scale[:, None])


def _in_coordinates_of(reference: StateSpace, model: StateSpace) -> StateSpace:
    """The model in the state coordinates in which its free response is closest to the reference's."""
    n = reference.order
    if model.order != n:
        raise SysidError(f"a small step of the parameters changes the number of states from {n} to {model.order}")
    if n == 0 or np.array_equal(entries(model), entries(reference)):
        return model
    observed, wanted = _observability(model), _observability(reference)
    weight = TIED * float(np.linalg.norm(wanted))
    identity = weight * np.eye(n)
    change, *_ = np.linalg.lstsq(np.vstack((observed, identity)), np.vstack((wanted, identity)), rcond=None)
    A = np.linalg.solve(change, model.A @ change)
    B, K = np.linalg.solve(change, model.B), np.linalg.solve(change, model.gain)
    return replace(model, A=np.asarray(A), B=np.asarray(B), C=model.C @ change, K=np.asarray(K))


def _observability(model: StateSpace) -> FloatArray:
    """Rows C A^k of the free response, for twice as many samples as there are states."""
    samples = range(2 * model.order)
    return np.concatenate([model.C @ np.linalg.matrix_power(model.A, k) for k in samples])
