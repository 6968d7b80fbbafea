import numpy as np
import pytest

from scenarios.bench.amplitude_split import scatter_of, systematic_of

LINES = 20


def normal(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)


def test_noise_and_distortion_are_told_apart():
    rng = np.random.default_rng(1)
    linear = np.full(LINES, 1.0 + 0.0j)
    groups = [linear + 0.03 * normal(rng, LINES) + 0.01 * normal(rng, 3, LINES) for _ in range(60)]
    found = scatter_of(groups, LINES)
    assert found.noise == pytest.approx(1.0, rel=0.05)
    assert found.distortion == pytest.approx(3.0, rel=0.05)
    assert found.noise_interval[0] < 1.0 < found.noise_interval[1]
    assert found.distortion_interval[0] < 3.0 < found.distortion_interval[1] < 4.0


def test_without_repeats_nothing_is_said_of_noise():
    found = scatter_of(list(normal(np.random.default_rng(1), 6, 1, LINES)), LINES)
    assert np.isnan(found.noise)
    assert np.isnan(found.noise_interval).all()
    assert found.distortion == pytest.approx(100.0, rel=0.2)


def test_a_systematic_error_is_found_free_of_what_scatter_adds():
    rng = np.random.default_rng(2)
    errors = 0.04 + 0.05 * normal(rng, 200, LINES)
    found = systematic_of(errors, LINES, allowed=2.0, false_alarm=1e-4)
    assert found.percent == pytest.approx(4.0, rel=0.05)
    assert found.interval[0] < 4.0 < found.interval[1]
    assert found.limit < found.percent
    assert systematic_of(errors, LINES, allowed=5.0, false_alarm=1e-4).limit > found.percent


def test_the_limit_follows_the_noise_and_no_verdict_depends_on_its_level():
    errors = normal(np.random.default_rng(3), 8, LINES)
    one = systematic_of(errors, LINES, allowed=0.0, false_alarm=1e-3)
    ten = systematic_of(10.0 * errors, LINES, allowed=0.0, false_alarm=1e-3)
    assert ten.limit == pytest.approx(10.0 * one.limit)
    assert ten.percent == pytest.approx(10.0 * one.percent)


@pytest.mark.parametrize("directions", [1, 3, LINES])
def test_false_alarms_are_no_more_than_stated(directions):
    rng = np.random.default_rng(4)
    mixing = rng.standard_normal((directions, LINES)) if directions < LINES else np.eye(LINES)
    runs, allowed, stated = 600, 0.03, 0.05
    alarms = 0
    for _ in range(runs):
        shift = rng.standard_normal(LINES)
        shift *= allowed * np.sqrt(LINES) / np.linalg.norm(shift)
        errors = shift + 0.1 * rng.standard_normal((6, directions)) @ mixing
        found = systematic_of(errors.astype(complex), LINES, allowed=100.0 * allowed, false_alarm=stated)
        alarms += found.percent > found.limit
    # three standard deviations above what is stated
    assert alarms <= runs * stated + 3.0 * np.sqrt(runs * stated)
    if directions == 1:
        none = [
            systematic_of((rng.standard_normal((6, 1)) @ mixing).astype(complex), LINES, allowed=0.0, false_alarm=0.05)
            for _ in range(runs)
        ]
        assert sum(one.percent > one.limit for one in none) > 0.5 * runs * stated, "no verdict that never fails"


def test_the_same_error_in_all_waveforms_has_no_scatter_to_hide_in():
    found = systematic_of(np.full((6, LINES), 0.06 + 0j), LINES, allowed=5.0, false_alarm=1e-6)
    assert found.percent == pytest.approx(6.0)
    assert found.limit == pytest.approx(5.0)
    assert found.interval == pytest.approx((6.0, 6.0))
