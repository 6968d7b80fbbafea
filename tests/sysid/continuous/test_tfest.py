import numpy as np
import pytest

from sysid import IOData, simulate
from sysid.continuous import tfest
from sysid.continuous.path_response import TransferFunction, respond
from sysid.models.continuous_estimate import damp
from sysid.models.continuous_model import ContinuousModel
from sysid.models.state_space import StateSpace
from tests.refusals import refused

RAO_GARNIER = ([-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0])
SYSTEMS = {
    "second order": ([1.0, 2.0], [1.0, 1.0, 4.0], 0.234, 0.1, 1),
    "Rao and Garnier": (*RAO_GARNIER, 0.0, 0.01, 20),
    "stiff": ([1e3], [1.0, 1000.1, 100.0], 0.0, 0.02, 5),
    "slow sampling": ([4.0], [1.0, 1.0, 4.0], 0.7, 1.0, 1),
    "first order": ([2.0], [1.0, 0.5], 0.52, 0.1, 4),
}


def record(b, a, delay, dt, hold, *, intersample="zoh", noise=0.0, samples=600, seed=0):
    """Record that begins in mid-motion, of a transfer function with coefficients of falling powers."""
    rng = np.random.default_rng(seed)
    A, B, C, D = TransferFunction(np.array(b[::-1]), np.array(a[::-1]), delay).realisation()
    model = ContinuousModel(StateSpace(A, B, C, [[D]], None, dt), np.array([[delay]]), intersample)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // hold + 60), hold)[: samples + 50]
    y = simulate(model.sampled(), u)[:, 0]
    return IOData(u[50:], (y + noise * rng.standard_normal(len(y)))[50:], dt, intersample=intersample)


@pytest.mark.slow
@pytest.mark.parametrize("intersample", ["zoh", "foh"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_exact_recovery_with_unknown_delays(name, intersample):
    b, a, delay, dt, hold = SYSTEMS[name]
    data = record(b, a, delay, dt, hold, intersample=intersample, samples=1500)
    estimate = tfest(data, len(a) - 1, len(b) - 1, delay=None if delay else 0.0)
    np.testing.assert_allclose(estimate.parameters, [*b, *a[1:], *([delay] if delay else [])], rtol=1e-8)


@pytest.mark.parametrize("intersample", ["zoh", "foh"])
def test_sensitivities_are_exact(intersample):
    u, step = np.random.default_rng(1).standard_normal(100), 1e-6
    b, a, delay = np.array([2.0, 1.0]), np.array([4.0, 1.0, 1.0]), 0.13

    def at(change):
        path = TransferFunction(b + change[:2], a + change[2:5], delay + change[5])
        return respond(path, u, 0.1, intersample)

    exact = at(np.zeros(6))
    columns = np.column_stack((exact.by_b, exact.by_a, exact.by_delay))
    for k, direction in enumerate(step * np.eye(6)):
        difference = (at(direction).y - at(-direction).y) / (2 * step)
        np.testing.assert_allclose(columns[:, k], difference, atol=1e-7)


def test_damping_and_frequency_of_an_oscillator():
    estimate = tfest(record([4.0], [1.0, 1.0, 4.0], 0.0, 0.1, 2, noise=0.05), 2, 0)
    modes = damp(estimate)
    for band, truth in zip(
        (modes.natural_frequency, modes.damping, modes.time_constant), (2.0, 0.25, 2.0), strict=True
    ):
        assert abs(band.value[0] - truth) < 4.0 * band.deviation[0] < 0.2
    assert "natural frequency" in str(estimate)


def test_refusals():
    data = record([2.0], [1.0, 0.5], 0.0, 0.1, 4, samples=100)
    refused("zeros must be a whole number from 0 to 1", tfest, data, 1, 2)
    refused("delay must be a time >= 0", tfest, data, 1, 0, delay=-1.0)
    refused("only to whole samples", tfest, data, 0, 0, delay=None)
