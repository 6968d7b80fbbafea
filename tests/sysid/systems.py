"""A second-order textbook system whose records many tests share, its distribution, and a two-output system."""

from dataclasses import replace

import numpy as np
from numpy.polynomial.polynomial import polyadd
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from sysid import IOData, Polynomials, StateSpace, residuals, simulate

A, B = [1.0, -1.5, 0.7], [0.0, 1.0, 0.5]
CORRELATED_OUTPUTS = StateSpace(
    [[0.9, 0.2], [-0.2, 0.7]],
    [[1.0], [0.3]],
    [[1.0, 0.0], [0.3, 1.0]],
    [[0.0], [0.2]],
    [[0.6, 0.1], [-0.2, 0.3]],
    0.1,
    [[1.0, 0.5], [0.5, 1.0]],
)
"""Two states, one input, and two outputs whose innovations correlate."""


def bursts_of_loss(rng, samples):
    """Which of so many samples are lost (N,): holes of 20 samples on average, a quarter of all samples."""
    lost, t = np.zeros(samples, dtype=bool), 0
    while t < samples:
        t += rng.geometric(1 / 60)
        length = rng.geometric(1 / 20)
        lost[t : t + length] = True
        t += length
    return lost


def losing(data, lost):
    """The record without the outputs of a mask (N,) or (N, ny), or of indices of samples."""
    y = data.y.copy()
    y[lost] = np.nan
    return replace(data, y=y, missing=True)


def random_roots(rng, degree, radius):
    """Roots inside the given radius, complex pairs and real ones mixed; of a pair the first."""
    degrees = 0
    while degrees < degree:
        modulus = radius * np.sqrt(rng.uniform(0.1, 1.0))
        if degree - degrees >= 2 and rng.random() < 0.6:
            yield modulus * np.exp(1j * rng.uniform(0.05, 2.5))
            degrees += 2
        else:
            yield modulus * rng.choice([1.0, 1.0, -1.0])
            degrees += 1


def random_polynomial(rng, degree, radius):
    """Monic, with random roots."""
    roots = [part for root in random_roots(rng, degree, radius) for part in {root, np.conj(root)}]
    return np.atleast_1d(np.poly(roots).real)


def second_order(seed=0, samples=400, noise=1.0, c=(1.0,), d=A, *, b=B, settle=0, lost=0.0, bursts=False):
    """Record of y = b/A u + noise c/d e, sampled every 0.1 s: `settle` samples go before, a part of y is `lost`."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, samples + settle))
    y = (lfilter(b, A, u) + lfilter(c, d, noise * e))[settle:]
    if bursts:
        y[bursts_of_loss(rng, samples)] = np.nan
    elif lost:
        y[rng.random(samples) < lost] = np.nan
    return IOData(u[settle:], y, 0.1, missing=bursts or lost > 0.0)


def in_feedback(seed=0, samples=1000, noise=1.0, *, gain=0.5, truth=None):
    """Record of a system in the loop u = r - gain y, from steady state, and the reference r (N,)."""
    rng = np.random.default_rng(seed)
    r, e = rng.standard_normal((2, samples + 200))
    p = Polynomials(A, B) if truth is None else truth
    own, into = np.convolve(np.convolve(p.A, p.F), p.D), np.convolve(p.B, p.D)
    # A F D y = B D u + C F e
    loop = polyadd(own, gain * into)
    y = lfilter(into, loop, r) + lfilter(np.convolve(p.C, p.F), loop, noise * e)
    return IOData(r - gain * y, y, 0.1)[200:], r[200:]


def exact_system(order, nk):
    """A random stable system of an order and a delay, and a noise-free record of it that begins in steady state."""
    rng = np.random.default_rng(10 * order + nk)
    poles = []
    while len(poles) < order:
        if order - len(poles) >= 2 and rng.random() < 0.5:
            pole = rng.uniform(0.3, 0.95) * np.exp(1j * rng.uniform(0.1, 2.5))
            poles += [pole, pole.conjugate()]
        else:
            poles.append(rng.uniform(-0.5, 0.95))
    a = np.atleast_1d(np.poly(poles).real)
    b = np.concatenate((np.zeros(nk), rng.standard_normal(order)))
    u = rng.standard_normal(1100)
    return Polynomials(A=a, B=b), IOData(u, lfilter(b, a, u), 0.02)[100:]


def excess_loss(model, batch, data):
    """How much larger the loss of a model is than that of the batch estimate: N (V - V*) / V*."""
    loss, least = (float(np.mean(residuals(m, data) ** 2)) for m in (model, batch))
    return len(data) * (loss / least - 1.0)


def covered(interval, true):
    """Where an interval, its lower and its upper end, holds the true value."""
    low, high = interval
    return (low <= true) & (true <= high)


def parameters_covered(estimate, true, deviations=1.96):
    """Whether the interval of each parameter, 95 % by default, holds its true value (p,)."""
    return np.abs(estimate.parameters - true) <= deviations * np.sqrt(np.diag(estimate.covariance))


def near(estimate, true, deviations=4.0):
    """Whether all parameters lie within so many of their standard deviations of the true ones."""
    return parameters_covered(estimate, true, deviations).all()


def joint_normal(model, data, x0):
    """Mean (N,) and covariance (N, N) of all outputs of a record that begins in state x0, for unit innovations."""
    noise = StateSpace(model.A, model.gain, model.C, np.eye(1), None, model.dt)
    spread = toeplitz(noise.markov(len(data))[:, 0, 0], np.zeros(len(data)))
    return simulate(model, data.u, x0=x0)[:, 0], spread @ spread.T


def multivariable(direct=True, poles=(0.95, 0.8, 0.3, -0.5)):
    """Two inputs, two outputs, four states; the first two poles are coupled into a pair."""
    rng, n = np.random.default_rng(2), len(poles)
    A = np.diag(poles)
    A[0, 1], A[1, 0] = 0.2, -0.2
    D = rng.standard_normal((2, 2)) * direct
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    # halves what it can of A, so that the predictor is stable
    return StateSpace(A, B, C, D, 0.5 * A @ np.linalg.pinv(C), 0.02)


def record_in_motion(truth, samples, seed=0, noise=0.0, scale=1.0):
    """From the middle of an experiment; innovations are white times `noise`, a number or (2, 2)."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples + 100, 2)) * [1.0, scale]
    e = np.dot(rng.standard_normal((samples + 100, 2)), noise)
    disturbance = StateSpace(truth.A, truth.gain, truth.C, np.eye(2), None, truth.dt)
    return IOData(u, simulate(truth, u) + simulate(disturbance, e), 0.02)[100:]
