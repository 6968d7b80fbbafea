"""Derivatives of the one-step prediction and of the response by the parameters of a polynomial model."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from sysid import Polynomials
from sysid.polynomial.orders import Orders
from sysid.records.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class Signals:
    """What goes through a system from rest.

    Attributes:
        u: Inputs (N, nu).
        y: Output (N,).
        e: Innovation (N,).
    """

    u: FloatArray
    y: FloatArray
    e: FloatArray


def regressors(at: Polynomials, orders: Orders, signals: Signals) -> FloatArray:
    """Derivatives of the prediction by the parameters, from rest [Ljung1999, sec. 10.3].

    The prediction error is D/C (A y - sum B_j/F_j u_j); at the truth it is the innovation.

    Args:
        at: The true polynomials.
        orders: Which coefficients are parameters.
        signals: Of the true system.

    Returns:
        (N, p), parameters in the sequence A, B, C, D, F.
    """
    c, d = at.C, at.D
    channels = [at.channel(j) for j in range(at.nu)]
    inputs = [lfilter(d, np.convolve(c, f), signals.u[:, j]) for j, (_, f) in enumerate(channels)]
    rows = _delayed(-lfilter(d, c, signals.y), range(1, orders.na + 1))
    for x, n, delay in zip(inputs, orders.nb, orders.nk, strict=True):
        rows += _delayed(x, range(delay, delay + n))
    rows += _delayed(lfilter([1.0], c, signals.e), range(1, orders.nc + 1))
    rows += _delayed(-lfilter([1.0], d, signals.e), range(1, orders.nd + 1))
    for x, (b, f), n in zip(inputs, channels, orders.nf, strict=True):
        rows += _delayed(-lfilter(b, f, x), range(1, n + 1))
    return np.array(rows).reshape(orders.count, len(signals.y)).T


def response_derivatives(at: Polynomials, orders: Orders, dt: float, f_hz: FloatArray) -> tuple[ComplexArray, ...]:
    """The response and its derivatives.

    Args:
        at: Polynomials.
        orders: Which coefficients are parameters.
        dt: Sampling interval, s.
        f_hz: Frequencies (nf,), Hz.

    Returns:
        Response (nf, 1, nu) and derivatives (p, nf, 1, nu).
    """
    z = np.exp(-2j * np.pi * dt * np.asarray(f_hz))
    a = np.polyval(at.A[::-1], z)
    response = np.zeros((len(z), 1, at.nu), dtype=complex)
    derivatives = np.zeros((orders.count, len(z), 1, at.nu), dtype=complex)
    first_b, first_f = orders.na, orders.count - sum(orders.nf)
    for j in range(at.nu):
        b, f = (np.polyval(row[::-1], z) for row in at.channel(j))
        response[:, 0, j] = b / (a * f)
        for k in range(orders.na):
            derivatives[k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / a
        for k in range(orders.nb[j]):
            derivatives[first_b + k, :, 0, j] = z ** (orders.nk[j] + k) / (a * f)
        for k in range(orders.nf[j]):
            derivatives[first_f + k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / f
        first_b, first_f = first_b + orders.nb[j], first_f + orders.nf[j]
    return response, derivatives


def _delayed(x: FloatArray, lags: range) -> list[FloatArray]:
    return [np.concatenate((np.zeros(lag), x[: len(x) - lag])) for lag in lags]
