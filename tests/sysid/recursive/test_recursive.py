import itertools
import pickle
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, armax, arx, oe, rarmax, rarx, roe
from sysid.models.polynomials import is_stable
from sysid.recursive.adaptation import Forgetting, Gradient, Kalman
from sysid.recursive.error_weights import error_weights
from tests.refusals import refused
from tests.sysid.systems import excess_loss


@pytest.mark.slow
@pytest.mark.parametrize(("problem", "orders"), [("p1", (5, 3, 2)), ("p3", (2, 2, 1)), ("p5", (3, 3, 2))])
def test_recursive_least_squares_is_least_squares(problem, orders, request):
    data = request.getfixturevalue(problem).draw(0)
    batch, estimate = arx(data, *orders), rarx(data, *orders)
    np.testing.assert_allclose(estimate.final.parameters, batch.parameters, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(estimate.final.covariance, batch.covariance, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(estimate.final.noise_variance, batch.noise_variance, rtol=1e-8)
    np.testing.assert_allclose(estimate.P * estimate.final.noise_variance, estimate.final.covariance, rtol=1e-12)
    # on the way too
    np.testing.assert_allclose(estimate.parameters[399], arx(data[:400], *orders).parameters, rtol=1e-7, atol=1e-8)
    assert estimate.parameters.shape == (len(data), batch.parameters.size)
    assert estimate.parameter_names == batch.parameter_names
    np.testing.assert_allclose(estimate.predicted[10:], (data.y - estimate.residuals)[10:], rtol=1e-12)
    assert np.isnan(estimate.predicted[0, 0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "batch", "recursive", "orders"), [("p3", armax, rarmax, (2, 2, 2, 1)), ("p2", oe, roe, (2, 2, 1))]
)
def test_tends_to_the_batch_estimate(problem, batch, recursive, orders, request):
    data = request.getfixturevalue(problem).draw(2)
    whole = batch(data, *orders)
    deviation = np.sqrt(np.diag(whole.covariance))
    for estimate, off, spread, variance in (
        (recursive(data, *orders), 1.0, 0.3, 0.05),
        # after an estimate of the beginning; what is lost is where the rest begins: its past is not known
        (recursive(data[600:], *orders, start=batch(data[:600], *orders)), 0.9, 0.15, 0.02),
    ):
        assert np.all(np.abs(estimate.final.parameters - whole.parameters) < off * deviation)
        np.testing.assert_allclose(np.sqrt(np.diag(estimate.final.covariance)), deviation, rtol=spread)
        np.testing.assert_allclose(estimate.final.noise_variance, whole.noise_variance, rtol=variance)
    # from the batch estimate on there is hardly anything to learn
    settled = recursive(data, *orders, start=whole.parameters, adaptation=Gradient(1e-6))
    assert np.all(np.abs(settled.final.parameters - whole.parameters) < 0.1 * deviation)


@pytest.mark.slow
def test_a_poorly_determined_model_begins_with_an_estimate(p1):
    """Condition 4e8: from zero one pass does not suffice, with a warning; from an estimate it does."""
    orders, distances = (5, 3, 5, 2), []
    for seed in range(3):
        data = p1.draw(seed)
        batch = armax(data, *orders)
        estimate = rarmax(data[600:], *orders, start=armax(data[:600], *orders))
        distances.append(excess_loss(estimate.final.model, batch.model, data))
        assert estimate.final.diagnostics["left"] < 33.0
        assert estimate.final.diagnostics["adaptation"] == Forgetting(1.0)
    assert np.median(distances) < 5.0
    assert np.max(distances) < 33.0
    with pytest.warns(SysidWarning, match=r"rarmax is still far from the minimum.*start=armax\(data\[:n\]"):
        poor = rarmax(data, *orders)
    assert excess_loss(poor.final.model, batch.model, data) > 100.0
    assert poor.final.diagnostics["left"] > 33.0


@pytest.mark.filterwarnings("ignore:the model is not stable", "ignore:after .* steps roe is still")
@pytest.mark.parametrize("adaptation", [None, Kalman(1e-4, 0.5), Gradient(0.05)], ids=lambda a: type(a).__name__)
@pytest.mark.parametrize(
    ("recursive", "orders"), [(rarx, (2, 2, 3)), (rarx, (1, 1, 0)), (rarmax, (2, 2, 2, 2)), (roe, (2, 2, 1))]
)
def test_a_stream_in_pieces_is_the_record(recursive, orders, adaptation, p3):
    data = p3.draw(3)[:200]
    whole = recursive(data, *orders, adaptation=adaptation, P0=10.0)
    edges = [0, 60, 61, 63, 120, 200]
    piece = recursive(data[:60], *orders, adaptation=adaptation, P0=10.0)
    pieces = [piece]
    for begin, end in itertools.pairwise(edges[1:]):
        piece = recursive(data[begin:end], *orders, start=pickle.loads(pickle.dumps(piece)))
        pieces.append(piece)
    for name in ("parameters", "predicted", "residuals"):
        np.testing.assert_array_equal(np.vstack([getattr(p, name) for p in pieces]), getattr(whole, name))
    np.testing.assert_array_equal(pieces[-1].P, whole.P)
    np.testing.assert_array_equal(pieces[-1].final.covariance, whole.final.covariance)
    np.testing.assert_array_equal(pieces[-1].final.noise_variance, whole.final.noise_variance)
    assert pieces[-1].shortened == whole.shortened


def jumping(seed=0):
    """The gain of a first-order plant doubles in the middle."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(3000)
    gain = np.where(np.arange(3000) < 1500, 1.0, 2.0)
    return IOData(u, lfilter([0, 1.0], [1, -0.8], gain * u) + 0.1 * rng.standard_normal(3000), 0.1)


@pytest.mark.slow
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
def test_follows_a_jump(adaptation):
    # nothing forgotten averages the jump away
    assert rarx(jumping(), 1, 1).parameters[-1, 1] == pytest.approx(1.5, abs=0.15)
    for estimator, at in ((rarx, 1), (roe, 0)):
        estimate = estimator(jumping(), 1, 1, adaptation=adaptation)
        gain = estimate.parameters[:, at]
        assert np.mean(gain[1300:1500]) == pytest.approx(1.0, abs=0.12)
        assert np.mean(gain[2500:]) == pytest.approx(2.0, abs=0.2)
        assert np.std(estimate.residuals[2500:]) < 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("adaptation", [Forgetting(0.97), Gradient(0.05), Gradient(0.005, normalised=False)])
def test_covariance_is_the_spread_of_the_last_parameters(adaptation):
    last, predicted = [], []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        u, e = rng.choice([-1.0, 1.0], 800), rng.standard_normal(800)
        estimate = rarx(IOData(u, lfilter([0, 1.0, 0.5], [1.0], u) + e, 0.1), 0, 2, adaptation=adaptation).final
        last.append(estimate.parameters)
        predicted.append(np.diag(estimate.covariance))
    np.testing.assert_allclose(np.sqrt(np.mean(predicted, axis=0)), np.std(last, axis=0), rtol=0.25)


@pytest.mark.parametrize("adaptation", [Forgetting(1.0), Forgetting(0.99), Kalman(1e-4), Gradient(0.1)])
def test_weights_of_the_errors_give_the_last_parameters(adaptation):
    # an exact identity of the linear recursion: the last error is that of the start and the weighted errors
    rng = np.random.default_rng(5)
    gains, gradients, errors = [], [], rng.standard_normal(60)
    memory, error_of_parameters = adaptation.enter(np.eye(2)), np.zeros(2)
    for t, psi in enumerate(rng.standard_normal((60, 2))):
        gain, memory = adaptation.step(memory, psi, t)
        error_of_parameters = error_of_parameters + gain * (errors[t] - psi @ error_of_parameters)
        gains.append(gain)
        gradients.append(psi)
    weights = error_weights(np.array(gains), np.array(gradients))
    np.testing.assert_allclose(weights.T @ errors, error_of_parameters, rtol=1e-10, atol=1e-12)


def test_warns_of_short_intervals_as_the_batch_estimate_does():
    rng = np.random.default_rng(7)
    u, e = rng.standard_normal((2, 120))
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.2, 0.5], u) + lfilter([0.4, 0.2], [1.0, -1.2, 0.5], e)
    start = armax(IOData(u[:40], y[:40], 1.0), 2, 2, 1)
    with pytest.warns(SysidWarning, match="118 errors for 5 parameters are few"):
        rarmax(IOData(u[40:], y[40:], 1.0), 2, 2, 1, start=start)


def test_errors_that_repeat_with_the_input_count_once_as_in_the_batch_estimate():
    rng = np.random.default_rng(6)
    u = np.resize(rng.standard_normal(80), 800)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -0.7], u + 0.5 * np.sin(3.0 * u)) + 0.1 * rng.standard_normal(800)
    data = IOData(u, y, 1.0)
    recursive, batch = rarx(data, 1, 2).final, arx(data, 1, 2)
    np.testing.assert_allclose(recursive.covariance, batch.covariance, rtol=1e-6)
    independent = recursive.diagnostics["covariance_of_independent_errors"]
    assert np.trace(recursive.covariance) > 2.0 * np.trace(independent)
    assert not recursive.diagnostics["warnings"]
    # the errors of both parts are the same: nobody knows it of a start
    with pytest.warns(SysidWarning, match="plays the same sequence"):
        later = rarx(data[240:], 1, 2, start=arx(data[:240], 1, 2)).final
    assert any("plays the same sequence" in text for text in later.diagnostics["warnings"])


def test_predictor_stays_stable_in_wild_data():
    rng = np.random.default_rng(0)
    data = IOData(rng.standard_normal(600), 100.0 * rng.standard_normal(600), 0.1)
    for estimate, places in (
        (rarmax(data, 2, 1, 3, adaptation=Forgetting(0.9)), slice(3, 6)),
        (roe(data, 1, 3, adaptation=Forgetting(0.9)), slice(1, 4)),
    ):
        assert np.isfinite(estimate.parameters).all()
        for theta in estimate.parameters[::7]:
            assert is_stable(np.concatenate(([1.0], theta[places])))
        assert estimate.shortened > 0


def test_two_inputs_and_a_direct_term():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    clean = lfilter([2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, 0.5], u[:, 1])
    data = IOData(u, clean + 0.1 * rng.standard_normal(4000), 0.1)
    estimate = roe(data, [1, 2], [1, 1], [0, 3], adaptation=Forgetting(0.999))
    np.testing.assert_allclose(estimate.final.parameters, [2.0, 1.0, -0.5, -0.8, 0.5], atol=0.03)
    exact = IOData(u, lfilter([2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, -0.8], u[:, 1]), 0.1)
    estimate = rarx(exact, 1, [1, 2], [0, 3])
    np.testing.assert_allclose(estimate.final.parameters, [-0.8, 2.0, 1.0, -0.5], atol=1e-6)


def test_scaling_the_channels_scales_the_model(p3):
    data = p3.draw(1)[:500]
    plain = rarmax(data, 2, 2, 2).parameters
    scaled = rarmax(IOData(1e3 * data.u, 1e-4 * data.y, data.dt), 2, 2, 2).parameters
    np.testing.assert_allclose(scaled / [1, 1, 1e-7, 1e-7, 1, 1], plain, rtol=1e-4, atol=1e-6)


def test_bad_settings(p3):
    data = p3.draw(0)[:200]
    refused("forgetting factor", lambda: Forgetting(1.1))
    refused("between 0 and 2", lambda: Gradient(2.5))
    refused("R2 must be", lambda: Kalman(1.0, 0.0))
    refused("without negative", lambda: Kalman([-1.0, 1.0]))
    refused(r"R1: expected a number, \(4,\)", lambda: rarx(data, 2, 2, adaptation=Kalman([1.0, 1.0])))
    refused("expected 4 parameters", lambda: rarx(data, 2, 2, start=[0.0]))
    refused("C and F stable", lambda: roe(data, 1, 1, start=[1.0, -1.2]))
    refused("settling must lie", lambda: Forgetting(1.0, 0.9, 1.0))
    refused("P0 must be symmetric", lambda: rarx(data, 2, 2, P0=np.eye(4) + np.eye(4, k=1)))
    refused(r"P0: expected a number, \(4,\)", lambda: rarx(data, 2, 2, P0=[1.0, 2.0]))
    other = armax(data, 1, 1, 1)
    refused(
        "expected an estimate with parameters a1, a2, b1, b2, got one by armax", partial(rarx, start=other), data, 2, 2
    )
    refused(r"expected an estimate with nk = \(2,\)", lambda: rarx(data, 2, 2, 2, start=arx(data, 2, 2, 1)))
    refused("expected a recursion of", lambda: rarx(data, 2, 2, start=rarx(data, 1, 1)))
    refused("as before", lambda: rarx(IOData(data.u, data.y, 0.5), 2, 2, start=rarx(data, 2, 2)))
    refused("one IOData record", lambda: rarx([data, data], 2, 2))
