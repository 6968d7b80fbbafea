"""Residual tests of the identified models, of right orders and of orders too low, and the choice of orders."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.stats import binom, chi2

from scenarios.bench.measurement import Measurement, Measurements, dynamic_order
from scenarios.bench.metric import DRAWS, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.null_distributions import bound_for, error_against_bound
from scenarios.bench.theory import INDEPENDENCE, Expectation, expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid.validation.monte_carlo import exact_interval_of_share

PROBLEMS = ("p2", "p3", "p4", "p5")
SELECTED = ("p2", "p3", "p5")
"""Problems on which orders are chosen: all but the one whose fits take longest."""

RECORDS = {"fit": 40, "underfit": 10, "select": 10}
LEVEL = 0.01
"""Nominal level of the tests."""

LAGS = 25
"""Of the tests; see `sysid.resid`."""

POWER = 0.95
"""Least mean share of models of too low an order that the tests must reject."""

HITS = 0.9
"""Least mean share of right orders that a choice must have; consistent criteria have more."""

SMALL = 2.0
"""Mean square error, in bounds, that the test of independence must not show."""


class ResidualTestsAndOrders(MetricDefinition):
    """Share of models whose residuals are rejected, and of orders that are chosen rightly.

    Of right orders the tests should reject about 1 %: fewer where an efficient estimate was fitted to the same record,
    more where its error has nothing to do with the record's noise. The limit is that of the latter, so that nothing
    efficient fails it. Of orders too low by one they should reject nearly all.
    """

    name = "tests_and_orders"
    title = "Residual tests and choice of orders"
    unit = "%"
    verdicts = 3 * len(PROBLEMS) + len(SELECTED)  # whiteness, independence and power; choice of orders

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of some problems with right orders, with too low ones, and without."""
        return tuple(
            Trial(name, draw, ask)
            for name in PROBLEMS
            for ask, records in RECORDS.items()
            if ask != "select" or name in SELECTED
            for draw in range(records * DRAWS[effort])
        )

    def evaluate(self, evidence: Evidence) -> Metric:
        """Count rejections and right orders."""
        return self.of_parts(
            [part for name in PROBLEMS for part in _parts(name, evidence)],
            self.verdicts * evidence.false_alarm,
            f"rejections at the nominal {100 * LEVEL:g} % of right orders, at least {100 * POWER:g} % of orders too "
            f"low by one, at least {100 * HITS:g} % of chosen orders right",
        )


Result = Callable[[Measurement], bool | None]
"""Whether a model counts: is rejected, or has the right order; None where that is not known."""


def _parts(name: str, evidence: Evidence) -> list[Part]:
    """Share of models of right orders that each test rejects, of too low ones that any does, and of right choices."""
    estimator = evidence.estimator
    size = size_of_independent_estimate(len(bound_for(name, estimator.structure).parameters))
    right, low = (problem(name).task(estimator.structure, ask) for ask in ("fit", "underfit"))
    theory, efficient = (expectation(estimator, name, metric) for metric in ("tests_and_orders", "efficiency"))
    if theory.passes and not efficient.passes:
        # Tests and criteria presume an estimate at the minimum of the prediction error, or close to it.
        why = "the excess of its error over the bound shows in the residuals, and criteria of orders compare minima"
        theory = Expectation(False, f"{efficient.why}; {why} that it does not look for")
    independence = theory
    known = [m for m in evidence.on(name) if m.kind == MODEL and m.independence_p >= 0.0]
    if known and not theory.passes:
        independence = _theory_of_independence(estimator, name, known)

    def rejected_low(m: Measurement) -> bool | None:
        if m.whiteness_p >= 0.0 or (m.independence_p >= 0.0 and dynamics):
            return m.whiteness_p < LEVEL or m.independence_p < LEVEL
        return None

    # an order that is too low for the disturbance alone is no fault of a model without one
    dynamics = low is not None and dynamic_order(problem(name).truth) > order_of(low)
    no_low = "" if low else "its structure has no order that is too low"
    no_right = "" if right else "its structure does not hold the dynamics"

    def rejected(p: float) -> bool | None:
        return p < LEVEL if p >= 0.0 else None

    rows: list[tuple[str, str, Result, Expectation, str]] = [
        ("whiteness", "fit", lambda m: rejected(m.whiteness_p), theory, ""),
        (INDEPENDENCE, "fit", lambda m: rejected(m.independence_p), independence, ""),
        ("orders too low", "underfit", rejected_low, Expectation(True), no_low),
    ]
    if name in SELECTED:
        order = right and order_of(right)
        rows.append(("choice", "select", lambda m: m.order == order if m.order >= 0 else None, theory, no_right))
    parts = []
    for test, ask, result, expected, obstacle in rows:
        requests = evidence.on(name, ask)
        results = [value for m in requests if m.kind == MODEL and (value := result(m)) is not None]
        count, total = sum(results), len(results)
        label, why = f"{test} on {name}", obstacle
        if not why and not total and all(m.kind == REFUSED for m in requests):
            why = (requests[0].why or "refused") if requests else "not asked"
        if why or 2 * total < len(requests):
            parts.append(unjudged(label, why or f"{total} of {len(requests)} records have a result: too few"))
            continue
        limits = (-np.inf, 100.0 * int(binom.isf(evidence.false_alarm, total, size)) / total)
        if ask != "fit":
            least = {"underfit": POWER, "select": HITS}[ask]
            limits = (100.0 * int(binom.ppf(evidence.false_alarm, total, least)) / total, 100.0)
        interval, perfect = exact_interval_of_share(count, total, 100.0), 100.0 * LEVEL if ask == "fit" else 100.0
        parts.append(Part.judged(label, 100.0 * count / total, perfect, interval, limits, expected, total))
    return parts


@lru_cache(maxsize=64)
def size_of_independent_estimate(count: int) -> float:
    """How often a nominal test rejects an efficient estimate of so many parameters that is independent of the record.

    Correlations of the residuals at h lags are normal with unit covariance in the true model. An efficient estimate's
    error adds at most as much again in each of the directions that its parameters open, since the part of the record's
    information on them that the h lags hold is at most all of it; a fit to the same record takes as much away.
    """
    rng = np.random.default_rng(20_009)
    draws = 100_000
    opened = min(count, LAGS)
    statistic = rng.chisquare(LAGS - opened, draws) if opened < LAGS else np.zeros(draws)
    if opened:
        statistic = statistic + 2.0 * rng.chisquare(opened, draws)
    return float(np.mean(statistic > chi2.isf(LEVEL, LAGS)))


def order_of(task: Task) -> int:
    """Number of states from input to output of a model with the orders of a task."""
    orders = task.orders
    if "order" in orders:
        return orders["order"]
    return max(orders.get("na", 0) + orders.get("nf", 0), orders["nb"] + orders["nk"] - 1)


def _theory_of_independence(estimator: Estimator, name: str, known: Measurements) -> Expectation:
    """Of residuals and past inputs, both whitened: a model of the disturbance is not needed, if the error is small.

    An unbiased estimate is an efficient one with an independent error [Rao1973, sec. 5a]. The limit holds an error of
    one bound that is independent of the record, and more where, as here, all but the excess over the bound depends on
    it.
    """
    expected = expectation(estimator, name, INDEPENDENCE)
    if not expected.passes:
        return expected
    errors = error_against_bound([m for m in known if m.response is not None], name, estimator.structure)
    size = float(np.mean(errors)) if len(errors) else np.inf
    if size <= SMALL:
        return Expectation(True)
    return Expectation(
        False,
        f"{expectation(estimator, name, 'efficiency').why}; residuals would be independent of past inputs, but with a "
        f"mean square error of {size:.3g} times the bound the excess over the bound shows in them",
    )
