import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData
from sysid.records.repetition import repetitions


def record(u, window=0):
    u = np.asarray(u, dtype=float)
    return IOData(u, np.zeros((len(u), 1)), 0.02, window=window)


def found(*inputs):
    return [(group.period, group.count) for group in repetitions([record(u) for u in inputs])]


def held(sequence, hold, samples):
    """A sequence played again and again, of which every `hold`-th sample is held."""
    t = np.arange(samples)
    return sequence[(t - t % hold) % len(sequence)]


@pytest.mark.parametrize("seed", range(5))
def test_period_is_found_through_hold_quantisation_offset_and_noise(seed):
    rng = np.random.default_rng(seed)
    sequence = np.sign(rng.standard_normal(100))
    played = held(sequence + 0.0, 3, 2800) + held(0.2 * rng.standard_normal(2800), 3, 2800)
    recorded = 7.0 + np.round(played / 0.01) * 0.01
    # a hold of three samples meets a file of a hundred in the same way after three files
    assert found(recorded) == [(300, 9)]
    (group,) = repetitions([record(recorded)])
    assert group.share == pytest.approx(1.0 / 1.04, abs=0.02)


def test_period_of_several_inputs_is_the_common_one():
    rng = np.random.default_rng(1)
    u = np.column_stack(
        (np.tile(rng.standard_normal(40), 30), np.tile(rng.standard_normal(60), 20), np.full(1200, 3.0))
    )
    assert found(u) == [(120, 10)]


def test_shortest_period_of_an_exact_repetition():
    rng = np.random.default_rng(2)
    assert found(np.tile(rng.standard_normal(50), 11)[:540]) == [(50, 10)]
    t = np.arange(2000)
    assert found(np.sin(2.0 * np.pi * t / 25.0)) == [(25, 80)]
    # a slow square wave is as smooth as a drift, but repeats to the last bit
    assert found(np.where(t % 600 < 300, 1.0, -1.0)) == [(600, 3)]


def test_records_of_one_sequence_share_a_repetition_from_any_phase_on():
    rng = np.random.default_rng(3)
    sequence, other = rng.standard_normal((2, 100))
    played = np.tile(sequence, 8)
    first, later, different = played[:600], played[37:737], np.tile(other, 5)
    groups = repetitions([record(first), record(later, window=50), record(different)])
    assert [(group.period, group.count) for group in groups] == [(100, 11), (100, 5)]
    folded = groups[0].folded([first[:, None], later[:, None], different[:, None]])
    assert (folded == folded[0]).all()
    assert all(start >= 50 for k, start in groups[0].starts if k == 1)


def test_equal_records_are_one_sequence():
    rng = np.random.default_rng(4)
    u = np.cumsum(rng.standard_normal(300))
    assert found(u, u + 5.0, rng.standard_normal(300)) == [(300, 2)]
    assert found(u, 2.0 * u, u[:200]) == [(300, 2)]


def unrepeated(kind, rng, n):
    white = rng.standard_normal(n)
    match kind:
        case "white":
            return white
        case "walk":
            return np.cumsum(white)
        case "low-pass":
            return lfilter([1.0], [1.0, -0.95], white)
        case "resonant":
            return lfilter([1.0], [1.0, -1.9, 0.98], white)
        case "held levels":
            return np.repeat(np.sign(white), 7)[:n]
        case "step":
            return (np.arange(n) > n // 3) + 0.01 * white
        case "ramp":
            return np.arange(n) + white
        case "chirp":
            return np.sin(2.0 * np.pi * np.arange(n) ** 2 * 0.2 / n)


@pytest.mark.parametrize("kind", ["white", "walk", "low-pass", "resonant", "held levels", "step", "ramp", "chirp"])
def test_nothing_repeats_in_inputs_that_are_new_all_the_time(kind):
    rng = np.random.default_rng(5)
    for _ in range(40):
        u = unrepeated(kind, rng, int(rng.integers(40, 3000)))
        assert found(u) == []


@pytest.mark.parametrize("samples", [1, 2, 5])
def test_inputs_too_short_or_constant_repeat_nothing(samples):
    assert found(np.zeros(samples)) == found(np.ones(samples)) == []
    assert repetitions([IOData(None, np.arange(20.0), 0.1)]) == ()
