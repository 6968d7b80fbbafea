"""Records of transfer functions in continuous time."""

import numpy as np

from sysid import ContinuousModel, IOData, StateSpace, simulate
from sysid.continuous.path_response import TransferFunction


def record(b, a, delay, dt, hold, *, intersample="zoh", noise=0.0, samples=600, seed=0):
    """Record that begins in mid-motion, of a transfer function with coefficients of falling powers."""
    rng = np.random.default_rng(seed)
    A, B, C, D = TransferFunction(np.array(b[::-1]), np.array(a[::-1]), delay).realisation()
    model = ContinuousModel(StateSpace(A, B, C, [[D]], None, dt), np.array([[delay]]), intersample)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // hold + 60), hold)[: samples + 50]
    y = simulate(model.sampled(), u)[:, 0]
    return IOData(u[50:], (y + noise * rng.standard_normal(len(y)))[50:], dt, intersample=intersample)
