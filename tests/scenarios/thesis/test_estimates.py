"""Estimates and fits are computed once per record."""

import gc
import weakref

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from hmtb_twin import linearize
from scenarios.experiments.campaign import NOMINAL
from scenarios.identification import methods
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.estimates import Fits, estimate, fits
from sysid import IOData, SysidError


def record(seed=0):
    u, noise = np.random.default_rng(seed).standard_normal((2, 400))
    return IOData(u, lfilter([0.0, 0.5], [1.0, -0.8], u) + 0.01 * noise, 0.02)


@pytest.fixture
def calls(monkeypatch):
    """Names of the estimators that ran, in sequence."""
    ran = []
    own = methods.estimate

    def counted(data, name, orders, **options):
        ran.append(name)
        return own(data, name, orders, **options)

    monkeypatch.setattr(methods, "estimate", counted)
    return ran


def test_an_estimate_is_computed_once_for_each_record_and_structure(calls):
    one, other = record(), record()
    assert estimate(one, "arx", (1, 1, 1)) is estimate(one, "arx", [1, 1, 1])
    assert calls == ["arx"]
    np.testing.assert_array_equal(
        estimate(other, "arx", (1, 1, 1)).parameters, estimate(one, "arx", (1, 1, 1)).parameters
    )
    estimate(one, "arx", (2, 1, 1))
    estimate(one, "oe", (1, 1, 1))
    assert calls == ["arx", "arx", "arx", "oe"]


def test_a_refusal_is_raised_each_time():
    data = record()
    for _ in range(2):
        with pytest.raises(SysidError, match="too many orders"):
            estimate(data, "arx", (300, 300, 1))


def test_fits_are_those_of_the_toolbox_for_estimate_and_model_alike(monkeypatch):
    data, model = record(), estimate(record(1), "arx", (1, 1, 1))
    (expected,) = sysid.compare(model, data)
    followed = fits(model, data)
    assert followed == Fits(float(expected.simulation[0]), float(expected.one_step[0]))
    monkeypatch.setattr(sysid, "compare", lambda *_: pytest.fail("compared twice"))
    assert fits(model.model, data) is followed


@pytest.mark.slow
def test_results_end_with_their_record():
    data = record()
    model = weakref.ref(estimate(data, "arx", (1, 1, 1)))
    fits(model(), data)
    del data
    gc.collect()
    assert model() is None


@pytest.mark.slow
def test_a_campaign_prepares_a_record_once(synthetic_logs):
    name = "siso-5-elbow_pitch"
    campaign = Campaign(NOMINAL, linearize(NOMINAL.arm()), synthetic_logs([name]), {})
    assert (
        campaign.single(5, "elbow_pitch") is campaign.singles("elbow_pitch")[5] is campaign.record(name, "elbow_pitch")
    )
