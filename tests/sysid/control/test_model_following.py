from dataclasses import replace

import numpy as np
import pytest
import scipy

import sysid
from sysid import Controller, model_following
from sysid.control.model_following import _observer
from sysid.models import block_diagonal
from tests.refusals import refused
from tests.sysid.control.closed_loop import DT, run, sensitivity_peak, servo


def coupled(seed=3):
    """Two servos that push each other, with noise of the state."""
    rng = np.random.default_rng(seed)
    both = block_diagonal([servo((-6.0, -30.0), 1), servo((-7.0, -40.0))])
    noise = {"B": both.B + 0.05 * rng.standard_normal((5, 2)), "K": 0.05 * rng.standard_normal((5, 2))}
    return replace(both, **noise, innovation_covariance=1e-8 * np.array([[1.0, 0.2], [0.2, 2.0]]))


REFERENCE = block_diagonal([servo((-13.0, -70.0), 1), servo((-12.0, -80.0))])


def moves(samples, loops, seed=0):
    """Smooth requests (N, loops) of some 0.1 rad that end at rest."""
    rng = np.random.default_rng(seed)
    corners = np.repeat(0.1 * rng.standard_normal((samples // 50, loops)), 50, axis=0)
    corners[-150:] = 0.0
    smooth = scipy.signal.lfilter([0.1], [1.0, -0.9], corners, axis=0)
    return np.asarray(scipy.signal.lfilter([0.1], [1.0, -0.9], smooth, axis=0))


def test_a_known_plant_answers_like_the_reference():
    requests = moves(1000, 2)
    wanted = sysid.simulate(REFERENCE, requests)
    alone = sysid.simulate(coupled(), requests)
    errors = []
    for effort in (1e-2, 1e-4, 1e-6):
        outputs, _, _ = run(model_following(coupled(), REFERENCE, effort=effort).controller, coupled(), requests)
        errors.append(np.sqrt(np.mean((outputs - wanted) ** 2) / np.mean((alone - wanted) ** 2)))
    assert errors[0] < 0.1
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < errors[1]


def test_feedforward_is_optimal():
    """No other sequence of commands follows a step of the request at lower cost: least squares over 300 samples."""
    plant, reference, effort = servo((-6.0, -30.0), 1), servo((-13.0, -70.0), 1), 1e-3
    requests = np.full((300, 1), 0.1)
    outputs, commands, _ = run(model_following(plant, reference, effort=effort).controller, plant, requests)
    wanted = sysid.simulate(reference, requests)[:, 0]
    answer = scipy.linalg.toeplitz(sysid.simulate(plant, np.eye(300)[:, :1])[:, 0], np.zeros(300))
    difference = np.eye(300) - np.eye(300, k=-1)
    best = np.linalg.lstsq(np.vstack([answer, np.sqrt(effort) * difference]), np.append(wanted, np.zeros(300)))[0]

    def cost(y, u):
        return np.sum((y - wanted) ** 2) + effort * np.sum((difference @ u) ** 2)

    np.testing.assert_allclose(commands[:250, 0], best[:250], atol=1e-6)
    assert cost(outputs[:, 0], commands[:, 0]) == pytest.approx(cost(answer @ best, best), rel=1e-6)


def test_integral_action():
    design = model_following(coupled(), REFERENCE)
    loop = design.controller.closed_loop(coupled())
    gain = loop.dc_gain()
    np.testing.assert_allclose(gain[:2, :2], REFERENCE.dc_gain(), atol=1e-9)
    np.testing.assert_allclose(gain[:2, 2:], 0.0, atol=1e-9)
    # Also of a plant that is not the model.
    other = replace(coupled(), B=1.3 * coupled().B)
    np.testing.assert_allclose(design.controller.closed_loop(other).dc_gain()[:2, 2:], 0.0, atol=1e-9)


@pytest.mark.parametrize("bound", [1.4, 2.0, 3.0])
def test_the_sensitivity_keeps_its_bound(bound):
    design = model_following(coupled(), REFERENCE, sensitivity=bound, disturbance=5.0, noise=1.0)
    assert sensitivity_peak(design.controller, coupled()) == pytest.approx(design.sensitivity, rel=0.02)
    assert design.sensitivity <= bound * 1.001


def test_the_observer_is_the_kalman_predictor():
    """The gain is where the Riccati recursion of the predictor ends."""
    plant, walk = coupled(), 0.5
    R = plant.innovation_covariance
    A = np.block([[plant.A, plant.B], [np.zeros((2, 5)), np.eye(2)]])
    C = np.hstack([plant.C, np.zeros((2, 2))])
    G = np.vstack([plant.gain, np.zeros((2, 2))])
    steps = walk * np.sqrt(np.diag(R)) / np.abs(np.diag(plant.dc_gain()))
    Q = G @ R @ G.T + np.diag(np.append(np.zeros(5), steps**2))
    P = Q.copy()
    for _ in range(5000):
        L = np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T + R @ G.T).T
        P = A @ P @ A.T + Q - L @ (C @ P @ C.T + R) @ L.T
    np.testing.assert_allclose(_observer(plant, walk, 1.0), L, rtol=1e-4, atol=1e-7)


def test_a_limited_command_does_not_wind_up():
    plant, requests = coupled(), np.zeros((900, 2))
    requests[50:450] = 0.5
    controller = model_following(plant, REFERENCE).controller
    _, unlimited, _ = run(controller, plant, requests)
    slow, _, _ = run(controller, plant, requests, rate=0.003)
    assert np.abs(np.diff(unlimited, axis=0)).max() > 0.03
    # The ramp of 0.003 a sample takes 167 samples; the output arrives with it and stays.
    assert slow.max() < 0.5 * 1.05
    np.testing.assert_allclose(slow[300:450], 0.5, atol=0.01)
    np.testing.assert_allclose(slow[-100:], 0.0, atol=0.01)
    # Whatever the limits do: stable from measurement and applied command to the state.
    assert np.abs(np.linalg.eigvals(controller.A)).max() < 0.9


def test_an_obstacle_meets_no_more_than_the_correction():
    """Held in place, the plant meets the plan's command and the correction, however long the feedback integrates."""
    plant, requests, bounds = coupled(), moves(600, 2, seed=6), np.array([0.01, 0.03])
    planned = run(model_following(plant, REFERENCE).controller, plant, requests)[1]
    most = []
    for correction in (None, bounds):
        law = model_following(plant, REFERENCE, correction=correction).controller.start()
        commands = np.empty_like(requests)
        for command, request in zip(commands, requests, strict=True):
            command[:] = law.command(request, np.zeros(2))
            law.applied(command)
        most.append(np.abs(commands - planned).max(axis=0))
    assert (most[0] > 3.0 * bounds).all()
    np.testing.assert_allclose(most[1], bounds, rtol=1e-6)


@pytest.mark.parametrize("rate", [0.005, 0.01, 0.02])
def test_requests_beyond_the_limits(rate):
    """A binary request, whose answer needs faster commands than the limits allow, is followed better than without."""
    requests = np.repeat(0.05 * np.sign(np.random.default_rng(5).standard_normal((150, 2))), 12, axis=0)
    wanted, none = sysid.simulate(REFERENCE, requests), np.zeros((2, 2))
    alone = Controller(none, none, none, none, none, np.eye(2), none, DT)
    without, controlled = (
        np.linalg.norm(run(law, coupled(), requests, rate=rate)[0] - wanted)
        for law in (alone, model_following(coupled(), REFERENCE).controller)
    )
    assert controlled < 0.95 * without


def test_the_run_is_the_closed_loop():
    plant, requests = coupled(), moves(300, 2, seed=4)
    controller = model_following(plant, REFERENCE).controller
    outputs, commands, _ = run(controller, plant, requests, disturbance=0.02)
    expected = sysid.simulate(controller.closed_loop(plant), np.hstack([requests, np.full((300, 2), 0.02)]))
    np.testing.assert_allclose(np.hstack([outputs, commands]), expected, atol=1e-9)


def test_refusals():
    plant = coupled()
    for wrong, text in (
        ({"plant": replace(plant, D=np.eye(2))}, "direct term"),
        ({"plant": replace(plant, innovation_covariance=None)}, "innovation covariance"),
        ({"plant": replace(plant, A=1.2 * plant.A)}, "stable"),
        ({"reference": servo((-13.0,))}, "2 inputs"),
        ({"reference": replace(REFERENCE, dt=0.01)}, "at 0.02 s"),
        ({"effort": 0.0}, "effort"),
        ({"sensitivity": 1.0}, "sensitivity"),
        ({"noise": 1.5}, "noise"),
        ({"disturbance": np.nan}, "disturbance"),
        ({"correction": [0.1]}, "correction: expected shape"),
        ({"plant": None}, "expected a StateSpace, got NoneType"),
        ({"plant": replace(plant, C=0.0 * plant.C)}, "a gain at 0 Hz"),
    ):
        refused(text, model_following, **{"plant": plant, "reference": REFERENCE, **wrong})
    controller = model_following(plant, REFERENCE).controller
    refused("plant: expected 2 inputs", controller.closed_loop, servo((-6.0,)))
    refused("at 0.02 s", controller.sensitivity, replace(plant, dt=0.01))
    refused("expected finite", controller.start().command, np.zeros(2), np.array([0.0, np.nan]))
    for wrong, text in (
        ({"dt": -1.0}, "dt must"),
        ({"feedforward": np.ones((2, 2))}, "feedforward: expected shape"),
        ({"feedforward": np.hstack([controller.C, controller.Dr]), "correction": [-1.0, 1.0]}, "above 0, got -1"),
    ):
        refused(text, replace, controller, **wrong)
