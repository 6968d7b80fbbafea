"""Prediction where output samples are missing: the Kalman filter of the innovation form."""

from dataclasses import dataclass

import numpy as np

from sysid.arrays import FloatArray
from sysid.data import IOData
from sysid.recursion import state_trajectory
from sysid.state_space import StateSpace

SETTLED = 1e-13  # state covariance, as a part of the innovation's, below which the stationary gain holds
LONG = 100  # samples between gaps for which the stationary filter is worth setting up


@dataclass(frozen=True, eq=False)
class Filtered:
    """Predicted states and what they rest on.

    Attributes:
        states: x(t) from outputs up to t - 1; the first column driven from rest, the others the free responses to unit
            initial states (N, n, 1 + n), or the first alone (N, n, 1).
        deviations: Inverse square root of each output's prediction variance (N, ny); zero where it is missing.
    """

    states: FloatArray
    deviations: FloatArray


def filtered(model: StateSpace, data: IOData, x0: FloatArray, *, free: bool = False) -> Filtered:
    """Run the predictor over a record with gaps [Ljung1999, sec. 14.2].

    In x+ = A x + B u + K e, y = C x + D u + e with e white of covariance R, the state is known exactly as long as all
    outputs are. Where some are missing its covariance grows by K R K', and the gain of those that are known follows
    from it until the state is known again.

    Args:
        model: The model; R counts only in its ratios, and is the unit matrix where the model has none.
        data: The record.
        x0: State at the first sample (n,).
        free: Whether the free responses are wanted too.
    """
    A, B, C, D, K = model.A, model.B, model.C, model.D, model.gain
    n, ny = K.shape
    R = np.eye(ny) if model.innovation_covariance is None else model.innovation_covariance
    if not np.trace(R) > 0.0:
        R = np.eye(ny)
    R = R / np.trace(R)
    known, y = data.known, np.where(data.known, data.y, 0.0)
    width = 1 + n if free else 1
    states = np.empty((len(data), n, width))
    weights = np.zeros((len(data), ny))
    x = np.zeros((n, width))
    x[:, 0] = x0
    if free:
        x[:, 1:] = np.eye(n)
    P = np.zeros((n, n))
    gaps = np.append(np.flatnonzero(~known.all(axis=1)), len(data))
    stationary = 1.0 / np.sqrt(np.maximum(np.diag(R), 1e-300))
    t = 0
    while t < len(data):
        until = int(gaps[np.searchsorted(gaps, t)])
        if until - t > LONG and np.abs(P).max(initial=0.0) <= SETTLED:
            drive = data.u[t:until] @ (B - K @ D).T + y[t:until] @ K.T
            rest = np.zeros_like(drive)
            for column in range(width):
                w = drive if column == 0 else rest
                run = state_trajectory(A - K @ C, np.vstack((w, w[:1])), x[:, column])
                states[t:until, :, column] = run[:-1]
                x[:, column] = run[-1]
            weights[t:until] = stationary
            P, t = np.zeros((n, n)), until
            continue
        states[t] = x
        o = known[t]
        S = C[o] @ P @ C[o].T + R[np.ix_(o, o)]
        across = A @ P @ C[o].T + K @ R[:, o]
        L = across / S if S.size == 1 else np.linalg.lstsq(S, across.T, rcond=None)[0].T
        weights[t, o] = 1.0 / np.sqrt(np.maximum(np.diag(S), 1e-300))
        error = -C[o] @ x
        error[:, 0] += y[t, o] - D[o] @ data.u[t]
        x = A @ x + L @ error
        x[:, 0] += B @ data.u[t]
        P = A @ P @ A.T + K @ R @ K.T - L @ S @ L.T
        P = 0.5 * (P + P.T)
        t += 1
    return Filtered(states, weights)
