"""Maximum likelihood of models of a measured response: weights, Levenberg-Marquardt search, test of the fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from sysid.frequency.vector_fit import points
from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd

ZERO_VARIANCE = 1e-12  # variance relative to the largest of a frequency that counts as zero: no information
SEARCHED = 4  # starts that are searched, the best ones
DISTINCT = 1e-3  # relative difference of their costs below which two starts count as one
CONVERGED = 1e-9  # remaining decrease, relative to the cost
ROUNDING = 1e-27  # cost relative to that of no model that is rounding alone
UNINFORMED = 1e-7  # singular value relative to the largest below which derivatives are collinear to first order
NEGLIGIBLE_SINGULAR = 1e-14  # singular value relative to the largest that is rounding: no steps go along it
LARGEST_DAMPING = 1e8  # in units of squared singular values of columns of unit length: steps are then rounding


class ResponseModel(Protocol):
    """A model whose likelihood is increased step by step."""

    def response(self) -> ComplexArray:
        """Response (nf, ny, nu)."""
        ...

    def columns(self) -> ComplexArray:
        """Its derivatives in some coordinates (nf, ny, nu, p)."""
        ...

    @property
    def free(self) -> int:
        """Number of independent parameters: rank of the derivatives."""
        ...

    def moved(self, step: FloatArray) -> Self | None:
        """The model after a step in these coordinates; None if it is not allowed."""
        ...


Model = TypeVar("Model", bound=ResponseModel)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Measured response with its weights.

    Attributes:
        response: The response, at frequencies with a known value.
        x: The frequencies as s, relative to `scale`, or as z (nf,).
        scale: In rad/s; 1 in discrete time.
        whitener: Symmetric, from real and imaginary parts of all entries to independent errors of unit variance
            (nf, 2 m, 2 m).
        rows: Number of independent errors.
        known_variance: Whether the variance of the errors is known; otherwise a common factor is estimated.
    """

    response: FrequencyResponse
    x: ComplexArray
    scale: float
    whitener: FloatArray
    rows: float
    known_variance: bool

    @staticmethod
    def of(response: FrequencyResponse, known_variance: bool) -> "Likelihood":
        """Weights from the covariance of a response; equal ones without it."""
        determined = response.determined()
        nf, count = len(determined.frequencies), 2 * int(np.prod(determined.response.shape[1:]))
        if nf < 2:
            raise SysidError(f"the response is known at {nf} frequencies, at least 2 are needed")
        x, scale = points(determined)
        if determined.covariance is None:
            whitener = np.broadcast_to(np.eye(count), (nf, count, count))
            return Likelihood(determined, x, scale, whitener, float(nf * count), False)
        values, vectors = np.linalg.eigh(determined.full_covariance())
        certain = values <= ZERO_VARIANCE * np.maximum(values[:, -1:], np.finfo(float).tiny)
        if certain.all(axis=1).any():
            f = determined.frequencies[np.argmax(certain.all(axis=1))]
            raise SysidError(
                f"the covariance is zero at {f:g} Hz: expected the variance of a measurement, or none at all"
            )
        # frequencies closer than the resolution share their information
        share = np.ones(nf)
        if determined.resolution is not None:
            share = np.minimum(np.gradient(determined.frequencies) / determined.resolution, 1.0)
        positive = np.where(certain, 1.0, values)
        root = np.where(certain, 0.0, np.sqrt(share[:, None] / positive))
        rows = float(share @ (~certain).sum(axis=1))
        # symmetric, so that rows belong to entries
        whitener = vectors @ (root[:, :, None] * vectors.transpose(0, 2, 1))
        return Likelihood(determined, x, scale, whitener, rows, known_variance)

    def errors(self, values: ComplexArray) -> FloatArray:
        """Measured minus model response, whitened (rows,)."""
        return self.table((self.response.response - values)[..., None])[:, 0]

    def cost(self, model: ResponseModel) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.errors(model.response()) ** 2))

    def table(self, columns: ComplexArray) -> FloatArray:
        """Columns (nf, ny, nu, p), whitened (rows, p)."""
        nf, p = len(columns), columns.shape[-1]
        flat = columns.reshape(nf, -1, p)
        real_and_imaginary = np.stack((flat.real, flat.imag), axis=2).reshape(nf, -1, p)
        return np.asarray((self.whitener @ real_and_imaginary).reshape(-1, p))

    def weights(self) -> FloatArray:
        """Inverse standard deviation of every entry, others disregarded (nf, ny, nu)."""
        squares = np.einsum("fij,fij->fj", self.whitener, self.whitener)
        weights = np.sqrt(squares.reshape(*self.response.response.shape, 2).sum(axis=-1))
        # entries without error would have none
        return np.where(weights > 0.0, weights, weights[weights > 0.0].min())


@dataclass(frozen=True, eq=False)
class Maximum(Generic[Model]):
    """Result of a search.

    Attributes:
        model: The model.
        cost: Weighted sum of squares.
        directions: Columns (p, r): steps of one standard deviation each for errors of unit variance.
        condition: Condition number of the derivatives, columns scaled.
        iterations: Accepted steps.
        converged: Whether the remaining decrease is negligible.
    """

    model: Model
    cost: float
    directions: FloatArray
    condition: float
    iterations: int
    converged: bool

    @property
    def rank(self) -> int:
        """Number of parameters that the data determine."""
        return self.directions.shape[1]


def greatest(data: Likelihood, starts: Sequence[Model], max_iterations: int) -> Maximum[Model]:
    """The greatest likelihood from the best of several starts."""
    costs = [(data.cost(start), start) for start in starts]
    chosen: list[tuple[float, Model]] = []
    for cost, start in sorted(costs, key=lambda cost_and_start: cost_and_start[0]):
        if not chosen or cost > chosen[-1][0] * (1.0 + DISTINCT):
            chosen.append((cost, start))
    maxima = [maximise(data, start, max_iterations) for _, start in chosen[:SEARCHED]]
    return min(maxima, key=lambda maximum: maximum.cost)


@dataclass(frozen=True, eq=False)
class _Linearised:
    """Singular directions of the derivatives, columns scaled to unit length.

    Attributes:
        values: Singular values that are no rounding (r,).
        to_step: From steps along the directions to steps in the coordinates of the model (p, r).
        slope: Errors along the directions (r,).
    """

    values: FloatArray
    to_step: FloatArray
    slope: FloatArray

    @staticmethod
    def of(data: Likelihood, model: ResponseModel, errors: FloatArray) -> "_Linearised":
        """Linearise the errors of a model."""
        table = data.table(model.columns())
        size = np.linalg.norm(table, axis=0)
        size[size == 0.0] = 1.0
        # the triangle has the same singular values as the table, and far fewer rows
        triangle = np.asarray(np.linalg.qr(np.column_stack((table / size, errors)), mode="r"))
        p = len(size)
        left, values, right = svd(triangle[:p, :p], full_matrices=False)
        count = int((values[: model.free] > NEGLIGIBLE_SINGULAR * values[0]).sum())
        slope = left[:, :count].T @ triangle[:p, p]
        return _Linearised(values[:count], right[:count].T / size[:, None], slope)

    def step(self, damping: float) -> FloatArray:
        """Levenberg-Marquardt step in the coordinates of the model (p,)."""
        return np.asarray(self.to_step @ (self.values * self.slope / (self.values**2 + damping)))

    def predicted_decrease(self, damping: float) -> float:
        """Decrease of the cost by that step if the errors were linear in the coordinates."""
        remaining = (damping / (self.values**2 + damping)) ** 2
        return float(self.slope @ (self.slope * (1.0 - remaining)))


def maximise(data: Likelihood, start: Model, max_iterations: int) -> Maximum[Model]:
    """Levenberg-Marquardt steps in the singular directions of the derivatives [More1978]."""
    model, errors, damping = start, data.errors(start.response()), 0.0
    cost = float(errors @ errors)
    rounding = ROUNDING * float(np.sum(data.table(data.response.response[..., None]) ** 2))
    iterations = 0
    while True:
        linear = _Linearised.of(data, model, errors)
        attainable = float(linear.slope @ linear.slope)
        settled = attainable <= CONVERGED * cost or cost <= rounding
        accepted = False
        while not settled and iterations < max_iterations and damping < LARGEST_DAMPING:
            trial = model.moved(linear.step(damping))
            if trial is not None:
                trial_errors = data.errors(trial.response())
                trial_cost = float(trial_errors @ trial_errors)
                if trial_cost < cost:
                    decrease = cost - trial_cost
                    ratio = decrease / linear.predicted_decrease(damping)
                    settled = decrease <= 1e-14 * cost
                    model, errors, cost, accepted = trial, trial_errors, trial_cost, True
                    iterations += 1
                    damping = _after_success(damping, ratio)
                    break
            damping = max(10.0 * damping, 1e-6)
        if not accepted:
            # steps that no longer succeed for rounding end at a minimum too, where little was left to gain
            flat = attainable <= 1e-6 * cost or cost <= 1e4 * rounding
            values = linear.values
            condition = float(values[0] / values[-1]) if len(values) else 1.0
            informed = values > UNINFORMED * values[:1]
            directions = (linear.to_step / values)[:, informed]
            return Maximum(model, cost, directions, condition, iterations, settled or flat)


def _after_success(damping: float, ratio: float) -> float:
    """Damping after a step whose decrease was `ratio` of the predicted one; full Gauss-Newton steps below 1e-12."""
    damping = damping / 10.0 if ratio > 0.5 else max(4.0 * damping, 1e-6)
    return damping if damping > 1e-12 else 0.0
