"""Run experiments side by side: physics in C, Python once per tick of the position loop for all of them."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from types import MappingProxyType
from typing import overload

import mujoco
import numpy as np
from mujoco import batch

from hmtb_twin.arm import Arm, load_arm
from hmtb_twin.errors import TwinError
from hmtb_twin.experiment import Experiment
from hmtb_twin.hand_controller import StickRecord, read_stick
from hmtb_twin.joint_log import JointLog, software_versions
from hmtb_twin.modes import MODES, joint_index, limit_command
from hmtb_twin.parameters import HAND_CONTROLLER, INDEXED_JOINTS, JOINTS, RECORDER, SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.recorder import read_resolvers

MOST_THREADS = 1024
"""More threads than that are a slip of the keyboard."""

Progress = Callable[[int, int], None]
"""Called with the ticks done and the ticks in all, summed over experiments."""


@dataclass(frozen=True)
class Logs(Sequence[JointLog]):
    """The logs of a campaign, in the order of its experiments; those that failed are missing.

    Attributes:
        logs: The logs.
        failed: Reason of each failure, by name (`name@seed` where names repeat).
        physics_seconds: Wall time spent in the physics, s.
        steps: Physics steps taken, over all experiments.
    """

    logs: tuple[JointLog, ...]
    failed: Mapping[str, str] = field(default_factory=dict)
    physics_seconds: float = 0.0
    steps: int = 0

    @overload
    def __getitem__(self, index: int) -> JointLog: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[JointLog, ...]: ...
    def __getitem__(self, index: int | slice) -> JointLog | tuple[JointLog, ...]:
        return self.logs[index]

    def __len__(self) -> int:
        return len(self.logs)

    def __iter__(self) -> Iterator[JointLog]:
        return iter(self.logs)


@dataclass
class _Row:
    """One experiment on its way through a batch."""

    experiment: Experiment
    ticks: int
    stick: StickRecord
    resolvers: np.random.Generator
    record: dict[str, np.ndarray] = field(default_factory=dict)
    failure: str | None = None


def simulate(
    experiments: Sequence[Experiment], *, threads: int | None = None, progress: Progress | None = None
) -> Logs:
    """Simulate experiments, all of one arm as rows of one `mujoco.batch.Batch`.

    Args:
        experiments: What to run.
        threads: Threads for the physics; all processors by default. The logs do not depend on it, bit for bit.
        progress: Called now and then with the ticks done and the ticks in all.

    Returns:
        The logs, and by name the experiments that failed because the physics diverged.

    Raises:
        TwinError: An experiment asks for something that the laboratory does not have; nothing is run then.
    """
    if threads is not None and not (isinstance(threads, int) and 1 <= threads <= MOST_THREADS):
        raise TwinError(f"threads = {threads} given, expected a whole number from 1 to {MOST_THREADS}")
    rows = [_prepare(experiment) for experiment in experiments]
    arms: dict[tuple[str, str, bool], list[_Row]] = defaultdict(list)
    for row in rows:
        arms[row.experiment.variant, row.experiment.payload, row.experiment.friction].append(row)
    total = sum(row.ticks for row in rows)
    done, seconds = 0, 0.0
    for (variant, payload, friction), group in arms.items():
        arm = load_arm(variant, payload, friction=friction)
        offset = done

        def report(ticks: int, offset: int = offset) -> None:
            if progress is not None:
                progress(offset + ticks, total)

        seconds += _run(arm, group, threads or 0, report)
        done += sum(row.ticks for row in group)
    names = [row.experiment.name for row in rows]
    labels = [
        name if names.count(name) == 1 else f"{name}@{row.experiment.seed}"
        for name, row in zip(names, rows, strict=True)
    ]
    return Logs(
        logs=tuple(_log(row) for row in rows if row.failure is None),
        failed=MappingProxyType({label: row.failure for label, row in zip(labels, rows, strict=True) if row.failure}),
        physics_seconds=seconds,
        steps=sum(row.ticks for row in rows) * _substeps(load_arm().model) if rows else 0,
    )


def _substeps(model: mujoco.MjModel) -> int:
    return round(SAMPLE_TIME / model.opt.timestep)


def _prepare(experiment: Experiment) -> _Row:
    arm = load_arm(experiment.variant, experiment.payload)
    arm.pose(experiment.pose)
    if experiment.mode not in MODES:
        raise TwinError(f"{experiment.name}: unknown mode {experiment.mode!r}, available: {', '.join(MODES)}")
    axes = [joint_index(name) for name in experiment.axes]
    if len(set(axes)) != len(axes) or set(experiment.axes) & set(INDEXED_JOINTS):
        raise TwinError(
            f"{experiment.name}: axes {', '.join(experiment.axes)} given, expected different joints of "
            f"{', '.join(JOINTS[1:])}; the shoulder roll is indexed"
        )
    ticks = round(experiment.duration * SAMPLE_RATE)
    if ticks < 1 or abs(ticks - experiment.duration * SAMPLE_RATE) > 1e-9 * ticks:
        raise TwinError(
            f"{experiment.name}: duration {experiment.duration:g} s given, expected a positive multiple of "
            f"{SAMPLE_TIME:g} s"
        )
    volts = np.asarray(experiment.volts(), dtype=float)
    if volts.shape != (ticks, len(axes)) or not np.isfinite(volts).all():
        raise TwinError(
            f"{experiment.name}: volts of shape {volts.shape} given, expected finite values of shape "
            f"{(ticks, len(axes))} for {experiment.duration:g} s at {SAMPLE_RATE} Hz"
        )
    wires, resolvers = np.random.default_rng(experiment.seed).spawn(2)
    stick = read_stick(volts, HAND_CONTROLLER, wires, noise=experiment.noise, quantisation=experiment.quantisation)
    return _Row(experiment, ticks, stick, resolvers)


def _run(arm: Arm, rows: list[_Row], threads: int, report: Callable[[int], None]) -> float:
    """Run the experiments of one arm, fill in their records and return the seconds spent in the physics."""
    simulations = batch.Batch(arm.model, nsim=len(rows), nthread=threads)
    poses = np.array([arm.pose(row.experiment.pose) for row in rows])
    for i, pose in enumerate(poses):
        start = arm.rest(pose)
        for name in ("qpos", "qvel", "act", "ctrl"):
            simulations.bind(name)[i] = getattr(start, name)
    control, angles, act, sensors = (simulations.bind(name) for name in ("ctrl", "qpos", "act", "sensordata"))
    lengths = np.array([row.ticks for row in rows])
    owner, joint, offset = _stick_columns(rows, lengths.max())
    record = {
        name: np.empty((lengths.max(), len(rows), width))
        for name, width in (("commanded", 7), ("true_angles", 7), ("load_pressure", 7), ("wrench", 6))
    }
    limit = arm.velocity_limits * SAMPLE_TIME
    substeps = _substeps(arm.model)
    command, pressures = poses.copy(), arm.pressure_states
    active = np.arange(len(rows))
    seconds, ticks = 0.0, 0
    simulations.forward()
    for k in range(lengths.max()):
        wanted = poses.copy()
        wanted[owner, joint] += offset[k]
        command = limit_command(wanted, command, limit)
        record["true_angles"][k] = angles
        record["load_pressure"][k] = act[:, pressures]
        record["wrench"][k] = sensors
        record["commanded"][k] = command
        control[active] = arm.controls(command[active])
        started = perf_counter()
        # The forward pass at the new state makes the wrench that of this very tick, under the command still in force.
        simulations.step(ids=active, nstep=substeps, stage=mujoco.mjtStage.mjSTAGE_ACC)
        seconds += perf_counter() - started
        ticks += len(active)
        alarms = simulations.warning[active, :, 1].any(axis=1)
        for i in active[alarms]:
            rows[i].failure = _reason(simulations.warning[i, :, 1], k)
        active = active[~alarms & (lengths[active] > k + 1)]
        if k % SAMPLE_RATE == 0 or not len(active):
            report(ticks)
        if not len(active):
            break
    for i, row in enumerate(rows):
        row.record = {name: values[: row.ticks, i] for name, values in record.items()}
    return seconds


def _stick_columns(rows: list[_Row], ticks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, for every excited axis of every experiment, its row, its joint and its offsets (ticks, n_axes), rad."""
    owner = [i for i, row in enumerate(rows) for _ in row.experiment.axes]
    joint = [joint_index(name) for row in rows for name in row.experiment.axes]
    offset = np.zeros((ticks, len(owner)))
    column = 0
    for row in rows:
        width = len(row.experiment.axes)
        offset[: row.ticks, column : column + width] = row.stick.angle
        column += width
    return np.array(owner, dtype=int), np.array(joint, dtype=int), offset


def _reason(counts: np.ndarray, tick: int) -> str:
    raised = [str(mujoco.mjtWarning(i)).rsplit("mjWARN_", 1)[-1] for i in np.flatnonzero(counts)]
    return f"the physics engine warned of {', '.join(raised)} at {tick * SAMPLE_TIME:.2f} s"


def _log(row: _Row) -> JointLog:
    experiment = row.experiment
    arm = load_arm(experiment.variant, experiment.payload)
    return JointLog(
        name=experiment.name,
        seed=experiment.seed,
        dt=SAMPLE_TIME,
        axes=tuple(experiment.axes),
        commanded=row.record["commanded"],
        measured=read_resolvers(
            row.record["true_angles"],
            arm.delays,
            RECORDER,
            row.resolvers,
            noise=experiment.noise,
            quantisation=experiment.quantisation,
        ),
        wrench=row.record["wrench"],
        true_angles=row.record["true_angles"],
        load_pressure=row.record["load_pressure"],
        volts=row.stick.volts,
        counts=row.stick.counts,
        provenance={
            "variant": experiment.variant,
            "payload": experiment.payload,
            "pose": experiment.pose,
            "mode": experiment.mode,
            "friction": str(experiment.friction).lower(),
            "noise": str(experiment.noise).lower(),
            "quantisation": str(experiment.quantisation).lower(),
            **_recipe(experiment),
            **software_versions(),
        },
    )


def _recipe(experiment: Experiment) -> dict[str, str]:
    """Return the text from which the experiment can be run again, where it has one."""
    write = getattr(experiment, "to_toml", None)
    return {"scenario": write()} if callable(write) else {}
