"""Linear constraints on the parameters of a polynomial model: known coefficients, as of MATLAB's idpoly structures.

All parameters are base + basis @ free. A search runs in the free ones; derivatives by them are J @ basis, exactly.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import (
    SCREENING_STEPS,
    InitialEstimate,
    Linearisation,
    Minimum,
    Search,
    levenberg_marquardt,
    linearise,
)
from sysid.polynomial.stability_limit import admissible, move_roots_inside, outward
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

ON_THE_CIRCLE = 1e-9  # modulus above one by which rounding may move the known root of an integrator
REFINED = 2  # initial estimates that are followed to their minima

FixedRows = Mapping[str, ArrayLike | Sequence[ArrayLike | None]]
"""Polynomials by letter, NaN for coefficients that are estimated; with several inputs a row per input or None."""


@dataclass(frozen=True, eq=False)
class Constraint:
    """Parameters as a linear function of fewer free ones.

    Attributes:
        base: All parameters where the free ones are zero (p,).
        basis: Their change by each free parameter (p, q).
    """

    base: FloatArray
    basis: FloatArray

    @property
    def count(self) -> int:
        """Number of free parameters q."""
        return self.basis.shape[1]

    def full(self, free: FloatArray) -> FloatArray:
        """All parameters (p,) from the free ones (q,)."""
        return self.base + self.basis @ free

    def nearest(self, theta: FloatArray) -> FloatArray:
        """Free parameters (q,) of the point that is nearest to parameters (p,)."""
        return np.asarray(np.linalg.lstsq(self.basis, theta - self.base, rcond=None)[0])

    def reduced(self, at: Linearisation, free: FloatArray) -> Linearisation:
        """Linearisation by the free parameters (q,), from that by all of them."""
        derivatives = (at.triangle * at.scale) @ self.basis
        triangle, lengths = scaled_triangle(np.column_stack((derivatives, at.target)), guarded=self.count)
        return replace(
            at,
            theta=free,
            triangle=triangle[: self.count, : self.count],
            target=lengths[-1] * triangle[: self.count, -1],
            scale=lengths[:-1],
        )

    def projected(self, at: Linearisation) -> FloatArray:
        """Free parameters (q,) that the linear model about unconstrained parameters prefers."""
        derivatives = at.triangle * at.scale
        target = derivatives @ (at.theta - self.base) - at.target
        return np.asarray(np.linalg.lstsq(derivatives @ self.basis, target, rcond=None)[0])

    def searched(self, orders: Orders, theta: FloatArray) -> FloatArray:
        """Parameters (p,) with D and F as one that are known altogether, which need not be stable."""
        searched = theta.copy()
        _, _, _, of_d, of_f = orders.ranges
        for positions in (of_d, *of_f):
            if not self.basis[positions].any():
                searched[positions] = 0.0
        return searched


def fixed_coefficients(fixed: FixedRows | None, orders: Orders, letters: str) -> Constraint | None:
    """Constraint of the coefficients that are known, None without any.

    Args:
        fixed: Polynomials by letter, as a `Polynomials` record has them: with the leading 1 of A, C, D and F and the nk
            leading zeros of B; NaN for what is estimated. With several inputs a row per input for B and F, or None.
        orders: The structure.
        letters: Polynomials of the method, such as "BF".

    Raises:
        SysidError: Another polynomial, a wrong length, values other than numbers, a leading coefficient other than 1 or
            zeros, a known C, D or F that is not stable, or nothing that remains to be estimated.
    """
    if fixed is None:
        return None
    values = np.full(orders.count, np.nan)
    for name, rows, positions, leading in _checked_rows(fixed, orders, letters):
        _write_row(values, name, rows, positions, leading)
    free = np.isnan(values)
    if not free.any():
        raise SysidError("fixed holds every coefficient, expected NaN for at least one that is estimated")
    if free.all():
        return None
    constraint = Constraint(np.where(free, 0.0, values), np.eye(orders.count)[:, free])
    _check_known_denominators(constraint, orders)
    return constraint


def _checked_rows(
    fixed: Mapping[str, Any], orders: Orders, letters: str
) -> Iterator[tuple[str, Any, slice, FloatArray]]:
    """Name, row, positions among the parameters, and leading coefficients, of every polynomial with known ones."""
    if not isinstance(fixed, Mapping):
        raise SysidError(
            f'fixed: expected polynomials by letter, e.g. {{"{letters[-1]}": [1, nan]}}, got {shown(fixed)}'
        )
    of_a, of_b, of_c, of_d, of_f = orders.ranges
    places = {"A": [of_a], "B": of_b, "C": [of_c], "D": [of_d], "F": of_f}
    seen: set[str] = set()
    for letter, given_rows in fixed.items():
        if not isinstance(letter, str) or letter.upper() not in letters or len(letter) != 1:
            raise SysidError(f"fixed: expected polynomials among {', '.join(letters)}, got {shown(letter)}")
        if letter.upper() in seen:
            raise SysidError(f"fixed: {letter.upper()} given twice, as {letter.lower()!r} too; expected it once")
        seen.add(letter.upper())
        positions = places[letter.upper()]
        rows = [given_rows]
        if len(positions) > 1:
            if not isinstance(given_rows, Sequence | np.ndarray) or len(given_rows) != len(positions):
                raise SysidError(
                    f"fixed: expected {len(positions)} rows of {letter}, one per input or None, got {shown(given_rows)}"
                )
            rows = list(given_rows)
        for j, (row, of_row) in enumerate(zip(rows, positions, strict=True)):
            if row is None:
                continue
            name = letter if len(rows) == 1 else f"{letter} of input {j + 1}"
            leading = np.zeros(orders.nk[j]) if letter.upper() == "B" else np.ones(1)
            yield name, row, of_row, leading


def _write_row(values: FloatArray, name: str, row: Any, positions: slice, leading: FloatArray) -> None:
    """Check the row of a polynomial and write its coefficients to their positions."""
    try:
        coefficients = np.array(row, dtype=float)
    except (TypeError, ValueError) as error:
        raise SysidError(f"fixed: expected numbers or NaN in {name}, got {shown(row)}") from error
    length = len(leading) + positions.stop - positions.start
    if coefficients.shape != (length,) or np.isinf(coefficients).any():
        raise SysidError(
            f"fixed: expected {length} finite numbers or NaN in {name}, its {len(leading)} leading "
            f"{_leading_name(leading)} among them, got {shown(row)}"
        )
    if not np.array_equal(coefficients[: len(leading)], leading):
        raise SysidError(
            f"fixed: expected {name} to begin with {len(leading)} leading {_leading_name(leading)}, got {shown(row)}"
        )
    values[positions] = coefficients[len(leading) :]


def _leading_name(leading: FloatArray) -> str:
    """Words for the leading coefficients of B or of another polynomial."""
    return "1" if leading.any() else "zeros of nk"


def _check_known_denominators(constraint: Constraint, orders: Orders) -> None:
    """Refuse a C, D or F that is known altogether and not stable; roots at one are taken for D and F."""
    _, _, c, d, f = orders.split(constraint.base)
    _, _, of_c, of_d, of_f = orders.ranges
    names = ["C", "D", *["F"] * len(f)]
    for name, polynomial, positions in zip(names, (c, d, *f), (of_c, of_d, *of_f), strict=True):
        radius = float(np.abs(np.roots(polynomial)).max(initial=0.0))
        limit = 1.0 - ON_THE_CIRCLE if name == "C" else 1.0 + ON_THE_CIRCLE
        if not constraint.basis[positions].any() and radius > limit:
            raise SysidError(f"fixed: the known {name} has a root of modulus {radius:.7g}, expected roots within one")


@dataclass(frozen=True, eq=False)
class ConstrainedCriterion:
    """Criterion of the free parameters, for `levenberg_marquardt`; of all of them without a constraint.

    Attributes:
        orders: The structure.
        constraint: The free parameters.
        samples: Of the longest experiment.
        of_all: Linearisation by all parameters (p,).
    """

    orders: Orders
    constraint: Constraint | None
    samples: int
    of_all: Callable[[FloatArray], Linearisation]

    def __call__(self, free: FloatArray, origin: FloatArray) -> Linearisation | None:
        """Linearisation at free parameters (q,) that a step from the `origin` leads to; None where unstable."""
        if not np.isfinite(free).all():
            return None
        if self.constraint is None:
            return self.of_all(move_roots_inside(self.orders, free, origin, self.samples))
        theta = self.constraint.full(free)
        # roots that are moved would move known coefficients: the search takes a shorter step
        if not admissible(self.orders, self.constraint.searched(self.orders, theta), self.samples):
            return None
        return self.constraint.reduced(self.of_all(theta), free)

    def full(self, free: FloatArray) -> FloatArray:
        """All parameters (p,)."""
        return free if self.constraint is None else self.constraint.full(free)

    def free(self, theta: FloatArray) -> FloatArray:
        """The free ones among all parameters (p,)."""
        return theta if self.constraint is None else self.constraint.nearest(theta)

    def outward(self, free: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Directions that lead out of the stable region (k, q), and how far it reaches (k,)."""
        rows, reach = outward(self.orders, self.full(free), samples=self.samples)
        if self.constraint is None:
            return rows, reach
        along = rows @ self.constraint.basis
        # known polynomials do not move
        moving = along.any(axis=1)
        return along[moving], reach[moving]


def constrained_search(
    experiments: Sequence[IOData],
    candidates: Iterable[InitialEstimate],
    orders: Orders,
    constraint: Constraint,
    *,
    max_iterations: int,
    initial_conditions: InitialConditions,
) -> Search:
    """Lowest minimum under a constraint; its linearisation is by the free parameters, but all of them are `theta`.

    Every unconstrained initial estimate gives two: the nearest admissible parameters, and the best ones by its linear
    model, which are efficient where it is a minimum [Ljung1999, app. II.2].

    Raises:
        SysidError: No initial estimate leads to stable C, D and F.
    """
    energy = sum(float(np.nansum(e.y**2)) for e in experiments)
    of_all = partial(linearise, experiments, orders, initial_conditions=initial_conditions)
    criterion = ConstrainedCriterion(orders, constraint, max(map(len, experiments)), of_all)

    def minimise(at: Linearisation, steps: int) -> Minimum:
        return levenberg_marquardt(criterion, at, energy, outward=criterion.outward, max_iterations=steps)

    screened: dict[str, Minimum] = {}
    for candidate in candidates:
        for name, free in _free_starts(experiments, candidate, orders, constraint, initial_conditions):
            at = criterion(free, free)
            if at is not None:
                screened[name] = minimise(at, min(SCREENING_STEPS, max_iterations))
    if not screened:
        raise SysidError(
            "no initial estimate with these fixed coefficients has C, D and F with all roots inside the unit circle: "
            "expected other coefficients, or start=Polynomials(...) that has them inside"
        )
    ranked = sorted(screened, key=lambda name: screened[name].at.cost)
    finished = {name: _finished(screened[name], minimise, max_iterations) for name in ranked[:REFINED]}
    chosen = min(finished, key=lambda name: finished[name].at.cost)
    best = finished[chosen]
    costs = {name: minimum.at.cost for name, minimum in screened.items()}
    full = replace(best, at=replace(best.at, theta=constraint.full(best.at.theta)))
    return Search(full, costs, chosen)


def _finished(minimum: Minimum, minimise: Callable[[Linearisation, int], Minimum], max_iterations: int) -> Minimum:
    """The minimum that a screened one leads to."""
    return minimum if minimum.converged else minimise(minimum.at, max_iterations)


def _free_starts(
    experiments: Sequence[IOData],
    candidate: InitialEstimate,
    orders: Orders,
    constraint: Constraint,
    initial_conditions: InitialConditions,
) -> Iterator[tuple[str, FloatArray]]:
    """Free parameters to start from, with their names, by an unconstrained initial estimate."""
    yield f"{candidate.name}, nearest", constraint.nearest(candidate.theta)
    if admissible(orders, candidate.theta):
        at = linearise(experiments, orders, candidate.theta, initial_conditions)
        yield f"{candidate.name}, projected", constraint.projected(at)
