"""Designed inputs: the information they rest on, the optimum they approach, the limits they keep."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from sysid import Polynomials, design_input
from sysid.design.information import Information, pilot_of, transform_length
from sysid.polynomial.orders import Orders
from sysid.validation import cramer_rao_bound
from tests.refusals import refused
from tests.sysid.systems import second_order

SERVO = Polynomials(B=[0, 0.06, 0.05], F=[1, -1.5, 0.61])
NOISE = {"dt": 0.02, "variance": 1e-4}
BITS = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 150), 2)


ESTIMATE = sysid.oe(second_order(0, 100), 1, 1)
LARGE = {"amplitude": 1e300, "rate": 1e300, "dt": None, "variance": None}
UNSTABLE = replace(ESTIMATE, model=replace(ESTIMATE.model, A=1.5 * np.eye(1)))


def information(model=SERVO, quantity=lambda m: m.bandwidth()[0, 0], n=300):
    pilot = pilot_of(model, n, **NOISE, size=1.0)
    return Information.of(pilot, n, transform_length([pilot], n), quantity, offset=True)


@pytest.mark.slow
@pytest.mark.parametrize("coloured", [{}, {"D": [1.0, -0.8]}, {"C": [1.0, 0.5], "D": [1.0, -0.8]}], ids=str)
def test_the_prediction_is_the_cramer_rao_bound(coloured):
    system = replace(SERVO, **coloured)
    n = 4000
    u = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], n // 2), 2)
    bound = cramer_rao_bound(system, Orders.of(system), u[:, None], **NOISE, frequencies=np.zeros(0))
    exact = bound.bandwidth_hz[0, 0] * bound.bandwidth_deviation[0, 0]
    predicted = design_input(system, n, amplitude=1.0, comparison=u, offset=False, **NOISE).comparison
    # the initial state is estimated too, at the price of a few of 4000 samples
    assert 0.9999 < predicted / exact < 1.01


@pytest.mark.slow
@pytest.mark.parametrize("estimator", [lambda d: sysid.armax(d, 2, 2, 2), lambda d: sysid.pem_ss(d, sysid.n4sid(d, 2))])
def test_the_prediction_of_an_estimate_for_its_own_record_is_its_interval(estimator):
    data = second_order(3, 2000, noise=0.5, c=[1.0, -0.5, 0.2])
    estimate = estimator(data)
    band = sysid.band(estimate, lambda model: model.dc_gain())
    design = design_input(estimate, 2000, amplitude=3.0, quantity=lambda m: m.dc_gain()[0, 0], comparison=data.u)
    assert design.comparison == pytest.approx(float(np.ravel(band.deviation)[0]), rel=0.05)
    assert design.deviation < design.comparison


@pytest.mark.parametrize("quantity", [lambda m: m.bandwidth()[0, 0], lambda m: m.step_response(5)[:, 0, 0]])
def test_derivatives_by_the_samples_and_by_the_shares(quantity):
    one = information(quantity=quantity)
    rng = np.random.default_rng(2)
    move = 1e-5 * rng.standard_normal(300)
    _, slope = one.of_signal(BITS)
    difference = (one.of_signal(BITS + move)[0] - one.of_signal(BITS - move)[0]) / 2.0
    assert slope @ move == pytest.approx(difference, rel=1e-5)
    shares = rng.dirichlet(np.ones(one.filters.shape[-1]))
    other = rng.dirichlet(np.ones(one.filters.shape[-1])) - shares
    _, slopes = one.of_shares(shares, 300.0)
    ends = (one.of_shares(shares + h * other, 300.0)[0] for h in (1e-5, -1e-5))
    assert -slopes @ other == pytest.approx(np.subtract(*ends) / 2e-5, rel=1e-5)


def test_the_optimum_for_one_gain_has_full_power_and_its_variance_that_of_the_textbook():
    """y = b u + e: the variance of b is that of e over N a^2 for any spectrum; an unknown offset needs mean 0."""
    gain = Polynomials(B=[2.0])
    quantity = {"quantity": lambda m: m.dc_gain()[0, 0], "amplitude": 0.5}
    for offset in (False, True):
        design = design_input(gain, 100, offset=offset, **quantity, **NOISE)
        assert design.deviation == pytest.approx(np.sqrt(1e-4 / (100 * 0.25)), rel=1e-6)
        assert design.bound == pytest.approx(design.deviation, rel=1e-3)
        assert abs(design.u.sum()) < 1e-9 or not offset


def test_nothing_beats_the_bound_and_the_design_beats_other_inputs():
    design = design_input(SERVO, 300, amplitude=1.0, comparison=BITS, **NOISE)
    assert design.bound < design.deviation < min(design.comparison, 1.25 * design.bound)
    one, rng = information(), np.random.default_rng(0)
    for _ in range(50):
        u = np.repeat(rng.choice([-1.0, 1.0], 300), rng.integers(1, 20))[:300]
        assert np.sqrt(one.of_signal(u)[0]) > design.deviation
    assert set(np.abs(design.u[:, 0])) == {1.0}
    assert f"{design.comparison:.4g}: {(design.comparison / design.deviation) ** 2:.3g} times the variance" in str(
        design
    )


@pytest.mark.slow
@pytest.mark.parametrize("rate", [50.0, 10.0, 2.0])
def test_limits_of_rate_hold_from_rest_on(rate):
    design = design_input(SERVO, 200, amplitude=1.0, rate=rate, **NOISE)
    assert np.abs(design.u).max() <= 1.0
    assert np.abs(np.diff(design.u[:, 0], prepend=0.0)).max() <= rate * 0.02 * (1.0 + 1e-6)
    free = design_input(SERVO, 200, amplitude=1.0, **NOISE)
    assert free.deviation < design.deviation
    assert f"changes <= {rate:g} per s" in str(design)


@pytest.mark.slow
def test_several_models_share_one_input_that_is_robust():
    slow, fast = SERVO, Polynomials(B=[0, 0.3, 0.2], F=[1, -0.8, 0.3])
    both = design_input([slow, fast], 200, amplitude=1.0, **NOISE)
    alone = [design_input(one, 200, amplitude=1.0, comparison=both.u, **NOISE) for one in (slow, fast)]
    assert both.deviation**2 == pytest.approx(np.mean([one.comparison**2 for one in alone]))
    crossed = design_input(fast, 200, amplitude=1.0, comparison=alone[0].u, **NOISE).comparison
    own = np.mean([alone[0].deviation ** 2, crossed**2])
    assert both.deviation**2 < own


@pytest.mark.parametrize(
    ("message", "model", "options"),
    [
        ("expected dt and variance as well", SERVO, {"dt": None}),
        ("not stable", UNSTABLE, {"dt": None, "variance": None}),
        ("amplitude must be a number > 0", SERVO, {"amplitude": 0.0}),
        ("rate must be a number > 0", SERVO, {"rate": -1.0}),
        ("rate must be a number > 0, 1e-60 or more, got 1e-300", SERVO, {"rate": 1e-300}),
        ("amplitude must be a number > 0, from 1e-60 to", ESTIMATE, LARGE),
        ("comparison: largest value 1e.300 given", SERVO, {"comparison": np.full(100, 1e300)}),
        (r"comparison: expected shape \(100,\) or \(100, 1\), got \(99,\)", SERVO, {"comparison": np.ones(99)}),
        ("does not determine", SERVO, {"comparison": np.zeros(100)}),
        ("is not a finite number", SERVO, {"quantity": lambda m: np.nan}),
        ("quantity must be a function", SERVO, {"quantity": "bandwidth"}),
        ("has 2 inputs, expected 1", Polynomials(B=[[0, 1.0], [0, 1.0]], F=[[1, -0.5], [1, -0.4]]), {}),
        ("expected an Estimate", "model", {}),
    ],
)
def test_refusals(message, model, options):
    refused(message, design_input, model, 100, **{"amplitude": 1.0, **NOISE, **options})
