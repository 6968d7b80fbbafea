import control
import numpy as np
import pytest

from sysid import Polynomials, StateSpace
from sysid.models import block_diagonal, innovations_form
from sysid.models.system_matrices import transmission_zeros
from tests.refusals import refused


def random_model(seed, n=4, nu=2, ny=3):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, C, D = rng.standard_normal((n, nu)), rng.standard_normal((ny, n)), rng.standard_normal((ny, nu))
    return StateSpace(A, B, C, D, None, 0.02)


def test_first_order_lag_by_hand():
    """y(t+1) = a y + (1 - a) u: |G|^2 = (1-a)^2 / (1 - 2a cos w + a^2) is 1/2 where cos w = (4a - 1 - a^2) / 2a."""
    a, dt = 0.9, 0.02
    model = StateSpace([[a]], [[1 - a]], [[1.0]], [[0.0]], None, dt)
    expected = np.arccos((4 * a - 1 - a**2) / (2 * a)) / (2 * np.pi * dt)
    np.testing.assert_allclose(model.bandwidth(), [[expected]], rtol=1e-12)
    np.testing.assert_allclose(model.dc_gain(), [[1.0]], rtol=1e-14)
    np.testing.assert_allclose(model.step_response(4)[:, 0, 0], [0, 0.1, 0.19, 0.271], rtol=1e-12)
    assert model.is_stable()
    assert len(model.zeros()) == 0


def test_bandwidth_is_the_first_crossing():
    """A notch at 2 Hz dips below the level and returns: the dip counts."""
    notch = np.exp(2j * np.pi * 2.0 * 0.02)
    b = np.poly([notch, notch.conjugate()]).real
    a = np.poly([0.98 * notch, 0.98 * notch.conjugate()]).real
    model = StateSpace.from_control(control.ss(control.tf(b, a, 0.02)))
    hz = model.bandwidth()[0, 0]
    assert 1.5 < hz < 2.0
    ratio = np.abs(model.frequency_response([hz])[0, 0, 0]) / abs(model.dc_gain()[0, 0])
    assert ratio == pytest.approx(np.sqrt(0.5), rel=1e-10)


def test_no_bandwidth_is_nan():
    all_pass = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[2.0]], None, 0.1)
    integrator = StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], None, 0.1)
    differentiator = StateSpace([[0.0]], [[1.0]], [[-1.0]], [[1.0]], None, 0.1)
    for model in (all_pass, integrator, differentiator):
        assert np.isnan(model.bandwidth()).all()
    assert not integrator.is_stable()
    assert np.isinf(integrator.dc_gain()).all()


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_control(seed):
    model = random_model(seed)
    system = model.to_control()
    f = np.array([0.1, 1.0, 7.0, 24.0])
    expected = np.array([system(np.exp(2j * np.pi * 0.02 * x)) for x in f])
    np.testing.assert_allclose(model.frequency_response(f), expected, rtol=1e-10)
    np.testing.assert_allclose(model.dc_gain(), system.dcgain(), rtol=1e-10)
    np.testing.assert_allclose(np.sort_complex(model.poles()), np.sort_complex(system.poles()), atol=1e-12)
    h = model.markov(6)
    np.testing.assert_allclose(h[0], model.D)
    np.testing.assert_allclose(h[4], model.C @ np.linalg.matrix_power(model.A, 3) @ model.B, rtol=1e-12)
    np.testing.assert_array_equal(model.impulse_response(6), h)


def test_block_diagonal_has_no_coupling():
    a, b = random_model(1, 3, 1, 1), random_model(2, 2, 1, 1)
    both = block_diagonal([a, b])
    g = both.frequency_response([1.0])[0]
    assert g[0, 1] == g[1, 0] == 0.0
    np.testing.assert_allclose(np.diag(g), [a.frequency_response([1.0])[0, 0, 0], b.frequency_response([1.0])[0, 0, 0]])
    np.testing.assert_allclose(both.bandwidth().diagonal(), [a.bandwidth()[0, 0], b.bandwidth()[0, 0]], rtol=1e-9)
    refused("sampling interval", lambda: block_diagonal([a, StateSpace(b.A, b.B, b.C, b.D, None, 0.1)]))
    refused("at least one", lambda: block_diagonal([]))


def test_what_does_not_fit_is_refused():
    wrong_b = (np.eye(2), np.ones((3, 1)), np.ones((1, 2)), [[0.0]], None, 0.1)
    refused(r"B: expected shape \(2, 1\)", StateSpace, *wrong_b)
    refused("dt", lambda: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.0))
    refused("NaN", lambda: StateSpace([[np.nan]], [[1.0]], [[1.0]], [[0.0]], None, 0.1))
    refused("discrete", lambda: StateSpace.from_control(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])))
    refused("n must be", lambda: random_model(0).markov(0))


def test_the_response_of_many_states_is_that_of_its_parts(monkeypatch):
    """One decomposition for all frequencies gives what an equation for each does, and meets the same poles."""
    rng = np.random.default_rng(5)
    a = rng.standard_normal((30, 30))
    a *= 0.98 / np.abs(np.linalg.eigvals(a)).max()
    model = StateSpace(a, rng.standard_normal((30, 2)), rng.standard_normal((3, 30)), np.ones((3, 2)), None, 0.01)
    f = np.geomspace(0.01, 50.0, 60)
    together = model.frequency_response(f)
    on_the_circle = StateSpace(np.eye(30), np.ones((30, 1)), np.ones((1, 30)), [[0.0]], None, 0.01)
    refused("the response is infinite", lambda: on_the_circle.frequency_response(0.0))
    monkeypatch.setattr("sysid.models.state_space.LARGE", 100)
    one_by_one = model.frequency_response(f)
    np.testing.assert_allclose(together, one_by_one, rtol=0.0, atol=1e-11 * np.abs(one_by_one).max())


def test_the_response_of_many_states_at_no_frequency_is_empty():
    many = StateSpace(0.5 * np.eye(30), np.ones((30, 2)), np.ones((1, 30)), np.zeros((1, 2)), None, 0.02)
    assert many.frequency_response(np.zeros(0)).shape == (0, 1, 2)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_delays_leave_no_spurious_zeros(delay):
    zeros = np.array([1.4, 0.3 + 0.5j, 0.3 - 0.5j])
    b = np.concatenate((np.zeros(delay), 2e-3 * np.poly(zeros).real))
    a = np.poly([0.9, 0.8, 0.5, 0.2]).real
    model = innovations_form(Polynomials(a, b, [1.0], [1.0], [1.0]), 0.02)
    zeros_of_model = model.zeros()
    # states of pure delay cancel at the origin and are no zeros of the input-output path
    nonzero = zeros_of_model[np.abs(zeros_of_model) > 1e-6]
    np.testing.assert_allclose(np.sort_complex(nonzero), np.sort_complex(zeros), atol=1e-9)


def test_square_multivariable_matches_the_pencil():
    rng = np.random.default_rng(0)
    A, B, C, D = rng.standard_normal((5, 5)), rng.standard_normal((5, 2)), rng.standard_normal((2, 5)), np.eye(2)
    expected = np.sort_complex(np.linalg.eigvals(A - B @ C))
    # The scale of the channels changes nothing.
    for u, y in ((1.0, 1.0), (1e-6, 1e5)):
        zeros = transmission_zeros(A, u * B, y * C, u * y * D)
        np.testing.assert_allclose(np.sort_complex(zeros), expected, atol=1e-8)


def test_common_zero_of_a_tall_system():
    """Two outputs that share the factor (z - 0.4) are both silent there."""
    shared = np.array([1.0, -0.4])
    a = np.poly([0.9, 0.5, 0.1]).real
    one = innovations_form(Polynomials(a, np.r_[0, shared]), 1.0)
    tall = StateSpace(one.A, one.B, np.eye(3)[[0, 2]], np.zeros((2, 1)), None, 1.0)
    for z in tall.zeros():
        system = np.block([[tall.A - z * np.eye(3), tall.B], [tall.C, tall.D]])
        assert np.linalg.svd(system, compute_uv=False)[-1] < 1e-9
