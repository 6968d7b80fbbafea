"""Dead times beyond the delays that are tested first."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, auto, delayest, procest, tfest
from sysid.frequency.far_delay import far_delay
from sysid.selection import choose_procest

POLE, GAIN, SAMPLES = np.exp(-1.0 / 60.0), 1.2, 800
TESTED = 20


def plant(u, dead_time):
    return lfilter(np.concatenate((np.zeros(1 + dead_time), [GAIN * (1.0 - POLE)])), [1.0, -POLE], u)


def record(kind, dead_time, seed=0):
    """A step early, a step up and down, or random levels from rest, about a level of 23.5, noise 0.4 % of the step."""
    rng = np.random.default_rng([seed, dead_time])
    u = np.where(np.arange(SAMPLES) >= 30, 20.0, 0.0)
    if kind == "two":
        u[400:] = 5.0
    if kind == "levels":
        u = np.repeat(rng.choice([0.0, 20.0], SAMPLES // 40), 40)
    return IOData(u, 23.5 + plant(u, dead_time) + 0.1 * rng.standard_normal(SAMPLES), 1.0)


@pytest.mark.parametrize("kind", ["step", "two", "levels"])
@pytest.mark.parametrize("dead_time", [40, 60, 200])
def test_a_long_dead_time_is_seen(kind, dead_time):
    assert far_delay([record(kind, dead_time)], TESTED) == pytest.approx(dead_time, abs=2)


def test_nothing_is_seen_where_the_tested_delays_explain_as_much():
    for seed in range(5):
        assert far_delay([record("levels", 3, seed)], TESTED) is None
        rng = np.random.default_rng(seed)
        walk = record("levels", 3, seed)
        assert far_delay([IOData(walk.u, walk.y[:, 0] + np.cumsum(rng.standard_normal(SAMPLES)), 1.0)], TESTED) is None
    short = record("step", 3)[:40]
    assert far_delay([short], TESTED) is None


def test_a_short_part_hides_no_long_delay():
    whole = record("levels", 60)
    assert far_delay([whole[:5], whole[6:], whole[:90]], TESTED) == pytest.approx(60, abs=2)


def test_a_resonance_that_resembles_a_long_delay_is_chosen_as_a_resonance():
    """Damping 0.01, a period of 100 samples: an arx of order 10 behind 319 samples had the gain 0.74."""
    rng = np.random.default_rng(3)
    pole = np.exp(2.0j * np.pi / 100.0 * np.sqrt(1.0 - 1e-4) - 0.02 * np.pi / 100.0)
    F = np.poly([pole, pole.conj()]).real
    u = np.repeat(rng.choice([-1.0, 1.0], 100), 20)
    y = lfilter([0.0, 0.5 * F.sum(), 0.5 * F.sum()], F, u)
    data = IOData(u, y + 0.1 * y.std() * rng.standard_normal(2000), 0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        choice = auto(data.detrend())
    assert choice.estimate.dc_gain()[0, 0] == pytest.approx(1.0, rel=0.1)
    assert choice.candidates[0].orders["nk"] <= TESTED


def test_delayest_says_that_it_does_not_look_far_enough():
    with pytest.warns(SysidWarning, match="a delay of about 60 samples explains y1 far better than those up to"):
        delayest(record("levels", 60))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert delayest(record("levels", 60), largest=80).arx[0, 0] == pytest.approx(61, abs=1)
    assert not any("larger one would test it" in str(warning.message) for warning in caught)


@pytest.mark.parametrize("kind", ["step", "two", "levels"])
@pytest.mark.parametrize("dead_time", [40, 60])
def test_the_choice_finds_it(kind, dead_time):
    """A step with a dead time of 60 samples was "sufficient" with a gain of 6 in place of 1.2."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        choice = auto(record(kind, dead_time).detrend(), offset=True)
    assert choice.estimate.dc_gain()[0, 0] == pytest.approx(GAIN, rel=0.05)
    assert choice.candidates[0].orders["nk"] in range(dead_time - 1, dead_time + 3)


def test_continuous_time_models_look_that_far_by_default():
    data = record("levels", 200)
    for fit in (procest(data, "P1D", offset=True), tfest(data, 1, 0, delay=None, offset=True)):
        assert fit.parameters[-1] == pytest.approx(200.0, abs=0.3)
    choice = choose_procest(record("two", 60), offset=True)
    assert choice.candidates[0].orders["kind"] == "P1D"
    assert choice.estimate.parameters[-1] == pytest.approx(60.0, abs=0.5)
