"""Simulation of experiments side by side, in batches of arms of one structure."""

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from types import MappingProxyType
from typing import overload

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.files.errors import OverloadError, TwinError
from hmtb_twin.run.batch_run import BatchRun
from hmtb_twin.run.experiment_row import ExperimentRow, at_rest, first_state, prepare


def structure(arm: Arm) -> Hashable:
    """Return a key that is equal for arms that can run in one batch, each on its own model.

    `mujoco.batch.Batch.set_models` needs equal sizes of all arrays of MuJoCo's state. One loop over the ticks also
    needs equal names, step, integrator and places of the drives' states.
    """
    model = arm.model
    sizes = tuple(getattr(model, name) for name in _sizes())
    numerics = (model.opt.timestep, int(model.opt.integrator))
    states = (_indices(arm.pressure_states), _indices(arm.spool_states), _indices(arm.supply_state))
    return sizes, bytes(model.names), numerics, arm.worksite, states


def _indices(states: np.ndarray | None) -> tuple[int, ...] | None:
    """Return indices as a tuple, which a key needs."""
    return None if states is None else tuple(states.tolist())


@cache
def _sizes() -> tuple[str, ...]:
    """Return the names of all sizes of a model, integers whose names begin with n."""
    empty = mujoco.MjSpec().compile()
    candidates = [name for name in dir(empty) if name.startswith("n")]
    return tuple(name for name in candidates if isinstance(getattr(empty, name), int))


MOST_THREADS = 1024
"""Largest number of threads: more are a typing error."""

Progress = Callable[[int, int], None]
"""Called with the completed ticks and the total, summed over experiments."""


@dataclass(frozen=True, repr=False)
class Logs(Sequence[JointLog]):
    """Logs of experiments in their order, without those that failed.

    Attributes:
        logs: The logs.
        failed: Reason of each failure by name: `name@seed` if names repeat, `name@seed#index` if these repeat too.
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

    def __repr__(self) -> str:
        """Name the logs, and how many experiments failed."""
        names = ", ".join(log.name for log in self.logs)
        return f"Logs({names or 'none'}; {len(self.failed)} failed)"

    def __len__(self) -> int:
        return len(self.logs)

    def __iter__(self) -> Iterator[JointLog]:
        return iter(self.logs)


def simulate(
    experiments: Experiment | Sequence[Experiment],
    *,
    threads: int | None = None,
    progress: Progress | None = None,
    keep_going: bool = False,
) -> Logs:
    """Simulate experiments, all on arms of one structure as rows of one `mujoco.batch.Batch`, each on its own model.

    Args:
        experiments: The experiments, or one.
        threads: Threads for the physics; all processors by default. The bits of the logs depend neither on it nor on
            which experiments run side by side.
        progress: Called with the completed ticks and the total.
        keep_going: Whether to report experiments that cannot run as failed and run the others.

    Returns:
        The logs, and by name the experiments that failed: the physics diverged, an operator returned an invalid motion,
        or, with `keep_going`, they could not run.

    Raises:
        TwinError: An experiment needs something that the laboratory does not have; nothing runs then.
        OverloadError: The drives of an experiment cannot hold the arm at its first pose with one of its payloads;
            nothing runs then.
        ValueError: The model of an arm does not compile; nothing runs then.
    """
    if threads is not None and not (isinstance(threads, int) and 1 <= threads <= MOST_THREADS):
        raise TwinError(f"threads = {threads} given, expected a whole number from 1 to {MOST_THREADS}")
    if not isinstance(experiments, Sequence):
        experiments = (experiments,)
    rows, failures = _prepared(experiments, keep_going=keep_going)
    groups: dict[Hashable, list[ExperimentRow]] = defaultdict(list)
    for row in rows.values():
        groups[structure(row.arm)].append(row)
    total = sum(row.ticks for row in rows.values())
    done, seconds, steps = 0, 0.0, 0
    while groups:
        # Taken out, so that the memory of a group's models is free before the next one runs.
        group = groups.pop(next(iter(groups)))
        run = BatchRun(group, threads or 0)
        run.run(partial(_report, progress, done, total))
        done += sum(row.ticks for row in group)
        seconds += run.seconds
        steps += run.ticks * run.substeps
        del run, group
    logs = []
    for index in list(rows):
        # Each record is released when its log is made: never two copies of all of them in memory.
        row = rows.pop(index)
        if row.failure is None:
            logs.append(row.log())
        else:
            failures[index] = row.failure
    labels = _labels(experiments)
    return Logs(
        logs=tuple(logs),
        failed=MappingProxyType({labels[index]: failures[index] for index in sorted(failures)}),
        physics_seconds=seconds,
        steps=steps,
    )


def _prepared(
    experiments: Sequence[Experiment], *, keep_going: bool
) -> tuple[dict[int, ExperimentRow], dict[int, str]]:
    """Return by index the experiments that can run, their arms at rest, and the reasons why others cannot.

    All requirements are checked before any arm is brought to rest.
    """
    # The cache of `load_arm` is bounded; this one loads each arm of a call once and releases it afterwards.
    load, settle = cache(load_arm), cache(at_rest)
    rows: dict[int, ExperimentRow] = {}
    failures: dict[int, str] = {}
    for index, experiment in enumerate(experiments):
        try:
            rows[index] = prepare(experiment, load)
        except ValueError as error:
            if not keep_going:
                raise
            failures[index] = str(error)
    for index, row in list(rows.items()):
        pose = row.experiment.pose
        try:
            row.start = first_state(row, settle)
        except ValueError as error:
            if keep_going:
                failures[index] = f"{error} ({pose})"
                del rows[index]
            elif isinstance(error, OverloadError):
                raise OverloadError(f"{row.experiment.name}: {error} ({pose})") from None
            else:
                raise
    return rows, failures


def _report(progress: Progress | None, before: int, total: int, ticks: int) -> None:
    if progress is not None:
        progress(before + ticks, total)


def _labels(experiments: Sequence[Experiment]) -> list[str]:
    """Return unique labels of experiments: name, with the seed if names repeat, with the index if that repeats."""
    names = [experiment.name for experiment in experiments]
    seeded_names = [f"{experiment.name}@{experiment.seed}" for experiment in experiments]
    name_counts, seeded_counts = Counter(names), Counter(seeded_names)
    labels = []
    for index, (name, seeded_name) in enumerate(zip(names, seeded_names, strict=True)):
        if name_counts[name] == 1:
            labels.append(name)
        elif seeded_counts[seeded_name] == 1:
            labels.append(seeded_name)
        else:
            labels.append(f"{seeded_name}#{index}")
    return labels
