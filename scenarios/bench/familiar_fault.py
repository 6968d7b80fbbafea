"""Faults that a response without noise gives away: a delay, a sign, a gain."""

from collections.abc import Sequence

import numpy as np

from sysid.records.arrays import ComplexArray, FloatArray

SHIFTS = (1, 2, -1, -2)
"""Samples by which delays are tried."""


def familiar_fault(
    responses: Sequence[ComplexArray], true: ComplexArray, frequencies: FloatArray, dt: float, most: float
) -> str:
    """What all responses have in common, in words; empty where they are nothing familiar.

    Args:
        responses: As estimated (nf, ny, nu), each.
        true: The true one, of the same shape.
        frequencies: (nf,), Hz.
        dt: Sampling interval, s.
        most: Relative root mean square error with which a response counts as the same.
    """
    turn = np.exp(-2j * np.pi * frequencies * dt)[:, None, None]
    tried = {f"{abs(n)} sample{'s' * (abs(n) > 1)} {'late' if n > 0 else 'early'}": true * turn**n for n in SHIFTS}
    tried["of the wrong sign"] = -true
    for words, wrong in tried.items():
        if _same(responses, wrong, most):
            return words
    gain = float(np.mean([np.vdot(true, response).real for response in responses]) / np.vdot(true, true).real)
    return f"{gain:.8g} times the truth" if _same(responses, gain * true, most) else ""


def _same(responses: Sequence[ComplexArray], expected: ComplexArray, most: float) -> bool:
    size = np.linalg.norm(expected)
    return all(np.linalg.norm(response - expected) <= most * size for response in responses)
