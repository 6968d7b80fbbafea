"""How often the test bench's metrics fail a perfect estimator.

    python tests/benchmarks/bench_simulated.py [RUNS]

Errors of simulated estimators are drawn from the Cramér-Rao bound, without records. Four tables: of each statistic and
problem, how often the mean over 100 records of a perfect estimator lies outside limits without slack; the same of the
test of mean errors; how often that test detects a mean of a given size; how often whole metrics fail a perfect
estimator in RUNS runs (2000) of the quick effort. The exit code is 1 where a rate exceeds the nominal one by a tenth of
it and four standard errors.
"""

import sys

import numpy as np
from scipy.stats import chi2, f, ncf

from scenarios.bench.accuracy import QUICK, RECORDS, Agreement, Efficiency
from scenarios.bench.bias import ALLOWED, ALONE, DIRECTIONS, Bias
from scenarios.bench.claims import COVERAGE, Coverage, NormalisedError, ResponseError, limits_by_frequency
from scenarios.bench.consistency import LENGTHS, Consistency, NoiseFreeRecovery, perfect_slopes
from scenarios.bench.consistency import QUICK as SLOPES
from scenarios.bench.consistency import RECORDS as SLOPE_RECORDS
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Evidence
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.bench.statistics import (
    NULL_BANDWIDTH_COVERAGE,
    bound_for,
    null_chi_square,
    null_distribution,
    null_parameter_coverage,
    statistic_of_perfect,
)
from scenarios.bench.tests_and_orders import LAGS, ResidualTestsAndOrders
from scenarios.estimators.estimator import Estimator
from sysid.validation.mean_error import f_statistic
from sysid.validation.monte_carlo import limits_of_mean
from sysid.validation.response_errors import (
    covered_share,
    free_parts,
    normalised_square,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)
from tests.benchmarks.simulated_estimators import Fault, simulated
from tests.benchmarks.tables import heading, row

NOMINAL = (1e-2, 1e-3, 1e-4)
SIZES = (0.0, 0.2, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
SETS = 20_000
SEED = 77
ESTIMATOR = Estimator("simulated", "bench:perfect")
ACCURACY = (NoiseFreeRecovery(), Consistency(), Efficiency(), Coverage(), NormalisedError(), ResponseError())


def rates_row(labels, rates, sets):
    """Print rates; count those that exceed the nominal one by more than a tenth of it and four standard errors."""
    row(*labels, *(f"{rate:.2g}" for rate in rates))
    return sum(rate > 1.1 * p + 4.0 * np.sqrt(p / sets) for rate, p in zip(rates, NOMINAL, strict=True))


def statistics():
    """Label, problem, means of many sets, single records, records in a set, number of sides."""
    rng = np.random.default_rng(SEED)
    for name in QUICK:
        bound = bound_for(name, None)
        for label, statistic, mean, sides in (
            ("squares over the bound", variance_ratio, 1.0, 1),
            ("squares over the claim", variance_ratio, 1.0, 2),
            ("normalised error of the response", normalised_square, 1.0, 2),
            ("coverage of the response", covered_share, COVERAGE, 2),
        ):
            means = statistic_of_perfect(bound, statistic, records=SETS * RECORDS, seed=SEED)
            means = means.reshape(SETS, RECORDS).mean(axis=1)
            yield label, name, means, null_distribution(name, None, statistic, mean), RECORDS, sides
        p = len(bound.parameters)
        means = rng.chisquare(p * RECORDS, SETS) / (p * RECORDS)
        yield "normalised error of parameters", name, means, null_chi_square(p), RECORDS, 2
        single = null_parameter_coverage(name, None)
        # resampled: the share of one record has few values, its distribution is known
        means = single[rng.integers(len(single), size=(SETS, RECORDS))].mean(axis=1)
        yield "coverage of parameters", name, means, single, RECORDS, 2
    means = rng.binomial(RECORDS, COVERAGE, SETS) / RECORDS
    yield "coverage of the bandwidth", "each", means, NULL_BANDWIDTH_COVERAGE, RECORDS, 2
    for name in SLOPES:
        counts = (SLOPE_RECORDS,) * len(LENGTHS)
        slopes = np.concatenate([perfect_slopes(name, None, LENGTHS, counts, seed=SEED + k) for k in range(5)])
        yield "slope", name, slopes, perfect_slopes(name, None, LENGTHS, counts), 1, 1


def limits_of_statistics():
    """Print the table of single statistics; return how many rates are too high."""
    heading("mean of", "problem", *(f"nominal {p:g}" for p in NOMINAL))
    wrong = 0
    for label, name, means, single, draws, sides in statistics():
        limits = [limits_of_mean([single], [draws], nominal, low=sides == 2) for nominal in NOMINAL]
        rates = [np.mean((means < low) | (means > high)) for low, high in limits]
        wrong += rates_row((label, name), rates, len(means))
    for name in QUICK:
        bound = bound_for(name, None)
        covariance, sets, rng = bound.response_covariance, SETS // 10, np.random.default_rng(SEED)
        ratios = [
            variance_ratio_by_frequency(
                real_and_imaginary(bound.response_errors(RECORDS, rng)), covariance, free_parts(covariance)
            )
            for _ in range(sets)
        ]
        means = np.mean(ratios, axis=1)
        limits = [limits_by_frequency(name, None, RECORDS, nominal) for nominal in NOMINAL]
        rates = [np.mean(((means < low) | (means > high)).any(axis=(1, 2, 3))) for low, high in limits]
        wrong += rates_row(("squares at the worst frequency", name), rates, sets)
    return wrong


def p_values(sets, records, size, allowed):
    """p-values (sets,) of sets of records whose errors have a mean of a size."""
    rng = np.random.default_rng(SEED)
    shift = np.eye(1, DIRECTIONS)[0] * size
    values = np.array([f_statistic(rng.standard_normal((records, DIRECTIONS)) + shift) for _ in range(sets)])
    freedom, centre = (DIRECTIONS, records - DIRECTIONS), records * allowed**2
    return ncf.sf(values, *freedom, centre) if centre else f.sf(values, *freedom)


def mean_errors(sets):
    """Print false alarms and power of the test of mean errors; return how many rates are too high."""
    wrong = 0
    heading("records", "mean, allowed", *(f"nominal {p:g}" for p in NOMINAL))
    for records, size in ((RECORDS, 0.0), (RECORDS, ALLOWED), (10 * RECORDS, ALLOWED)):
        p = p_values(sets, records, size, size)
        wrong += rates_row((records, f"{size:g}"), [np.mean(p < nominal) for nominal in NOMINAL], sets)
    print()
    heading("records", *(f"detects mean {size:g}" for size in SIZES))
    for records in (RECORDS, 10 * RECORDS):
        p_of = [p_values(max(1, sets // 20), records, size, ALLOWED) for size in SIZES]
        row(records, *(f"{np.mean(p < false_alarm_of_each()):.3g}" for p in p_of))
    return wrong


def residual_tests(rng):
    """Right orders, and residuals of a model whose error is independent of the record."""
    for trial in ResidualTestsAndOrders().trials("quick"):
        if trial.ask != "fit":
            yield Measurement(trial, "refused")
            continue
        bound = bound_for(trial.problem, None)
        count = len(bound.parameters) if bound is not None else 0
        white, independent = chi2.sf(rng.chisquare(LAGS - count, 2) + 2.0 * rng.chisquare(count, 2), LAGS)
        yield Measurement(trial, "model", whiteness_p=float(white), independence_p=float(independent))


def verdicts(rng):
    """Verdict and probability of a false alarm of each metric, in one run of the quick effort."""

    def measured(definition):
        return simulated([trial for trial in definition.trials("quick") if trial.problem != ALONE], Fault(), rng)

    alike = measured(Efficiency())
    metrics = {}
    for definition in (*ACCURACY, Bias(), ResidualTestsAndOrders(), Agreement()):
        if isinstance(definition, ResidualTestsAndOrders):
            measurements = list(residual_tests(rng))
        elif definition.trials("quick") == Efficiency().trials("quick"):
            measurements = alike
        else:
            measurements = measured(definition)
        reference = measured(definition) if isinstance(definition, Agreement) else ()
        evidence = Evidence(measurements, ESTIMATOR, false_alarm_of_each(), reference)
        metrics[definition.name] = definition.evaluate(evidence)
    return {name: (metric.passed, metric.false_alarm) for name, metric in metrics.items()}


def whole_runs(runs):
    """Print how often metrics fail a perfect estimator; 1 where more runs fail than allowed."""
    rng = np.random.default_rng(SEED)
    of_runs = [verdicts(rng) for _ in range(runs)]
    allowed = {name: false_alarm * runs for name, (_, false_alarm) in of_runs[0].items()}
    heading("metric", f"failed of {runs}", "allowed")
    for name, most in allowed.items():
        row(name, sum(one[name][0] is False for one in of_runs), f"{most:.2g}")
    failed, mean = sum(any(passed is False for passed, _ in one.values()) for one in of_runs), sum(allowed.values())
    row("any", failed, f"{mean:.2g}")
    return failed > mean + 4.0 * np.sqrt(mean) + 1.0


def main():
    """Print the tables; True where a rate is too high."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    wrong = limits_of_statistics()
    print()
    wrong += mean_errors(10 * runs)
    print()
    return wrong + whole_runs(runs) > 0


if __name__ == "__main__":
    sys.exit(main())
