"""Covariance functions as a record."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, covf
from tests.sysid.refusals import refused


def test_blocks_and_names() -> None:
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((50, 2)), rng.standard_normal((50, 1))
    found = covf(IOData(u, y, 0.1, window=10, input_names=("a", "b")), lags=4)
    assert found.names == ("y1", "a", "b")
    assert (found.output.shape, found.input.shape, found.cross.shape) == ((9, 1, 1), (9, 2, 2), (9, 1, 2))
    by_hand = sum(y[t + 3, 0] * u[t, 1] for t in range(10, 47)) / 40
    assert found.cross[7, 0, 1] == pytest.approx(by_hand, rel=1e-12)
    np.testing.assert_allclose(np.diagonal(found.normalised[4]), 1.0)
    np.testing.assert_allclose(found.values[::-1].transpose(0, 2, 1), found.values, atol=1e-13)


def test_known_covariance_of_an_autoregression() -> None:
    y = lfilter([1.0], [1, -0.8], np.random.default_rng(1).standard_normal(400_000))
    found = covf(IOData(y, y, 1.0), lags=3)
    np.testing.assert_allclose(found.output[3:, 0, 0], 0.8 ** np.arange(4) / (1 - 0.64), rtol=0.03)


def test_refusals() -> None:
    refused("lags must be", lambda: covf(IOData([1.0, 2.0], [1.0, 2.0], 0.1), lags=2))
