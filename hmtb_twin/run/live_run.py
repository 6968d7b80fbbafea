"""One experiment run tick by tick, watched while it runs, with its servo power in the hands of whoever watches."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.run.batch_run import BatchRun
from hmtb_twin.run.experiment_row import first_state, prepare


@dataclass(frozen=True)
class Frame:
    """State of the arm at one tick of a run or log: angles, command, forces, status.

    Attributes:
        tick: Number of the tick.
        angles: Joint angles without sensor errors (7,), rad.
        command: Joint command in force (7,), rad.
        wrench: Wrist force and torque (6,), N and N m.
        status: What was limited, bits of `Status`.
        unit_pose: Position in m and quaternion of the replacement unit (7,); None in free space.
        contact_force: Sum of normal forces between unit and worksite, N; None in free space.
        measured: Angles on the bus in the tick of the command (7,), rad; None where nothing was recorded.
        dt: Length of a tick, s.
    """

    tick: int
    angles: np.ndarray
    command: np.ndarray
    wrench: np.ndarray
    status: int
    unit_pose: np.ndarray | None = None
    contact_force: float | None = None
    measured: np.ndarray | None = None
    dt: float = SAMPLE_TIME

    @property
    def time(self) -> float:
        """Since the start of the experiment, s."""
        return self.tick * self.dt

    @property
    def wrist_force(self) -> float:
        """Magnitude of the wrist force, N."""
        return float(np.linalg.norm(self.wrench[:3]))


def frame_of(log: JointLog, tick: int) -> Frame:
    """Return the arm at one tick of a log."""
    unit_pose = None if log.unit_pose is None else log.unit_pose[tick]
    contact_force = None if log.contact_force is None else float(log.contact_force[tick])
    return Frame(
        tick=tick,
        angles=log.true_angles[tick],
        command=log.felt[tick],
        wrench=log.wrench[tick],
        status=int(log.status[tick]),
        unit_pose=unit_pose,
        contact_force=contact_force,
        measured=log.measured[tick],
        dt=log.dt,
    )


class LiveRun:
    """One experiment, run tick by tick: the bits of its log are those that `simulate` gives.

    Args:
        experiment: The experiment; a dataclass, so that shutdowns can be noted in its description.
        load: `load_arm` or a function that returns its arms.

    Attributes:
        tick: Ticks done.
        ticks: Ticks of the whole experiment.
        failure: Why the run ended before its last tick: the physics diverged, or the operator returned an invalid
            motion; None otherwise.

    Raises:
        TwinError: The experiment needs something that the laboratory does not have.
        OverloadError: The drives cannot hold the arm at its first pose with one of its payloads.
    """

    def __init__(self, experiment: Experiment, *, load: Callable[..., Arm] = load_arm) -> None:
        self._row = row = prepare(experiment, load, live=True)
        row.start = first_state(row)
        self._run = BatchRun([row], 1)
        self._steps = self._run.steps()
        self._switched: list[float] = list(experiment.shutdown)
        self.tick, self.ticks = 0, row.ticks
        self._sample_time = row.arm.description.sample_time
        self._readings = np.empty((row.ticks, len(row.arm.joints)))
        self.failure: str | None = None

    def step(self) -> Frame | None:
        """Run one tick and return the arm after it; None at the end of the experiment or after a failure."""
        # A copy: the next step overwrites the arrays of the batch.
        angles = self._run.channels()["true_angles"][0].copy()
        if next(self._steps, None) is None:
            return None
        self.failure = self._row.failure
        if self.failure is not None:
            self._steps.close()
            return None
        done, self.tick = self.tick, self.tick + 1
        # The recorder read the angles before the command of this tick acted.
        self._readings[done] = self._row.reading(done, angles)
        recorded_ticks = np.maximum(done - self._row.arm.delays, 0)
        measured = self._readings[recorded_ticks, np.arange(self._readings.shape[1])]
        station = self._row.station
        channels = {name: values[0].copy() for name, values in self._run.channels().items()}
        contact_force = float(channels["contact_force"][0]) if "contact_force" in channels else None
        return Frame(
            tick=self.tick,
            angles=channels["true_angles"],
            command=station.commands[done].copy(),
            wrench=channels["wrench"],
            status=int(station.status[done]),
            unit_pose=channels.get("unit_pose"),
            contact_force=contact_force,
            measured=measured,
            dt=self._sample_time,
        )

    @property
    def powered(self) -> bool:
        """Whether the servos have power at the next tick."""
        return bool(self._row.station.powered[min(self.tick, self.ticks - 1)])

    def switch_power(self, *, on: bool) -> None:
        """Switch the servo power from the next tick on: off is an emergency shutdown, on is the reset after it.

        From now on nothing else switches it: shutdowns that were planned for later are dropped.

        Raises:
            TwinError: The run has not begun or has ended.
        """
        if not 0 < self.tick < self.ticks or self.failure is not None:
            raise TwinError("the servo power can be switched only while the arm runs")
        self._switched = [time for time in self._switched if round(time / self._sample_time) < self.tick]
        if on != bool(self._row.station.powered[self.tick - 1]):
            # Products with the sampling time such as 0.06 come out as 0.060000000000000005.
            self._switched.append(round(self.tick * self._sample_time, 9))
        self._run.switch_power(self.tick, on=on)

    @property
    def experiment(self) -> Experiment:
        """The experiment with the shutdowns that were made: `simulate` repeats the run from it."""
        if self._switched == list(self._row.experiment.shutdown):
            return self._row.experiment
        return cast(Experiment, replace(cast(Any, self._row.experiment), shutdown=tuple(self._switched)))

    def log(self) -> JointLog:
        """End the run and return its log up to the current tick.

        Raises:
            TwinError: No tick was run.
        """
        if self.tick == 0:
            raise TwinError(f"{self._row.experiment.name}: nothing was recorded, the run ended before its first tick")
        self._steps.close()
        # The log describes the run as it was, with the shutdowns made while it ran.
        self._row.experiment = self.experiment
        return self._row.log(self.tick)
