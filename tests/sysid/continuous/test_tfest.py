import itertools
from dataclasses import replace

import numpy as np
import pytest

from sysid import FrequencyResponse, IOData, c2d, d2c, damp, fit_response_ss, n4sid, read_model, tfest, write_model
from sysid.continuous.output_error_criterion import OutputError
from sysid.continuous.path_response import TransferFunction, respond
from sysid.continuous.structures import ProcessPath, RationalPath
from sysid.models.continuous_estimate import _with_interval
from tests.refusals import refused
from tests.sysid.continuous.record import record

RAO_GARNIER = ([-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0])
SYSTEMS = {
    "second order": ([1.0, 2.0], [1.0, 1.0, 4.0], 0.234, 0.1, 1),
    "Rao and Garnier": (*RAO_GARNIER, 0.0, 0.01, 20),
    "stiff": ([1e3], [1.0, 1000.1, 100.0], 0.0, 0.02, 5),
    "slow sampling": ([4.0], [1.0, 1.0, 4.0], 0.7, 1.0, 1),
    "first order": ([2.0], [1.0, 0.5], 0.52, 0.1, 4),
}


@pytest.mark.slow
@pytest.mark.parametrize("name, intersample", [*zip(SYSTEMS, itertools.cycle(["zoh", "foh"]))])
def test_exact_recovery_with_unknown_delays(name, intersample):
    b, a, delay, dt, hold = SYSTEMS[name]
    data = record(b, a, delay, dt, hold, intersample=intersample, samples=1000)
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


@pytest.mark.parametrize("structure", [RationalPath(2, 1, None), ProcessPath("P3DZIU")])
def test_the_gradient_is_exact_with_free_initial_states(structure):
    """The best initial states depend on the denominators."""
    u, step = np.random.default_rng(2).standard_normal(40), 1e-6
    theta = np.linspace(0.6, 0.87, len(structure.names))
    criterion = OutputError([IOData(u, np.cumsum(u), 0.1)], [structure], 1.0, True)
    slopes = [(criterion(theta + d).cost - criterion(theta - d).cost) / (4 * step) for d in step * np.eye(len(theta))]
    np.testing.assert_allclose(criterion(theta).gradient, slopes, rtol=1e-5, atol=1e-5)


def test_damping_and_frequency_of_an_oscillator():
    estimate = tfest(record([4.0], [1.0, 1.0, 4.0], 0.0, 0.1, 2, noise=0.05), 2, 0)
    modes = damp(estimate)
    for band, truth in zip(
        (modes.natural_frequency, modes.damping, modes.time_constant), (1.0 / np.pi, 0.25, 2.0), strict=True
    ):
        assert abs(band.value[0] - truth) < 4.0 * band.deviation[0] < 0.2
    assert "natural frequency / Hz" in str(estimate)
    (low,), (high,) = modes.natural_frequency.ci95
    assert low * high == pytest.approx(modes.natural_frequency.value[0] ** 2)


def test_intervals_are_possible_ones_and_show_their_width():
    vague = damp(tfest(record([4.0], [1.0, 1.0, 4.0], 0.0, 0.1, 2, noise=2.0, samples=60), 3, 2))
    assert (vague.natural_frequency.ci95[0] > 0.0).all()
    assert max(map(np.max, vague.damping.ci95)) <= 1.0
    assert _with_interval(12.0, 11.99998, 12.00002) == "12.000000 (11.999980 to 12.000020)"
    assert _with_interval(0.29177, 0.0001, 900.0) == "0.292 (0.000100 to 900)"


def test_model_files_hold_fits_to_responses_in_continuous_time(tmp_path):
    f = np.array([0.05, 0.1, 0.2, 0.5, 1.0])
    response = FrequencyResponse.from_data(f, 2.0 / (2j * np.pi * f + 0.5), variance=np.full(5, 0.01))
    estimate, path = tfest(response, 1, 0), tmp_path / "model.json"
    back = read_model(write_model(estimate, path))
    np.testing.assert_array_equal(back.frequency_response(f).covariance, estimate.frequency_response(f).covariance)
    refused("fit_response_ss in continuous time has no form", write_model, fit_response_ss(response, 1), path)


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_a_delay_estimated_as_zero_has_the_covariance_of_a_free_one():
    data = record([4.0], [1.0, 1.0, 4.0], 0.05, 0.1, 4, samples=200, noise=1.0, seed=1)
    estimate = tfest(data, 2, 0, delay=None, max_delay=0.3, coloured=False)
    assert estimate.parameters[-1] == 0.0
    right = np.append(estimate.parameters[:-1], 1e-5)
    parts = OutputError([data], [RationalPath(2, 0, None)], 0.3, True).columns(data, right)[0][:, :-1]
    expected = estimate.noise_variance * np.linalg.inv(parts.T @ parts)
    np.testing.assert_allclose(estimate.covariance, expected, rtol=1e-3)


def test_refusals():
    data = record([2.0], [1.0, 0.5], 0.0, 0.1, 4, samples=100)
    refused("zeros must be a whole number from 0 to 1", tfest, data, 1, 2)
    refused("delay must be a time >= 0", tfest, data, 1, 0, delay=-1.0)
    refused("only to whole samples", tfest, data, 0, 0, delay=None)
    flat = FrequencyResponse.from_data([1.0, 2.0, 3.0], [1.0, 1.0, 1.0])
    refused(
        "no options max_delay, coloured, initial_conditions, offset, start and fixed", tfest, flat, 1, 0, offset=True
    )
    refused("held .zoh. or linear", tfest, replace(data, intersample="bl"), 1, 0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_texts_show_matrices_the_interval_and_which_delay_is_zero():
    data = record([2.0], [1.0, 0.5], 0.0, 0.1, 4, samples=150, noise=0.05)
    continuous = d2c(n4sid(data, 1))
    assert "x' = A x + B u" in str(continuous)
    assert "local1" not in str(continuous)
    assert "converted to every 0.02 s" in repr(c2d(continuous, 0.02))
    two = IOData(np.hstack((np.roll(data.u, 7), data.u)), data.y, 0.1)
    assert "the delay Td[2] is at its lower limit 0" in str(tfest(two, 1, 0, delay=[0.0, None], max_delay=0.3))
