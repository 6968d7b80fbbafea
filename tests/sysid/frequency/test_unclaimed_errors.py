"""Warnings of errors that the deviations of a response do not include: smoothing and scatter from line to line."""

import warnings
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid

SMOOTHED = "counts as disturbance"
SCATTER = "scatters from line to line"
SMOOTHING = {
    "spa": partial(sysid.spa, lag=30),
    "spafdr": partial(sysid.spafdr, resolution=0.05),
    "welch": partial(sysid.welch, segment=60),
    "etfe": partial(sysid.etfe, smoothing=15),
}
PERIOD = 100


def recorded(rng, denominator, samples=1000):
    """Record of white noise through a filter, with white errors of the output."""
    u, e = rng.standard_normal((2, samples + 200))
    y = lfilter([1.0, 0.3], denominator, u) + 0.5 * e
    return sysid.IOData(u[200:], y[200:], 1.0)


def periods(rng, cubic, realisations=1, count=5):
    """Periods of a random-phase multisine through a static nonlinearity and a filter, each an experiment."""
    records = []
    for _ in range(realisations):
        phases = rng.uniform(0.0, 2.0 * np.pi, PERIOD // 2 - 1)
        u = np.cos(2.0 * np.pi * np.outer(np.arange(PERIOD), np.arange(1, PERIOD // 2)) / PERIOD + phases).sum(axis=1)
        u /= u.std()
        played = np.tile(u, count + 2)
        y = lfilter([1.0], [1.0, -0.5], played + cubic * played**3)[2 * PERIOD :]
        records.append(sysid.IOData(played[2 * PERIOD :], y + 0.1 * rng.standard_normal(count * PERIOD), 1.0))
    return records


def told(estimate, text):
    """Whether an estimator warns of a text."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        estimate()
    return any(text in str(message.message) for message in caught)


@pytest.mark.parametrize("name", SMOOTHING)
def test_a_resonance_within_the_smoothing_is_told(name):
    resonant = np.poly([0.97 * np.exp(1j), 0.97 * np.exp(-1j)]).real
    for seed in range(5):
        data = recorded(np.random.default_rng(seed), resonant)
        assert told(lambda data=data: SMOOTHING[name](data), SMOOTHED)


@pytest.mark.parametrize("name", SMOOTHING)
def test_a_constant_response_is_not_blamed(name):
    data = [recorded(np.random.default_rng(seed), [1.0, 0.3]) for seed in range(20)]
    # at a level of 0.01 more than two of 20 have a probability of 0.001
    assert sum(told(lambda one=one: SMOOTHING[name](one), SMOOTHED) for one in data) <= 2


def test_smoothing_is_told_without_regard_to_units():
    resonant = np.poly([0.97 * np.exp(1j), 0.97 * np.exp(-1j)]).real
    data = recorded(np.random.default_rng(0), resonant)
    texts = []
    for scale in (1.0, 1e-6, 1e6):
        with pytest.warns(sysid.SysidWarning, match=SMOOTHED) as caught:
            sysid.spa(sysid.IOData(data.u / scale, data.y * scale, 1.0))
        texts.append(str(caught[0].message))
    assert texts == texts[:1] * 3


def test_a_longer_lag_follows_the_resonance():
    resonant = np.poly([0.8 * np.exp(1j), 0.8 * np.exp(-1j)]).real
    data = recorded(np.random.default_rng(1), resonant, 4000)
    assert told(lambda: sysid.spa(data, lag=10), SMOOTHED)
    assert not told(lambda: sysid.spa(data, lag=400), SMOOTHED)


def test_distortion_that_repeats_is_told_by_etfe_and_bla():
    for seed in range(5):
        (record,) = periods(np.random.default_rng(seed), 0.1)
        split = [record[k * PERIOD : (k + 1) * PERIOD] for k in range(5)]
        assert told(lambda split=split: sysid.etfe(split), SCATTER)
        assert told(lambda record=record: sysid.bla(record, PERIOD), SCATTER)


def test_several_realisations_measure_distortion_and_are_not_blamed():
    records = periods(np.random.default_rng(0), 0.1, realisations=4)
    assert not told(lambda: sysid.bla(records, PERIOD), SCATTER)


def test_noise_between_periods_alone_is_not_blamed():
    blamed = 0
    for seed in range(40):
        (record,) = periods(np.random.default_rng(seed), 0.0)
        blamed += told(lambda record=record: sysid.bla(record, PERIOD), SCATTER)
    # at a level of 0.01: more than three of 40 has a probability of 0.001
    assert blamed <= 3


def test_a_record_without_noise_is_not_blamed_for_rounding():
    rng = np.random.default_rng(3)
    u = np.tile(rng.standard_normal(PERIOD), 6)
    y = lfilter([1.0], [1.0, -0.5], u)
    data = sysid.IOData(u[2 * PERIOD :], y[2 * PERIOD :], 1.0)
    assert not told(lambda: sysid.bla(data, PERIOD), SCATTER)
