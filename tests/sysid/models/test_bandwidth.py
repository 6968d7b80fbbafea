from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, arx, oe
from sysid.models.bandwidth import bandwidth_claim, lowest_excited

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


def test_a_record_shorter_than_a_period_of_the_bandwidth_does_not_tell_it():
    u = np.random.default_rng(5).standard_normal(400)
    y = lfilter([0, 0.1], [1, -0.9], u)
    assert claimed(IOData(u, y, DT), arx).hz == pytest.approx(0.839, rel=0.01)
    for samples in (8, 40):
        length, lowest = f"{samples * DT:.3g} s", f"{1 / samples / DT:.2g} Hz"
        reason = f"the record of {length} holds no full period of frequencies below {lowest}"
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
