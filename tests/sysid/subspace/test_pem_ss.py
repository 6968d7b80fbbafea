import pickle
import warnings
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, StateSpace, SysidWarning, armax, n4sid, oe, okid, pem_ss, residuals, simulate
from sysid.subspace.predictor_fit import constrained_step
from tests.refusals import refused
from tests.sysid.systems import CORRELATED_OUTPUTS, covered, multivariable, record_in_motion

TRUTH = multivariable(poles=(0.95, 0.8, 0.3))
UNLIKE = np.array([[0.5, 0.4], [0.0, 0.1]])
"""Makes correlated disturbances of two outputs, one larger than the other."""
draw = partial(record_in_motion, TRUTH, 800, noise=UNLIKE)


def test_second_order_is_armax(p3):
    """A single-output model with free K is an ARMAX model: the same minimum, variance and intervals."""
    data = p3.draw(0)
    expected = armax(data, 2, 2, 2)
    estimate = pem_ss(data, n4sid(data, 2), direct=False)
    f = np.array([0.2, 1.0, 5.0, 20.0])
    ours, theirs = estimate.frequency_response(f), expected.frequency_response(f)
    assert np.all(np.abs(ours.response - theirs.response) < 0.1 * theirs.magnitude_deviation())
    np.testing.assert_allclose(ours.covariance, theirs.covariance, rtol=0.02, atol=1e-4 * theirs.covariance.max())
    np.testing.assert_allclose(estimate.noise_variance, expected.noise_variance, rtol=1e-3)
    assert np.sum(estimate.residuals**2) <= np.sum(expected.residuals**2) * (1 + 1e-6)


def test_best_of_several_starts(p3):
    data = p3.draw(0)
    good = n4sid(data, 2)
    unstable = StateSpace(2.0 * np.eye(2), good.model.B, good.model.C, good.model.D, None, good.model.dt)
    alone = pem_ss(data, good, gain=False)
    estimate = pem_ss(data, [unstable, okid(data, 2, p=20), good], gain=False)
    assert np.isnan(estimate.diagnostics["criteria"][0])
    assert min(estimate.diagnostics["criteria"][1:]) <= alone.diagnostics["criteria"][0]
    np.testing.assert_allclose(estimate.bandwidth().hz, alone.bandwidth().hz, rtol=1e-4)
    refused(r"one order; got orders \[2, 3\]", lambda: pem_ss(data, [good, n4sid(data, 3)]))
    refused(r"got orders \[\]", lambda: pem_ss(data, []))


def test_without_gain_it_is_an_output_error_model(p2):
    data = p2.draw(1)
    expected = oe(data, 2, 2)
    estimate = pem_ss(data, okid(data, 2, p=20), gain=False, direct=False)
    assert not estimate.model.gain.any()
    assert not estimate.model.D.any()
    np.testing.assert_allclose(estimate.bandwidth().hz, expected.bandwidth().hz, rtol=1e-4)
    np.testing.assert_allclose(estimate.bandwidth().ci95, expected.bandwidth().ci95, rtol=1e-3)
    np.testing.assert_allclose(estimate.noise_variance, expected.noise_variance, rtol=1e-3)


def clean(seed, outputs):
    """Five real poles, of which a model of third order leaves far more than the noise."""
    rng = np.random.default_rng(seed)
    A, B, C = np.diag(rng.uniform(0.3, 0.999, 5)), rng.standard_normal((5, 1)), rng.standard_normal((outputs, 5))
    u = np.repeat(rng.standard_normal(40), 50)
    y = simulate(StateSpace(A, B, C, np.zeros((outputs, 1)), None, 1.0), u[:, None])
    return IOData(u, y + 1e-4 * rng.standard_normal((2000, outputs)), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "search"), [(4, False), pytest.param(14, True, marks=pytest.mark.thorough), (15, False), (18, False)]
)
def test_clean_data_of_higher_order_are_fitted_as_well_as_by_armax(seed, search):
    """Steps in A - K C, B - K D, K, C and D end up to 3.5 times higher after 100 steps."""
    data = clean(seed, 1)
    start, expected = n4sid(data, 3, stable=True), armax(data, 3, 4, 3, 0)
    with warnings.catch_warnings(action="ignore" if search else "error", category=SysidWarning):
        estimate = pem_ss(data, start, search=search)
    assert np.mean(estimate.residuals**2) <= 1.001 * np.mean(expected.residuals**2)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_predictors_at_the_edge_of_stability_are_fitted_as_well_as_by_armax():
    """Three zeros of the noise model meet at -1; a start is never left for a worse fit."""
    rng = np.random.default_rng(2)
    poles = [0.95 * np.exp(0.3j), 0.95 * np.exp(-0.3j), 0.8, 0.6 * np.exp(1j), 0.6 * np.exp(-1j)]
    u = rng.standard_normal(600)
    data = IOData(u, lfilter(np.append(0.0, rng.standard_normal(5)), np.poly(poles).real, u), 1.0)
    expected = armax(data, 3, 3, 3, 1)
    for start in (3, expected):
        estimate = pem_ss(data, start, direct=False)
        assert np.mean(estimate.residuals**2) <= 1.001 * np.mean(expected.residuals**2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4, 7])
def test_noise_zeros_on_the_unit_circle_leave_the_intervals_of_armax(seed):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, 400))
    data = IOData(u, lfilter([0.0, 1.0, 0.5], [1, -1.5, 0.7], u) + lfilter([1, 0, -1], [1, -1.5, 0.7], e), 1.0)
    with warnings.catch_warnings(action="ignore", category=SysidWarning):
        estimate, expected = pem_ss(data, 2, direct=False, search=False), armax(data, 2, 2, 2)
    ours, theirs = (one.frequency_response([0.02, 0.08, 0.2]) for one in (estimate, expected))
    assert estimate.diagnostics["converged"]
    np.testing.assert_allclose(ours.magnitude, theirs.magnitude, rtol=1e-3)
    np.testing.assert_allclose(ours.magnitude_deviation(), theirs.magnitude_deviation(), rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 16, 24])
def test_starts_of_clean_data_meet_with_two_outputs(seed):
    data = clean(seed, 2)
    starts = [n4sid(data, 3, stable=True), n4sid(data, 3, block_rows=4), okid(data, 3, p=5)]
    fits = [pem_ss(data, start, search=False) for start in starts]
    assert all(fit.diagnostics["converged"] for fit in fits)
    assert np.ptp([fit.diagnostics["criteria"] for fit in fits]) < 1e-4


@pytest.mark.thorough
def test_efficient_and_covered():
    """Responses scatter as their covariances say, in several outputs too."""
    f = np.array([0.5, 3.0, 15.0])
    g, hz = TRUTH.frequency_response(f), TRUTH.bandwidth()
    squares, hits, bandwidths = [], [], []
    known = np.isfinite(hz)
    for seed in range(60):
        data = draw(seed=seed)
        estimate = pem_ss(data, n4sid(data, 3))
        response = estimate.frequency_response(f)
        error = response.response - g
        parts = np.stack((error.real, error.imag), axis=-1)
        solved = np.linalg.solve(response.covariance, parts[..., None])[..., 0]
        squares.append(np.sum(parts * solved, axis=-1) / 2)
        hits.append(covered(response.magnitude_ci95(), np.abs(g)))
        bandwidths.append(estimate.bandwidth().covers(hz)[known])
    assert 0.85 < np.mean(squares) < 1.15
    assert 0.92 < np.mean(hits) < 0.98
    # three binomial standard deviations below 95 % of 60
    assert np.mean(bandwidths) > 0.866


def test_an_output_of_all_the_weight_is_fitted_as_if_alone():
    data, weight = draw(seed=1), np.diag([0.0, 7.0])
    alone = pem_ss(data.select(outputs=[1]), n4sid(data.select(outputs=[1]), 3), gain=False)
    estimate = pem_ss(data, n4sid(data, 3, gain=False), gain=False, output_weight=weight)
    np.testing.assert_allclose(estimate.noise_variance[1, 1], alone.noise_variance[0, 0], rtol=0.01)
    ours, theirs = estimate.frequency_response([0.5, 3.0]), alone.frequency_response([0.5, 3.0])
    np.testing.assert_allclose(ours.response[:, 1:], theirs.response, rtol=1e-3)
    np.testing.assert_allclose(ours.magnitude_deviation()[:, 1:], theirs.magnitude_deviation(), rtol=0.02)


def test_weights_choose_the_criterion():
    """The identity gives the least sum of squares, the inverse covariance of the errors the default."""
    data = draw(seed=1)
    start = n4sid(data, 3)
    default = pem_ss(data, start)
    squares = pem_ss(data, start, output_weight=np.eye(2))
    assert np.sum(squares.residuals**2) < 0.999 * np.sum(default.residuals**2)
    change = squares.parameters + 1e-3 * np.vstack((np.eye(len(squares.parameters)), -np.eye(len(squares.parameters))))
    sums = [np.sum(residuals(squares.realise(theta), data) ** 2) for theta in change]
    assert min(sums) > np.sum(squares.residuals**2)
    for size in (1e-320, 1e308):
        again = pem_ss(data, start, output_weight=size * np.eye(2))
        np.testing.assert_array_equal(again.parameters, squares.parameters)
    same = pem_ss(data, start, output_weight=1e6 * np.linalg.inv(default.noise_variance))
    np.testing.assert_allclose(same.model.markov(20), default.model.markov(20), atol=1e-3)
    deviations = (e.frequency_response([3.0]).magnitude_deviation() for e in (same, default))
    np.testing.assert_allclose(next(deviations), next(deviations), rtol=0.01)


@pytest.mark.thorough
def test_intervals_hold_with_any_weight():
    """The inverse information takes the weight for the inverse covariance: its intervals of y1 hold in 87 %."""
    f, system = np.array([0.2, 0.7, 3.0]), CORRELATED_OUTPUTS
    g, hits = system.frequency_response(f), []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        u, e = rng.standard_normal((1000, 1)), rng.standard_normal((1000, 2)) @ [[1.0, 0.15], [0.0, 0.3]]
        v = simulate(StateSpace(system.A, system.gain, system.C, np.eye(2), None, 0.1), e)
        estimate = pem_ss(IOData(u, simulate(system, u) + v, 0.1), system, output_weight=np.eye(2), search=False)
        hits.append(covered(estimate.frequency_response(f).magnitude_ci95(), np.abs(g)))
    assert 0.92 < np.mean(hits) < 0.98 and np.mean(hits, axis=(0, 1)).min() > 0.92


@pytest.mark.thorough
def test_coloured_disturbances_need_the_coloured_covariance():
    f, start = np.array([0.5, 3.0]), StateSpace(TRUTH.A, TRUTH.B, TRUTH.C, TRUTH.D, None, 0.02)
    g = TRUTH.frequency_response(f)
    plain, coloured = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.standard_normal((150, 2)), 6, axis=0)
        v = lfilter([1.0], [1, -0.9], rng.standard_normal((900, 2)) @ UNLIKE, axis=0)
        data = IOData(u, simulate(TRUTH, u) + v, 0.02)[100:]
        # Without the option the intervals fail plainly: a quarter of the draws shows it.
        for hits, option in ((plain, False), (coloured, True)) if seed < 10 else ((coloured, True),):
            estimate = pem_ss(data, start, gain=False, coloured=option)
            hits.append(covered(estimate.frequency_response(f).magnitude_ci95(), np.abs(g)))
    assert np.mean(plain) < 0.85
    assert 0.90 < np.mean(coloured) < 0.99


def test_white_disturbances_hardly_notice_the_coloured_covariance(p2):
    data = [p2.draw(0)[:5000], p2.draw(0)[6000:9000]]
    start = n4sid(data, 2)
    plain, coloured = (pem_ss(data, start, gain=False, coloured=option) for option in (False, True))
    ratio = np.sqrt(np.diag(coloured.covariance) / np.diag(plain.covariance))
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)


def test_the_basis_of_the_start_does_not_matter():
    data = draw(seed=2)
    m = n4sid(data, 3).model
    T = np.array([[1.0, 30.0, 0.0], [0.0, 0.01, 2.0], [5.0, 0.0, 1.0]])
    back = np.linalg.inv(T)
    other = StateSpace(T @ m.A @ back, T @ m.B, m.C @ back, m.D, T @ m.gain, m.dt)
    a, b = pem_ss(data, m), pem_ss(data, other)
    np.testing.assert_allclose(b.model.markov(20), a.model.markov(20), rtol=1e-4, atol=1e-5)
    expected = a.frequency_response([3.0]).covariance
    np.testing.assert_allclose(b.frequency_response([3.0]).covariance, expected, rtol=1e-2, atol=1e-8)


def test_estimates_can_be_copied_and_realised():
    data = draw(seed=4)
    estimate = pickle.loads(pickle.dumps(pem_ss(data, n4sid(data, 3))))
    np.testing.assert_allclose(estimate.realise(estimate.parameters).markov(9), estimate.model.markov(9))
    assert estimate.diagnostics["converged"]
    assert estimate.diagnostics["start"] == "n4sid"
    assert len(estimate.parameters) == 3 * (2 + 2 * 2) + 4


def test_stops_are_reported():
    data = draw(seed=5)
    poor = StateSpace(np.diag([0.5, 0.3, -0.2]), np.ones((3, 2)), np.ones((2, 3)), np.zeros((2, 2)), None, 0.02)
    with pytest.warns(SysidWarning, match="did not converge: stopped after 1 iterations"):
        pem_ss(data, poor, search=False, max_iterations=1)


def test_refusals():
    data = draw(seed=6)[:100]
    unstable = StateSpace([[1.5]], np.ones((1, 2)), np.zeros((2, 1)), np.zeros((2, 2)), None, 0.02)
    refused("with gain=False the start must be stable", lambda: pem_ss(data, unstable, gain=False))
    refused("the start needs a stable predictor", lambda: pem_ss(data, unstable))
    still = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), np.eye(2), None, 0.02)
    refused("at least one state", lambda: pem_ss(data, still))
    refused("coloured=True needs gain=False", lambda: pem_ss(data, TRUTH, coloured=True))
    refused("expected a StateSpace or an Estimate", lambda: pem_ss(data, "n4sid"))
    refused("1 input", lambda: pem_ss(IOData(np.arange(9.0), np.arange(9.0), 0.02), TRUTH))
    refused("too many states for the data", lambda: pem_ss(data[:6], TRUTH))
    for weight, message in (
        (np.eye(3), r"expected a matrix \(2, 2\) for 2 output"),
        (1.0, r"got shape \(\)"),
        ([[1.0, 2.0], [0.0, 1.0]], "must be symmetric"),
        (np.diag([1.0, -1.0]), "without negative eigenvalues"),
        (np.zeros((2, 2)), "not zero"),
        (np.diag([1.0, np.nan]), "1 value.* NaN"),
    ):
        refused(message, pem_ss, data, TRUTH, output_weight=weight)
    lost = IOData(data.u, np.where(np.arange(100)[:, None] == 9, np.nan, data.y), 0.02, missing=True)
    refused("lacks 2 of 200 output samples", pem_ss, lost, TRUTH, output_weight=np.eye(2))


def test_unstable_systems_are_followed_by_a_stable_predictor():
    rng = np.random.default_rng(0)
    u, e = rng.standard_normal((2, 300))
    y = lfilter([0, 1.0], [1, -1.02], u) + lfilter([1, -0.5], [1, -1.02], 0.1 * e)
    data = IOData(u, y, 0.1)
    start = StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.4]], 0.1)
    assert pem_ss(data, start).model.poles()[0].real == pytest.approx(1.02, abs=1e-4)


@pytest.mark.parametrize("seed", range(30))
def test_constrained_steps_are_the_best_there_are(seed):
    rng = np.random.default_rng(seed)
    q, m = 6, int(rng.integers(1, 12))
    values, g, rows = rng.uniform(0.1, 10.0, q), rng.standard_normal(q), rng.standard_normal((m, q))
    if seed % 3 == 0:
        rows = np.vstack((rows, rows[:1], np.zeros((1, q))))
    step = constrained_step(values, g, rows)
    assert (rows @ step <= 1e-9).all()
    # a cone and a parabola: the gradient left over is normal to the step, and no feasible direction is downhill
    left = g - values * step
    assert left @ step == pytest.approx(0.0, abs=1e-9)
    for direction in rng.standard_normal((200, q)):
        if (rows @ direction <= 0.0).all():
            assert left @ direction <= 1e-9
