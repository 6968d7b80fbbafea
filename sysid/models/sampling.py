"""Exact sampling of continuous-time dynamics whose delayed input is held or linear between samples."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

INTEGER = 1e-9  # distance of a delay from a whole number of samples that is rounding


@dataclass(frozen=True, eq=False)
class Sampled:
    """Discrete-time dynamics x(k+1) = phi x(k) + sum over lags of gamma[lag] u(k - lag), exact at the samples.

    Attributes:
        phi: State transition over one sampling interval (n, n).
        gamma: Weights of the inputs by their lag (n, m) each; lag -1 only for an input that is linear between samples.
        weights: u(t - delay) at sample k is the sum of weights[lag] u(k - lag).
        slopes: Likewise its derivative, units per s; that of a held input is zero.
    """

    phi: FloatArray
    gamma: dict[int, FloatArray]
    weights: dict[int, float]
    slopes: dict[int, float]

    def drive(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what inputs (N, m) add to each next state (N, n), and the first state (n,) if at rest before."""
        contribution, x0 = np.zeros((len(u), len(self.phi))), np.zeros(len(self.phi))
        for lag, gamma in self.gamma.items():
            contribution += lagged_input(u, lag) @ gamma.T
            if lag == -1:
                # a linear input rises to its first value before the record
                x0 = gamma @ u[0]
        return contribution, x0


def sample(A: FloatArray, B: FloatArray, dt: float, delay: float = 0.0, intersample: str = "zoh") -> Sampled:
    """Sample x' = A x + B u(t - delay) exactly, by matrix exponentials [AstromWittenmark1997, sec. 2.3].

    The delay in s is any value >= 0; the input between samples is held (`zoh`) or linear (`foh`).
    """
    lag = math.ceil(delay / dt - INTEGER)
    ahead = max(lag - delay / dt, 0.0)  # part of the interval in which the next sample acts already
    # first the sample of `lag` acts, for 1 - ahead of the interval, then the one that follows it
    first_phi, first_step, first_ramp = _integrals(A, B, dt, (1.0 - ahead) * dt)
    second_phi, second_step, second_ramp = _integrals(A, B, dt, ahead * dt)
    if intersample == "zoh":
        gamma = {lag: second_phi @ first_step, lag - 1: second_step}
        weights, slopes = {lag: 1.0}, {}
    elif intersample == "foh":
        # the line between two samples starts at the part `ahead` of its rise
        rise = ahead * first_step + first_ramp
        gamma = {
            lag: second_phi @ (first_step - rise),
            lag - 1: second_phi @ rise + second_step - second_ramp,
            lag - 2: second_ramp,
        }
        weights = {lag: 1.0 - ahead, lag - 1: ahead}
        slopes = {lag: -1.0 / dt, lag - 1: 1.0 / dt}
    else:
        raise SysidError(
            f"continuous-time models take an input that is held (zoh) or linear (foh) between samples, got "
            f"{intersample!r}; dataclasses.replace(data, intersample='foh') takes it as linear"
        )
    if not ahead:
        # the sample that would act in no part of the interval
        without_effect = lag - 1 if intersample == "zoh" else lag - 2
        gamma.pop(without_effect)
    nonzero_weights = {k: weight for k, weight in weights.items() if weight}
    return Sampled(second_phi @ first_phi, gamma, nonzero_weights, slopes)


def lagged_input(u: FloatArray, lag: int) -> FloatArray:
    """Return u(k - lag) for each sample k, zero outside the record (N, m)."""
    out = np.zeros_like(u)
    if lag < 0:
        out[:lag] = u[-lag:]
    else:
        out[lag:] = u[: max(len(u) - lag, 0)]
    return out


def _integrals(A: FloatArray, B: FloatArray, dt: float, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return exp(A time), and the states after `time` from rest for inputs u = 1 and u = t / dt."""
    n, m = B.shape
    states, steps, ramps = slice(0, n), slice(n, n + m), slice(n + m, n + 2 * m)
    # steps and ramps as further states, u' = 1/dt: a single exponential integrates all of them, also for a singular A
    generator = np.zeros((n + 2 * m, n + 2 * m))
    generator[states, states] = A
    generator[states, steps] = B
    generator[steps, ramps] = np.eye(m) / dt
    transition = scipy.linalg.expm(generator * time)
    return transition[states, states], transition[states, steps], transition[states, ramps]
