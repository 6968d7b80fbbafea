"""Exchange of the replacement unit (RPCM): the operator's scripts, the tasks, and the outcome from the log."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import acos, radians
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin import Experiment, HandController, JointLog, Operator, Status, load_arm
from hmtb_twin.control.modes import TOOL_AXES, axis_gains
from hmtb_twin.parameters.variants import OPERATING_POSE
from hmtb_twin.parameters.worksite import SEATS, UNIT, Seat
from scenarios.experiments.operator import Pose, ScriptedOperator, Step
from scenarios.experiments.reach import ReachingOperator
from scenarios.files.errors import ScenarioError, unknown

HOLSTER, RECEPTACLE = SEATS["holster"], SEATS["receptacle"]

CLEAR = 0.06
"""How far above the unit the empty end effector stays clear of it, m."""

ALIGNED = RECEPTACLE.mouth + 0.015
"""Height over the floor of the receptacle at which the unit is aligned, m."""


@cache
def approach_point() -> Pose:
    """Return the holster-out approach point: where the tool is at the operating pose."""
    arm = load_arm()
    return arm.controller.tool_pose(arm.pose(OPERATING_POSE))


def rpcm_script() -> tuple[Step, ...]:
    """Return the steps of the whole exchange.

    The operator grips the unit in its holster, draws it out to the approach point, holds there, brings it to the
    receptacle, aligns, inserts and releases it; then grips it again, extracts it and returns.
    """
    approach, over = approach_point(), _over_receptacle()
    carry = partial(Step, carry=True, closed=True)
    touch = partial(Step, touching=True)
    grip = touch("grip", None, near=0.0025, turn=radians(3.0), speed=0.03, stride=0.04, closed=True, pause=0.8)
    return (
        Step("approach", _above(HOLSTER, CLEAR)),
        grip,
        touch("draw out", approach, closed=True, speed=0.06, stride=0.06, near=0.008),
        Step("hold", approach, closed=True, near=0.006, pause=5.0),
        carry("transfer", over, near=0.008, speed=0.08, pause=1.5),
        carry("align", _above(RECEPTACLE, ALIGNED), near=0.003, speed=0.04, pause=1.5),
        carry("insert", RECEPTACLE.seated, near=0.002, aside=0.004, speed=0.02, stride=0.012, touching=True, pause=1.0),
        touch("release", None, near=0.01, pause=1.0),
        Step("withdraw", _above(RECEPTACLE, CLEAR), near=0.006, speed=0.05, pause=5.0),
        replace(grip, name="grip again"),
        carry("extract", over, speed=0.05, stride=0.06, near=0.01, touching=True),
        Step("return", approach, closed=True, near=0.006, speed=0.08),
    )


def unloaded_script() -> tuple[Step, ...]:
    """Return the steps of the same motion with an empty end effector: the unit stays in its holster."""
    approach, over = approach_point(), _over_receptacle()
    return (
        Step("hold", approach, near=0.006, pause=5.0),
        Step("transfer", over, near=0.008, speed=0.08, pause=1.5),
        Step("align", _above(RECEPTACLE, ALIGNED), near=0.003, speed=0.04, pause=1.5),
        Step("lower", RECEPTACLE.seated, near=0.003, speed=0.02, stride=0.012, pause=5.0),
        Step("raise", over, speed=0.05, stride=0.06, near=0.01),
        Step("return", approach, near=0.006, speed=0.08),
    )


def _above(seat: Seat, height: float) -> Pose:
    position, rotation = seat.seated
    return position + np.array([0.0, 0.0, height]), rotation


def _over_receptacle() -> Pose:
    """Over the receptacle, as high as the approach point."""
    (x, y, _), rotation = RECEPTACLE.seated
    return np.array([x, y, approach_point()[0][2]]), rotation


DEPTH = 0.002
"""Largest height of an inserted unit above the floor of its seat, m."""

TILT = 0.04
"""Largest tilt or turn of an inserted unit, rad: a little more than the clearance allows."""

HARD = 200.0
"""Contact force above which a warning is given wherever it arises, N."""

ASIDE = 0.02
"""Largest distance of a unit that counts as over a seat, or at the approach point, m."""

PHASES = ("approach", "draw out", "hold", "transfer", "align", "insert", "release", "extract", "return")
"""The phases of the exchange, in order."""


@dataclass(frozen=True)
class RpcmOutcome:
    """Outcome of one exchange.

    Attributes:
        inserted: Whether the released unit stood in the receptacle until it was gripped again.
        returned: Whether the end effector brought it back to the holster-out approach point.
        phases: Start and end of every completed phase, s.
        height: Of the released unit above the floor of its seat, m; NaN if it was never released.
        aside: Its distance from the middle of the seat, m.
        tilt: Its angle to the seat, rad.
        peak_contact_force: Largest sum of normal forces between unit and worksite from its entry between the
            receptacle's guides to its release, N.
        largest_contact_force: The largest of the whole record, gripping and releasing included, N.
    """

    inserted: bool
    returned: bool
    phases: Mapping[str, tuple[float, float]]
    height: float
    aside: float
    tilt: float
    peak_contact_force: float
    largest_contact_force: float

    def __str__(self) -> str:
        if "insert" not in self.phases:
            return f"not inserted, the unit was not released; completed: {', '.join(self.phases) or 'nothing'}"
        verdict = "inserted" if self.inserted else "not inserted"
        stands = f"{1e3 * self.height:z.1f} mm above its seat, {1e3 * self.aside:z.1f} mm aside"
        back = f"back at {self.phases['return'][1]:.1f} s" if self.returned else "not brought back"
        return (
            f"{verdict}, released at {self.phases['insert'][1]:.1f} s, {stands}; "
            f"contact force up to {self.peak_contact_force:.0f} N while inserting, "
            f"{self.largest_contact_force:.0f} N in all; {back}"
        )

    def warning(self) -> str | None:
        """Return one line if a large contact force arose outside the insertion, else None."""
        if self.largest_contact_force <= max(HARD, self.peak_contact_force):
            return None
        return (
            f"the largest contact force, {self.largest_contact_force:.0f} N, arose outside the insertion: "
            "gripping, drawing out, releasing or a collision"
        )

    def summary(self) -> dict[str, object]:
        """Return the outcome as plain values for JSON."""
        return {**vars(self), "phases": {name: list(times) for name, times in self.phases.items()}}


def rpcm_outcome(log: JointLog) -> RpcmOutcome:
    """Evaluate an exchange of the replacement unit.

    A phase ends where the log shows it: *approach* when the end effector grips the unit, *draw out* when the unit is
    clear of the holster, *hold* when it leaves the approach point, *transfer* over the receptacle, *align* between its
    guides, *insert* at its release, *release* when it is gripped again, *extract* when it is clear of the guides,
    *return* at the approach point.

    Raises:
        ScenarioError: The record is not of the worksite.
    """
    if log.unit_pose is None or log.contact_force is None:
        raise ScenarioError(f"{log.name}: no replacement unit in this log; expected an experiment at the worksite")
    position, force = log.unit_pose[:, :3], log.contact_force
    offset = np.linalg.norm((position - RECEPTACLE.seated[0])[:, :2], axis=1)
    held = (log.status & Status.UNIT_HELD) > 0
    beside = np.linalg.norm(position - approach_point()[0], axis=1) > ASIDE
    over, above = offset <= ASIDE, _height(position, RECEPTACLE)
    # Ticks at which the end condition of each phase holds, in the order of the phases.
    conditions = (
        held,
        held & (_height(position, HOLSTER) > HOLSTER.mouth),
        # It was at the approach point before.
        held & beside & (np.cumsum(held & ~beside) > 0),
        held & over,
        held & over & (above < RECEPTACLE.mouth),
        ~held,
        held,
        held & (above > RECEPTACLE.mouth),
        held & ~beside,
    )
    ends = _ends_in_order(conditions)
    times = [0.0, *(end * log.dt for end in ends)]
    completed = PHASES[: len(ends)]
    phases = {name: (times[i], times[i + 1]) for i, name in enumerate(completed)}
    align, insert, release = map(PHASES.index, ("align", "insert", "release"))
    height, aside, tilt, peak = np.nan, np.nan, np.nan, 0.0
    if "align" in completed:
        # A tick holds the largest force since the tick before: at the release it still belongs to the insertion.
        released = ends[insert] + 1 if "insert" in completed else None
        peak = float(force[ends[align] : released].max())
    if "insert" in completed:
        # The unit is judged as it stands just before it is gripped again.
        last = ends[release] - 1 if "release" in completed else len(log) - 1
        height, aside = float(above[last]), float(offset[last])
        tilt = _angle_to_receptacle(log.unit_pose[last, 3:])
    return RpcmOutcome(
        inserted=bool(height <= DEPTH and aside <= 2.0 * RECEPTACLE.clearance and tilt <= TILT),
        returned=len(ends) == len(PHASES),
        phases=MappingProxyType(phases),
        height=height,
        aside=aside,
        tilt=tilt,
        peak_contact_force=peak,
        largest_contact_force=float(force.max()),
    )


def _ends_in_order(conditions: Sequence[np.ndarray]) -> list[int]:
    """First tick at which each condition holds, not before that of the condition before; up to the first that fails."""
    ends: list[int] = []
    begin = 0
    for condition in conditions:
        ticks = np.flatnonzero(condition[begin:])
        if not len(ticks):
            break
        begin += int(ticks[0])
        ends.append(begin)
    return ends


def _angle_to_receptacle(quaternion: np.ndarray) -> float:
    """Angle between a unit and the seat of the receptacle, rad: 2 acos |q'q0| of unit quaternions."""
    seated = np.empty(4)
    # Logs hold quaternions, seats rotation matrices.
    mujoco.mju_mat2Quat(seated, RECEPTACLE.seated[1].ravel())
    # The product may exceed 1 by rounding, where acos has no value.
    return 2.0 * acos(min(1.0, abs(float(seated @ quaternion))))


def _height(position: np.ndarray, seat: Seat) -> np.ndarray:
    """Return the height of the unit's lower end above the floor of a seat (N,), m."""
    return np.asarray(position[:, 2] - UNIT.size[0] - seat.position[2])


TASKS: dict[str, Callable[[], tuple[Step, ...]]] = {"rpcm": rpcm_script, "rpcm-unloaded": unloaded_script}
"""The script of each task at the worksite."""

REACH = "reach"
"""The task in free space: to move the tool from one drawn place to the next."""

MODE = "cartesian_rate"
"""Control mode of all tasks."""


def check_task(task: str, experiment: Experiment, *, excited: bool) -> None:
    """Check that an experiment has the mode, axes and worksite that a task needs.

    Raises:
        ScenarioError: Unknown task, or an experiment that does not suit it.
    """
    if task not in (*TASKS, REACH):
        raise ScenarioError(unknown("task", task, (*TASKS, REACH)))
    at_worksite = task != REACH
    unmet = []
    if experiment.mode != MODE:
        unmet.append(f'mode = "{MODE}"')
    if experiment.axes != TOOL_AXES:
        unmet.append(f"axes = {', '.join(TOOL_AXES)}")
    if experiment.worksite != at_worksite:
        unmet.append(f"worksite = {str(at_worksite).lower()}")
    if at_worksite and experiment.payload != "none":
        unmet.append('payload = "none", the unit in its holster')
    if excited:
        unmet.append("no excitation")
    if unmet:
        raise ScenarioError(f"task {task!r} expects {'; '.join(unmet)}")


def task_operator(task: str, seed: int, hand_controller: HandController) -> Operator:
    """Return an operator for a task; the seed draws the operator's errors, or where the tool is moved in free space."""
    gains = axis_gains(MODE, TOOL_AXES, hand_controller)
    if task == REACH:
        return ReachingOperator(gains, seed)
    return ScriptedOperator(TASKS[task](), gains, seed)
