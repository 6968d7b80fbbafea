"""Means that dominate: told where a model without offset is bent by them, and only there."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidWarning
from sysid.polynomial.data_checks import check_means

B, A = [0.0, 1.0, 0.5], [1.0, -1.5, 0.7]


def record(level_u: float, level_y: float, noise: float = 0.1, samples: int = 400) -> IOData:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(samples)
    y = lfilter(B, A, u) + noise * rng.standard_normal(samples)
    return IOData(u + level_u, y + level_y, 0.1)


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
def test_an_offset_that_no_gain_explains_is_told(fit):
    data = record(10.0, 40.0)
    with pytest.warns(SysidWarning, match=r"input u1 has mean 9\.9\d+ .* detrend first"):
        bent = fit(data)
    assert abs(bent.dc_gain()[0, 0] - 7.5) > 3.0
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        assert fit(data.detrend()).dc_gain()[0, 0] == pytest.approx(7.5, rel=0.1)


def test_it_is_told_without_noise_too():
    assert check_means([record(10.0, 40.0, noise=0.0)], 2)


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_means_that_the_gain_explains_are_left_alone(noise, order):
    rng = np.random.default_rng(1)
    step = np.repeat([0.0, 1.0], [10, 390])
    for u in (step, 5.0 + rng.standard_normal(400), 5.0 + np.repeat(rng.standard_normal(20), 20)):
        y = lfilter(B, A, u) + noise * rng.standard_normal(400)
        assert not check_means([IOData(u, y, 0.1)], order)
        assert not check_means([IOData(u[100:], y[100:], 0.1)], order)


def test_offsets_that_do_not_dominate_are_left_alone():
    assert not check_means([record(0.5, 40.0)], 2)
    assert not check_means([record(10.0, 2.0 - 75.0 + 75.0)], 2)


@pytest.mark.parametrize("method", [sysid.spa, sysid.welch])
def test_spectra_name_the_channels_whose_mean_leaks(method):
    said = r"the mean dominates u1 \(mean 9\.\d+, standard deviation [\d.]+\), y1"
    with pytest.warns(SysidWarning, match=said) as caught:
        method(record(10.0, 40.0))
    assert len(caught) == 1
