"""What spoils a record does what it says, and nothing else."""

import numpy as np
import pytest

from scenarios.thesis.disturbances import BURST, DISTURBANCES, LOSSY, TREATMENTS
from sysid import IOData


def record(n=2000):
    rng = np.random.default_rng(1)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 5), 5)
    return IOData(u, np.convolve(u, 0.1 * 0.9 ** np.arange(100))[:n], 0.02, output_names=("angle",)).detrend()


def spoilt(key, degree, seed=0, data=None):
    return DISTURBANCES[key].spoil(data or record(), degree, np.random.default_rng(seed))


@pytest.mark.parametrize("key", list(DISTURBANCES))
def test_inputs_stay_and_chance_is_the_seeds(key):
    data, degree = record(), DISTURBANCES[key].degrees[-1]
    one, again = spoilt(key, degree), spoilt(key, degree)
    np.testing.assert_array_equal(one.y, again.y)
    assert one.output_names == data.output_names
    if not DISTURBANCES[key].whole:
        np.testing.assert_array_equal(one.u, data.u)
    assert (DISTURBANCES[key].draws > 1) == (not np.array_equal(one.y, spoilt(key, degree, 1).y, equal_nan=True)) or (
        key == "length"  # the last degree is the whole record
    )


def test_a_constant_goes_with_the_mean_and_a_rise_with_the_line():
    data = record()
    biased = spoilt("bias", 2.0)
    assert biased.y.mean() == pytest.approx(2 * data.y.std())
    np.testing.assert_allclose(TREATMENTS["mean removed"](biased).y, data.y, atol=1e-12)
    rising = spoilt("drift", 2.0)
    assert (rising.y - data.y)[-1, 0] == pytest.approx(2 * data.y.std())
    np.testing.assert_allclose(TREATMENTS["line removed"](rising).y, data.detrend(1).y, atol=1e-12)
    left = TREATMENTS["mean removed"](rising).y - data.y
    assert np.ptp(left) == pytest.approx(2 * data.y.std())


def test_outliers_come_in_the_share_and_size_asked():
    data = record(20_000)
    moved = (spoilt("outliers", 2.0, data=data).y - data.y)[:, 0]
    assert np.mean(moved != 0) == pytest.approx(0.02, rel=0.15)
    np.testing.assert_allclose(np.abs(moved[moved != 0]), 5 * data.y.std(), rtol=1e-9)
    sizes = (spoilt("outlier size", 10.0, data=data).y - data.y)[:, 0]
    np.testing.assert_allclose(np.abs(sizes[sizes != 0]), 10 * data.y.std(), rtol=1e-9)


def test_lost_samples_are_the_same_held_and_marked():
    held, marked = spoilt("held drop-outs", 10.0), spoilt("marked drop-outs", 10.0)
    lost = ~marked.known[:, 0]
    assert len(held) == LOSSY
    assert lost.sum() == LOSSY // 10
    np.testing.assert_array_equal(held.y[~lost], marked.y[~lost])
    first = int(np.flatnonzero(lost)[0])
    np.testing.assert_array_equal(held.y[first : first + BURST, 0], held.y[first - 1, 0])
    assert marked.missing and not held.missing


def test_noise_has_the_ratio_asked_and_the_colour():
    data = record(20_000)
    for key in ("white noise", "coloured noise"):
        noise = (spoilt(key, 20.0, data=data).y - data.y)[:, 0]
        assert 20 * np.log10(data.y.std() / noise.std()) == pytest.approx(20.0, abs=1e-9)
        beside = np.corrcoef(noise[1:], noise[:-1])[0, 1]
        assert beside == pytest.approx(0.9 if key == "coloured noise" else 0.0, abs=0.03)


def test_a_part_has_the_length_asked_and_begins_with_a_period():
    data = record()
    part = spoilt("length", 10.0)
    assert len(part) == 500
    assert round(part.start / data.dt) % 100 == 0
    assert abs(part.y.mean()) < 1e-15
    assert spoilt("length", 236.0) is not None and len(spoilt("length", 236.0)) == len(data)
