"""Search for the structure, delay and orders of a model by a criterion, each candidate fitted in a few steps."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import Any, TypeVar

import numpy as np

from sysid.models.estimate import mean_square
from sysid.models.polynomials import innovations_form, stabilised
from sysid.models.predict import predict
from sysid.models.state_space import StateSpace
from sysid.polynomial.error_jacobian import error_jacobian, gapped_error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.initial_estimates import (
    armax_initial_estimates,
    bj_initial_estimates,
    check_room_to_start,
    completed,
    oe_initial_estimates,
)
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import check_enough_data
from sysid.polynomial.prediction_error import InitialEstimate, search
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.subspace import n4sid, pem_ss
from sysid.validation.structure_scan import Order, parameter_count

Experiments = tuple[IOData, ...]
Rung = TypeVar("Rung")

PATIENCE = 2  # orders in a row that are tried beyond the best of a structure

SEARCHED = 2.0
"""Penalty of a parameter beyond Schwarz's log(N): with more parameters there are more structures to choose from, about
exp(p) times as many with p of some ten coefficients [ChenChen2008]."""

FAR = 100.0  # EBIC above the best from which on a structure does not climb again from the shortest delays
NEAR = 30.0  # EBIC above the best up to which a family is refined: some five superfluous parameters
REFINED = 8  # rounds of changes of single orders, at most
STEPS = 15  # iterations of a candidate, at most: those that are far too large take the most, and are not chosen
STARTS = 2  # initial estimates of its own that a candidate may have, beside the nearest fits
FILLING = 4  # orders on which the length of the ARX model that fills gaps depends
EXACT = 1e-20  # loss, relative to the mean square output, that is rounding of data without noise

LIMIT = 1.0 - 1e-6
"""Radius at which roots of starts are kept; roots of the input path beyond it are at the edge of stability."""

EDGE = 30.0
"""EBIC by which a candidate at the edge of stability must be better: an integrator is, a pole in the noise is not."""

ORDERS: Mapping[str, tuple[str, ...]] = {
    "arx": ("na", "nb", "nk"),
    "oe": ("nb", "nf", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
}
"""Structures of one output with their orders, the simpler first."""

FAMILIES = (("arx", "armax"), ("oe", "bj"))  # structures that pass into one another when single orders change

DISTURBANCE = 2
"""Orders of C and D in rising Box-Jenkins models: a resonance, which single steps from fewer poles do not reach."""


@dataclass(frozen=True)
class Candidate:
    """A structure with its orders, and how it fits.

    Attributes:
        method: Name of the estimator.
        orders: Its orders by name.
        parameters: Number of parameters.
        loss: Mean square of the one-step errors on the samples that all candidates share; with several outputs the
            ny-th root of the determinant of their covariance.
        ebic: Extended BIC, N log det(R) + p (log(N) + `SEARCHED`): a difference of 10 is strong evidence
            [KassRaftery1995].
        validation: Mean square error of the simulated validation outputs, each over its variance; NaN without such
            data.
        radius: Largest modulus of the poles from input to output.
    """

    method: str
    orders: Mapping[str, Order]
    parameters: int
    loss: float
    ebic: float
    validation: float
    radius: float

    def __str__(self) -> str:
        """Method and orders."""
        return f"{self.method} " + " ".join(f"{name}={order}" for name, order in self.orders.items())

    @property
    def remark(self) -> str:
        """Whether the model is unstable or nearly so; empty if not."""
        return "unstable" if self.radius >= 1.0 else "edge of stability" if self.radius > LIMIT else ""


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a candidate with one output.

    Attributes:
        orders: Layout of the parameters.
        theta: The parameters (p,).
        candidate: How they fit.
    """

    orders: Orders
    theta: FloatArray
    candidate: Candidate


class StructureSearch:
    """Candidates fitted so far, all judged on the same samples."""

    def __init__(self, experiments: Experiments, others: Experiments, largest: int, methods: Sequence[str]) -> None:
        self.experiments, self.others, self.largest, self.methods = experiments, others, largest, methods
        self.candidates: list[Candidate] = []
        self.fits: dict[Orders, Fit] = {}
        self.power = mean_square(np.concatenate([e.y[e.known.all(axis=1)] for e in experiments]))
        self.exact = False
        self.direct = True
        self.failed: list[str] = []
        # initial estimates need complete outputs
        nu = experiments[0].nu
        gaps = experiments[0].ny == 1 and not all(e.complete for e in experiments)
        filling = Orders(FILLING, (FILLING,) * nu, 0, 0, (0,) * nu, (1,) * nu)
        self.filled = completed(experiments, filling) if gaps else experiments
        # longest initial transient of all candidates
        start = 2 * largest
        self.skipped = [min(max(e.window, start), len(e) // 2) for e in experiments]
        known = (e.known[s:].all(axis=1) for e, s in zip(experiments, self.skipped, strict=True))
        self.samples = int(sum(map(np.count_nonzero, known)))

    def climb_structures(self, delays: tuple[int, ...]) -> None:
        """Try rising orders of every structure, then change single orders of the best ones."""

        def rung(name: str, n: int, nk: tuple[int, ...]) -> Orders:
            b, none = (n,) * len(nk), (0,) * len(nk)
            if name in FAMILIES[0]:
                return Orders(n, b, n if name == "armax" else 0, 0, none, nk)
            colour = DISTURBANCE if name == "bj" else 0
            return Orders(0, b, colour, colour, b, nk)

        # a slow beginning of the response looks like a delay: those that fit well climb from the shortest one too
        shortest = tuple(min(delay, 1) for delay in delays)
        for nk in dict.fromkeys((delays, shortest)):
            limit = min(map(self.criterion, self.candidates), default=np.inf) + FAR
            least = {name: min(self._criteria([name]), default=limit) for name in ORDERS if name in self.methods}
            for name, value in least.items():
                if value <= limit:
                    self._climb([rung(name, n, nk) for n in range(1, self.largest + 1)], self.try_orders)
        for family in FAMILIES:
            # a direct term only where the data show one: a held input has none
            self._refine(family, shortest)

    def climb_states(self) -> None:
        """Try rising orders of a state-space model."""
        self._climb(range(1, self.largest + 1), self._try_states)

    def _climb(self, ladder: Iterable[Rung], attempt: Callable[[Rung], Candidate | None]) -> None:
        """Raise the order until `PATIENCE` in a row are no better than the best."""
        best, at = np.inf, 0
        for n, rung in enumerate(ladder):
            if self.exact:
                # rounding alone would choose among the rest
                break
            value = self.criterion(attempt(rung))
            best, at = (value, n) if value < best else (best, at)
            if n - at >= PATIENCE and np.isfinite(best):
                break

    def _refine(self, family: Sequence[str], least: Sequence[int]) -> None:
        """Change single orders of the best candidate of a family, if near the best of all, as long as that helps."""
        fits = [fit for fit in self.fits.values() if fit.candidate.method in family]
        if min(self._criteria(family), default=np.inf) > min(self._criteria(ORDERS), default=np.inf) + NEAR or not fits:
            return
        best = min(fits, key=lambda fit: self.criterion(fit.candidate))
        for _ in range(REFINED):
            names = {name for method in family if method in self.methods for name in ORDERS[method]}
            around = [
                one
                for one in _neighbours(best.orders, names)
                if np.all(np.greater_equal(one.nk, least)) and _structure(one) in self.methods
            ]
            for orders in around:
                self.try_orders(orders, best)
            near = [self.fits[orders] for orders in around if orders in self.fits]
            better = min(near, key=lambda fit: self.criterion(fit.candidate), default=best)
            if self.criterion(better.candidate) >= self.criterion(best.candidate):
                break
            best = better

    def _try_states(self, order: int) -> Candidate | None:
        try:
            estimate = pem_ss(
                self.experiments,
                n4sid(complete_parts(self.experiments), order, direct=self.direct),
                direct=self.direct,
                max_iterations=2 * STEPS,
            )
        except SysidError as error:
            self.failed.append(f"order {order}: {error}")
            return None
        ends = np.cumsum([len(e) for e in self.experiments])[:-1]
        errors = np.split(estimate.residuals, ends)
        path = estimate.model.input_path()
        return self._judged("pem_ss", {"order": order}, parameter_count(estimate), errors, path)

    def try_orders(self, orders: Orders, base: Fit | None = None) -> Candidate | None:
        """Fit a candidate in few steps, unless that was done before; None if it cannot be fitted."""
        if orders not in self.fits:
            try:
                check_enough_data(self.experiments, orders, max(orders.nc, orders.nd) + sum(orders.nf))
                check_room_to_start(self.experiments, orders)
                theta = search(
                    self.experiments,
                    lambda wanted: self._starts(wanted, base),
                    orders,
                    smaller_too=False,
                    thorough=False,
                    max_iterations=STEPS,
                ).best.at.theta
            except SysidError as error:
                self.failed.append(f"{orders}: {error}")
                return None
            method = _structure(orders)
            polynomials = orders.polynomials(theta)
            candidate = self._judged(
                method,
                orders.select(*ORDERS[method]),
                orders.count,
                [_errors(e, orders, theta) for e in self.experiments],
                innovations_form(replace(polynomials, C=np.ones(1), D=np.ones(1)), self.experiments[0].dt, 1.0),
            )
            self.fits[orders] = Fit(orders, theta, candidate)
        return self.fits[orders].candidate

    def _starts(self, orders: Orders, base: Fit | None) -> Iterator[InitialEstimate]:
        """The best smaller fit, the base of the change, and without a base some that do not depend on earlier fits."""
        smaller = [fit for fit in self.fits.values() if _nested(fit.orders, orders)]
        nearest = {"smaller": min(smaller, key=lambda fit: fit.candidate.loss, default=None), "base": base}
        for name, fit in nearest.items():
            if fit is not None:
                yield InitialEstimate(name, _resized(fit, orders))
        if base is None:
            own = armax_initial_estimates if orders.na else bj_initial_estimates
            own = own if orders.na or orders.nc or orders.nd else oe_initial_estimates
            yield from islice(own(self.filled, orders), STARTS)

    def _judged(
        self, method: str, orders: Mapping[str, Order], count: int, parts: Sequence[FloatArray], path: StateSpace
    ) -> Candidate:
        errors = np.concatenate([part[s:] for part, s in zip(parts, self.skipped, strict=True)])
        loss = mean_square(errors[np.isfinite(errors).all(axis=1)])
        rounding = max(EXACT * self.power, np.finfo(float).tiny)
        self.exact = self.exact or loss <= rounding
        likelihood = self.samples * errors.shape[1] * np.log(max(loss, rounding))
        ebic = float(likelihood + count * (np.log(self.samples) + SEARCHED))
        radius = float(np.abs(path.poles()).max(initial=0.0))
        self.candidates.append(Candidate(method, orders, count, loss, ebic, self._validated(path), radius))
        return self.candidates[-1]

    def _validated(self, path: StateSpace) -> float:
        if not self.others:
            return np.nan
        errors = [((e.y - predict(path, e, steps=None)) / np.nanstd(e.y, axis=0))[e.window :] for e in self.others]
        return float(np.nanmean(np.concatenate(errors) ** 2))

    def _criteria(self, methods: Iterable[str]) -> list[float]:
        return [self.criterion(one) for one in self.candidates if one.method in methods]

    def criterion(self, one: Candidate | None) -> float:
        """What is to be small: the validation error, else EBIC; infinite for what failed or is unstable."""
        if one is None or one.radius >= 1.0:
            return np.inf
        return one.validation if self.others else one.ebic + EDGE * (one.radius > LIMIT)

    def ranked(self) -> tuple[Candidate, ...]:
        """All candidates, the best first, unstable ones last; `SysidError` if there are none."""
        if not self.candidates:
            raise SysidError(f"no candidate could be fitted: {'; '.join(self.failed[:3])}")
        return tuple(sorted(self.candidates, key=lambda one: (self.criterion(one), one.ebic, one.parameters)))


def complete_parts(experiments: Experiments) -> list[IOData]:
    """Experiments without gaps."""
    return [part for e in experiments for part in e.complete_parts()]


def _errors(experiment: IOData, orders: Orders, theta: FloatArray) -> FloatArray:
    """One-step errors (N, 1), NaN where the output is missing."""
    jacobian = error_jacobian if experiment.complete else gapped_error_jacobian
    errors = jacobian(experiment, orders, theta, InitialConditions.ESTIMATED).columns[:, -1:]
    start = np.zeros((len(experiment) - len(errors), 1))
    return np.where(experiment.known, np.vstack((start, errors)), np.nan)


def _structure(orders: Orders) -> str:
    """Name of the simplest structure, arx to bj, with every polynomial whose order is not zero."""
    used = {name for name in ("na", "nc", "nd", "nf") if np.any(getattr(orders, name))}
    return next(name for name, own in ORDERS.items() if used <= set(own))


def _nested(small: Orders, large: Orders) -> bool:
    """Whether a structure is part of another one with the same delays."""
    pairs = ((getattr(small, name), getattr(large, name)) for name in ("na", "nb", "nc", "nd", "nf"))
    return small.nk == large.nk and all(np.all(np.less_equal(a, b)) for a, b in pairs)


def _resized(fit: Fit, orders: Orders) -> FloatArray:
    """Parameters of a fit in other orders (p,): coefficients cut off or filled with zeros, roots kept inside."""

    def cut(row: FloatArray, length: int) -> FloatArray:
        return np.pad(row[:length], (0, max(length - len(row), 0)))

    a, b, c, d, f = fit.orders.split(fit.theta)
    return orders.join(
        cut(a, orders.na + 1),
        [cut(row, k + n) for row, k, n in zip(b, orders.nk, orders.nb, strict=True)],
        stabilised(cut(c, orders.nc + 1), LIMIT),
        stabilised(cut(d, orders.nd + 1), LIMIT),
        [stabilised(cut(row, n + 1), LIMIT) for row, n in zip(f, orders.nf, strict=True)],
    )


def _neighbours(orders: Orders, names: Iterable[str]) -> Iterator[Orders]:
    """Orders that differ by one in one place, and delays that leave the last lag of the input where it is."""

    def changed(name: str, place: int, step: int, of: Orders = orders) -> Orders:
        value = getattr(of, name)
        new: Any = (
            value + step if isinstance(value, int) else (*value[:place], value[place] + step, *value[place + 1 :])
        )
        return replace(of, **{name: new})

    moves = [
        (name, place, step)
        for name in sorted(names)
        for place in range(np.size(getattr(orders, name)))
        for step in (-1, 1)
    ]
    both = (
        changed("nb", place, -step, changed(*move)) for move in moves for name, place, step in [move] if name == "nk"
    )
    for one in chain((changed(*move) for move in moves), both):
        if min(one.na, one.nc, one.nd, *one.nf, *one.nk) >= 0 and min(one.nb) >= 1:
            yield one
