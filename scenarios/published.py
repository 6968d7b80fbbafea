"""The models that the thesis prints, to its digits: the study's reference data [Morris1996, ch. IV and V].

All are at 50 Hz, from the commanded to the measured angle of one joint. The digits are those of a scanned text; what
they imply is computed and tested, not taken from the text. Two prints of one model are kept apart where they disagree:
the shoulder-yaw ARMAX has a DC gain of 1.18 as a transfer function (4.7) and 1.31 as a state space (4.9), because the
latter's digits are fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid import StateSpace, block_diagonal

DT = 0.02
"""Sampling interval of every published model, s."""


@dataclass(frozen=True)
class PublishedModel:
    """One printed model.

    Attributes:
        label: Method and equation, e.g. ``"ARMAX (4.7)"``.
        joint: Joint that it describes.
        method: ``"armax"``, ``"oe"`` or ``"okid"``.
        model: The model in innovation form, K zero where the print has none.
        chosen: Whether the thesis takes it into a three-joint model.
    """

    label: str
    joint: str
    method: str
    model: StateSpace
    chosen: bool

    @property
    def bandwidth_hz(self) -> float:
        """Frequency at which the gain has fallen by 3 dB from its value at zero, Hz."""
        return float(self.model.bandwidth()[0, 0])


def _transfer_function(numerator: Sequence[float], denominator: Sequence[float], K: Sequence[float]) -> StateSpace:
    """Observer form of a strictly proper fraction in z, highest power first; the thesis' own form."""
    a = np.asarray(denominator, dtype=float)
    n = len(a) - 1
    A = np.eye(n, k=1)
    A[:, 0] = -a[1:]
    B = np.zeros((n, 1))
    B[n - len(numerator) :, 0] = numerator
    return StateSpace(A, B, np.eye(1, n), np.zeros((1, 1)), np.asarray(K, dtype=float)[:, None], DT)


def _okid(A: list[list[float]], B: list[float], C: list[float], D: float, G: list[float]) -> StateSpace:
    """An observer model; K = -G [Morris1996, eq. 5.7]."""
    return StateSpace(np.array(A), np.array(B)[:, None], np.array([C]), np.array([[D]]), -np.array(G)[:, None], DT)


YAW_ARMAX = PublishedModel(
    "ARMAX (4.7)",
    "shoulder_yaw",
    "armax",
    _transfer_function(
        [0.003804, 0.003504, -0.004285, 0.0],
        [1.0, -2.542, 2.367, -0.8523, -0.08044, 0.1103],
        [2.1470, -2.4323, 1.1597, 0.0804, -0.1103],
    ),
    True,
)
YAW_ARMAX_STATE_SPACE = PublishedModel(
    "ARMAX (4.9)",
    "shoulder_yaw",
    "armax",
    _transfer_function(
        [0.0038, 0.0035, -0.0043, 0.0],
        [1.0, -2.5420, 2.3667, -0.8523, -0.0804, 0.1103],
        [2.1470, -2.4323, 1.1597, 0.0804, -0.1103],
    ),
    False,
)
YAW_OE = PublishedModel(
    "OE (4.8)",
    "shoulder_yaw",
    "oe",
    _transfer_function([0.0464, 0.06144], [1.0, -0.7501, -0.1815, 0.0], [0.0, 0.0, 0.0]),
    False,
)
SHOULDER_PITCH_OE = PublishedModel(
    "OE (4.10)",
    "shoulder_pitch",
    "oe",
    _transfer_function([0.03459, 0.07584], [1.0, -0.9776, 0.07922], [0.0, 0.0]),
    True,
)
ELBOW_PITCH_ARMAX = PublishedModel(
    "ARMAX (4.12)",
    "elbow_pitch",
    "armax",
    _transfer_function([0.01237, 0.0426], [1.0, -1.488, 0.5435, 0.0], [1.4698, -0.2739, 0.0]),
    True,
)
YAW_OKID = PublishedModel(
    "OKID (5.8)",
    "shoulder_yaw",
    "okid",
    _okid(
        [[0.99487, 0.02896], [-0.15355, 0.55941]],
        [2.7065, 12.366],
        [0.004706, -0.001125],
        0.000714,
        [-276.41, -123.20],
    ),
    True,
)
SHOULDER_PITCH_OKID = PublishedModel(
    "OKID (5.9)",
    "shoulder_pitch",
    "okid",
    _okid(
        [[0.90891, 0.10801], [-0.35206, 0.33925]],
        [6.881, 11.762],
        [0.014742, -0.0065875],
        0.010405,
        [-65.283, 22.597],
    ),
    True,
)
ELBOW_PITCH_OKID = PublishedModel(
    "OKID (5.10)",
    "elbow_pitch",
    "okid",
    _okid(
        [[0.94738, 0.077488], [-0.27646, 0.517280]],
        [4.7407, 11.0670],
        [0.013258, -0.0059914],
        0.0032941,
        [-77.049, 11.586],
    ),
    True,
)

PUBLISHED: tuple[PublishedModel, ...] = (
    YAW_ARMAX,
    YAW_ARMAX_STATE_SPACE,
    YAW_OE,
    YAW_OKID,
    SHOULDER_PITCH_OE,
    SHOULDER_PITCH_OKID,
    ELBOW_PITCH_ARMAX,
    ELBOW_PITCH_OKID,
)
"""Every printed model, joint by joint."""

BREAK_FREQUENCY = {"shoulder_yaw": 6.0, "shoulder_pitch": 7.0, "elbow_pitch": 7.0}
"""Low-frequency cutoff that the thesis reads off its spectral estimates, rad/s [Morris1996, sec. III.2A and III.3]."""


def published(joint: str) -> tuple[PublishedModel, ...]:
    """The printed models of one joint; none for the joints that the thesis did not identify."""
    return tuple(entry for entry in PUBLISHED if entry.joint == joint)


def sysid_model() -> StateSpace:
    """The thesis' "SysID model": yaw ARMAX, shoulder-pitch OE, elbow-pitch ARMAX [Morris1996, eq. 4.14].

    With the digits of the transfer functions, which are more than those of the state-space print.
    """
    return block_diagonal([YAW_ARMAX.model, SHOULDER_PITCH_OE.model, ELBOW_PITCH_ARMAX.model])


def okid_model() -> StateSpace:
    """The thesis' "OKID model" of three joints [Morris1996, eq. 5.11]."""
    return block_diagonal([YAW_OKID.model, SHOULDER_PITCH_OKID.model, ELBOW_PITCH_OKID.model])


def hybrid_model() -> StateSpace:
    """SysID for yaw and OKID for the pitches [Morris1996, sec. VI.6]."""
    return block_diagonal([YAW_ARMAX.model, SHOULDER_PITCH_OKID.model, ELBOW_PITCH_OKID.model])
