"""Minima that were found before serve later searches of the same data, never of others."""

import dataclasses

import numpy as np
import pytest

from sysid import IOData, armax
from sysid.polynomial import prediction_error
from sysid.polynomial.recent_minima import RecentResults, fingerprint

RNG = np.random.default_rng(4)
U = np.repeat(RNG.choice([-1.0, 1.0], 60), 5)
E = 0.1 * RNG.standard_normal(300)
Y = np.convolve(U, [0.0, 0.4, 0.3, 0.2])[:300] + E + 0.5 * np.concatenate(([0.0], E[:-1]))
RECORD = IOData(U, Y, 0.1)


def changed(values, index, by):
    out = np.array(values)
    out[index] += by
    return out


@pytest.mark.parametrize(
    "other",
    [
        IOData(U, changed(Y, 200, 1e-12), 0.1),
        IOData(changed(U, 200, 1e-12), Y, 0.1),
        IOData(U, changed(Y, 200, np.nan), 0.1, missing=True),
        IOData(U, Y, 0.1, window=5),
        IOData(U[:-1], Y[:-1], 0.1),
        IOData(Y, U, 0.1),
        IOData(np.column_stack((U, Y)), Y, 0.1),
    ],
)
def test_other_records_are_told_apart(other):
    assert fingerprint([RECORD]) == fingerprint([dataclasses.replace(RECORD, name="the same samples")])
    assert fingerprint([RECORD]) != fingerprint([other])
    assert fingerprint([RECORD, other]) != fingerprint([other, RECORD])


def test_a_result_is_computed_once_and_the_oldest_is_forgotten():
    computed = []

    def compute(key):
        computed.append(key)
        return key

    recent = RecentResults(2)
    for key in ("a", "b", "a", "c", "a"):
        assert recent.get(key, lambda key=key: compute(key)) == key
    assert computed == ["a", "b", "c", "a"]


def test_the_second_search_finds_the_same_bits_without_an_evaluation(monkeypatch):
    monkeypatch.setattr(prediction_error, "RECENT_MINIMA", RecentResults(100))
    first = armax(RECORD, 2, 2, 2, 1)

    def refuse(*_, **__):
        raise AssertionError("minimised again")

    monkeypatch.setattr(prediction_error, "minimise", refuse)
    again = armax(RECORD, 2, 2, 2, 1)
    assert np.array_equal(again.parameters, first.parameters)
    assert np.array_equal(again.covariance, first.covariance)
    assert again.diagnostics == first.diagnostics
    with pytest.raises(AssertionError, match="minimised again"):
        armax(RECORD[:299], 2, 2, 2, 1)
