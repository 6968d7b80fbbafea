"""Poles and zeros of one channel of a larger model, from its modes."""

from dataclasses import dataclass

import numpy as np

from sysid import StateSpace

SILENT = 1e-7
"""Modes that carry less than this part of the gain at 0 Hz are other channels': a zero of this one sits on them."""

ORIGIN = 1e-6
"""Poles and zeros of smaller modulus are delays, or faster than the sampling tells from one."""

FAR = 1e3
"""Zeros of larger modulus are rounding: the channel has them at infinity."""


@dataclass(frozen=True)
class Modal:
    """One channel by its modes.

    Attributes:
        poles: Poles in the z plane, largest modulus first, without those at the origin (n,).
        shares: Part of the gain at 0 Hz that each carries, as a modulus (n,).
        zeros: Zeros in the z plane, largest modulus first, without those at the origin (m,).
    """

    poles: np.ndarray
    shares: np.ndarray
    zeros: np.ndarray


def modal(channel: StateSpace) -> Modal:
    """Take a channel apart into the modes that it shares with its command and its measurement.

    Balanced truncation keeps the response but moves poles that a zero is near; here poles are eigenvalues of the whole
    model. Of its zeros those on modes that the channel does not show are left out, each with its mode.

    Args:
        channel: A stable single-input single-output model, all states kept.

    Returns:
        Its poles with their shares, and its zeros.
    """
    A, B, C = channel.A, channel.B.astype(complex), channel.C
    poles, vectors = np.linalg.eig(A)
    residues = (C @ vectors)[0] * np.linalg.solve(vectors, B)[:, 0]
    shares = np.abs(residues / (1.0 - poles)) / abs(channel.dc_gain()[0, 0])
    moving = np.abs(poles) > ORIGIN
    shown = moving & (shares > SILENT)
    zeros = channel.zeros()
    zeros = zeros[np.isfinite(zeros) & (np.abs(zeros) > ORIGIN) & (np.abs(zeros) < FAR)]
    for pole in poles[moving & ~shown]:
        if len(zeros):
            zeros = np.delete(zeros, np.argmin(np.abs(zeros - pole)))
    order = np.argsort(-np.abs(poles[shown]), kind="stable")
    return Modal(poles[shown][order], shares[shown][order], zeros[np.argsort(-np.abs(zeros), kind="stable")])
