"""How often the test bench's figures of accuracy fail a perfect estimator, and how surely they find known faults.

    python tests/benchmarks/bench_false_alarms.py [RUNS]

Three tables. Of each statistic and problem, how often the mean over 100 records of a perfect estimator lies outside of
limits without slack, for three asked probabilities; a rate above the asked one by a tenth of it and four standard
errors fails. Of whole figures with their slack, how often a perfect estimator fails at the probability of a real run,
over RUNS runs (2000) of the quick effort. Of each known fault, the share of RUNS / 40 runs that each metric fails.
"""

import sys
from typing import TypeVar

import numpy as np
from simulated_estimators import FAULTS, FOUND_BY, simulated

from scenarios.bench.accuracy import QUICK, RECORDS, Efficiency
from scenarios.bench.claims import COVERAGE, Coverage, NormalisedError, ResponseError, limits_by_frequency
from scenarios.bench.consistency import LENGTHS, Consistency, NoiseFreeRecovery, perfect_slopes
from scenarios.bench.consistency import QUICK as SLOPES
from scenarios.bench.consistency import RECORDS as SLOPE_RECORDS
from scenarios.bench.metric import MetricDefinition
from scenarios.bench.metrics import false_alarm_of_each
from scenarios.bench.statistics import (
    bound_for,
    covered_share,
    errors_of_perfect,
    free_parts,
    limits_of_mean,
    normalised_square,
    null_bandwidth_coverage,
    null_chi_square,
    null_distribution,
    null_parameter_coverage,
    statistic_of_perfect,
    variance_ratio,
    variance_ratio_by_frequency,
)
from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import response_covariance
from sysid.records.arrays import FloatArray

Thing = TypeVar("Thing")
ASKED = (1e-2, 1e-3, 1e-4)
SETS = 20_000
SEED = 77
METRICS: tuple[MetricDefinition, ...] = (
    NoiseFreeRecovery(),
    Consistency(),
    Efficiency(),
    Coverage(),
    NormalisedError(),
    ResponseError(),
)


def main() -> int:
    """Print the tables; 1 where a rate is not what is asked or a fault is found by other figures than it should be."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    print("| mean of | problem | " + " | ".join(f"asked {asked:g}" for asked in ASKED) + " |")
    print("|---|---|" + "---:|" * len(ASKED))
    wrong = 0
    for label, name, means, single, draws, sides in statistics():
        cells = []
        for asked in ASKED:
            low, high = limits_of_mean(single, draws, asked, low=sides == 2)
            rate = float(np.mean((means < low) | (means > high)))
            wrong += too_many(rate, asked, len(means))
            cells.append(f"{rate:.2g}")
        print(f"| {label} | {name} | " + " | ".join(cells) + " |", flush=True)
    for name in QUICK:
        cells = []
        for asked, rate, sets in worst_frequencies(name):
            wrong += too_many(rate, asked, sets)
            cells.append(f"{rate:.2g}")
        print(f"| squares at the worst frequency | {name} | " + " | ".join(cells) + " |", flush=True)
    print()
    wrong += whole_runs(runs)
    print()
    wrong += faults(max(1, runs // 40))
    return int(wrong > 0)


def known(value: Thing | None) -> Thing:
    """What every textbook problem has.

    Raises:
        ScenarioError: It has not.
    """
    if value is None:
        raise ScenarioError("a textbook problem without Cramér-Rao bound")
    return value


def too_many(rate: float, asked: float, sets: int) -> bool:
    """Whether a rate is above the one asked by more than a tenth of it and four standard errors."""
    return rate > 1.1 * asked + 4.0 * float(np.sqrt(asked / sets))


def statistics() -> list[tuple[str, str, FloatArray, FloatArray, int, int]]:
    """Label, problem, means of many sets, single records, records in a set, number of sides."""
    out = []
    rng = np.random.default_rng(SEED)
    for name in QUICK:
        bound = known(bound_for(name, None))
        for label, statistic, mean, sides in (
            ("squares over the bound", variance_ratio, 1.0, 1),
            ("squares over the claim", variance_ratio, 1.0, 2),
            ("normalised error of the response", normalised_square, 1.0, 2),
            ("coverage of the response", covered_share, COVERAGE, 2),
        ):
            drawn = statistic_of_perfect(bound, statistic, SETS * RECORDS, SEED).reshape(SETS, RECORDS)
            out.append(
                (label, name, drawn.mean(axis=1), known(null_distribution(name, None, statistic, mean)), RECORDS, sides)
            )
        p = len(bound.parameters)
        single = null_chi_square(p)
        means = rng.chisquare(p * RECORDS, SETS) / (p * RECORDS)
        out.append(("normalised error of parameters", name, means, single, RECORDS, 2))
        single = known(null_parameter_coverage(name, None))
        # resampled: the share of one record has few values, its distribution is known
        means = single[rng.integers(len(single), size=(SETS, RECORDS))].mean(axis=1)
        out.append(("coverage of parameters", name, means, single, RECORDS, 2))
    means = rng.binomial(RECORDS, COVERAGE, SETS) / RECORDS
    out.append(("coverage of the bandwidth", "each", means, null_bandwidth_coverage(), RECORDS, 2))
    for name in SLOPES:
        counts = (SLOPE_RECORDS,) * len(LENGTHS)
        drawn = np.concatenate([perfect_slopes(name, None, LENGTHS, counts, seed=SEED + k) for k in range(5)])
        out.append(("slope", name, drawn, perfect_slopes(name, None, LENGTHS, counts), 1, 1))
    return out


def worst_frequencies(name: str) -> list[tuple[float, float, int]]:
    """Asked probability, rate, and number of sets."""
    sets = SETS // 10
    bound = known(bound_for(name, None))
    covariance = response_covariance(bound)
    rng = np.random.default_rng(SEED)
    means = np.array(
        [
            variance_ratio_by_frequency(
                errors_of_perfect(bound, RECORDS, rng), covariance, free_parts(covariance)
            ).mean(axis=0)
            for _ in range(sets)
        ]
    )
    out = []
    for asked in ASKED:
        low, high = limits_by_frequency(name, None, RECORDS, asked)
        out.append((asked, float(np.mean(((means < low) | (means > high)).any(axis=(1, 2, 3)))), sets))
    return out


def verdicts(fault: str, rng: np.random.Generator) -> dict[str, tuple[bool | None, float]]:
    """Verdict and false-alarm probability of each metric, by the quick effort."""
    out = {}
    accuracy = simulated(Efficiency().trials("quick"), FAULTS[fault], rng)
    for definition in METRICS:
        shared = definition.trials("quick") == Efficiency().trials("quick")
        measured = accuracy if shared else simulated(definition.trials("quick"), FAULTS[fault], rng)
        metric = definition.evaluate(measured, Estimator("simulated", "bench:perfect"), false_alarm_of_each(), ())
        out[definition.name] = (metric.passed, metric.false_alarm)
    return out


def whole_runs(runs: int) -> int:
    """Failures of a perfect estimator in whole runs."""
    rng = np.random.default_rng(SEED)
    failed = dict.fromkeys((definition.name for definition in METRICS), 0)
    allowed = dict.fromkeys(failed, 0.0)
    any_failed = 0
    for _ in range(runs):
        given = verdicts("perfect", rng)
        for name, (passed, false_alarm) in given.items():
            failed[name] += passed is False
            allowed[name] = false_alarm
        any_failed += any(passed is False for passed, _ in given.values())
    print(f"| metric | failed of {runs} | allowed |\n|---|---:|---:|")
    for name, count in failed.items():
        print(f"| {name} | {count} | {allowed[name] * runs:.2g} |")
    print(f"| any | {any_failed} | {sum(allowed.values()) * runs:.2g} |")
    mean = sum(allowed.values()) * runs
    return int(any_failed > mean + 4.0 * np.sqrt(mean) + 1.0)


def faults(runs: int) -> int:
    """Share of the runs that each metric fails, fault by fault; those that should be found are in bold."""
    rng = np.random.default_rng(SEED)
    names = [definition.name for definition in METRICS]
    print(f"| fault, {runs} runs | " + " | ".join(names) + " |\n|---|" + "---:|" * len(names))
    wrong = 0
    for fault, found_by in FOUND_BY.items():
        given = [verdicts(fault, rng) for _ in range(runs)]
        shares = {name: np.mean([one[name][0] is False for one in given]) for name in names}
        wrong += sum(bool(share < 1.0 if name in found_by else share > 0.0) for name, share in shares.items())
        cells = [f"**{shares[name]:.3g}**" if name in found_by else f"{shares[name]:.3g}" for name in names]
        print(f"| {fault} | " + " | ".join(cells) + " |", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
