"""Fits whose path from the input minimises simulation errors, whatever the noise model [Ljung1999, sec. 8.5].

With C = A and D = 1 the prediction errors of a structure are its simulation errors y - B/(A F) u: the path is searched
under this constraint. C and D are then fitted to the prediction errors with the path as known.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid.models.polynomials import stabilised
from sysid.polynomial.constraints import Constraint, constrained_search
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import InitialEstimate, Search
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData


@dataclass(frozen=True, eq=False)
class SimulationSearch:
    """Minima of the simulation errors and, with the path as known, of the prediction errors.

    Attributes:
        orders: Of the structure.
        tied: Orders with C = A and D = 1, in which the errors are those of the simulation.
        basis: Parameters of `tied` by the coefficients of A, B and F, in this sequence (k, q).
        path: Minimum of the simulation errors; `theta` in the layout of `tied`.
        noise_basis: Parameters by the coefficients of C and D (p, r).
        noise: Minimum of the prediction errors over C and D; None without these.
        theta: All parameters (p,).
    """

    orders: Orders
    tied: Orders
    basis: FloatArray
    path: Search
    noise_basis: FloatArray
    noise: Search | None
    theta: FloatArray

    @property
    def of_path(self) -> NDArray[np.int_]:
        """Positions of the coefficients of A, B and F among the parameters (q,)."""
        return _places_of_path(self.orders)

    @property
    def of_tied_path(self) -> NDArray[np.int_]:
        """The same among the parameters of `tied` (q,)."""
        return _places_of_path(self.tied)


def simulation_search(
    experiments: Sequence[IOData],
    initial_estimates: Callable[[Orders], Iterable[InitialEstimate]],
    find: partial[Search],
) -> SimulationSearch:
    """Search the path by simulation errors, then C and D by prediction errors.

    Args:
        experiments: The data.
        initial_estimates: Initial estimates of a structure.
        find: `search` with the structure, a start, the limit on the steps and the initial conditions.
    """
    orders: Orders = find.keywords["orders"]
    options = {name: find.keywords[name] for name in ("max_iterations", "initial_conditions")}
    of_path = _places_of_path(orders)
    by_prediction = find(experiments, initial_estimates).best.at.theta
    tied, basis = _tied(orders)
    if orders.na:
        constraint = Constraint(np.zeros(tied.count), basis)
        candidates = [InitialEstimate("prediction", constraint.full(_with_stable_a(orders, by_prediction)[of_path]))]
        if len(orders.nb) == 1 and not any(orders.nf):
            # with one input, A is the F of an output-error model
            single = replace(orders, na=0, nc=0, nd=0, nf=(orders.na,))
            b_then_f = find(experiments, initial_estimates, orders=single, start=None).best.at.theta
            a_then_b = np.roll(b_then_f, orders.na)
            candidates.append(InitialEstimate("output error", constraint.full(a_then_b)))
        path = constrained_search(experiments, candidates, tied, constraint, **options)
    else:
        path = find(experiments, initial_estimates, orders=tied, start=None)
    theta = by_prediction.copy()
    theta[of_path] = np.linalg.lstsq(basis, path.best.at.theta, rcond=None)[0]
    noise, noise_basis = _noise_search(experiments, orders, theta, options)
    if noise is not None:
        theta = noise.best.at.theta
    return SimulationSearch(orders, tied, basis, path, noise_basis, noise, theta)


def _noise_search(
    experiments: Sequence[IOData], orders: Orders, theta: FloatArray, options: dict[str, Any]
) -> tuple[Search | None, FloatArray]:
    """C and D by the prediction errors, from those at `theta` and from none; and the parameters by them (p, r)."""
    of_noise = np.setdiff1d(np.arange(orders.count), _places_of_path(orders))
    basis = np.eye(orders.count)[:, of_noise]
    if not len(of_noise):
        return None, basis
    white = theta.copy()
    white[of_noise] = 0.0
    candidates = [InitialEstimate("prediction", theta), InitialEstimate("white", white)]
    return constrained_search(experiments, candidates, orders, Constraint(white, basis), **options), basis


def _places_of_path(orders: Orders) -> NDArray[np.int_]:
    """Positions of the coefficients of A, B and F among the parameters."""
    of_a, of_b, _, _, of_f = orders.ranges
    places = [np.arange(positions.start, positions.stop) for positions in (of_a, *of_b, *of_f)]
    return np.concatenate(places)


def _tied(orders: Orders) -> tuple[Orders, FloatArray]:
    """The structure with C = A and D = 1, and its parameters by the coefficients of A, B and F (k, q)."""
    tied = replace(orders, nc=orders.na, nd=0)
    places = _places_of_path(tied)
    basis = np.zeros((tied.count, len(places)))
    basis[places, np.arange(len(places))] = 1.0
    basis[tied.ranges[2], : orders.na] = np.eye(orders.na)
    return tied, basis


def _with_stable_a(orders: Orders, theta: FloatArray) -> FloatArray:
    """Parameters with the roots of A inside the unit circle: an unstable model cannot be simulated."""
    a, b, c, d, f = orders.split(theta)
    return orders.join(stabilised(a), b, c, d, f)
