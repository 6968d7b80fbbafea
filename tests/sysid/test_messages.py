"""Printed records, and warnings and errors that name the problem."""

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, StateSpace, SysidError, SysidWarning
from tests.sysid.refusals import refused


@pytest.fixture(scope="module")
def data() -> IOData:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(600)
    y = np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    return IOData(u, y + 0.01 * rng.standard_normal(600), 0.02, input_units=("rad",), name="robot")


def test_a_record_is_one_line(data: IOData) -> None:
    assert str(data) == "robot: 600 samples every 0.02 s; input u1 [rad]; output y1"
    assert "the first 10 to initialise" in str(IOData(data.u, data.y, 0.02, window=10))


def test_an_estimate_lists_parameters_with_their_deviations(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    first, *rest = str(found).splitlines()
    assert first.startswith("OE (")
    assert first.endswith("from 600 samples every 0.02 s")
    deviation = np.sqrt(found.covariance[0, 0])
    assert f"  {found.parameter_names[0]} = {found.parameters[0]:.6g} ± {deviation:.2g}" in rest
    assert f"  poles from input to output (z plane): {found.poles()[0].real:.4f}" in rest


def test_a_large_estimate_stays_short(data: IOData) -> None:
    found = sysid.arx(data, 10, 10, 1)
    assert "  20 parameters" in str(found)
    assert str(found).count("\n") == 4
    assert str(replace(found, diagnostics={"warnings": ("poor",)})).endswith("\n  warning: poor")


def test_fits_and_tests_say_their_verdict(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    (fit,) = sysid.compare({"mine": found}, data)
    expected = f"mine: {fit.simulation[0]:.2f} % in simulation, {fit.one_step[0]:.2f} % one step ahead"
    assert str(fit) == expected
    good, bad = sysid.resid(found, data), sysid.resid(sysid.oe(data, 1, 0, 1), data)
    assert str(good).splitlines()[2].startswith("  y1 and u1: independent (p = ")
    assert "not passed" in str(bad)
    assert "y1: not white" in str(bad)


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
    refused(rf"at sample \d+ .*{hint}", lambda: sysid.rarx(data, 2, 2, adaptation=rule))


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
    refused("2 zeros and only 1 poles", lambda: sysid.c2d(control.tf([1.0, 1.0, 1.0], [1.0, 1.0]), 0.1))
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
    refused("models or estimates", lambda: sysid.compare(3, IOData([1.0, 2.0], [1.0, 2.0], 0.1)))
