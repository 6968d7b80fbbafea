"""Simulation of experiments side by side, in batches of arms of one structure."""

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from types import MappingProxyType
from typing import overload

import mujoco

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.parameters.errors import OverloadError, TwinError
from hmtb_twin.run.batch_run import BatchRun
from hmtb_twin.run.experiment_row import ExperimentRow, at_rest, prepare


def structure(arm: Arm) -> Hashable:
    """Return what arms have in common that can run side by side, a model each, and that nothing else has.

    `mujoco.batch.Batch.set_models` wants the same sizes of all that MuJoCo's state holds. One loop over the ticks wants
    more: the same names at the same places, the same step and integrator, and the states of the drives in the same
    places.

    Args:
        arm: An arm.

    Returns:
        A key, equal for arms of the same structure.
    """
    model = arm.model
    supply, spools = arm.supply_state, arm.spool_states
    return (
        tuple(getattr(model, name) for name in _sizes()),
        bytes(model.names),
        model.opt.timestep,
        int(model.opt.integrator),
        arm.worksite,
        tuple(arm.pressure_states.tolist()),
        None if spools is None else tuple(spools.tolist()),
        None if supply is None else tuple(supply.tolist()),
    )


@cache
def _sizes() -> tuple[str, ...]:
    """Names of all sizes of a model: MuJoCo calls each of them n and what is counted."""
    empty = mujoco.MjSpec().compile()
    return tuple(name for name in dir(empty) if name.startswith("n") and isinstance(getattr(empty, name), int))


MOST_THREADS = 1024
"""More threads than that are a slip of the keyboard."""

Progress = Callable[[int, int], None]
"""Called with the ticks done and the ticks in all, summed over experiments."""


@dataclass(frozen=True)
class Logs(Sequence[JointLog]):
    """The logs of a campaign, in the order of its experiments; those that failed are missing.

    Attributes:
        logs: The logs.
        failed: Reason of each failure, by name (`name@seed` where names repeat, `name@seed#place` with the place among
            the experiments, from 0, where these repeat, too).
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


def simulate(
    experiments: Sequence[Experiment],
    *,
    threads: int | None = None,
    progress: Progress | None = None,
    keep_going: bool = False,
) -> Logs:
    """Simulate experiments, all on arms of one structure as rows of one `mujoco.batch.Batch`, each on its own model.

    Args:
        experiments: What to run.
        threads: Threads for the physics; all processors by default. The logs do not depend on it, nor on which
            experiments run side by side, bit for bit.
        progress: Called now and then with the ticks done and the ticks in all.
        keep_going: Whether an experiment that cannot be run is one that failed, with its reason, and the others are run
            all the same.

    Returns:
        The logs, and by name the experiments that failed: the physics diverged, an operator did what the stick cannot
        do, or, where asked to keep going, it could not be run.

    Raises:
        TwinError: An experiment asks for something that the laboratory does not have; nothing is run then.
        OverloadError: The drives of an experiment cannot hold the arm at the pose where it starts; nothing is run then.
            Whether they can hold it wherever the experiment moves it shows in the run.
        ValueError: The model of an arm does not compile; nothing is run then.
    """
    if threads is not None and not (isinstance(threads, int) and 1 <= threads <= MOST_THREADS):
        raise TwinError(f"threads = {threads} given, expected a whole number from 1 to {MOST_THREADS}")
    rows, failures = _prepared(experiments, keep_going=keep_going)
    alike: dict[Hashable, list[ExperimentRow]] = defaultdict(list)
    for row in rows.values():
        alike[structure(row.arm)].append(row)
    total = sum(row.ticks for row in rows.values())
    done, seconds, steps = 0, 0.0, 0
    while alike:
        group = alike.pop(next(iter(alike)))
        run = BatchRun(group, threads or 0)
        run.run(partial(_report, progress, done, total))
        done += sum(row.ticks for row in group)
        seconds += run.seconds
        steps += run.ticks * run.substeps
        del run, group
    logs = []
    for place in list(rows):
        # A record goes as its log comes, so that there are never two of all of them.
        row = rows.pop(place)
        if row.failure is None:
            logs.append(row.log())
        else:
            failures[place] = row.failure
    labels = _labels(experiments)
    return Logs(
        logs=tuple(logs),
        failed=MappingProxyType({labels[place]: failures[place] for place in sorted(failures)}),
        physics_seconds=seconds,
        steps=steps,
    )


def _prepared(
    experiments: Sequence[Experiment], *, keep_going: bool
) -> tuple[dict[int, ExperimentRow], dict[int, str]]:
    """Return the experiments that can be run, their arms at rest where they start, and why the others cannot, by place.

    What an experiment wants of the laboratory is looked at before any arm is brought to rest.
    """
    # `load_arm` remembers some arms only; of a call with more, each is loaded once all the same, and forgotten after.
    load, settle = cache(load_arm), cache(at_rest)
    rows: dict[int, ExperimentRow] = {}
    failures: dict[int, str] = {}
    for place, experiment in enumerate(experiments):
        try:
            rows[place] = prepare(experiment, load)
        except ValueError as error:
            if not keep_going:
                raise
            failures[place] = str(error)
    for place, row in list(rows.items()):
        pose = row.experiment.pose
        try:
            row.start = settle(row.arm, pose)
        except ValueError as error:
            if keep_going:
                failures[place] = f"{error} ({pose})"
                del rows[place]
            elif isinstance(error, OverloadError):
                raise OverloadError(f"{row.experiment.name}: {error} ({pose})") from None
            else:
                raise
    return rows, failures


def _report(progress: Progress | None, before: int, total: int, ticks: int) -> None:
    if progress is not None:
        progress(before + ticks, total)


def _labels(experiments: Sequence[Experiment]) -> list[str]:
    """Return what tells each experiment from the others: name, and where that repeats seed, and then its place."""
    names = [experiment.name for experiment in experiments]
    labels = [f"{experiment.name}@{experiment.seed}" for experiment in experiments]
    named, labelled = Counter(names), Counter(labels)
    return [
        name if named[name] == 1 else label if labelled[label] == 1 else f"{label}#{place}"
        for place, (name, label) in enumerate(zip(names, labels, strict=True))
    ]
