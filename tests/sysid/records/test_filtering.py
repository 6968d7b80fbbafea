"""Filtering and resampling leave the system unchanged."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from sysid import IOData, arx, keep_band, prefilter, resample
from tests.sysid.refusals import refused


def test_a_prefiltered_record_has_the_same_model() -> None:
    u = np.random.default_rng(0).standard_normal(400)
    data = IOData(u, lfilter([0, 1, 0.5], [1, -1.5, 0.7], u), 0.1, window=5, name="run")
    found = prefilter(data, *butter(2, 0.4))
    assert (found.window, found.name) == (5, "run")
    assert np.abs(found.y - data.y).max() > 0.1
    fit = arx(found[100:], 2, 2)
    np.testing.assert_allclose(fit.parameters, [-1.5, 0.7, 1.0, 0.5], atol=1e-7)


def test_a_constant_passes_without_a_transient() -> None:
    data = IOData(np.full(50, 2.0), np.full(50, -3.0), 0.1)
    np.testing.assert_allclose(prefilter(data, *butter(3, 0.2)).u, 2.0, rtol=1e-9)
    np.testing.assert_allclose(prefilter(data, [0.5]).y, -1.5)


def test_a_band() -> None:
    t = np.arange(1000) * 0.01
    slow, middle, fast = (np.sin(2 * np.pi * f * t) for f in (1.0, 5.0, 20.0))
    data = IOData(slow + middle + fast + 4.0, middle + fast, 0.01)
    np.testing.assert_allclose(keep_band(data, 2.0, 10.0).u[:, 0], middle, atol=1e-12)
    np.testing.assert_allclose(keep_band(data, 2.0).u[:, 0], middle + fast, atol=1e-12)
    np.testing.assert_allclose(keep_band(data, high_hz=1.0).u[:, 0], 4.0 + slow, atol=1e-12)


def test_refusals() -> None:
    data = IOData(np.arange(20.0), np.arange(20.0), 0.1)
    refused(r"not stable: largest pole modulus 1\.5", lambda: prefilter(data, 1.0, [1.0, -1.5]))
    refused("rows of coefficients", lambda: prefilter(data, 1.0, [0.0, 1.0]))
    refused(r"they are 0 to 5 Hz in steps of 0\.5", lambda: keep_band(data, 5.1, 6.0))
    gapped = IOData([1.0, 2.0, 3.0], [1.0, np.nan, 2.0], 0.1, missing=True)
    refused("complete_parts", lambda: keep_band(gapped))
    refused("complete_parts", lambda: prefilter(gapped, [1.0, 2.0]))


T = np.arange(1200) * 0.01


def test_slow_signals_stay_and_fast_ones_do_not_alias() -> None:
    slow, fast = np.sin(2 * np.pi * 1.3 * T), np.sin(2 * np.pi * 38.0 * T)
    found = resample(IOData(slow + 5.0, slow + fast, 0.01, window=20, output_units=("rad",)), 1, 4)
    assert (len(found), found.dt, found.window, found.intersample) == (300, 0.04, 5, "bl")
    assert found.output_units == ("rad",)
    middle = slice(30, -30)
    np.testing.assert_allclose(found.u[middle, 0], 5.0 + slow[::4][middle], atol=2e-3)
    # 38 Hz would come back at 12 Hz
    np.testing.assert_allclose(found.y[middle, 0], slow[::4][middle], atol=5e-3)


@pytest.mark.parametrize(("up", "down"), [(3, 2), (2, 1), (4, 6)])
def test_rational_ratios(up: int, down: int) -> None:
    slow = np.sin(2 * np.pi * 1.3 * T)
    found = resample(IOData(slow, 2 * slow, 0.01), up, down)
    assert found.dt == pytest.approx(0.01 * down / up)
    np.testing.assert_allclose(found.time[60:-60], np.arange(len(found))[60:-60] * 0.01 * down / up)
    np.testing.assert_allclose(found.u[60:-60, 0], np.sin(2 * np.pi * 1.3 * found.time[60:-60]), atol=2e-3)
    np.testing.assert_allclose(found.y, 2 * found.u, rtol=1e-9, atol=1e-12)


def test_refusals_of_resampling() -> None:
    data = IOData(T, T, 0.01)
    assert resample(data, 3, 3) is data
    refused("down must be", lambda: resample(data, 1, 0))
    refused("of 1200 samples only 1 would remain", lambda: resample(data, 1, 1200))
    refused("complete_parts", lambda: resample(IOData([1.0, 2.0, 3.0], [1.0, np.nan, 2.0], 0.1, missing=True), 2))
