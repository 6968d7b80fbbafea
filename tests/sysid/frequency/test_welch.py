"""Averaged periodograms: against SciPy, their scale, several channels."""

import numpy as np
import pytest
import scipy.signal
from scipy.signal import lfilter

from sysid import IOData, welch
from tests.sysid.refusals import refused


def test_against_another_implementation() -> None:
    u, e = np.random.default_rng(0).standard_normal((2, 1000))
    y = lfilter([0, 1.0], [1, -0.7], u) + 0.1 * e
    found = welch(IOData(u, y, 0.5), segment=128, window=np.hamming)
    options = {"fs": 2.0, "window": np.hamming(128), "nperseg": 128, "detrend": False, "return_onesided": False}
    phi_uy = scipy.signal.csd(u, y, **options)[1][1:64]
    phi_u = scipy.signal.welch(u, **options)[1][1:64]
    np.testing.assert_allclose(found.cross_spectrum[:63, 0, 0], phi_uy, rtol=1e-9)
    np.testing.assert_allclose(found.input_spectrum[:63, 0, 0], phi_u, rtol=1e-9)
    np.testing.assert_allclose(found.response[:63, 0, 0], phi_uy / phi_u, rtol=1e-9)
    coherence = scipy.signal.coherence(u, y, 2.0, np.hamming(128), 128, detrend=False)[1][1:]
    np.testing.assert_allclose(found.coherence[:, 0, 0], coherence, rtol=1e-9)


def test_experiments_are_averaged_not_joined() -> None:
    data = IOData(*np.random.default_rng(1).standard_normal((2, 900)), 0.1, window=100)
    whole = welch([data[100:500], data[500:]], segment=100, overlap=0.0)
    np.testing.assert_allclose(whole.input_spectrum, welch(data, segment=100, overlap=0.0).input_spectrum, rtol=1e-12)
    assert whole.degrees_of_freedom == pytest.approx(14.0)


def test_two_inputs_are_told_apart() -> None:
    u = np.random.default_rng(2).standard_normal((8000, 2))
    u[:, 1] += 0.8 * u[:, 0]
    y = np.column_stack((u[:, 0] - 2 * u[:, 1], 0.5 * u[:, 1]))
    found = welch(IOData(u, y, 1.0))
    np.testing.assert_allclose(found.response, np.broadcast_to([[1, -2], [0, 0.5]], found.response.shape), atol=1e-10)


def test_refusals() -> None:
    data = IOData(*np.random.default_rng(3).standard_normal((2, 100)), 0.1)
    refused("segment must be", lambda: welch(data, segment=101))
    refused("overlap", lambda: welch(data, overlap=1.0))
    refused("as many finite", lambda: welch(data, segment=10, window=lambda n: np.ones(n + 1)))
    refused("constant", lambda: welch(IOData(np.ones(50), np.arange(50.0), 0.1)))
