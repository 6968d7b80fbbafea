"""Filters leave the system what it is."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from sysid import IOData, SysidError, arx, keep_band, prefilter


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
    with pytest.raises(SysidError, match=r"not stable: largest pole modulus 1\.5"):
        prefilter(data, 1.0, [1.0, -1.5])
    with pytest.raises(SysidError, match="rows of coefficients"):
        prefilter(data, 1.0, [0.0, 1.0])
    with pytest.raises(SysidError, match=r"they are 0 to 5 Hz in steps of 0\.5"):
        keep_band(data, 5.1, 6.0)
    gapped = IOData([1.0, 2.0, 3.0], [1.0, np.nan, 2.0], 0.1, missing=True)
    with pytest.raises(SysidError, match="complete_parts"):
        keep_band(gapped)
    with pytest.raises(SysidError, match="complete_parts"):
        prefilter(gapped, [1.0, 2.0])
