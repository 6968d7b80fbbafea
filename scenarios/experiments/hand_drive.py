"""Experiments that are driven by hand: the hand controller's springs, what its operator sees, and the record."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from time import perf_counter

import numpy as np

from hmtb_twin import JointLog, Motion, View
from hmtb_twin.control.modes import TOOL_AXES
from hmtb_twin.run.live_run import Frame
from scenarios.experiments.log_review import status_words
from scenarios.experiments.operator import way_to
from scenarios.experiments.recipe import Recipe
from scenarios.experiments.rpcm import RECEPTACLE, rpcm_outcome
from scenarios.experiments.scenario import Scenario

SPRING = 0.25
"""Time after the last push at which an axis springs back, s: browsers delay a push by some."""

_PROGRAM = """from pathlib import Path
from hmtb_twin import JointLog
from scenarios.experiments.rpcm import rpcm_outcome

log = JointLog.load(Path({path!r}))
data = log.iodata("{joint}")  # command and angle, for any estimator of sysid
print("no exchange" if log.unit_pose is None else rpcm_outcome(log))"""


class Stick:
    """The 2x3-axis hand controller as the operator of one experiment; `clock` gives the springs' time, s.

    Attributes:
        grip: Whether the end effector is closed.
        view: What the operator saw last; None before the first tick.
    """

    def __init__(self, axes: tuple[str, ...], *, grip: bool = True, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        # At rest, as if the last push had ended long ago.
        self._deflections = dict.fromkeys(axes, (0.0, -inf))
        self.grip = grip
        self.view: View | None = None

    def push(self, axis: str, volts: float, duration: float = SPRING) -> None:
        """Deflect an axis by volts for a duration in s, or until the next push; others than its own do nothing."""
        # Keys on the page may belong to axes that this experiment does not move.
        if axis in self._deflections:
            self._deflections[axis] = volts, self._clock() + duration

    def volts(self) -> dict[str, float]:
        """Deflection of each axis at this moment, V."""
        time = self._clock()
        deflected = dict.fromkeys(self._deflections, 0.0)
        for axis, (volts, until) in self._deflections.items():
            if time < until:
                deflected[axis] = volts
        return deflected

    def move(self, view: View) -> Motion:
        """Return the deflections and the grip of a tick; see `hmtb_twin.Operator`."""
        self.view = view
        return Motion(np.array(list(self.volts().values())), self.grip)


@dataclass(frozen=True)
class Drive(Scenario):
    """An experiment that is driven by hand.

    Attributes:
        stick: The hand controller.
    """

    stick: Stick = field(default_factory=lambda: Stick(()), compare=False)

    def operator(self) -> Stick:
        """Return the hand controller."""
        return self.stick


def displays(frame: Frame, driven: Drive | None) -> list[str]:
    """What the displays of the control station show."""
    words = [f"{frame.time:.1f} s", *status_words(frame.status)]
    forces = f"wrist force {frame.wrist_force:.1f} N"
    if frame.contact_force is not None:
        forces += f", contact force {frame.contact_force:.1f} N"
    # The operator's view is that of the last tick; before the first there is none.
    view = driven.stick.view if driven is not None else None
    if driven is None or view is None or view.unit is None:
        return [", ".join(words), forces]
    words.append("end effector closed" if driven.stick.grip else "end effector open")
    is_held = view.unit.held
    target = RECEPTACLE.seated if is_held else None
    offset, turn = way_to(target, view, carry=is_held)
    distances = zip(TOOL_AXES, (*1e3 * offset, *np.degrees(turn)), strict=True)
    way = ", ".join(f"{axis} {distance:+z.0f}" for axis, distance in distances)
    label = "unit to its receptacle" if is_held else "tool to unit"
    return [", ".join(words), forces, f"{label}, mm and deg: {way}"]


def drive_recipe(log: JointLog, path: str) -> Recipe:
    """What to do with the record of a drive, a file, without the page."""
    # The joint whose command moved most has the most to identify from.
    joint = log.joints[int(np.ptp(log.commanded, axis=0).argmax())]
    commands = [
        ("hmtb", "identify", path, "--joint", joint),
        ("hmtb", "view", path),
        ("hmtb", "video", path, "--camera", "deck"),
    ]
    return Recipe(commands, _PROGRAM.format(path=path, joint=joint))


def exchange(log: JointLog) -> tuple[list[str], list[tuple[str, str, str]]]:
    """How the exchange of the replacement unit went: lines, and the times of its phases in s; none in free space."""
    if log.unit_pose is None:
        return [], []
    outcome = rpcm_outcome(log)
    lines = [f"exchange: {outcome}"]
    if warning := outcome.warning():
        lines.append(f"warning: {warning}")
    phases = []
    for name, (start, end) in outcome.phases.items():
        phases.append((name, f"{start:.1f}", f"{end:.1f}"))
    return lines, phases
