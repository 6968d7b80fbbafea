"""Experiments on arms of one structure, run as rows of one `mujoco.batch.Batch`, each on its own model."""

from collections import defaultdict
from collections.abc import Callable, Generator, Mapping, Sequence
from functools import partial
from time import perf_counter

import mujoco
import numpy as np
from mujoco import batch

from hmtb_twin.bus.joint_log import WRENCH
from hmtb_twin.control.experiment import Status, View
from hmtb_twin.files.errors import TwinError
from hmtb_twin.run.experiment_row import STATE, ExperimentRow
from hmtb_twin.run.worksite_run import WorksiteRun


def warning_names(counts: np.ndarray) -> str:
    """Return the names of the engine warnings with counts (n,) above zero, separated by commas."""
    warnings = [str(mujoco.mjtWarning(i)) for i in np.flatnonzero(counts)]
    # The bindings print "mjtWarning.mjWARN_BADQACC".
    return ", ".join(warning.rsplit("mjWARN_", 1)[-1] for warning in warnings)


BLOCK = 256
"""Ticks that are computed ahead and recorded as a block: 5 s.

Long enough that Python's work per block is negligible, short enough that the blocks of a thousand experiments are
small compared to their logs."""


class Recording:
    """Channels of experiments of different lengths.

    Args:
        lengths: Ticks of each experiment.
        widths: Numbers of each channel at a tick.

    Attributes:
        records: Channels of each experiment by name, (ticks, width), complete after `close`.
    """

    def __init__(self, lengths: Sequence[int], widths: Mapping[str, int]) -> None:
        rows, longest = len(lengths), max(lengths)
        self._first = 0
        self._blocks = {}
        self.records: list[dict[str, np.ndarray]] = [{} for _ in lengths]
        for name, width in widths.items():
            self._blocks[name] = np.empty((min(BLOCK, longest), rows, width))
            for ticks, record in zip(lengths, self.records, strict=True):
                record[name] = np.empty((ticks, width))

    def write(self, tick: int, values: Mapping[str, np.ndarray]) -> None:
        """Write the channels (rows, width) of a tick; ticks must come in order."""
        if tick - self._first == BLOCK:
            self.close(tick)
        for name, value in values.items():
            self._blocks[name][tick - self._first] = value

    def close(self, ticks: int) -> None:
        """Copy the block up to a tick into the records."""
        first, self._first = self._first, ticks
        for row, record in enumerate(self.records):
            for name, channel in record.items():
                # A row that ended before this block has an empty span.
                span = channel[first:ticks]
                span[:] = self._blocks[name][: len(span), row]


class BatchRun:
    """One run of experiments side by side: physics in C, Python once per tick for all of them.

    The bits of a row depend neither on the other rows nor on the number of threads.

    Args:
        rows: The experiments, on arms of one `structure`, with their first states.
        threads: Threads for the physics; 0 for all processors.

    Attributes:
        seconds: Wall time spent in the physics, s.
        ticks: Ticks run, over all rows.
        substeps: Physics steps of each of these ticks.
    """

    def __init__(self, rows: Sequence[ExperimentRow], threads: int) -> None:
        self.seconds, self.ticks = 0.0, 0
        self._rows = rows
        # The first arm represents all: everything read here is equal for arms of one structure.
        arm = rows[0].arm
        self._joints, self._rate = len(arm.joints), arm.description.sample_rate
        self._sample_time = arm.description.sample_time
        self.substeps = round(self._sample_time / arm.model.opt.timestep)
        self._simulations = simulations = batch.Batch(arm.model, nsim=len(rows), nthread=threads)
        self._models = [row.arm.model for row in rows]
        # The batch begins with the first arm's model in every row.
        if len(set(map(id, self._models))) > 1:
            self._simulations.set_models(self._models)
        for i, row in enumerate(rows):
            for name in STATE:
                simulations.bind(name)[i] = row.start[name]
        self._control, self._angles, self._act = map(simulations.bind, ("ctrl", "qpos", "act"))
        self._sensors = simulations.bind("sensordata")
        self._positions, self._rotations = simulations.bind("site_xpos"), simulations.bind("site_xmat")
        self._tool = arm.model.site("tool").id
        self._pressures, self._spools, self._supply = arm.pressure_states, arm.spool_states, arm.supply_state
        self._site = WorksiteRun(simulations, [row.arm for row in rows]) if arm.worksite else None
        if self._site:
            self._models = [self._site.model(i, powered=True) for i in range(len(rows))]
            self._simulations.set_models(self._models)
        self._lengths = np.array([row.ticks for row in rows])
        self._active = np.arange(len(rows))
        self._live = [i for i, row in enumerate(rows) if row.station.live]
        self._switched = _switched(rows)
        self._ahead = np.zeros((min(BLOCK, self._lengths.max()), len(rows), arm.model.nu))

    def run(self, report: Callable[[int], None]) -> None:
        """Run the experiments; fill in their records or failures. `report` is called with the completed ticks."""
        for tick in self.steps():
            if tick % self._rate == 1 or not len(self._active):
                report(self.ticks)

    def steps(self) -> Generator[int]:
        """Run the experiments tick by tick and yield the number of ticks since the start after each.

        The records are filled in when the last tick is done, or when the iterator is closed: up to the ticks done.
        """
        self._simulations.forward()
        widths = {name: channel.shape[1] for name, channel in self.channels().items()}
        recording = Recording(self._lengths.tolist(), widths)
        if self._site:
            # Without an operator nobody closes or opens the fingers: the unit is held all the time or never.
            for i in set(range(len(self._rows))).difference(self._live):
                self._rows[i].station.status |= self._status(i)
        tick = 0
        try:
            while len(self._active):
                recording.write(tick, self.channels())
                if tick % BLOCK == 0:
                    self._look_ahead(tick)
                self._operate(tick)
                if len(self._active):
                    self._step(tick)
                tick += 1
                yield tick
        finally:
            # Also when a live run is ended early: what was recorded until then is kept.
            recording.close(tick)
            for row, record in zip(self._rows, recording.records, strict=True):
                row.record = record

    def switch_power(self, tick: int, *, on: bool) -> None:
        """Set the servo power of live experiments from a future tick to the end of the run."""
        # Later switches that were planned are overwritten: whoever holds the switch decides.
        for i in self._live:
            self._rows[i].station.powered[tick:] = on
        self._switched = _switched(self._rows)

    def channels(self) -> dict[str, np.ndarray]:
        """Return the recorded channels at this tick, (rows, width) each."""
        channels = {
            "true_angles": self._angles[:, : self._joints],
            "load_pressure": self._act[:, self._pressures],
            "wrench": self._sensors[:, : len(WRENCH)],
        }
        if self._site:
            channels["unit_pose"] = self._site.unit_pose
            channels["contact_force"] = self._site.contact_force
        if self._spools is not None:
            channels["spool"] = self._act[:, self._spools]
            channels["supply_pressure"] = self._act[:, self._supply]
        return channels

    def _look_ahead(self, tick: int) -> None:
        """Compute the controls of a block of ticks of rows that depend only on the excitation."""
        for i in self._active.tolist():
            row = self._rows[i]
            if not row.station.live:
                block = row.controls(slice(tick, tick + BLOCK))
                self._ahead[: len(block), i] = block

    def _operate(self, tick: int) -> None:
        """Run operators, power switches and payload changes of a tick."""
        changed = False
        for i in self._live:
            row = self._rows[i]
            if tick >= row.ticks or row.failure is not None:
                continue
            angles = self._angles[i, : self._joints]
            try:
                row.station.tick(tick, row.reading(tick, angles), partial(self._view, tick, i))
            except TwinError as error:
                self._fail(i, f"{error}, at {tick * self._sample_time:.2f} s")
                continue
            carrying = None
            if self._site:
                if row.station.grip is not None:
                    changed |= self._site.close(i, row.station.grip)
                row.station.status[tick] |= self._status(i)
                carrying = self._site.carrying(i)
            self._ahead[tick % BLOCK, i] = row.controls(slice(tick, tick + 1), carrying)[0]
        for i in self._switched.get(tick, ()):
            self._models[i] = self._model(tick, i)
            changed = True
        if changed:
            self._simulations.set_models(self._models)

    def _model(self, tick: int, i: int) -> mujoco.MjModel:
        """Return the model of row i at a tick, which depends on servo power and payload."""
        powered = bool(self._rows[i].station.powered[tick])
        if self._site:
            return self._site.model(i, powered=powered)
        arm = self._rows[i].arm_at(tick)
        return arm.model if powered else arm.unpowered

    def _step(self, tick: int) -> None:
        """Step the physics through a tick under its controls."""
        active, simulations = self._active, self._simulations
        self._control[active] = self._ahead[tick % BLOCK, active]
        started = perf_counter()
        try:
            # The forward pass at the new state computes the wrench of this tick, under the command still in force.
            simulations.step(ids=active, nstep=self.substeps, stage=mujoco.mjtStage.mjSTAGE_ACC)
        except batch.SimulationError as error:
            for i in error.ids:
                self._fail(i, f"the physics engine stopped at {tick * self._sample_time:.2f} s: {simulations.error(i)}")
        self.seconds += perf_counter() - started
        self.ticks += len(active)
        for i in active[simulations.warning[active, :, 1].any(axis=1)].tolist():
            names = warning_names(simulations.warning[i, :, 1])
            self._fail(i, f"the physics engine warned of {names} at {tick * self._sample_time:.2f} s")
        # Rows that are at their end stay in the arrays and are stepped no more.
        self._active = self._active[self._lengths[self._active] > tick + 1]

    def _fail(self, i: int, reason: str) -> None:
        """End row i with the reason of its failure; the others go on."""
        self._rows[i].failure = reason
        self._active = self._active[self._active != i]

    def _status(self, i: int) -> int:
        """Return the status bits that the latch of row i sets."""
        held = self._site is not None and self._site.held[i]
        return int(Status.UNIT_HELD) if held else 0

    def _view(self, tick: int, i: int) -> View:
        """Return the view of the operator of row i."""
        unit = self._site.look(i) if self._site else None
        # Copies, because an operator may keep them while the batch overwrites its arrays.
        position = self._positions[i, self._tool].copy()
        rotation = self._rotations[i, self._tool].reshape(3, 3).copy()
        wrench = self._sensors[i, : len(WRENCH)].copy()
        return View(
            time=tick * self._sample_time, tool_position=position, tool_rotation=rotation, wrench=wrench, unit=unit
        )


def _switched(rows: Sequence[ExperimentRow]) -> dict[int, list[int]]:
    """Return by tick the rows whose servo power switches or whose payload changes."""
    switched: dict[int, list[int]] = defaultdict(list)
    for i, row in enumerate(rows):
        station = row.station
        power_switches = np.diff(station.powered)
        payload_changes = np.diff(station.exchanges) > 0
        for tick in np.flatnonzero(power_switches | payload_changes) + 1:
            switched[int(tick)].append(i)
    return dict(switched)
