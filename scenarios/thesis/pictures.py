"""Pictures of the laboratory in the report: the arm, and moments of the exchange of the replacement unit."""

from collections.abc import Sequence
from dataclasses import dataclass

from hmtb_twin import JointLog, TwinError, load_arm, render
from hmtb_twin.arm.rendering import Stage
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.logged_arm import pictured_arm
from scenarios.experiments.rpcm import rpcm_outcome
from scenarios.report.figures import photograph
from scenarios.thesis.comparison import Comparison

PHASES = ("approach", "draw out", "transfer", "insert")
"""Phases of the exchange that are shown; the picture is of the middle of each."""

SIZE = (640, 480)
"""Width and height of a moment, pixels."""


@dataclass(frozen=True)
class Moment:
    """A picture of the exchange.

    Attributes:
        phase: What is being done.
        time: When, s.
        picture: The picture as the address of an image, or nothing where none could be drawn.
    """

    phase: str
    time: float
    picture: str


def arm_picture() -> tuple[str, str]:
    """The picture of the arm as the address of an image, or nothing and what is missing to draw one."""
    try:
        return photograph(render(load_arm(), width=1200, height=750)), ""
    except TwinError as error:
        said = str(error)
        return "", said[:1].upper() + said[1:]


def exchange(study: Comparison, phases: Sequence[str] = PHASES) -> tuple[tuple[Moment, ...], str]:
    """Moments of the exchange and how it ended.

    Args:
        study: The study.
        phases: Which phases to show, of those that the exchange reached.

    Returns:
        The moments, and the outcome in words; none and nothing where there is no record or nothing to draw with.
    """
    log = study.logs.get(RPCM)
    if log is None or log.unit_pose is None:
        return (), ""
    outcome = rpcm_outcome(log)
    times = {name: sum(outcome.phases[name]) / 2 for name in phases if name in outcome.phases}
    try:
        return _drawn(log, times), str(outcome)
    except TwinError:
        return (), str(outcome)


def _drawn(log: JointLog, times: dict[str, float]) -> tuple[Moment, ...]:
    if log.unit_pose is None:
        return ()
    moments = []
    with Stage(pictured_arm(log), *SIZE) as stage:
        for phase, time in times.items():
            tick = min(round(time / log.dt), len(log) - 1)
            picture = stage.picture("seats", log.true_angles[tick], log.unit_pose[tick])
            moments.append(Moment(phase, time, photograph(picture)))
    return tuple(moments)
