"""State-space models: textbook values and agreement with python-control."""

import control
import numpy as np
import pytest

from sysid import StateSpace, SysidError
from sysid.models import block_diagonal
from tests.sysid.refusals import refused


def random_model(seed: int, n: int = 4, nu: int = 2, ny: int = 3) -> StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    return StateSpace(
        A, rng.standard_normal((n, nu)), rng.standard_normal((ny, n)), rng.standard_normal((ny, nu)), None, 0.02
    )


def test_first_order_lag_by_hand() -> None:
    """y(t+1) = a y + (1 - a) u: |G|^2 = (1-a)^2 / (1 - 2a cos w + a^2) is 1/2 where cos w = (4a - 1 - a^2) / 2a."""
    a, dt = 0.9, 0.02
    model = StateSpace([[a]], [[1 - a]], [[1.0]], [[0.0]], None, dt)
    expected = np.arccos((4 * a - 1 - a**2) / (2 * a)) / (2 * np.pi * dt)
    np.testing.assert_allclose(model.bandwidth(), [[expected]], rtol=1e-12)
    np.testing.assert_allclose(model.dc_gain(), [[1.0]], rtol=1e-14)
    np.testing.assert_allclose(model.step_response(4)[:, 0, 0], [0, 0.1, 0.19, 0.271], rtol=1e-12)
    assert model.is_stable()
    assert len(model.zeros()) == 0


def test_bandwidth_is_the_first_crossing() -> None:
    """A notch at 2 Hz dips below the level and returns: the dip counts."""
    notch = np.exp(2j * np.pi * 2.0 * 0.02)
    b = np.poly([notch, notch.conjugate()]).real
    a = np.poly([0.98 * notch, 0.98 * notch.conjugate()]).real
    model = StateSpace.from_control(control.ss(control.tf(b, a, 0.02)))
    hz = model.bandwidth()[0, 0]
    assert 1.5 < hz < 2.0
    ratio = np.abs(model.frequency_response([hz])[0, 0, 0]) / abs(model.dc_gain()[0, 0])
    assert ratio == pytest.approx(np.sqrt(0.5), rel=1e-10)


def test_no_bandwidth_is_nan() -> None:
    all_pass = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[2.0]], None, 0.1)
    integrator = StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], None, 0.1)
    differentiator = StateSpace([[0.0]], [[1.0]], [[-1.0]], [[1.0]], None, 0.1)
    for model in (all_pass, integrator, differentiator):
        assert np.isnan(model.bandwidth()).all()
    assert not integrator.is_stable()
    assert np.isinf(integrator.dc_gain()).all()


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_control(seed: int) -> None:
    model = random_model(seed)
    system = model.to_control()
    f = np.array([0.1, 1.0, 7.0, 24.0])
    expected = np.array([system(np.exp(2j * np.pi * 0.02 * x)) for x in f])
    np.testing.assert_allclose(model.frequency_response(f), expected, rtol=1e-10)
    np.testing.assert_allclose(model.dc_gain(), system.dcgain(), rtol=1e-10)
    np.testing.assert_allclose(np.sort_complex(model.poles()), np.sort_complex(system.poles()), atol=1e-12)
    back = StateSpace.from_control(system)
    np.testing.assert_array_equal(back.A, model.A)
    assert back.dt == model.dt


def test_markov_parameters_are_the_pulse_response() -> None:
    model = random_model(5)
    h = model.markov(6)
    np.testing.assert_allclose(h[0], model.D)
    np.testing.assert_allclose(h[4], model.C @ np.linalg.matrix_power(model.A, 3) @ model.B, rtol=1e-12)
    np.testing.assert_array_equal(model.impulse_response(6), h)


def test_block_diagonal_has_no_coupling() -> None:
    a, b = random_model(1, 3, 1, 1), random_model(2, 2, 1, 1)
    both = block_diagonal([a, b])
    g = both.frequency_response([1.0])[0]
    assert g[0, 1] == g[1, 0] == 0.0
    np.testing.assert_allclose(np.diag(g), [a.frequency_response([1.0])[0, 0, 0], b.frequency_response([1.0])[0, 0, 0]])
    np.testing.assert_allclose(both.bandwidth().diagonal(), [a.bandwidth()[0, 0], b.bandwidth()[0, 0]], rtol=1e-9)
    refused("sampling interval", lambda: block_diagonal([a, StateSpace(b.A, b.B, b.C, b.D, None, 0.1)]))
    refused("at least one", lambda: block_diagonal([]))


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(SysidError, match=r"B: expected shape \(2, 1\)"):
        StateSpace(np.eye(2), np.ones((3, 1)), np.ones((1, 2)), [[0.0]], None, 0.1)
    refused("dt", lambda: StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], None, 0.0))
    refused("NaN", lambda: StateSpace([[np.nan]], [[1.0]], [[1.0]], [[0.0]], None, 0.1))
    refused("discrete", lambda: StateSpace.from_control(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])))
    refused("n must be", lambda: random_model(0).markov(0))


def test_the_response_of_many_states_is_that_of_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
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
