"""Residual tests of the identified models, of right orders and of orders too low, and the choice of orders."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.stats import binom, chi2

from scenarios.bench.efficiency import power_against_bound
from scenarios.bench.measure import dynamic_order
from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS, Figure, Part
from scenarios.bench.perfect_records import bound_for
from scenarios.bench.reliability import interval_of_share
from scenarios.bench.theory import INDEPENDENCE, Expectation, expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.task import Task
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

PROBLEMS = ("p2", "p3", "p4", "p5")
SELECTED = ("p2", "p3", "p5")
"""Of them where orders are chosen: all but the one whose fits take longest."""

RECORDS = {"fit": 40, "underfit": 10, "select": 10}
LEVEL = 0.01
"""Of the tests."""

LAGS = 25
"""That the tests look at; see `sysid.resid`."""

POWER = 0.95
"""Share of models of too low an order that the tests must at least reject in the mean."""

HITS = 0.9
"""Share of right orders that a choice must at least have in the mean; consistent criteria have more."""

SMALL = 2.0
"""Mean square error, in bounds, that the test of independence must not show."""

SINGLES = 100_000
SEED = 20_009


@dataclass(frozen=True)
class ResidualTestsAndOrders:
    """Share of models whose residuals are rejected, and of orders that are chosen rightly.

    Of right orders the tests should reject about 1 %: fewer where an efficient estimate was fitted to the same record,
    more where its error has nothing to do with the record's noise. The limit is that of the latter, so that nothing
    efficient fails it. Of orders too low by one they should reject nearly all.
    """

    name: str = "tests_and_orders"
    title: str = "Residual tests and choice of orders"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of some problems with right orders, with too low ones, and without."""
        return tuple(
            Trial(name, draw, ask)
            for name in PROBLEMS
            for ask, records in RECORDS.items()
            if ask != "select" or name in SELECTED
            for draw in range(records * DRAWS[effort])
        )

    def verdicts(self) -> int:
        """Whiteness, independence and power per problem, and the choice where orders are chosen."""
        return 3 * len(PROBLEMS) + len(SELECTED)

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Count rejections and hits."""
        del referee
        parts = []
        for name in PROBLEMS:
            own = [m for m in measured if m.trial.problem == name]
            bound = bound_for(name, contestant.structure)
            parts += [
                _size("whiteness", name, own, contestant, bound, false_alarm),
                _size("independence", name, own, contestant, bound, false_alarm),
                _power(name, own, contestant, false_alarm),
            ]
            if name in SELECTED:
                parts.append(_hits(name, own, contestant, false_alarm))
        return figure_of_parts(
            self.name,
            self.title,
            "%",
            parts,
            self.verdicts() * false_alarm,
            f"rejections at the nominal {100 * LEVEL:g} % of right orders, at least {100 * POWER:g} % of orders too "
            f"low by one, at least {100 * HITS:g} % of chosen orders right",
        )


def _size(
    test: str,
    name: str,
    own: Sequence[Measured],
    contestant: Contestant,
    bound: Bound | None,
    false_alarm: float,
) -> Part:
    label = f"{test} on {name}"
    values = {"whiteness": lambda m: m.whiteness_p, "independence": lambda m: m.independence_p}[test]
    known, why = _known(own, "fit", lambda m: bool(np.isfinite(values(m))))
    if known is None:
        return unjudged(label, why)
    found = int(sum(values(m) < LEVEL for m in known))
    count = 0 if bound is None else len(bound.parameters)
    share = size_of_independent_estimate(count)
    most = int(binom.isf(false_alarm, len(known), share))
    theory = _theory(contestant, name)
    if test == INDEPENDENCE and not theory.passes:
        theory = _theory_of_independence(contestant, name, known)
    return _part(label, found, known, 100.0 * LEVEL, (-np.inf, 100.0 * most / len(known)), theory.passes, theory.why)


def _power(name: str, own: Sequence[Measured], contestant: Contestant, false_alarm: float) -> Part:
    label = f"orders too low on {name}"
    task = problem(name).task(contestant.structure, "underfit")
    if task is None:
        return unjudged(label, "its structure has no order that is too low")
    # an order that is too low for the disturbance alone says nothing against a model without one
    dynamics = dynamic_order(problem(name).truth) > order_of(task)
    known, why = _known(
        own, "underfit", lambda m: bool(np.isfinite(m.whiteness_p) or (dynamics and np.isfinite(m.independence_p)))
    )
    if known is None:
        return unjudged(label, why)
    found = int(sum(m.whiteness_p < LEVEL or m.independence_p < LEVEL for m in known))
    least = int(binom.ppf(false_alarm, len(known), POWER))
    return _part(label, found, known, 100.0, (100.0 * least / len(known), 100.0))


def _hits(name: str, own: Sequence[Measured], contestant: Contestant, false_alarm: float) -> Part:
    label = f"choice on {name}"
    known, why = _known(own, "select", lambda m: m.order >= 0)
    if known is None:
        return unjudged(label, why)
    task = problem(name).task(contestant.structure)
    if task is None:
        return unjudged(label, "its structure does not hold the dynamics")
    found = int(sum(m.order == order_of(task) for m in known))
    least = int(binom.ppf(false_alarm, len(known), HITS))
    theory = _theory(contestant, name)
    return _part(label, found, known, 100.0, (100.0 * least / len(known), 100.0), theory.passes, theory.why)


@lru_cache(maxsize=64)
def size_of_independent_estimate(count: int) -> float:
    """How often a test at the nominal level rejects an efficient estimate whose error is independent of the record.

    Correlations of the residuals at h lags are normal with unit covariance in the true model. An efficient estimate's
    error adds at most as much again in each of the directions that its parameters open, since the part of the record's
    information on them that the h lags hold is at most all of it; a fit to the same record takes as much away.

    Args:
        count: Number of parameters.
    """
    rng = np.random.default_rng(SEED)
    opened = min(count, LAGS)
    statistic = rng.chisquare(LAGS - opened, SINGLES) if opened < LAGS else np.zeros(SINGLES)
    if opened:
        statistic = statistic + 2.0 * rng.chisquare(opened, SINGLES)
    return float(np.mean(statistic > chi2.isf(LEVEL, LAGS)))


def order_of(task: Task) -> int:
    """Number of states from input to output of a model with the orders of a task."""
    orders = task.orders
    if "order" in orders:
        return orders["order"]
    return max(orders.get("na", 0) + orders.get("nf", 0), orders["nb"] + orders["nk"] - 1)


def _theory(contestant: Contestant, name: str) -> Expectation:
    """Of what a method gives: tests and criteria presume the minimum of the prediction error, or close to it."""
    own = expectation(contestant, name, "tests_and_orders")
    if not own.passes:
        return own
    efficient = expectation(contestant, name, "efficiency")
    if efficient.passes:
        return own
    return Expectation(
        False,
        f"{efficient.why}; what its error has beyond the bound shows in the residuals, and criteria of orders compare "
        "minima that it does not look for",
    )


def _theory_of_independence(contestant: Contestant, name: str, known: Sequence[Measured]) -> Expectation:
    """Of residuals and past inputs, both whitened: a model of the disturbance is not needed, if the error is small.

    An unbiased estimate is an efficient one with an independent error [Rao1973, sec. 5a]. The limit holds an error of
    one bound that is independent of the record, and more where, as here, all but what lies beyond the bound depends on
    it.
    """
    own = expectation(contestant, name, INDEPENDENCE)
    if not own.passes:
        return own
    errors = power_against_bound([m for m in known if m.response is not None], name, contestant.structure)
    size = float(np.mean(errors)) if len(errors) else np.inf
    if size <= SMALL:
        return Expectation(True)
    return Expectation(
        False,
        f"{expectation(contestant, name, 'efficiency').why}; independence of past inputs would stand, but with a mean "
        f"square error of {size:.3g} times the bound what it has beyond the bound shows in the residuals",
    )


def _known(own: Sequence[Measured], ask: str, told: Callable[[Measured], bool]) -> tuple[list[Measured] | None, str]:
    """Trials of which something is known, or why there is no verdict."""
    asked = [m for m in own if m.trial.ask == ask]
    if not asked:
        return None, "not asked"
    if all(m.kind == REFUSED for m in asked):
        return None, asked[0].why or "refused"
    known = [m for m in asked if m.kind == MODEL and told(m)]
    if 2 * len(known) < len(asked):
        return None, f"{len(known)} of {len(asked)} records tell of it: too few"
    return known, ""


def _part(
    label: str,
    found: int,
    known: Sequence[Measured],
    expected: float,
    limits: tuple[float, float],
    theory: bool = True,
    why: str = "",
) -> Part:
    value = 100.0 * float(found) / len(known)
    return Part(
        label=label,
        value=value,
        expected=expected,
        interval=interval_of_share(found, len(known)),
        limits=limits,
        passed=bool(limits[0] <= value <= limits[1]),
        theory=theory,
        why=why,
        draws=len(known),
    )
