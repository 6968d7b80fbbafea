import re
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidWarning, arx, oe, okid, order_of_excitation
from sysid.polynomial.data_checks import check_means
from tests.refusals import refused
from tests.sysid.systems import A, B, second_order

T = np.arange(2000)


@pytest.mark.parametrize(
    ("signal", "order"),
    [
        (np.sin(0.3 * T), 2),
        (np.sin(0.3 * T) + np.sin(1.2 * T), 4),
        (1.0 + np.sin(0.3 * T), 3),
        (np.ones(2000), 1),
        (np.zeros(2000), 0),
        (np.random.default_rng(0).standard_normal(2000), 20),
        (np.where(T % 8 < 4, 1.0, -1.0), 4),
    ],
)
def test_known_orders(signal, order):
    assert order_of_excitation(signal, max_order=20) == order
    refused("one input at a time", lambda: order_of_excitation(np.ones((50, 2)), max_order=3))
    refused("max_order", lambda: order_of_excitation(T[:10], max_order=6))


@pytest.mark.parametrize("highest", [0.5, 3.0])
def test_slow_tones_excite_two_orders_each(highest):
    """At 100 Hz successive samples of tones below 0.5 Hz are nearly alike: the lags of all samples have rank 4."""
    time, rng = 0.01 * np.arange(6000), np.random.default_rng(5)
    u = sum(np.sin(2 * np.pi * highest * k / 12 * time + rng.uniform(0, 6)) / k for k in range(1, 13))
    for asked in (4, 10, 24, 30):
        assert order_of_excitation(u, max_order=asked) == min(asked, 24)
    assert order_of_excitation(np.sin(1e-3 * T)) == 2
    assert order_of_excitation(T.astype(float) ** 2) == 3


@pytest.mark.parametrize("value", [1.0, 3.7, 1e6 / 3.0, -0.1, 1e-9])
@pytest.mark.parametrize("order", [0, 1])
def test_a_constant_input_is_refused_even_when_its_mean_is_removed(value, order):
    """Removing a mean leaves rounding behind, which would excite as noise does."""
    y = np.random.default_rng(0).standard_normal(333)
    constant = IOData(np.full(333, value), y, 0.1)
    np.testing.assert_array_equal(constant.detrend(order).u, 0.0)
    shaken = IOData(value * (1.0 + 4e-16 * np.sign(y)), y, 0.1)
    for data in (constant, constant.detrend(order), shaken, constant.subtract(u=value * (1 + 1e-15))):
        for identify in (lambda d: arx(d, 1, 1), lambda d: oe(d, 1, 1), lambda d: okid(d, 1, p=2)):
            refused("u1 is constant", identify, data)


@pytest.mark.filterwarnings("ignore:the regressors have rank")
def test_two_sines_are_too_few_for_a_fifth_order_model():
    u = np.sin(0.3 * T) + np.sin(1.2 * T)
    y = np.convolve(u, [0.0, 1.0, 0.5])[:2000] + 0.01 * np.random.default_rng(0).standard_normal(2000)
    with pytest.warns(SysidWarning, match="exciting of order 4 only, the model needs 5"):
        estimate = arx(IOData(u, y, 0.02), 5, 5)
    assert "order 4 only" in estimate.diagnostics["warnings"][0]


def record(level_u, level_y, noise=0.1):
    data = second_order(noise=noise, d=[1.0])
    return IOData(data.u + level_u, data.y + level_y, 0.1)


@pytest.mark.parametrize(
    "fit",
    [
        lambda d: sysid.arx(d, 2, 2),
        lambda d: sysid.oe(d, 2, 2),
        lambda d: sysid.armax(d, 2, 2, 2),
        lambda d: sysid.iv4(d, 2, 2),
        lambda d: sysid.n4sid(d, 2),
        lambda d: sysid.rarx(d, 2, 2).final,
    ],
)
def test_an_offset_that_no_gain_explains_is_reported(fit):
    data = record(10.0, 40.0)
    with pytest.warns(
        SysidWarning,
        match=r"the mean dominates u1 \(mean 9\.9\d+, .* output y1 has an offset of about -3\d\.\d+ that .* detrend",
    ):
        bent = fit(data)
    assert abs(bent.dc_gain()[0, 0] - 7.5) > 3.0
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        assert fit(data.detrend()).dc_gain()[0, 0] == pytest.approx(7.5, rel=0.1)


def test_one_mean_is_enough_also_without_noise_and_small_ones_are_left_alone():
    assert check_means([record(10.0, 40.0, noise=0.0)], 2)
    assert "the mean dominates y1" in check_means([record(0.0, 40.0)], 2)[0]
    assert "the mean dominates u1" in check_means([record(10.0, 2.0)], 2)[0]
    assert not check_means([record(0.5, 2.0)], 2)


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_means_that_the_gain_explains_are_left_alone(noise, order):
    rng = np.random.default_rng(1)
    step = np.repeat([0.0, 1.0], [10, 390])
    for u in (step, 5.0 + rng.standard_normal(400), 5.0 + np.repeat(rng.standard_normal(20), 20)):
        y = lfilter(B, A, u) + noise * rng.standard_normal(400)
        assert not check_means([IOData(u, y, 0.1)], order)
        assert not check_means([IOData(u[100:], y[100:], 0.1)], order)


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
def test_the_offset_of_a_slow_process_is_reported(noise):
    """From sample to sample its output moves less than the noise does."""
    u = np.repeat([1.0, 3.0, 1.0, 3.0, 1.0, 3.0], 120)
    pole = np.exp(-5.0 / 600.0)
    y = lfilter(np.r_[np.zeros(10), 2.0 * (1.0 - pole)], [1.0, -pole], u - 1.0) + 2.0
    y += noise * np.random.default_rng(0).standard_normal(720)
    assert re.search(r"offset of about (18|19|20)\.", check_means([IOData(u, y + 19.5, 5.0)], 1)[0])
    assert not check_means([IOData(u, y, 5.0)], 1)


@pytest.mark.parametrize("method", [sysid.spa, sysid.welch])
def test_spectra_name_the_channels_whose_mean_leaks(method):
    leak = r"the mean dominates u1 \(mean 9\.\d+, standard deviation [\d.]+\), y1"
    with pytest.warns(SysidWarning, match=leak) as warned:
        method(record(10.0, 40.0))
    assert sum("the mean dominates" in str(one.message) for one in warned) == 1
