"""Correlation analysis: the impulse response within its own bounds."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, cra
from tests.sysid.refusals import refused


def record(seed: int, kind: str, noise: float = 0.3, samples: int = 1200) -> IOData:
    rng = np.random.default_rng(seed)
    if kind == "binary":
        u = rng.choice([-1.0, 1.0], samples)
    else:
        u = lfilter([1.0], [1, -0.8] if kind == "coloured" else [1.0], rng.standard_normal(samples))
    e = lfilter([1.0], [1, -0.5], rng.standard_normal(samples))
    return IOData(u + 3.0, lfilter([0, 0, 0, 0, 0.5], [1, -0.8], u) + noise * e - 2.0, 0.1)[100:]


TRUTH = np.concatenate((np.zeros(4), 0.5 * 0.8 ** np.arange(27)))


@pytest.mark.parametrize("kind", ["white", "binary", "coloured"])
@pytest.mark.parametrize("noise", [0.02, 0.5])
def test_intervals_hold_at_their_level(kind: str, noise: float) -> None:
    inside, silent = [], []
    for seed in range(60):
        found = cra(record(seed, kind, noise), lags=30)
        low, high = (edge[:, 0, 0] for edge in found.interval())
        inside.append(np.mean((low <= TRUTH) & (high >= TRUTH)))
        silent.append(np.mean(np.abs(found.response[:4, 0, 0]) <= found.bound[:4, 0, 0]))
    assert 0.98 <= np.mean(inside) <= 1.0
    # 99 % of 240
    assert np.mean(silent) >= 0.97
    assert np.abs(found.response[4, 0, 0]) > found.bound[4, 0, 0]


def test_bounds_are_no_wider_than_they_must_be() -> None:
    """The scatter over draws is the deviation claimed."""
    responses = [cra(record(seed, "white"), lags=12) for seed in range(100)]
    scatter = np.std([r.response[:, 0, 0] for r in responses], axis=0)
    claimed = np.mean([r.deviation[:, 0, 0] for r in responses], axis=0)
    assert 0.85 < np.mean(scatter / claimed) < 1.15


def test_it_solves_the_equations_of_correlation_analysis() -> None:
    data = record(0, "white").detrend()
    found = cra(data, lags=5, whitening=0)
    u, y = data.u[:, 0], data.y[:, 0]
    table = np.column_stack([u[5 - k : len(u) - k] for k in range(6)])
    table -= table.mean(axis=0)
    expected = np.linalg.solve(table.T @ table, table.T @ (y[5:] - y[5:].mean()))
    np.testing.assert_allclose(found.response[:, 0, 0], expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.step_response[2], found.response[:3].sum(axis=0))
    np.testing.assert_allclose(found.time, 0.1 * np.arange(6))


def test_several_channels_and_experiments() -> None:
    """A response that ends within the lags comes out exactly, also of inputs that correlate."""
    rng = np.random.default_rng(0)
    parts = []
    for samples in (300, 500):
        u = rng.standard_normal((samples, 2)) @ [[1.0, 0.9], [0.0, 0.4]]
        y = np.column_stack((lfilter([0, 1.0], 1, u[:, 0]), lfilter([0, 0, 2.0], 1, u[:, 1])))
        parts.append(IOData(u, y, 0.1, window=20))
    found = cra(parts, lags=4)
    expected = np.zeros((5, 2, 2))
    expected[1, 0, 0], expected[2, 1, 1] = 1.0, 2.0
    np.testing.assert_allclose(found.response, expected, atol=1e-10)


def test_refusals() -> None:
    data = record(0, "white", samples=160)
    refused("too little data: lags = 30 give 31", lambda: cra(data[:90], lags=30))
    refused("whitening", lambda: cra(data, whitening=-1))
    refused("level", lambda: cra(data, lags=5, level=0.0))
    refused("constant", lambda: cra(IOData(np.ones(100), np.arange(100.0), 0.1), lags=5))
