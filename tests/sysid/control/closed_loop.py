"""Servos of the tests of controllers, and loops with them: run sample by sample, and their sensitivity."""

import numpy as np
import scipy

from sysid import StateSpace

DT = 0.02


def servo(poles, delay=0):
    """A position servo with real poles in rad/s and unit gain, its measurement late by samples."""
    polynomial = np.poly([*np.exp(np.array(poles) * DT), *np.zeros(delay)])
    return StateSpace(*scipy.signal.tf2ss([np.sum(polynomial)], polynomial), None, DT, np.array([[1e-8]]))


def run(law, plant, requests, *, disturbance=0.0, noise=0.0, limit=np.inf, rate=np.inf):
    """Run a law on a plant.

    Args:
        requests: (N, m).
        disturbance: Added to the commands (N, m), or constant.
        noise: Standard deviation of the measurement noise.
        limit: Of the commands; rate: of their moves per sample.

    Returns:
        Measurements and applied commands (N, m), and the run.
    """
    rng, work, x, sent = np.random.default_rng(1), law.start(), np.zeros(plant.order), np.zeros(plant.nu)
    outputs, commands = np.empty_like(requests), np.empty_like(requests)
    for k, d in enumerate(np.broadcast_to(disturbance, requests.shape)):
        outputs[k] = plant.C @ x + noise * rng.standard_normal(plant.ny)
        sent = np.clip(np.clip(work.command(requests[k], outputs[k]), sent - rate, sent + rate), -limit, limit)
        work.applied(sent)
        commands[k], x = sent, plant.A @ x + plant.B @ (sent + d)
    return outputs, commands, work


def sensitivity_peak(controller, plant):
    """Peak of the sensitivity at the input of a plant of two loops, from the disturbance to the command and back."""
    loop = controller.closed_loop(plant)
    assert loop.is_stable()
    from_disturbance = loop.frequency_response(np.geomspace(1e-3, 24.9, 400))[:, 2:, 2:]
    return np.linalg.norm(from_disturbance + np.eye(2), 2, axis=(1, 2)).max()
