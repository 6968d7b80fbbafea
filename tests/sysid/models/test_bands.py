"""Bands of whatever follows from a model."""

from typing import Any

import numpy as np
import pytest

from sysid import StateSpace, band, n4sid, oe
from sysid.models import poles_band, sampled_band, zeros_band
from sysid.models.bands import sample_models
from tests.sysid.refusals import refused


def step(model: StateSpace) -> np.ndarray:
    return model.step_response(60)[:, 0, 0]


def test_pole_and_gain_of_a_first_order_model_by_hand(p2: Any) -> None:
    """G = b / (z + f): pole -f, gain b / (1 + f)."""
    estimate = oe(p2.draw(0), 1, 1)
    b, f = estimate.parameters
    found = poles_band(estimate)
    np.testing.assert_allclose(found.roots, [-f])
    np.testing.assert_allclose(found.covariance[0], [[estimate.covariance[1, 1], 0], [0, 0]], rtol=1e-6, atol=1e-20)
    np.testing.assert_allclose(found.modulus_deviation(), np.sqrt(estimate.covariance[1, 1]), rtol=1e-6)
    gradient = np.array([1 / (1 + f), -b / (1 + f) ** 2])
    expected = np.sqrt(gradient @ estimate.covariance @ gradient)
    gain = band(estimate, StateSpace.dc_gain)
    np.testing.assert_allclose(gain.deviation, [[expected]], rtol=1e-4)
    np.testing.assert_allclose(gain.ci95[1] - gain.value, 1.959964 * gain.deviation, rtol=1e-6)


def test_zero_of_a_second_order_model_by_hand(p2: Any) -> None:
    """B = b1 z + b2: the zero is -b2 / b1."""
    estimate = oe(p2.draw(0), 2, 2)
    b1, b2 = estimate.parameters[:2]
    gradient = np.array([b2 / b1**2, -1 / b1, 0, 0])
    found = zeros_band(estimate)
    np.testing.assert_allclose(found.roots, [-b2 / b1], rtol=1e-9)
    np.testing.assert_allclose(found.covariance[0, 0, 0], gradient @ estimate.covariance @ gradient, rtol=1e-3)


def test_draws_agree_with_the_delta_method(p2: Any) -> None:
    estimate = oe(p2.draw(1), 2, 2)
    first = band(estimate, step)
    drawn = sampled_band(estimate, step, np.random.default_rng(0), draws=1000)
    # a standard deviation from 1000 draws has one of 2.2 %
    np.testing.assert_allclose(drawn.deviation[5:], first.deviation[5:], rtol=0.1)
    np.testing.assert_allclose(drawn.ci95, first.ci95, atol=0.3 * first.deviation.max())
    poles = np.array([m.poles() for m in sample_models(estimate, np.random.default_rng(1), draws=1000)])
    np.testing.assert_allclose(poles.real.std(axis=0), np.sqrt(poles_band(estimate).covariance[:, 0, 0]), rtol=0.1)


@pytest.mark.slow
def test_bands_cover(p2: Any) -> None:
    truth = p2.model
    response, poles, zeros = step(truth), truth.poles(), truth.zeros()
    hits = []
    for seed in range(100):
        estimate = oe(p2.draw(seed)[:3000], 2, 2)
        low, high = band(estimate, step).ci95
        gain = band(estimate, StateSpace.dc_gain)
        found = poles_band(estimate)
        inside = np.abs(found.roots - poles).real <= 1.96 * np.sqrt(found.covariance[:, 0, 0])
        ring = zeros_band(estimate)
        hits.append(
            [
                np.mean(((low <= response) & (response <= high))[1:]),
                (gain.ci95[0] <= truth.dc_gain()).all() and (truth.dc_gain() <= gain.ci95[1]).all(),
                inside.mean(),
                abs(ring.roots[0] - zeros[0]) <= 1.96 * np.sqrt(ring.covariance[0, 0, 0]),
            ]
        )
    # three binomial standard deviations below 95 % of 100
    assert np.mean(hits, axis=0).min() > 0.88


def test_ellipses_hold_95_percent_of_draws(p3: Any) -> None:
    estimate = oe(p3.draw(0), 2, 2)
    found = poles_band(estimate)
    outline = found.ellipses(200)
    assert found.roots[0].imag != 0.0
    models = sample_models(estimate, np.random.default_rng(0), draws=800)
    near = np.array([m.poles()[np.argmin(np.abs(m.poles() - found.roots[0]))] for m in models]) - found.roots[0]
    edge = outline[0] - found.roots[0]
    sector = np.argmin(np.abs(np.angle(near[:, None] / edge)), axis=1)
    assert np.mean(np.abs(near) <= np.abs(edge[sector])) == pytest.approx(0.95, abs=0.03)


def test_what_is_not_known_stays_so(p3: Any) -> None:
    estimate = n4sid(p3.draw(0), 2)
    assert np.isnan(band(estimate, StateSpace.dc_gain).deviation).all()
    assert np.isnan(poles_band(estimate).covariance).all()
    assert np.isnan(poles_band(estimate).ellipses()).all()
    refused("n4sid gives no covariance", lambda: sample_models(estimate, np.random.default_rng(0)))
    refused("draws must be", lambda: sample_models(estimate, np.random.default_rng(0), draws=1))
