"""The answer on the 1 Hz finding in words, from bandwidths that are known."""

import numpy as np
import pytest

from scenarios.identification.one_hertz import (
    best_linear_in_words,
    between,
    coverage_in_words,
    joined,
    published_in_words,
    recovered_in_words,
    verdict,
)
from scenarios.identification.recovered_bandwidth import RecoveredBandwidth

NAN = float("nan")


def row(hz, low, high, **others):
    values = {"joint": "elbow_pitch", "method": "oe", "test": "5", "seed": 1, "true_hz": 1.0} | others
    return RecoveredBandwidth(hz=hz, ci95=(low, high), **values)


def test_near_1_hz_and_right_are_two_things():
    rows = [row(1.1, 1.05, 1.15), row(0.7, 0.4, 1.2), row(NAN, NAN, NAN)]
    assert [(one.near, one.covers) for one in rows] == [(True, False), (False, True), (False, False)]
    assert [row(hz, hz, hz).near for hz in (0.79, 0.8, 1.25, 1.26)] == [False, True, True, False]
    words = coverage_in_words(rows)
    assert "1 of 3 intervals of parameters at 95 % hold the small-signal truth" in words
    assert "1 of those near 1 Hz are too sure of themselves" in words
    assert "1 of 3 are not claimed" in words


def test_best_linear_has_an_interval_too():
    wide = (1.0, 0.9, 1.0 / 0.9)
    assert row(1.12, 1.05, 1.12**2 / 1.05, best_linear=wide).covers_best_linear  # neither holds the other's value
    assert not row(1.2, 1.15, 1.2**2 / 1.15, best_linear=wide).covers_best_linear
    assert not row(NAN, NAN, NAN, best_linear=wide).covers_best_linear
    assert row(1.0, 0.9, 1.1).covers_best_linear is None
    assert row(1.0, 0.9, 1.1, best_linear=(NAN, NAN, NAN)).covers_best_linear is None
    words = coverage_in_words([row(1.12, 1.05, 1.19, best_linear=wide), row(NAN, NAN, NAN, best_linear=wide)])
    assert "1 of 2 agree with the best linear bandwidth" in words
    words = best_linear_in_words([row(1.0, 0.9, 1.1, best_linear=(0.95, 0.94, 0.96))])
    assert "0.95 (0.94 to 0.96, elbow pitch) Hz; 1 of 1 is about 1 Hz." in words
    assert best_linear_in_words([row(1.0, 0.9, 1.1)]) == ""


@pytest.mark.slow
def test_the_verdict_tells_methods_apart():
    arx = (row(0.6, 0.5, 0.7, method="arx"), row(1.0, 0.9, 1.1, method="arx"))
    words = verdict([row(1.0, 0.9, 1.1), *arx, row(NAN, NAN, NAN, method="spa")])
    assert "stands for the arm itself, 1.00 Hz (elbow pitch); every bandwidth recovered by OE keeps to it" in words
    assert "not every bandwidth recovered by ARX (1 of 2) does; spectral analysis can claim none" in words
    assert "of the models that the thesis prints 2 of 2 (elbow pitch) keep to it" in words
    assert "does not stand for the arm itself, 0.16 Hz (elbow pitch)" in verdict([row(1.0, 0.9, 1.1, true_hz=0.159)])


def test_recovered_bandwidths_are_counted_by_method():
    rows = [row(hz, 0.9, 1.1, half_power_hz=1.0) for hz in (1.0, 1.0, 0.5)]
    words = recovered_in_words([*rows, row(1.2, 0.9, 1.1, half_power_hz=0.5), row(NAN, NAN, NAN, method="spa")])
    assert "3 of 5 bandwidths are about 1 Hz: OE 3 of 4 (0.50 to 1.20 Hz), spectral analysis 0 of 1 (none" in words
    assert "it is 3 of 5 (0.50 to 1.00 Hz)" in words


def test_the_thesis_own_yaw_models_do_not_keep_to_it():
    words = published_in_words(["shoulder_yaw", "shoulder_pitch", "elbow_pitch"])
    assert "own 8 printed models 3 are near 1 Hz by their bandwidth and 4 by the gain 0.707" in words
    assert "0.12 to 0.47 Hz, and only OE (4.8) reaches 0.707" in words
    assert "yaw" not in published_in_words(["elbow_pitch"])
    assert published_in_words(["wrist_roll"]) == ""


def test_words():
    assert (between([1.0, 1.001]), between([0.5, 2])) == ("1.00", "0.50 to 2.00")
    assert [joined(parts) for parts in (["a"], ["a", "b"], ["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
    assert np.isnan(row(1.0, 0.9, 1.1).half_power_hz)
