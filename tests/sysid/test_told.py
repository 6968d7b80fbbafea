"""What estimates say of themselves: worthless fits, wound-up recursions, wrong periods, intervals without an end."""

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, StateSpace, SysidError, SysidWarning


def test_okid_says_where_its_model_is_worth_nothing():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + 40.0
    with pytest.warns(SysidWarning, match=r"worse than that of their mean: y1 -\d+ %"):
        sysid.okid(IOData(u + 10.0, y + 0.1 * rng.standard_normal(400), 0.1), 2, p=10)


@pytest.mark.parametrize(
    ("rule", "hint"),
    [(sysid.recursive.Forgetting(0.7), "larger forgetting"), (sysid.recursive.Gradient(1e3, False), "smaller gain")],
)
def test_a_recursion_that_goes_astray_says_where(rule, hint):
    rng = np.random.default_rng(0)
    u = np.where(np.arange(2000) < 500, rng.standard_normal(2000), 0.0)
    data = IOData(u, lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + 1e-3 * rng.standard_normal(2000), 0.1)
    with pytest.raises(SysidError, match=rf"at sample \d+ .*{hint}"):
        sysid.rarx(data, 2, 2, adaptation=rule)


def test_a_wrong_period_is_told():
    rng = np.random.default_rng(0)
    u = np.tile(rng.standard_normal(100), 6)
    data = IOData(u, lfilter([0.0, 1.0], [1.0, -0.8], u) + 0.01 * rng.standard_normal(600), 0.1, window=100)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sysid.bla(data, 100)
    with pytest.warns(SysidWarning, match=r"input u1 of experiment 0 is not periodic with 90 samples: .* \d+\.?\d* %"):
        sysid.bla(data, 90)


def test_a_bandwidth_that_the_data_do_not_tell_ends_at_nyquist():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    found = sysid.arx(IOData(u, lfilter([0.0, 0.1], [1.0, -0.9], u) + 0.01 * rng.standard_normal(300), 0.1), 1, 1)
    (low,), (high,) = found.bandwidth().ci95
    assert 0.0 < low < high < 5.0
    vague = replace(found, covariance=4e3 * found.covariance)
    assert vague.bandwidth().ci95[1] == 5.0
    with pytest.warns(SysidWarning, match="bandwidth is not determined"):
        nothing = replace(found, covariance=1e6 * found.covariance).bandwidth()
    assert nothing.ci95 == (0.0, 5.0)


def test_a_gain_has_no_dynamics_to_sample():
    for system in (control.ss([], [], [], [[2.0]]), control.tf([2.0], [1.0])):
        assert sysid.c2d(system, 0.1).order == sysid.models.continuous.c2d_matched(system, 0.1).order == 0
        assert sysid.c2d(system, 0.1).dc_gain() == sysid.models.continuous.c2d_matched(system, 0.1).dc_gain() == 2.0
    with pytest.raises(SysidError, match="2 zeros and only 1 poles"):
        sysid.c2d(control.tf([1.0, 1.0, 1.0], [1.0, 1.0]), 0.1)
    assert sysid.c2d(control.tf([1.0], [1.0, 1.0]), np.int64(2)).dt == 2.0


@pytest.mark.filterwarnings("ignore:Badly conditioned")
def test_a_leading_coefficient_of_rounding_is_none():
    rounded, exact = (
        sysid.models.continuous.c2d_matched(control.tf(n, [1.0, 2.0, 1.0]), 0.1) for n in ([1e-17, 1.0], [1.0])
    )
    np.testing.assert_allclose(rounded.markov(9), exact.markov(9), rtol=1e-12)


def test_short_forms_are_short():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(400)
    data = IOData(u, lfilter([0.0, 1.0], [1.0, -0.8], u) + 0.1 * rng.standard_normal(400), 0.1, name="run")
    found = sysid.oe(data, 1, 1)
    assert repr(data) == "<IOData run: 400 samples every 0.1 s; input u1; output y1>"
    assert repr(found) == "<Estimate: OE (nb 1, nf 1, nk 1) from 400 samples every 0.1 s>"
    assert repr(found.bandwidth()) == "Bandwidth(hz=<1 x 1>, ci95=(<1 x 1>, <1 x 1>))"
    records = [
        found.model,
        found.frequency_response([1.0, 2.0]),
        sysid.delayest(data),
        sysid.identifiability(found),
        sysid.band(found, StateSpace.dc_gain),
        sysid.cross_validate(lambda parts: sysid.arx(parts, 1, 1), data),
        sysid.era(found.model.markov(20), 1),
        sysid.rarx(data, 1, 1),
        sysid.resid(found, data),
        *sysid.compare(found, data),
    ]
    for record in records:
        assert len(repr(record)) <= 160
        assert "\n" not in repr(record)


def test_deviations_that_are_not_known_are_left_out():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(200)
    assert "nan" not in str(sysid.n4sid(IOData(u, lfilter([0.0, 1.0], [1.0, -0.8], u), 0.1), 1))


def test_fits_of_lists_and_of_what_is_none():
    assert sysid.validation.fit_percent([1, 2, 3], [1, 2, 3]) == 100.0
    for wrong in (
        lambda: sysid.validation.fit_percent([1, 2, 3], [1, np.nan, 3]),
        lambda: sysid.validation.fit_percent("ab", [1, 2]),
    ):
        with pytest.raises(SysidError):
            wrong()
    with pytest.raises(SysidError, match="models or estimates"):
        sysid.compare(3, IOData([1.0, 2.0], [1.0, 2.0], 0.1))
