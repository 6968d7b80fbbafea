"""Run experiments side by side: physics in C, Python once per tick of the position loop for all of them."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from json import dumps
from time import perf_counter
from types import MappingProxyType
from typing import overload

import mujoco
import numpy as np
from mujoco import batch

from hmtb_twin.arm import Arm, load_arm
from hmtb_twin.control_station import ControlStation
from hmtb_twin.engine_warnings import warned_of
from hmtb_twin.errors import OverloadError, TwinError
from hmtb_twin.experiment import Experiment, Operator, View
from hmtb_twin.joint_log import WRENCH, JointLog, software_versions
from hmtb_twin.parameters import JOINTS, SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.recorder import delayed, read_resolvers
from hmtb_twin.status import Status
from hmtb_twin.worksite_run import WorksiteRun

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
    station: ControlStation
    resolver_noise: np.ndarray
    drive_noise: np.ndarray | None
    record: dict[str, np.ndarray] = field(default_factory=dict)
    failure: str | None = None

    @property
    def ticks(self) -> int:
        return self.station.ticks


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
        OverloadError: The drives of an experiment cannot hold the arm at the pose where it starts; nothing is run then.
            Whether they can hold it wherever the experiment moves it shows in the run.
    """
    if threads is not None and not (isinstance(threads, int) and 1 <= threads <= MOST_THREADS):
        raise TwinError(f"threads = {threads} given, expected a whole number from 1 to {MOST_THREADS}")
    rows = [_prepare(experiment) for experiment in experiments]
    arms: dict[Arm, list[_Row]] = defaultdict(list)
    for row in rows:
        arms[_arm(row.experiment)].append(row)
    starts = {arm: _starts(arm, group) for arm, group in arms.items()}
    total = sum(row.ticks for row in rows)
    done, seconds, steps = 0, 0.0, 0
    for arm, group in arms.items():
        offset = done

        def report(ticks: int, offset: int = offset) -> None:
            if progress is not None:
                progress(offset + ticks, total)

        seconds += _run(arm, group, starts[arm], threads or 0, report)
        done += sum(row.ticks for row in group)
        steps += sum(row.ticks for row in group) * _substeps(arm.model)
    names = [row.experiment.name for row in rows]
    labels = [
        name if names.count(name) == 1 else f"{name}@{row.experiment.seed}"
        for name, row in zip(names, rows, strict=True)
    ]
    return Logs(
        logs=tuple(_log(row) for row in rows if row.failure is None),
        failed=MappingProxyType({label: row.failure for label, row in zip(labels, rows, strict=True) if row.failure}),
        physics_seconds=seconds,
        steps=steps,
    )


def _substeps(model: mujoco.MjModel) -> int:
    return round(SAMPLE_TIME / model.opt.timestep)


def _arm(experiment: Experiment) -> Arm:
    return load_arm(
        experiment.variant,
        experiment.payload,
        plant=experiment.plant,
        specimen=experiment.specimen,
        friction=experiment.chain.friction,
        worksite=experiment.worksite,
    )


def _prepare(experiment: Experiment) -> _Row:
    arm = _arm(experiment)
    wires, resolvers, drives = np.random.default_rng(experiment.seed).spawn(3)
    station = ControlStation(experiment, arm, wires)
    shape = station.commands.shape
    torques = arm.process_noise * drives.standard_normal(shape) if arm.process_noise.any() else None
    return _Row(experiment, station, resolvers.standard_normal(shape), torques)


def _starts(arm: Arm, rows: list[_Row]) -> dict[str, mujoco.MjData]:
    """Return the state of the arm at rest at every pose from which it starts."""
    starts: dict[str, mujoco.MjData] = {}
    for row in rows:
        pose = row.experiment.pose
        if pose not in starts:
            try:
                starts[pose] = arm.rest(arm.pose(pose))
            except OverloadError as error:
                raise OverloadError(f"{row.experiment.name}: {error} ({pose})") from None
    return starts


def _run(
    arm: Arm,
    rows: list[_Row],
    starts: Mapping[str, mujoco.MjData],
    threads: int,
    report: Callable[[int], None],
) -> float:
    """Run the experiments of one arm, fill in their records and return the seconds spent in the physics."""
    simulations = batch.Batch(arm.model, nsim=len(rows), nthread=threads)
    for i, row in enumerate(rows):
        start = starts[row.experiment.pose]
        for name in ("qpos", "qvel", "act", "ctrl", "eq_active"):
            simulations.bind(name)[i] = getattr(start, name)
    control, angles, act, sensors = (simulations.bind(name) for name in ("ctrl", "qpos", "act", "sensordata"))
    lengths = np.array([row.ticks for row in rows])
    commands = np.zeros((lengths.max(), len(rows), len(JOINTS)))
    for i, row in enumerate(rows):
        commands[: row.ticks, i] = row.station.commands
    noise = _drive_noise(rows, commands.shape)
    record = {
        name: np.empty((lengths.max(), len(rows), width))
        for name, width in (("true_angles", 7), ("load_pressure", 7), ("wrench", 6))
    }
    site = WorksiteRun(simulations, arm) if arm.worksite else None
    if site:
        record["unit_pose"] = np.empty((lengths.max(), len(rows), 7))
        record["contact_force"] = np.empty((lengths.max(), len(rows), 1))
    spools, supply = arm.spool_states, arm.supply_state
    if spools is not None:
        record["spool"] = np.empty((lengths.max(), len(rows), 7))
        record["supply_pressure"] = np.empty((lengths.max(), len(rows), 1))
    live = [i for i, row in enumerate(rows) if row.station.live]
    if live:
        tool = arm.model.site("tool").id
        positions, rotations = (simulations.bind(name) for name in ("site_xpos", "site_xmat"))
    substeps, pressures = _substeps(arm.model), arm.pressure_states
    active = np.arange(len(rows))
    seconds, ticks = 0.0, 0

    def look(tick: int, i: int) -> View:
        """What the operator of simulation i sees."""
        return View(
            time=tick * SAMPLE_TIME,
            tool_position=positions[i, tool].copy(),
            tool_rotation=rotations[i, tool].reshape(3, 3).copy(),
            wrench=sensors[i, : len(WRENCH)].copy(),
            unit=site.look(i) if site else None,
        )

    simulations.forward()
    for k in range(lengths.max()):
        record["true_angles"][k] = angles[:, : len(JOINTS)]
        record["load_pressure"][k] = act[:, pressures]
        record["wrench"][k] = sensors[:, : len(WRENCH)]
        if site:
            record["unit_pose"][k], record["contact_force"][k] = site.unit_pose, site.contact_force
        if spools is not None:
            record["spool"][k], record["supply_pressure"][k] = act[:, spools], act[:, supply]
        changed = False
        for i in live:
            if k < rows[i].ticks and rows[i].failure is None:
                try:
                    rows[i].station.tick(k, _reading(rows[i], k, angles[i, : len(JOINTS)]), partial(look, k, i))
                except TwinError as error:
                    rows[i].failure = f"{error}, at {k * SAMPLE_TIME:.2f} s"
                    active = active[active != i]
                    continue
                commands[k, i] = rows[i].station.commands[k]
                closed = rows[i].station.grip
                if site and closed is not None:
                    changed |= site.close(i, closed)
        if not len(active):
            break
        if live:
            _switch_models(simulations, arm, rows, k, site, changed)
        torques = None if noise is None else noise[k, active]
        if site:
            for i in active[site.held[active]]:
                rows[i].station.status[k] |= Status.UNIT_HELD
            control[active] = site.controls(commands[k, active], torques, active)
        else:
            control[active] = arm.controls(commands[k, active], torques)
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
        for name in {"contact_force", "supply_pressure"} & row.record.keys():
            row.record[name] = row.record[name][:, 0]
    return seconds


def _drive_noise(rows: list[_Row], shape: tuple[int, ...]) -> np.ndarray | None:
    """Torques that the valve drives add, (ticks, experiments, 7) N m; none where all are quiet."""
    if all(row.drive_noise is None for row in rows):
        return None
    noise = np.zeros(shape)
    for i, row in enumerate(rows):
        if row.drive_noise is not None:
            noise[: row.ticks, i] = row.drive_noise
    return noise


def _reading(row: _Row, tick: int, angles: np.ndarray) -> np.ndarray:
    """What the controller's own resolvers tell at a tick, (7,) rad."""
    experiment = row.experiment
    return read_resolvers(
        angles, row.resolver_noise[tick], experiment.specimen.recorder, resolver=experiment.chain.resolver
    )


def _switch_models(
    simulations: batch.Batch, arm: Arm, rows: list[_Row], tick: int, site: WorksiteRun | None, changed: bool
) -> None:
    """Let simulations whose servo power goes off or on at a tick run on with closed or working valves."""
    powered = [row.station.powered for row in rows]
    if changed or any(tick < len(on) and tick > 0 and on[tick] != on[tick - 1] for on in powered):
        on_now = [bool(tick >= len(on) or on[tick]) for on in powered]
        simulations.set_models(site.models(on_now) if site else [arm.model if on else arm.unpowered for on in on_now])


def _reason(counts: np.ndarray, tick: int) -> str:
    return f"the physics engine warned of {warned_of(counts)} at {tick * SAMPLE_TIME:.2f} s"


def _log(row: _Row) -> JointLog:
    experiment, station = row.experiment, row.station
    readings = read_resolvers(
        row.record["true_angles"],
        row.resolver_noise,
        experiment.specimen.recorder,
        resolver=experiment.chain.resolver,
    )
    return JointLog(
        name=experiment.name,
        seed=experiment.seed,
        dt=SAMPLE_TIME,
        axes=tuple(experiment.axes),
        commanded=station.commands,
        measured=delayed(readings, _arm(experiment).delays),
        status=station.status,
        volts=station.volts,
        counts=station.counts,
        **row.record,
        provenance={
            "variant": experiment.variant,
            "payload": experiment.payload,
            "drives": _arm(experiment).drives_kind,
            **{f"plant_{name}": str(value) for name, value in vars(experiment.plant).items()},
            **{f"specimen_{name}": dumps(value) for name, value in experiment.specimen.deviations.items()},
            "pose": experiment.pose,
            "mode": experiment.mode,
            **{name: str(on).lower() for name, on in vars(experiment.chain).items()},
            **_recipe(experiment, station.operator),
            **software_versions(),
        },
    )


def _recipe(experiment: Experiment, operator: Operator | None) -> dict[str, str]:
    """Return the text from which the experiment can be run again, where a text tells all of it."""
    by = {} if operator is None else {"operator": f"{type(operator).__module__}.{type(operator).__qualname__}"}
    write = getattr(experiment, "to_toml", None)
    if not callable(write) or getattr(experiment, "has_own_operator", False):
        return by
    return {"scenario": write(), **by}
