"""Errors of observers: they fall to the noise, and hold for several channels, several records and gaps."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.record_figures.observer_errors import observer_errors
from sysid import IOData, StateSpace, simulate

SYSTEM = StateSpace([[1.5, -0.7], [1.0, 0.0]], [[1.0], [0.0]], [[0.1, 0.05]], [[0.0]], None, 0.02)


def record(noise, samples=4000):
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 2), 2)
    return IOData(u, simulate(SYSTEM, u)[:, 0] + noise * rng.standard_normal(samples), 0.02)


def test_errors_fall_to_the_noise_and_smoothing_is_no_worse():
    noise = 0.02
    data = record(noise)
    rows = {row.p: row for row in observer_errors(data, (1, 2, 4, 8))}
    spread = float(np.std(data.y))
    # Enough parameters leave little more than the noise; one does not suffice for two poles.
    assert rows[8].prediction * spread == pytest.approx(noise, rel=0.15)
    assert rows[1].prediction > 2 * rows[8].prediction
    assert all(row.smoothing < row.prediction for row in rows.values())


def test_an_output_that_is_another_plus_noise_is_smoothed_to_that_noise():
    data = record(0.0)
    rng = np.random.default_rng(0)
    beside = data.y[:, 0] + 0.1 * rng.standard_normal(len(data))
    both = IOData(data.u, np.column_stack((data.y[:, 0], beside)), data.dt)
    (row,) = observer_errors(both, (4,), output=1)
    assert row.smoothing * np.std(beside) == pytest.approx(0.1, rel=0.1)


def test_records_apart_and_gaps_give_nearly_the_same():
    data = record(0.02)
    (whole,) = observer_errors(data, (4,))
    y = data.y.copy()
    y[500:520] = np.nan
    for parts in ([data[:2000], data[2000:]], [replace(data, y=y, missing=True)]):
        (row,) = observer_errors(parts, (4,))
        assert row.prediction == pytest.approx(whole.prediction, rel=0.03)
        assert row.smoothing == pytest.approx(whole.smoothing, rel=0.03)


def test_numbers_for_which_a_record_is_too_short_have_no_row():
    assert [row.p for row in observer_errors(record(0.02)[:60], (1, 2, 10))] == [1, 2]
