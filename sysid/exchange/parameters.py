"""How the parameters of an estimate enter its model, in a form that a file holds."""

import re
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.delta_method import spread, standard_directions
from sysid.models.estimate import DataSummary, Estimate
from sysid.models.polynomials import Polynomials, innovations_form
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

Place = tuple[str, int, int]
"""Polynomial, row (input) and power of q^-1 of a coefficient, the latter two from 0."""

TIED = 1e-8  # weight of the identity where outputs do not determine the change of basis


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Pure function from parameters to the model: every parameter is a coefficient of a polynomial.

    Attributes:
        polynomials: All coefficients, those that are no parameters too.
        places: Of the parameters.
        data: Sampling interval and names.
        variance: Innovation variance that the model carries; None if unknown.
    """

    polynomials: Polynomials
    places: tuple[Place, ...]
    data: DataSummary
    variance: FloatArray | None

    def moved(self, theta: FloatArray) -> Polynomials:
        """Polynomials with these parameters (p,)."""
        rows = {name: np.array(getattr(self.polynomials, name)) for name in "ABCDF"}
        for (name, row, power), value in zip(self.places, theta, strict=True):
            np.atleast_2d(rows[name])[row, power] = value
        return Polynomials(**rows)

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for parameters (p,)."""
        return replace(innovations_form(self.moved(theta), self.data.dt, self.variance), **self.data.labels)


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


def places_of(estimate: Estimate) -> tuple[Place, ...] | None:
    """Places of all parameters in the polynomials; None where parameters are no coefficients."""
    polynomials = estimate.polynomials
    if polynomials is None:
        return None
    zeros = [int(np.flatnonzero(row)[0]) if row.any() else 0 for row in np.atleast_2d(polynomials.B)]
    delays = np.broadcast_to(estimate.orders.get("nk", zeros), len(zeros))
    places = []
    for name in estimate.parameter_names:
        parts = re.fullmatch(r"([abcdf])(\d+)(?:\[(\d+)\])?", name)
        if parts is None:
            return None
        row = int(parts[3] or 1) - 1
        places.append((parts[1].upper(), row, int(parts[2]) + (int(delays[row]) - 1 if parts[1] == "b" else 0)))
    realise = Coefficients(polynomials, tuple(places), estimate.data, estimate.model.innovation_covariance)
    try:
        exact = np.array_equal(entries(realise(estimate.parameters)), entries(estimate.model))
    except (IndexError, SysidError):
        return None
    return tuple(places) if exact else None


def entries(model: StateSpace) -> FloatArray:
    """Entries of A, B, C, D, K, row by row."""
    return np.concatenate([matrix.ravel() for matrix in (model.A, model.B, model.C, model.D, model.gain)])


def with_entries(model: StateSpace, values: FloatArray) -> StateSpace:
    """The model with other `entries`."""
    matrices = (model.A, model.B, model.C, model.D, model.gain)
    parts = np.split(values, np.cumsum([matrix.size for matrix in matrices])[:-1])
    A, B, C, D, K = (part.reshape(matrix.shape) for part, matrix in zip(parts, matrices, strict=True))
    return replace(model, A=A, B=B, C=C, D=D, K=K)


def entry_moves(estimate: Estimate) -> FloatArray:
    """Change of `entries` per standard direction of the parameters (p, entries); NaN without a covariance.

    Estimators realise models in coordinates of their own choice, which a small step of a parameter may turn: every
    model is brought to the coordinates of the estimate first.
    """

    def aligned(theta: FloatArray) -> FloatArray:
        return entries(_in_coordinates_of(estimate.model, estimate.realise(theta)))

    return spread(aligned, estimate.parameters, estimate.covariance)


def derivatives(estimate: Estimate) -> FloatArray | None:
    """Derivatives of `entries` by the parameters (p, entries); None without a covariance."""
    if isinstance(estimate.realise, LinearEntries):
        return estimate.realise.derivatives
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
    own, other = (
        np.concatenate([m.C @ np.linalg.matrix_power(m.A, k) for k in range(2 * n)]) for m in (model, reference)
    )
    weight = TIED * float(np.linalg.norm(other))
    identity = weight * np.eye(n)
    change, *_ = np.linalg.lstsq(np.vstack((own, identity)), np.vstack((other, identity)), rcond=None)
    A, B, K = (np.asarray(np.linalg.solve(change, part)) for part in (model.A @ change, model.B, model.gain))
    return replace(model, A=A, B=B, C=model.C @ change, K=K)
