"""Pictures of the report: the arm, moments of the exchange, and a film of a joint that plays the PRBS."""

import base64
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from hmtb_twin import JOINTS, TwinError, load_arm, render
from hmtb_twin.arm.rendering import Stage
from hmtb_twin.run.playback import frame_times, frames, pictured_arm
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.experiments.film import write_film
from scenarios.experiments.rpcm import rpcm_outcome
from scenarios.files.errors import ScenarioError
from scenarios.report.figure_style import MRAD, short
from scenarios.report.figures import photograph
from scenarios.thesis.comparison import Comparison

PHASES = ("approach", "draw out", "transfer", "insert")
"""Phases of the exchange that are shown; the picture is of the middle of each."""

SIZE = (480, 360)
"""Width and height of a moment and of the film, pixels."""

FILMED = "shoulder_pitch"
"""Joint that the film shows."""

SPAN = (20.0, 24.0)
"""First and last time of the film, s: two periods of the waveform."""

RATE = 12.5
"""Frames of the film per second."""

VISIBLE = 0.12
"""Motion that the eye follows on the arm, rad: the film enlarges smaller ones to about this."""


class Moment(NamedTuple):
    """A phase of the exchange, its time, s, and its picture as the address of an image."""

    phase: str
    time: float
    picture: str


class ArmPicture(NamedTuple):
    """A picture of the arm as the address of an image; without one the address is empty, and there is a reason."""

    address: str
    reason: str


class Exchange(NamedTuple):
    """Moments of the exchange, and its outcome in words; empty where there is none."""

    moments: tuple[Moment, ...]
    outcome: str


class Film(NamedTuple):
    """A film as the address of a video, with its caption; without a film the address is empty, the caption says why."""

    address: str
    caption: str


def arm_picture() -> ArmPicture:
    """Picture of the arm; without OpenGL there is none."""
    try:
        return ArmPicture(photograph(render(load_arm(), width=960, height=600)), "")
    except TwinError as error:
        return ArmPicture("", _sentence(error))


def _sentence(error: Exception) -> str:
    """The message of an error with a capital first letter."""
    return str(error)[:1].upper() + str(error)[1:]


def enlargement(motion: np.ndarray) -> int:
    """Whole number by which the film enlarges a motion (N,), rad: 1, 2 or 5 times a power of ten, one if it is seen."""
    peak = float(np.abs(motion).max())
    if peak == 0.0 or peak >= VISIBLE:
        return 1
    largest_factor = VISIBLE / peak
    decade = 10.0 ** np.floor(np.log10(largest_factor))
    return max(1, round(max(step * decade for step in (1, 2, 5) if step * decade <= largest_factor)))


def film(study: Comparison) -> Film:
    """Film of one joint that plays the PRBS, its motion enlarged where it is too small to be seen.

    Without a record, OpenGL or an encoder there is none, and the caption says why.
    """
    log = study.logs.get(single_joint_test(study.estimation_test, FILMED))
    if log is None:
        return Film("", f"There is no film: the PRBS test of the {short(FILMED)} has no record.")
    angles = np.asarray(log.true_angles)
    home = angles[0]
    factor = enlargement((angles - home)[:, JOINTS.index(FILMED)])
    # About the first pose, at which the joint rests.
    enlarged = replace(log, true_angles=home + factor * (angles - home))
    # A record shorter than the span is filmed to its end.
    last = min(SPAN[1], (len(log) - 1) * log.dt)
    span = (max(0.0, last - (SPAN[1] - SPAN[0])), last)
    try:
        # An encoder writes to a file that it can seek in, not to memory.
        with TemporaryDirectory() as folder:
            pictures = frames(enlarged, ["overview"], size=SIZE, times=frame_times(span, rate=RATE))
            data = write_film(pictures, Path(folder) / "film.mp4", rate=RATE).read_bytes()
    except (TwinError, ScenarioError) as error:
        return Film("", f"There is no film. {_sentence(error)}.")
    swing = MRAD * float(np.ptp((angles - home)[:, JOINTS.index(FILMED)])) / 2.0
    size = f"Every angle is enlarged {factor} times" if factor > 1 else "Not enlarged"
    return Film(
        "data:video/mp4;base64," + base64.b64encode(data).decode("ascii"),
        f"The {short(FILMED)} plays the pseudorandom binary sequence that models are identified from, in real time. "
        f"{size}: the joint moves by ±{swing:.2g} mrad.",
    )


def exchange(study: Comparison) -> Exchange:
    """Moments of the exchange and its outcome in words; neither without a record, no moments without OpenGL."""
    log = study.logs.get(RPCM)
    if log is None or log.unit_pose is None:
        return Exchange((), "")
    outcome = rpcm_outcome(log)
    times = {name: sum(outcome.phases[name]) / 2 for name in PHASES if name in outcome.phases}
    moments = []
    try:
        with Stage(pictured_arm(log), *SIZE) as stage:
            for phase, time in times.items():
                tick = min(round(time / log.dt), len(log) - 1)
                picture = stage.picture("seats", log.true_angles[tick], log.unit_pose[tick])
                moments.append(Moment(phase, time, photograph(picture)))
    except TwinError:
        return Exchange((), str(outcome))
    return Exchange(tuple(moments), str(outcome))
