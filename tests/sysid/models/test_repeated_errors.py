"""Intervals from records whose input repeats, of a system with a nonlinearity and of linear ones."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData
from sysid.models.repeated_errors import count_repetition_once, repeated_errors
from sysid.recursive import Forgetting

DT = 0.02
PERIOD, PERIODS = 200, 15
F = np.array([1.0, 2.0, 4.0])
CUBIC = 0.2
BEFORE = [0.0, 0.4], [1.0, -0.6]
BEHIND = [0.3], [1.0, -0.7]
LINES = np.arange(1, 60)

ESTIMATORS = {
    "arx": lambda data: sysid.arx(data, 2, 2, 1),
    "armax": lambda data: sysid.armax(data, 2, 2, 2, 1),
    "arx coloured": lambda data: sysid.arx(data, 2, 2, 1, coloured=True),
    "oe": lambda data: sysid.oe(data, 2, 2, 1),
    "weighted oe": lambda data: sysid.oe(data, 2, 2, 1, weighting=(0, 1)),
    "bj": lambda data: sysid.bj(data, 2, 1, 1, 2, 1),
    "polyest": lambda data: sysid.polyest(data, 1, 2, 0, 0, 1, 1),
    "iv4": lambda data: sysid.iv4(data, 2, 2, 1),
    "ivx": lambda data: sysid.ivx(data, 2, 2, 1, data.u),
    "impulseest": lambda data: sysid.impulseest(data, 30),
    "okid": lambda data: sysid.okid(data, 2, p=6),
    "pem_ss": lambda data: sysid.pem_ss(data, 2),
    "tfest": lambda data: sysid.tfest(data, 2, 1),
    "rarx": lambda data: sysid.rarx(data, 2, 2, 1).final,
    "rarx forgetting": lambda data: sysid.rarx(data, 2, 2, 1, adaptation=Forgetting(0.999)).final,
    "roe": lambda data: sysid.roe(data, 2, 2, 1, start=sysid.oe(data[:PERIOD], 2, 2, 1)).final,
}


def multisine(seed, period=PERIOD):
    """Random-phase multisine of unit power (period,)."""
    phases = 2.0 * np.pi * np.random.default_rng([0, seed]).random(len(LINES))
    waves = np.cos(2.0 * np.pi * np.outer(np.arange(period), LINES) / period + phases)
    return waves.sum(axis=1) * np.sqrt(2.0 / len(LINES))


def wiener_hammerstein(u, cubic):
    x = lfilter(*BEFORE, u)
    return lfilter(*BEHIND, x + cubic * x**3)


def record(seed, cubic=CUBIC, noise=0.002, periods=PERIODS):
    """Steady record of whole periods."""
    u = np.tile(multisine(seed), periods + 1)
    y = wiener_hammerstein(u, cubic)
    y = y + noise * np.random.default_rng([1, seed]).standard_normal(len(y))
    return IOData(u[PERIOD:], y[PERIOD:], DT)


def best_linear_gain(f):
    """Gain of the best linear system for normal inputs of the multisine's spectrum (Bussgang)."""
    z = np.exp(2j * np.pi * f * DT)
    linear = np.polyval(BEFORE[0][::-1], 1 / z) / np.polyval(BEFORE[1][::-1], 1 / z)
    linear *= np.polyval(BEHIND[0][::-1], 1 / z) / np.polyval(BEHIND[1][::-1], 1 / z)
    of_lines = np.exp(2j * np.pi * LINES / PERIOD)
    before = np.polyval(BEFORE[0][::-1], 1 / of_lines) / np.polyval(BEFORE[1][::-1], 1 / of_lines)
    power = float(np.mean(np.abs(before) ** 2))
    return np.abs(linear * (1.0 + 3.0 * CUBIC * power))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_every_estimator_counts_errors_that_repeat_once_and_says_so(name):
    estimate = ESTIMATORS[name](record(0))
    diagnostics = estimate.diagnostics
    assert (diagnostics["periods"], diagnostics["period"], diagnostics["sequences"]) == (PERIODS, PERIOD, 1)
    assert diagnostics["repeated_share"] > 0.5
    assert f"{PERIODS} periods of 1 sequence" in str(estimate) or name in {"okid", "pem_ss", "impulseest"}
    before, after = diagnostics["covariance_of_independent_errors"], estimate.covariance
    assert np.linalg.eigvalsh(after - before).min() >= -1e-9 * np.linalg.eigvalsh(after).max()
    assert np.trace(after) > 2.0 * np.trace(before)


@functools.cache
def coverages(name):
    """Share of 40 sequences whose intervals hold the best linear gain: counted once, and as independent errors."""
    truth = best_linear_gain(F)
    once, every_time = [], []
    for seed in range(40):
        estimate = ESTIMATORS[name](record(seed))
        independent = estimate.diagnostics["covariance_of_independent_errors"]
        for list_of, covariance in ((once, estimate.covariance), (every_time, independent)):
            changed = replace(estimate, covariance=covariance)
            low, high = changed.frequency_response(F).magnitude_ci95()
            list_of.append((low[:, 0, 0] <= truth) & (truth <= high[:, 0, 0]))
    return float(np.mean(once)), float(np.mean(every_time))


@pytest.mark.parametrize("name", ["arx", "armax", "oe", "iv4", "okid"])
def test_intervals_of_a_nonlinear_system_hold_its_best_linear_gain(name):
    once, every_time = coverages(name)
    # 95 % but for chance, few lines, and the bias of orders that the nonlinearity exceeds
    assert once > 0.8
    assert every_time < 0.6


@pytest.mark.parametrize("name", ["armax", "oe", "iv4", "okid", "pem_ss"])
def test_nothing_changes_where_the_errors_of_a_linear_system_do_not_repeat(name):
    widened = 0
    for seed in range(12):
        estimate = ESTIMATORS[name](record(seed, cubic=0.0, noise=0.02))
        widened += "periods" in estimate.diagnostics
    assert widened <= 1


def test_without_a_repetition_the_estimate_is_returned_as_it_is():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(1000)
    data = IOData(u, wiener_hammerstein(u, CUBIC), DT)
    estimate = sysid.oe(data, 2, 2, 1)
    assert "periods" not in estimate.diagnostics
    assert count_repetition_once(estimate, [data]) is estimate


def test_files_of_one_sequence_count_as_one():
    parts = [record(3)[: 5 * PERIOD], record(3)[5 * PERIOD + 70 :]]
    estimate = sysid.oe(parts, 2, 2, 1)
    assert (estimate.diagnostics["periods"], estimate.diagnostics["sequences"]) == (5 + 9, 1)
    two = sysid.oe([record(3), record(4)], 2, 2, 1)
    assert (two.diagnostics["periods"], two.diagnostics["sequences"]) == (2 * PERIODS, 2)
    assert "30 periods of 2 sequences" in str(two)


def test_two_sequences_are_two_experiments():
    alone = [sysid.oe(record(seed), 2, 2, 1).frequency_response(F).magnitude_deviation() for seed in range(8)]
    pairs = [sysid.oe([record(s), record(s + 50)], 2, 2, 1).frequency_response(F) for s in range(8)]
    ratio = np.median(alone) / np.median([pair.magnitude_deviation() for pair in pairs])
    assert ratio == pytest.approx(np.sqrt(2.0), rel=0.2)


def test_missing_outputs_and_windows():
    data = record(5)
    y = data.y.copy()
    y[250:280] = np.nan
    gapped = IOData(data.u, y, DT, missing=True, window=100)
    estimate = sysid.oe(gapped, 2, 2, 1)
    assert estimate.diagnostics["periods"] == PERIODS - 1


@pytest.mark.parametrize("scale", [1e6, 1e9])
def test_a_covariance_whose_steps_are_unstable_is_counted_by_smaller_ones(scale):
    # as a pole at the stability limit has it: what a hundredth of its deviation away lies is no predictor
    counted = sysid.oe(record(0), 2, 2, 1)
    wide = replace(counted, covariance=scale * counted.diagnostics["covariance_of_independent_errors"], diagnostics={})
    again = count_repetition_once(wide, [record(0)])
    assert again.diagnostics["periods"] == PERIODS
    # it is larger by far than what repeats asks for
    assert again.covariance == pytest.approx(wide.covariance, rel=1e-9)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_test_of_repetition_has_its_level_for_errors_of_any_colour(colour):
    p_values = []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        u = np.tile(rng.standard_normal(80), 12)
        errors = lfilter([1.0], [1.0, -colour], rng.standard_normal(len(u)))
        p_values.append(repeated_errors([IOData(u, errors, DT)], [errors[:, None]]).p_value)
    assert 0.02 < np.mean(np.array(p_values) < 0.05) < 0.09
    assert np.mean(p_values) == pytest.approx(0.5, abs=0.07)
