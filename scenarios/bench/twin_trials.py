"""Trials on the arm that the figures of amplitude and of bandwidth share."""

from scenarios.bench.metric import DRAWS
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
"""The joints that the thesis identified."""

AMPLITUDES = {"quick": (5, 10, 40), "full": (5, 10, 20, 40, 80)}
"""Root mean square of the angle asked for, mrad: from where friction rules to where the velocity limit does."""

WAVEFORMS = {"quick": 8, "full": 80}
REPEATED = {"quick": 3, "full": 30}
"""Of the first so many waveforms there are two records, which differ by noise alone."""

SEQUENCES = {"quick": 2, "full": 20}
"""Records of binary sequences, each with its own."""

SEQUENCE_MRAD = 67
"""Amplitude of the thesis' test 5, mrad: 1 V."""


def multisine_class(joint: str, mrad: int) -> str:
    """Name of the class of excitation of a joint at an amplitude."""
    return f"twin-nominal-{joint}-multisine-{mrad}mrad"


def sequence_class(joint: str) -> str:
    """Name of the problem of binary sequences of a joint."""
    return f"twin-nominal-{joint}-prbs-{SEQUENCE_MRAD}mrad"


def multisine_trials(effort: str) -> tuple[Trial, ...]:
    """Multisines: joints, amplitudes, waveforms, repeats of some.

    Raises:
        ScenarioError: There is no such effort.
    """
    _check(effort)
    return tuple(
        Trial(f"{multisine_class(joint, mrad)}-w{waveform}", draw)
        for joint in JOINTS
        for mrad in AMPLITUDES[effort]
        for waveform in range(WAVEFORMS[effort])
        for draw in range(2 if waveform < REPEATED[effort] else 1)
    )


def sequence_trials(effort: str) -> tuple[Trial, ...]:
    """Binary sequences of each joint.

    Raises:
        ScenarioError: There is no such effort.
    """
    _check(effort)
    return tuple(Trial(sequence_class(joint), draw) for joint in JOINTS for draw in range(SEQUENCES[effort]))


def _check(effort: str) -> None:
    if effort not in DRAWS:
        raise ScenarioError(f"effort {effort!r} given, expected one of {', '.join(DRAWS)}")
