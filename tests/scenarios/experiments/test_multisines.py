"""The excitation class of best linear approximations."""

import numpy as np
import pytest

from scenarios.experiments.multisines import Multisines
from tests.refusals import refused


def lines_of(offsets, multisines):
    """Complex amplitudes of the first period, over the amplitude that a line should have."""
    n = multisines.samples
    return np.fft.rfft(offsets[:n], axis=0) / (multisines.rms * n / np.sqrt(2 * len(multisines.lines)))


def test_a_record_is_periodic_flat_and_as_large_as_asked():
    multisines = Multisines(rms=0.02, f_min=0.5, f_max=4.0, period=5.12, periods=3, settling=2)
    offsets = multisines.offsets(1)[:, 0]
    assert len(offsets) == 50 * multisines.duration == 5 * 256
    assert np.ptp(offsets.reshape(5, 256), axis=0).max() == 0.0
    assert offsets.std() == pytest.approx(0.02, rel=1e-12)
    expected = np.isin(np.arange(129), multisines.lines).astype(float)
    np.testing.assert_allclose(np.abs(lines_of(offsets, multisines)), expected, atol=1e-12)
    np.testing.assert_array_equal(multisines.lines, np.arange(3, 21))


def test_phases_are_drawn_anew_by_realisation_and_seed_and_by_nothing_else():
    one = Multisines(seed=3)
    np.testing.assert_array_equal(one.offsets(2), Multisines(seed=3, realisations=5).offsets(2))
    others = [one.offsets(3), Multisines(seed=4).offsets(2), one.offsets(2, 1, 2)[:, :1]]
    assert all(abs(np.corrcoef(one.offsets(2)[:, 0], other[:, 0])[0, 1]) < 0.5 for other in others)


@pytest.mark.parametrize("axes", [2, 3])
def test_records_of_a_realisation_are_orthogonal_at_every_line(axes):
    multisines = Multisines(period=5.12)
    records = np.array([lines_of(multisines.offsets(0, e, axes), multisines) for e in range(axes)])
    u = records[:, multisines.lines].transpose(1, 2, 0)  # (lines, axes, records)
    np.testing.assert_allclose(u @ u.conj().transpose(0, 2, 1), np.tile(axes * np.eye(axes), (len(u), 1, 1)), atol=1e-9)


def test_an_odd_random_grid_leaves_even_lines_and_one_of_four_odd_ones_silent():
    multisines = Multisines(odd=True, seed=1)
    assert (multisines.lines % 2 == 1).all()
    odd = multisines.band[multisines.band % 2 == 1]
    groups = np.isin(odd[: 4 * (len(odd) // 4)], multisines.lines).reshape(-1, 4)
    np.testing.assert_array_equal(groups.sum(axis=1), 3)
    assert not np.array_equal(multisines.lines, Multisines(odd=True, seed=2).lines)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rms": 0.0}, "rms = 0.0 given, expected above 0"),
        ({"period": 1.23456}, "period = 1.23456 given, expected a multiple of 0.02 s"),
        ({"realisations": 1}, "realisations = 1 given, expected 2 or more"),
        ({"periods": 1}, "periods = 1"),
        ({"settling": 0}, "settling = 0"),
        ({"f_max": 25.0}, "f_max = 25.0 given, expected f_min to below 25 Hz"),
        ({"f_min": 1.01, "f_max": 1.02}, "no line in 1.01 to 1.02 Hz"),
        ({"periods": 10_000}, "records of 102010 s requested"),
        ({"seed": -1}, "a seed is a whole number"),
        ({"realisations": 2.5}, "realisations must be a whole number, given 2.5"),
        ({"rms": float("nan")}, "rms must be a finite number, given nan"),
        ({"odd": "no"}, "odd must be true or false, given 'no'"),
    ],
)
def test_impossible_records_are_refused(change, message):
    refused(message, Multisines, **change)
