"""Metric: how often residual tests reject models of right and of too low order, and the right order is chosen."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, product

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
        trials = []
        for name, (ask, records) in product(PROBLEMS, RECORDS.items()):
            if ask != "select" or name in SELECTED:
                trials += [Trial(name, draw, ask) for draw in range(records * DRAWS[effort])]
        return tuple(trials)

    def evaluate(self, evidence: Evidence) -> Metric:
        """Count rejections and right orders."""
        return self.of_parts(
            list(chain.from_iterable(_parts(name, evidence) for name in PROBLEMS)),
            self.verdicts * evidence.false_alarm,
            f"rejections at the nominal {100 * LEVEL:g} % of right orders, at least {100 * POWER:g} % of orders too "
            f"low by one, at least {100 * HITS:g} % of chosen orders right",
        )


@dataclass(frozen=True)
class ResidualTest:
    """A test of the models of one kind of request.

    Attributes:
        name: Beginning of the label of its part.
        ask: Kind of the requests.
        counts: Whether a model counts: is rejected, or has the right order; None where that is not known.
        theory: What theory expects.
        obstacle: Why there is no such test on the problem; empty where there is.
    """

    name: str
    ask: str
    counts: Callable[[Measurement], bool | None]
    theory: Expectation
    obstacle: str = ""


def _parts(name: str, evidence: Evidence) -> list[Part]:
    """Share of models of right orders that each test rejects, of too low ones that any does, and of right choices."""
    structure = evidence.estimator.structure
    size = size_of_independent_estimate(len(bound_for(name, structure).parameters))
    return [_part(test, name, evidence, size) for test in _tests_on(name, evidence)]


def _tests_on(name: str, evidence: Evidence) -> list[ResidualTest]:
    """The tests on a problem, with what theory expects of each."""
    estimator = evidence.estimator
    right = problem(name).task(estimator.structure, "fit")
    too_low = problem(name).task(estimator.structure, "underfit")
    theory = _theory_of_tests(estimator, name)
    independence = theory
    tested = [m for m in evidence.on(name) if m.kind == MODEL and m.independence_p >= 0.0]
    if tested and not theory.passes:
        independence = _theory_of_independence(estimator, name, tested)
    # An order that is too low for the disturbance alone is no fault of a model without one.
    dynamics = too_low is not None and dynamic_order(problem(name).truth) > order_of(too_low)

    def rejected_low(m: Measurement) -> bool | None:
        if m.whiteness_p >= 0.0 or (m.independence_p >= 0.0 and dynamics):
            return m.whiteness_p < LEVEL or m.independence_p < LEVEL
        return None

    def order_is_right(m: Measurement) -> bool | None:
        return m.order == right_order if m.order >= 0 else None

    no_low = "" if too_low else "its structure has no order that is too low"
    tests = [
        ResidualTest("whiteness", "fit", lambda m: _rejected(m.whiteness_p), theory),
        ResidualTest(INDEPENDENCE, "fit", lambda m: _rejected(m.independence_p), independence),
        ResidualTest("orders too low", "underfit", rejected_low, Expectation(True), no_low),
    ]
    if name in SELECTED:
        right_order = right and order_of(right)
        no_right = "" if right else "its structure does not hold the dynamics"
        tests.append(ResidualTest("choice", "select", order_is_right, theory, no_right))
    return tests


def _rejected(p_value: float) -> bool | None:
    """Whether a test rejects a model; None where it was not made (NaN)."""
    return p_value < LEVEL if p_value >= 0.0 else None


def _theory_of_tests(estimator: Estimator, name: str) -> Expectation:
    theory = expectation(estimator, name, "tests_and_orders")
    efficient = expectation(estimator, name, "efficiency")
    if efficient.passes or not theory.passes:
        return theory
    # Tests and criteria presume an estimate at the minimum of the prediction error, or close to it.
    why = "the excess of its error over the bound shows in the residuals, and criteria of orders compare minima"
    return Expectation(False, f"{efficient.why}; {why} that it does not look for")


def _part(test: ResidualTest, name: str, evidence: Evidence, size: float) -> Part:
    """The share of models that count, judged.

    Args:
        test: The test.
        name: The problem.
        evidence: Measurements.
        size: How often the test rejects an efficient estimate that is independent of the record.
    """
    requests = evidence.on(name, test.ask)
    results = [test.counts(m) for m in requests if m.kind == MODEL]
    results = [result for result in results if result is not None]
    count, total = sum(map(bool, results)), len(results)
    label, why = f"{test.name} on {name}", test.obstacle
    if not why and not requests:
        why = "not asked"
    elif not why and all(m.kind == REFUSED for m in requests):
        why = requests[0].why or "refused"
    if why or 2 * total < len(requests):
        return unjudged(label, why or f"{total} of {len(requests)} records have a result: too few")
    # Limits of binomial counts. Of right orders too many rejections fail, of the others too few.
    if test.ask == "fit":
        expected, limits = 100.0 * LEVEL, (-np.inf, 100.0 * int(binom.isf(evidence.false_alarm, total, size)) / total)
    else:
        share = {"underfit": POWER, "select": HITS}[test.ask]
        expected, limits = 100.0, (100.0 * int(binom.ppf(evidence.false_alarm, total, share)) / total, 100.0)
    interval = exact_interval_of_share(count, total, 100.0)
    return Part.judged(label, 100.0 * count / total, expected, interval, limits, test.theory, total)


@lru_cache(maxsize=64)
def size_of_independent_estimate(count: int) -> float:
    """How often a nominal test rejects an efficient estimate of so many parameters that is independent of the record.

    Correlations of the residuals at h lags are normal with unit covariance in the true model. An efficient estimate's
    error adds at most as much again in each of the directions that its parameters open, since the part of the record's
    information on them that the h lags hold is at most all of it; a fit to the same record takes as much away.
    """
    rng = np.random.default_rng(20_009)
    draws = 100_000
    # An estimate opens no more directions than there are lags.
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
    # Coefficients of B beyond the order of the poles, and the delay, take states too.
    return max(orders.get("na", 0) + orders.get("nf", 0), orders["nb"] + orders["nk"] - 1)


def _theory_of_independence(estimator: Estimator, name: str, tested: Measurements) -> Expectation:
    """Of residuals and past inputs, both whitened: a model of the disturbance is not needed, if the error is small.

    An unbiased estimate is an efficient one with an independent error [Rao1973, sec. 5a]. The limit holds an error of
    one bound that is independent of the record, and more where, as here, all but the excess over the bound depends on
    it.
    """
    expected = expectation(estimator, name, INDEPENDENCE)
    if not expected.passes:
        return expected
    errors = error_against_bound([m for m in tested if m.response is not None], name, estimator.structure)
    size = float(np.mean(errors)) if len(errors) else np.inf
    if size <= SMALL:
        return Expectation(True)
    return Expectation(
        False,
        f"{expectation(estimator, name, 'efficiency').why}; residuals would be independent of past inputs, but with a "
        f"mean square error of {size:.3g} times the bound the excess over the bound shows in them",
    )
