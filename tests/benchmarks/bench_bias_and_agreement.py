"""How often the test bench's figures of bias, of residual tests and of agreement fail a perfect estimator, and power.

    python tests/benchmarks/bench_bias_and_agreement.py [SETS]

Four tables. Of the test of mean errors, how often it exceeds its limit where the mean is as large as is allowed, over
SETS sets (20000) of Gaussian errors and of errors with heavier tails, for four asked probabilities; a rate above the
asked one by a tenth of it and four standard errors fails where errors are Gaussian. How often it finds a mean of a
given size. How often whole figures fail perfect estimators, whose errors and residuals have nothing to do with those of
the second implementation, or are opposite to them. What share of biased, late and inefficient estimators they fail.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, f, ncf
from simulated_estimators import Fault, simulated

from scenarios.bench.accuracy import Agreement
from scenarios.bench.bias import ALLOWED, ALONE, DIRECTIONS, RECORDS, Bias, f_statistic
from scenarios.bench.measurement import Measurement
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.bench.statistics import bound_for
from scenarios.bench.tests_and_orders import LAGS, PROBLEMS, ResidualTestsAndOrders
from scenarios.estimators.estimator import Estimator
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

ASKED = (1e-2, 1e-3, 5e-4, 1e-4)
SIZES = (0.0, 0.2, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
HEAVY = 5
"""Degrees of freedom of Student's distribution."""

SEED = 91
CONTESTANT = Estimator("simulated", "bench:perfect")
Noise = Callable[[np.random.Generator, tuple[int, int]], FloatArray]


def gaussian(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Of unit variance."""
    return rng.standard_normal(shape)


def heavy(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Of unit variance, and with far values."""
    return rng.standard_t(HEAVY, shape) * np.sqrt((HEAVY - 2.0) / HEAVY)


def p_values(sets: int, records: int, size: float, allowed: float, noise: Noise) -> FloatArray:
    """Of many sets of records with a mean of a size (sets,)."""
    rng = np.random.default_rng(SEED)
    out = np.empty(sets)
    for k in range(sets):
        errors = noise(rng, (records, DIRECTIONS))
        errors[:, 0] += size
        freedom, shift = (DIRECTIONS, records - DIRECTIONS), records * allowed**2
        statistic = f_statistic(errors)
        out[k] = ncf.sf(statistic, *freedom, shift) if shift else f.sf(statistic, *freedom)
    return out


def rates(sets: int) -> int:
    """False alarms of the test itself."""
    print(f"| errors | records | mean, allowed | {' | '.join(f'asked {asked:g}' for asked in ASKED)} |")
    print("|---|---:|---:|" + "---:|" * len(ASKED))
    wrong = 0
    for label, noise in (("Gaussian", gaussian), (f"Student, {HEAVY}", heavy)):
        for records, size in ((RECORDS, 0.0), (RECORDS, ALLOWED), (10 * RECORDS, ALLOWED)):
            p = p_values(sets, records, size, size, noise)
            found = [float(np.mean(p < asked)) for asked in ASKED]
            print(
                f"| {label} | {records} | {size:g} | " + " | ".join(f"{rate:.2g}" for rate in found) + " |", flush=True
            )
            if noise is gaussian:
                wrong += sum(
                    rate > 1.1 * asked + 4.0 * np.sqrt(asked / sets) for rate, asked in zip(found, ASKED, strict=True)
                )
    return wrong


def power(sets: int) -> None:
    """Share of means of a size that are found with a verdict's probability of a false alarm."""
    share = false_alarm_of_each()
    print(f"| records | {' | '.join(f'mean {size:g}' for size in SIZES)} |\n|---:|" + "---:|" * len(SIZES))
    for records in (RECORDS, 10 * RECORDS):
        cells = [float(np.mean(p_values(sets, records, size, ALLOWED, gaussian) < share)) for size in SIZES]
        print(f"| {records} | " + " | ".join(f"{cell:.3g}" for cell in cells) + " |", flush=True)


def residual_tests(rng: np.random.Generator) -> list[Measurement]:
    """Right orders, residuals of a model whose error has nothing to do with the record."""
    out = []
    for trial in ResidualTestsAndOrders().trials("quick"):
        if trial.ask != "fit":
            out.append(Measurement(trial, "refused"))
            continue
        bound = bound_for(trial.problem, None)
        count = len(bound.parameters) if bound is not None else 0
        statistics = rng.chisquare(LAGS - count, 2) + 2.0 * rng.chisquare(count, 2)
        white, independent = chi2.sf(statistics, LAGS)
        out.append(Measurement(trial, "model", whiteness_p=float(white), independence_p=float(independent)))
    return out


def answers(definition: Agreement | Bias, fault: Fault, rng: np.random.Generator) -> list[Measurement]:
    """On problems with a bound."""
    trials: Sequence[Trial] = [trial for trial in definition.trials("quick") if trial.problem != ALONE]
    return simulated(trials, fault, rng)


def mirrored(m: Measurement) -> Measurement:
    """With the opposite error."""
    bound = bound_for(m.trial.problem, None)
    return m if bound is None or m.response is None else replace(m, response=2.0 * bound.response - m.response)


def whole_figures(runs: int) -> int:
    """Failures of perfect estimators."""
    rng = np.random.default_rng(SEED)
    share = false_alarm_of_each()
    failed = dict.fromkeys(("bias", "tests_and_orders", "agreement, independent", "agreement, opposite"), 0)
    for _ in range(runs):
        own, theirs = answers(Agreement(), Fault(), rng), answers(Agreement(), Fault(), rng)
        figures = {
            "bias": Bias().evaluate(answers(Bias(), Fault(), rng), CONTESTANT, share, ()),
            "tests_and_orders": ResidualTestsAndOrders().evaluate(residual_tests(rng), CONTESTANT, share, ()),
            "agreement, independent": Agreement().evaluate(own, CONTESTANT, share, theirs),
            "agreement, opposite": Agreement().evaluate(own, CONTESTANT, share, [mirrored(m) for m in own]),
        }
        for name, metric in figures.items():
            failed[name] += metric.passed is not True
    allowed = runs * share * max(2 * len(PROBLEMS), Agreement().verdicts, Bias().verdicts)
    print(f"| metric, {runs} runs | failed | allowed at most |\n|---|---:|---:|")
    for name, count in failed.items():
        print(f"| {name} | {count} | {allowed:.2g} |")
    return sum(count > allowed + 4.0 * np.sqrt(allowed) + 1.0 for count in failed.values())


def faults(runs: int) -> None:
    """Share of runs in which a fault is found."""
    rng = np.random.default_rng(SEED)
    share = false_alarm_of_each()
    print(f"| fault, {runs} runs | bias | agreement |\n|---|---:|---:|")
    for label, fault in (
        ("gain 1 % too high", Fault(gain=1.01)),
        ("gain 2 % too high", Fault(gain=1.02)),
        ("gain 5 % too high", Fault(gain=1.05)),
        ("one sample too late", Fault(delay=1)),
        ("variance 1.5 times the bound", Fault(variance=1.5)),
        ("variance 10 times the bound", Fault(variance=10.0)),
    ):
        bias = [Bias().evaluate(answers(Bias(), fault, rng), CONTESTANT, share, ()).passed for _ in range(runs)]
        agreement = [
            Agreement()
            .evaluate(answers(Agreement(), fault, rng), CONTESTANT, share, answers(Agreement(), Fault(), rng))
            .passed
            for _ in range(runs)
        ]
        shares = [float(np.mean([passed is False for passed in given])) for given in (bias, agreement)]
        print(f"| {label} | {shares[0]:.3g} | {shares[1]:.3g} |", flush=True)


def main() -> int:
    """Print the tables; 1 where a perfect estimator fails more often than asked."""
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    wrong = rates(sets)
    print()
    power(max(1, sets // 20))
    print()
    wrong += whole_figures(max(1, sets // 20))
    print()
    faults(max(1, sets // 400))
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
