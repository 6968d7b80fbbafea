"""Residual tests of the identified models, of right orders and of orders too low, and the choice of orders."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.stats import binom, chi2

from scenarios.bench.accuracy import error_against_bound
from scenarios.bench.measurement import Measurement, Measurements, dynamic_order
from scenarios.bench.metric import DRAWS, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.statistics import bound_for, interval_of_percentage
from scenarios.bench.theory import INDEPENDENCE, Expectation, expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

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

DRAWN = 100_000
SEED = 20_009


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

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Count rejections and right orders."""
        parts = []
        for name in PROBLEMS:
            own = [m for m in measurements if m.trial.problem == name]
            parts += [
                _size("whiteness", name, own, estimator, false_alarm),
                _size("independence", name, own, estimator, false_alarm),
                _power(name, own, estimator, false_alarm),
            ]
            if name in SELECTED:
                parts.append(_hits(name, own, estimator, false_alarm))
        return self.of_parts(
            parts,
            self.verdicts * false_alarm,
            f"rejections at the nominal {100 * LEVEL:g} % of right orders, at least {100 * POWER:g} % of orders too "
            f"low by one, at least {100 * HITS:g} % of chosen orders right",
        )


def _size(test: str, name: str, own: Measurements, estimator: Estimator, false_alarm: float) -> Part:
    """Share of models of right orders that a test rejects."""
    label = f"{test} on {name}"

    def p_value(m: Measurement) -> float:
        return m.whiteness_p if test == "whiteness" else m.independence_p

    known, why = _known(own, "fit", lambda m: bool(np.isfinite(p_value(m))))
    if not known:
        return unjudged(label, why)
    bound = bound_for(name, estimator.structure)
    share = size_of_independent_estimate(0 if bound is None else len(bound.parameters))
    most = int(binom.isf(false_alarm, len(known), share))
    theory = _theory(estimator, name)
    if test == INDEPENDENCE and not theory.passes:
        theory = _theory_of_independence(estimator, name, known)
    rejected = int(sum(p_value(m) < LEVEL for m in known))
    return _part(label, rejected, len(known), 100.0 * LEVEL, (-np.inf, 100.0 * most / len(known)), theory)


def _power(name: str, own: Measurements, estimator: Estimator, false_alarm: float) -> Part:
    """Share of models of too low an order that the tests reject."""
    label = f"orders too low on {name}"
    task = problem(name).task(estimator.structure, "underfit")
    if task is None:
        return unjudged(label, "its structure has no order that is too low")
    # an order that is too low for the disturbance alone is no fault of a model without one
    dynamics = dynamic_order(problem(name).truth) > order_of(task)
    known, why = _known(
        own, "underfit", lambda m: bool(np.isfinite(m.whiteness_p) or (dynamics and np.isfinite(m.independence_p)))
    )
    if not known:
        return unjudged(label, why)
    rejected = int(sum(m.whiteness_p < LEVEL or m.independence_p < LEVEL for m in known))
    least = int(binom.ppf(false_alarm, len(known), POWER))
    return _part(label, rejected, len(known), 100.0, (100.0 * least / len(known), 100.0), Expectation(True))


def _hits(name: str, own: Measurements, estimator: Estimator, false_alarm: float) -> Part:
    """Share of right orders among those that the estimator chooses."""
    label = f"choice on {name}"
    known, why = _known(own, "select", lambda m: m.order >= 0)
    if not known:
        return unjudged(label, why)
    task = problem(name).task(estimator.structure)
    if task is None:
        return unjudged(label, "its structure does not hold the dynamics")
    right = int(sum(m.order == order_of(task) for m in known))
    least = int(binom.ppf(false_alarm, len(known), HITS))
    return _part(label, right, len(known), 100.0, (100.0 * least / len(known), 100.0), _theory(estimator, name))


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
    statistic = rng.chisquare(LAGS - opened, DRAWN) if opened < LAGS else np.zeros(DRAWN)
    if opened:
        statistic = statistic + 2.0 * rng.chisquare(opened, DRAWN)
    return float(np.mean(statistic > chi2.isf(LEVEL, LAGS)))


def order_of(task: Task) -> int:
    """Number of states from input to output of a model with the orders of a task."""
    orders = task.orders
    if "order" in orders:
        return orders["order"]
    return max(orders.get("na", 0) + orders.get("nf", 0), orders["nb"] + orders["nk"] - 1)


def _theory(estimator: Estimator, name: str) -> Expectation:
    """Tests and criteria presume an estimate at the minimum of the prediction error, or close to it."""
    expected = expectation(estimator, name, "tests_and_orders")
    efficient = expectation(estimator, name, "efficiency")
    if not expected.passes or efficient.passes:
        return expected
    return Expectation(
        False,
        f"{efficient.why}; the excess of its error over the bound shows in the residuals, and criteria of orders "
        "compare minima that it does not look for",
    )


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


def _known(own: Measurements, ask: str, usable: Callable[[Measurement], bool]) -> tuple[list[Measurement], str]:
    """Usable measurements; none where there are too few, with the reason."""
    requests = [m for m in own if m.trial.ask == ask]
    if not requests:
        return [], "not asked"
    if all(m.kind == REFUSED for m in requests):
        return [], requests[0].why or "refused"
    known = [m for m in requests if m.kind == MODEL and usable(m)]
    if 2 * len(known) < len(requests):
        return [], f"{len(known)} of {len(requests)} records have a result: too few"
    return known, ""


def _part(
    label: str, count: int, total: int, expected: float, limits: tuple[float, float], theory: Expectation
) -> Part:
    value = 100.0 * float(count) / total
    return Part.judged(label, value, expected, interval_of_percentage(count, total), limits, theory, total)
