from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from sysid import IOData, arx, oe
from sysid.models.bandwidth import bandwidth_claim
from sysid.records.excited_band import excited_band, lowest_excited

DT = 0.02


def claimed(record, fit=oe):
    return bandwidth_claim(fit(record, 1, 1), record)


def assert_withheld(claim, reason):
    assert np.isnan([claim.hz, claim.low, claim.high]).all()
    assert claim.refused
    assert reason in claim.warnings[0]


def test_an_interval_over_decades_is_no_interval():
    rng = np.random.default_rng(1)
    u = rng.standard_normal(2000)
    record = IOData(u, lfilter([0, 0.1], [1, -0.9], u) + 0.01 * rng.standard_normal(2000), DT).detrend()
    estimate = oe(record, 1, 1, 1)
    assert bandwidth_claim(estimate, record).hz == estimate.bandwidth().hz[0, 0]
    assert bandwidth_claim(estimate, record).warnings == ()
    vague = bandwidth_claim(replace(estimate, covariance=1e7 * estimate.covariance), record)
    assert_withheld(vague, "spans more than a factor of 100")


def test_a_record_shorter_than_half_a_period_of_the_bandwidth_does_not_tell_it():
    u = np.random.default_rng(5).standard_normal(400)
    y = lfilter([0, 0.1], [1, -0.9], u)
    assert claimed(IOData(u, y, DT), arx).hz == pytest.approx(0.839, rel=0.01)
    for samples in (8, 20):
        length, lowest = f"{samples * DT:.3g} s", f"{0.5 / samples / DT:.2g} Hz"
        reason = f"the record of {length} holds no half period of frequencies below {lowest}"
        assert_withheld(claimed(IOData(u[:samples], y[:samples], DT), arx), reason)


def test_a_bandwidth_below_the_excitation_is_not_claimed():
    rng = np.random.default_rng(2)
    u = np.sin(2 * np.pi * 5.0 * DT * np.arange(4000)) + np.sin(2 * np.pi * 8.0 * DT * np.arange(4000))
    y = lfilter([0, 0.1], [1, -0.9], u) + 1e-3 * rng.standard_normal(4000)
    assert_withheld(claimed(IOData(u, y, DT).detrend()), "excites nothing below 5 Hz")


@pytest.mark.parametrize("skip", [0, 37])
def test_a_periodic_record_extrapolates_to_zero(skip):
    rng = np.random.default_rng(3)
    period = np.repeat(rng.choice([-1.0, 1.0], 50), 2)
    u = np.tile(period, 42)[skip:] + 1e-3 * rng.standard_normal(4200 - skip)
    y = lfilter([0, 0.1], [1, -0.9], u) + 1e-3 * rng.standard_normal(len(u))
    claim = claimed(IOData(u, y, DT).detrend())
    assert claim.hz == pytest.approx(0.839, rel=0.02)
    expected = "nothing below 0.5 Hz is excited; the gain at 0 Hz, and with it the bandwidth, is extrapolated"
    assert claim.warnings == (expected,)


def test_broad_excitation_reaches_down_to_zero():
    rng = np.random.default_rng(4)
    white = rng.standard_normal(2000)
    tone = np.sin(2 * np.pi * 3.0 * DT * np.arange(2000))
    for u in (white, lfilter([1], [1, -0.95], white), tone + 0.3 * white):
        assert lowest_excited(IOData(u, u, DT).detrend()) == 0.0
    assert lowest_excited(IOData(tone, tone, DT)) == pytest.approx(3.0)
    assert lowest_excited(IOData(tone + 1.0, tone, DT)) == 0.0  # a mean that is left in excites 0 Hz


def chirp(low, high, duration, dt):
    time = np.arange(round(duration / dt)) * dt
    return np.sin(2 * np.pi * (low * time + 0.5 * (high - low) / duration * time**2))


@pytest.mark.parametrize("low, high", [(2.0, 20.0), (5.0, 20.0)])
def test_a_chirp_excites_from_its_first_to_its_last_frequency(low, high):
    u = chirp(low, high, 20.0, 0.01)
    # a sweep of 1 Hz/s blurs its ends by some tenths of 1 Hz
    assert excited_band(IOData(u, u, 0.01).detrend()) == pytest.approx((low, high), abs=0.5)
    assert excited_band(IOData(u[::-1], u, 0.01).detrend()) == pytest.approx((low, high), abs=0.5)


def test_a_chirp_over_the_whole_record_gives_the_bandwidth():
    """A PD joint at 1 kHz under 0.1 to 8 Hz: the half-power frequency of wn^2 / (s^2 + 2 z wn s + wn^2) is known."""
    dt, wn, zeta = 1e-3, 2 * np.pi * 5.0, 0.26
    u = chirp(0.1, 8.0, 30.0, dt)
    b, a, _ = cont2discrete(([wn**2], [1.0, 2 * zeta * wn, wn**2]), dt)
    y = lfilter(b.ravel(), a, u) + 1e-4 * np.random.default_rng(0).standard_normal(len(u))
    record = IOData(u, y, dt)
    claim = bandwidth_claim(oe(record, 2, 2, 1), record)
    root = 1.0 - 2.0 * zeta**2
    exact = 5.0 * np.sqrt(root + np.sqrt(root**2 + 1.0))
    assert claim.hz == pytest.approx(exact, rel=1e-3)
    assert claim.warnings == ()


def tones(highest, samples, dt, rng):
    time = np.arange(samples) * dt
    return sum(np.sin(2 * np.pi * highest * k / 12 * time + rng.uniform(0, 6)) / k for k in range(1, 13))


@pytest.mark.parametrize("highest", [0.5, 1.0, 3.0])
def test_a_bandwidth_above_the_tones_of_the_input_is_extrapolated(highest):
    """A servo of 8 Hz under commands of 12 tones: nothing in the record shows what happens above the last tone."""
    dt, wn = 0.01, 2 * np.pi * 8.0
    rng = np.random.default_rng(5)
    u = tones(highest, 6000, dt, rng)
    assert excited_band(IOData(u, u, dt))[1] == pytest.approx(highest, rel=0.05)
    b, a, _ = cont2discrete(([wn**2], [1.0, 1.8 * wn, wn**2]), dt)
    y = lfilter(b.ravel(), a, u) + 2e-5 * rng.standard_normal(len(u))
    record = IOData(u, y, dt)
    assert_withheld(
        bandwidth_claim(oe(record, 2, 2, 1), record), f"times the highest frequency that the input excites, {highest:g}"
    )
    # records that judge the model and excite more are evidence of the response there
    white = rng.standard_normal(2000)
    judged = bandwidth_claim(oe(record, 2, 2, 1), record, judged=(IOData(white, white, dt),))
    assert judged.hz == pytest.approx(5.918, rel=0.01)


def test_a_bandwidth_little_above_strong_lines_of_the_input_is_claimed_and_said_to_be_extrapolated():
    dt, wn = 0.01, 2 * np.pi * 2.0
    rng = np.random.default_rng(6)
    b, a, _ = cont2discrete(([wn**2], [1.0, 1.6 * wn, wn**2]), dt)
    # the exact bandwidth of a pair with damping 0.8: 0.871 of its natural frequency
    for highest, is_claimed in ((1.3, True), (0.9, False)):
        phases = rng.uniform(0, 6, 12)
        t = np.arange(6000) * dt
        u = sum(np.sin(2 * np.pi * highest * k / 12 * t + phases[k - 1]) for k in range(1, 13))
        record = IOData(u, lfilter(b.ravel(), a, u) + 1e-2 * rng.standard_normal(len(u)), dt)
        claim = bandwidth_claim(oe(record, 2, 2, 1), record)
        assert claim.refused is not is_claimed
        if is_claimed:
            assert claim.hz == pytest.approx(0.871 * 2.0, rel=0.03)
            assert "the bandwidth is extrapolated: it is 1.3 times the highest frequency" in claim.warnings[0]


def test_weak_lines_count_where_the_response_exceeds_the_noise():
    """A single step: its spectrum falls far below the strongest line, but determines a fast plant."""
    u = np.where(np.arange(600) > 250, 1.0, 0.0)
    y = lfilter([0, 0.5], [1, -0.5], u)
    noise = np.random.default_rng(1).standard_normal(600)
    quiet, noisy = (IOData(u, y + size * noise, DT).detrend() for size in (1e-3, 0.3))
    # |0.5 / (1 - 0.5 exp(-i w))|^2 is a half where cos w = 0.75
    assert claimed(quiet).hz == pytest.approx(np.arccos(0.75) / (2 * np.pi * DT), rel=0.02)
    assert_withheld(claimed(noisy), "times the highest frequency that the input excites")


def test_no_bandwidth_of_a_model_is_no_claim_above_the_excitation():
    """A servo that follows slow tones within the noise: a model without bandwidth does not show that it has none."""
    rng = np.random.default_rng(7)
    u = tones(1.0, 3000, 0.01, rng)
    record = IOData(u, u + 1e-2 * rng.standard_normal(3000), 0.01).detrend()
    assert_withheld(
        bandwidth_claim(arx(record, 0, 1, 0), record), "the model has none, but the input excites nothing above 1"
    )
    white = rng.standard_normal(3000)
    followed = IOData(white, white + 1e-2 * rng.standard_normal(3000), 0.01).detrend()
    assert not bandwidth_claim(arx(followed, 0, 1, 0), followed).refused
