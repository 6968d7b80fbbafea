"""Recursive estimators: the batch estimate in the end, parameters followed on the way."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidError, armax, arx, oe, rarmax, rarx, roe
from sysid.adaptation import Forgetting, Gradient, Kalman
from sysid.polynomials import is_stable
from sysid.recursive_prediction_error import _stable


def test_recursive_least_squares_is_least_squares(p5: Any) -> None:
    data = p5.draw(0)
    batch, found = arx(data, 3, 3, 2), rarx(data, 3, 3, 2)
    deviation = np.sqrt(np.diag(batch.covariance))
    assert np.all(np.abs(found.final.parameters - batch.parameters) < 1e-3 * deviation)
    np.testing.assert_allclose(found.final.covariance, batch.covariance, rtol=1e-3)
    np.testing.assert_allclose(found.final.noise_variance, batch.noise_variance, rtol=1e-3)
    # on the way too
    early = arx(data[:400], 3, 3, 2)
    np.testing.assert_allclose(found.parameters[399], early.parameters, rtol=2e-3)
    assert found.parameters.shape == (2000, 6)
    assert found.parameter_names == batch.parameter_names


@pytest.mark.parametrize(
    ("problem", "batch", "recursive", "orders"),
    [("p3", armax, rarmax, (2, 2, 2, 1)), ("p2", oe, roe, (2, 2, 1))],
)
def test_tends_to_the_batch_estimate(
    problem: str, batch: Any, recursive: Any, orders: tuple[int, ...], request: pytest.FixtureRequest
) -> None:
    data = request.getfixturevalue(problem).draw(1)
    whole, found = batch(data, *orders), recursive(data, *orders)
    deviation = np.sqrt(np.diag(whole.covariance))
    assert np.all(np.abs(found.final.parameters - whole.parameters) < 1.0 * deviation)
    # from the batch estimate on there is hardly anything to learn
    settled = recursive(data, *orders, start=whole.parameters, adaptation=Gradient(1e-6))
    assert np.all(np.abs(settled.final.parameters - whole.parameters) < 0.1 * deviation)
    np.testing.assert_allclose(np.sqrt(np.diag(found.final.covariance)), deviation, rtol=0.3)
    np.testing.assert_allclose(found.final.noise_variance, whole.noise_variance, rtol=0.05)


def jumping(seed: int = 0) -> IOData:
    """The gain of a first-order plant doubles in the middle."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(3000)
    gain = np.where(np.arange(3000) < 1500, 1.0, 2.0)
    return IOData(u, lfilter([0, 1.0], [1, -0.8], gain * u) + 0.1 * rng.standard_normal(3000), 0.1)


@pytest.mark.parametrize(
    "adaptation",
    [
        Forgetting(0.98),
        Kalman(1e-4, 0.02),
        Kalman([1e-5, 1e-4], 0.02),
        Kalman(np.diag([1e-5, 1e-4]), 0.02),
        Gradient(0.1),
        Gradient(0.005, normalised=False),
    ],
    ids=lambda a: type(a).__name__,
)
def test_follows_a_jump(adaptation: Any) -> None:
    for estimator, at in ((rarx, 1), (roe, 0)):
        found = estimator(jumping(), 1, 1, adaptation=adaptation)
        gain = found.parameters[:, at]
        assert np.mean(gain[1300:1500]) == pytest.approx(1.0, abs=0.12)
        assert np.mean(gain[2500:]) == pytest.approx(2.0, abs=0.2)
        assert np.std(found.residuals[2500:]) < 0.5


def test_nothing_forgotten_follows_no_jump() -> None:
    assert rarx(jumping(), 1, 1).parameters[-1, 1] == pytest.approx(1.5, abs=0.15)


@pytest.mark.parametrize("adaptation", [Forgetting(0.97), Gradient(0.05), Gradient(0.005, normalised=False)])
def test_covariance_is_the_spread_of_the_last_parameters(adaptation: Any) -> None:
    last, predicted = [], []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        u, e = rng.choice([-1.0, 1.0], 800), rng.standard_normal(800)
        found = rarx(IOData(u, lfilter([0, 1.0, 0.5], [1.0], u) + e, 0.1), 0, 2, adaptation=adaptation).final
        last.append(found.parameters)
        predicted.append(np.diag(found.covariance))
    np.testing.assert_allclose(np.sqrt(np.mean(predicted, axis=0)), np.std(last, axis=0), rtol=0.25)


def test_predictor_stays_stable_in_wild_data() -> None:
    rng = np.random.default_rng(0)
    data = IOData(rng.standard_normal(600), 100.0 * rng.standard_normal(600), 0.1)
    for found, places in (
        (rarmax(data, 2, 1, 3, adaptation=Forgetting(0.9)), slice(3, 6)),
        (roe(data, 1, 3, adaptation=Forgetting(0.9)), slice(1, 4)),
    ):
        assert np.isfinite(found.parameters).all()
        for theta in found.parameters[::7]:
            assert is_stable(np.concatenate(([1.0], theta[places])))
        assert found.shortened > 0


def test_stability_by_reflection_coefficients() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        theta = rng.uniform(-1.5, 1.5, 3)
        assert _stable(theta, [(0, 3)]) == is_stable(np.concatenate(([1.0], theta)))


def test_two_inputs_and_a_direct_term() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    clean = lfilter([2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, 0.5], u[:, 1])
    data = IOData(u, clean + 0.1 * rng.standard_normal(4000), 0.1)
    found = roe(data, [1, 2], [1, 1], [0, 3], adaptation=Forgetting(0.999))
    np.testing.assert_allclose(found.final.parameters, [2.0, 1.0, -0.5, -0.8, 0.5], atol=0.03)
    exact = IOData(u, lfilter([2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, -0.8], u[:, 1]), 0.1)
    found = rarx(exact, 1, [1, 2], [0, 3])
    np.testing.assert_allclose(found.final.parameters, [-0.8, 2.0, 1.0, -0.5], atol=1e-6)


def test_scaling_the_channels_scales_the_model(p3: Any) -> None:
    data = p3.draw(1)[:500]
    plain = rarmax(data, 2, 2, 2).parameters
    scaled = rarmax(IOData(1e3 * data.u, 1e-4 * data.y, data.dt), 2, 2, 2).parameters
    np.testing.assert_allclose(scaled / [1, 1, 1e-7, 1e-7, 1, 1], plain, rtol=1e-4, atol=1e-6)


def test_bad_settings(p3: Any) -> None:
    data = p3.draw(0)[:200]
    with pytest.raises(SysidError, match="forgetting factor"):
        Forgetting(1.1)
    with pytest.raises(SysidError, match="between 0 and 2"):
        Gradient(2.5)
    with pytest.raises(SysidError, match="R2 must be"):
        Kalman(1.0, 0.0)
    with pytest.raises(SysidError, match="without negative"):
        Kalman([-1.0, 1.0])
    with pytest.raises(SysidError, match=r"R1: expected a number, \(4,\)"):
        rarx(data, 2, 2, adaptation=Kalman([1.0, 1.0]))
    with pytest.raises(SysidError, match="expected 4 parameters"):
        rarx(data, 2, 2, start=[0.0])
    with pytest.raises(SysidError, match="C and F stable"):
        roe(data, 1, 1, start=[1.0, -1.2])
    with pytest.raises(SysidError, match="one IOData record"):
        rarx([data, data], 2, 2)  # type: ignore[arg-type]
    lost = data.y.copy()
    lost[50] = np.nan
    with pytest.raises(SysidError, match="lacks 1 of 200"):
        rarx(IOData(data.u, lost, data.dt, missing=True), 2, 2)
