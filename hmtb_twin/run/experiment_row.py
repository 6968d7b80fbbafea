"""One experiment in a batch: its arm, station, noise and log."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from json import dumps
from typing import Any

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm, check_arm, load_arm
from hmtb_twin.bus.joint_log import JointLog, software_versions
from hmtb_twin.bus.recorder import delayed, read_resolvers
from hmtb_twin.control.control_station import ControlStation
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.control.hand_controller import low_pass
from hmtb_twin.files.errors import OverloadError
from hmtb_twin.parameters.values import Recorder
from hmtb_twin.parameters.variants import VARIANTS

STATE = ("qpos", "qvel", "act", "ctrl", "eq_active")
"""Fields of MuJoCo's state that start from the arm at rest; all others start at zero."""

_NUMBERS = ("contact_force", "supply_pressure")
"""Channels with one number per tick, (N,) in a log."""


@dataclass
class ExperimentRow:
    """One experiment, a row of a batch.

    Attributes:
        experiment: The experiment.
        arms: Its arm with the first payload, then with that of each payload change.
        station: Its control station.
        recorder: The recorder with the noise of the arm's resolvers.
        resolver_noise: Standard normal numbers for the resolvers (N, 7).
        logged_noise: Noise on the commands in the record alone (N, 7), rad; None without.
        drive_noise: Torque noise of the drives (N, 7), N m; None without.
        start: The fields `STATE` of the arm at rest at the experiment's pose; empty before `at_rest`.
        record: Recorded channels, (N, width) each; empty before the run.
        failure: Reason of the failure; None without one.
    """

    experiment: Experiment
    arms: tuple[Arm, ...]
    station: ControlStation
    recorder: Recorder
    resolver_noise: np.ndarray
    logged_noise: np.ndarray | None
    drive_noise: np.ndarray | None
    start: dict[str, np.ndarray] = field(default_factory=dict)
    record: dict[str, np.ndarray] = field(default_factory=dict)
    failure: str | None = None

    @property
    def arm(self) -> Arm:
        """Its arm with the first payload."""
        return self.arms[0]

    def arm_at(self, tick: int) -> Arm:
        """Return its arm with the payload of a tick."""
        return self.arms[self.station.exchanges[tick]]

    @property
    def ticks(self) -> int:
        """Length N of the experiment."""
        return self.station.ticks

    def controls(self, ticks: slice, arm: Arm | None = None) -> np.ndarray:
        """Return the control vectors (n, nu) of ticks whose commands are known.

        Args:
            ticks: The ticks.
            arm: The arm as its controller knows it at these ticks; that with the payload of each by default.
        """
        if arm is None:
            # The controller's model of the payload, and with it the feedforward torque, changes at these ticks.
            changes = ticks.start + np.flatnonzero(np.diff(self.station.exchanges[ticks])) + 1
            spans = pairwise([ticks.start, *changes, ticks.stop])
            return np.vstack([self.controls(slice(first, last), self.arm_at(first)) for first, last in spans])
        noise = None if self.drive_noise is None else self.drive_noise[ticks]
        return arm.controls(self.station.commands[ticks], noise)

    def reading(self, tick: int, angles: np.ndarray) -> np.ndarray:
        """Return the resolver readings of the angles (7,) at a tick, rad."""
        return read_resolvers(angles, self.resolver_noise[tick], self.recorder, resolver=self.experiment.chain.resolver)

    def log(self, ticks: int | None = None) -> JointLog:
        """Return the log of the run, or of its first ticks."""
        experiment, station, span = self.experiment, self.station, slice(ticks)
        record = {name: values[span] for name, values in self.record.items()}
        for name in record.keys() & set(_NUMBERS):
            record[name] = record[name][:, 0]
        readings = read_resolvers(
            record["true_angles"], self.resolver_noise[span], self.recorder, resolver=experiment.chain.resolver
        )
        recorded_commands = commands = station.commands[span]
        sent = requested = None
        if self.logged_noise is not None:
            recorded_commands, sent = commands + self.logged_noise[span], commands
        if station.loop is not None:
            requested = station.loop.requested[span]
        return JointLog(
            name=experiment.name,
            seed=experiment.seed,
            dt=self.arm.description.sample_time,
            axes=tuple(experiment.axes),
            commanded=recorded_commands,
            sent=sent,
            requested=requested,
            measured=delayed(readings, self.arm.delays),
            status=station.status[span],
            volts=station.volts[span],
            counts=station.counts[span],
            **record,
            joints=self.arm.joints,
            provenance=self._provenance(),
        )

    def _provenance(self) -> dict[str, str]:
        """Return arm, settings and software of the log; the order is that of the attributes in its file."""
        experiment = self.experiment
        provenance = {"variant": experiment.variant, "payload": experiment.payload}
        if experiment.variant not in VARIANTS:
            # Files may change after the run, and the truth with them.
            provenance["arm_sha256"] = self.arm.description.fingerprint
        changes = [[change.time, change.payload] for change in experiment.payload_changes]
        if changes:
            provenance["payload_changes"] = dumps(changes)
        provenance["drives"] = self.arm.drives_kind
        provenance |= {f"plant_{name}": str(value) for name, value in vars(experiment.plant).items()}
        deviations = experiment.specimen.deviations
        provenance |= {f"specimen_{name}": dumps(value) for name, value in deviations.items()}
        provenance |= {"pose": experiment.pose, "mode": experiment.mode}
        provenance |= {name: str(on).lower() for name, on in vars(experiment.chain).items()}
        provenance |= _description(experiment, self.station)
        provenance |= software_versions()
        return provenance


def prepare(experiment: Experiment, load: Callable[..., Arm], *, live: bool = False) -> ExperimentRow:
    """Return an experiment with its arm, station and noise.

    Args:
        experiment: The experiment.
        load: `load_arm` or a function that returns its arms.
        live: Whether all commands are computed tick by tick, with the same bits.

    Raises:
        TwinError: The experiment needs something that the laboratory does not have.
    """
    payloads = [experiment.payload, *(change.payload for change in experiment.payload_changes)]
    arms = tuple(experiment_arm(experiment, payload, worksite=True, load=load) for payload in payloads)
    # A run has one step, and an empty end effector needs a shorter one than a loaded one.
    step = min(arm.model.opt.timestep for arm in arms)
    arms = tuple(_at_step(arm, step) for arm in arms)
    arm = arms[0]
    # A stream for each source: the draws of one do not depend on whether another is switched on.
    wires, resolvers, drives, logging = np.random.default_rng(experiment.seed).spawn(4)
    station = ControlStation(experiment, arm, wires, live=live)
    shape = station.commands.shape
    torques = arm.process_noise * drives.standard_normal(shape) if arm.process_noise.any() else None
    noise = resolvers.standard_normal(shape)
    logged, interface = None, experiment.hand_controller
    if experiment.chain.logged_noise and interface.logged_noise > 0.0:
        logged = interface.logged_noise * low_pass(
            logging.standard_normal(shape), interface.logged_noise_corner, arm.description.sample_time
        )
    recorder = experiment.specimen.recorder(arm.description)
    return ExperimentRow(experiment, arms, station, recorder, noise, logged, torques)


def _at_step(arm: Arm, step: float) -> Arm:
    """Return an arm with a physics step in s; the same record if it has that step already."""
    return arm if arm.model.opt.timestep == step else arm.at_step(step)


def at_rest(arm: Arm, pose: str) -> dict[str, np.ndarray]:
    """Return the fields `STATE` of the arm at rest at a pose; raises `OverloadError` if the drives cannot hold it."""
    # Not the state itself: its working memory is a hundred times larger.
    rest: mujoco.MjData = arm.rest(arm.pose(pose))
    return {name: np.array(getattr(rest, name)) for name in STATE}


def first_state(row: ExperimentRow, settle: Callable[[Arm, str], dict[str, np.ndarray]] = at_rest) -> dict[str, Any]:
    """Return the state at rest with the first payload, once the drives are known to hold every payload.

    Args:
        row: The experiment.
        settle: `at_rest` or a function that returns its states.

    Raises:
        OverloadError: The drives cannot hold the arm at the pose with one of its payloads.
    """
    pose = row.experiment.pose
    for arm in row.arms[1:]:
        try:
            settle(arm, pose)
        except OverloadError as error:
            raise OverloadError(f"payload {arm.payload}: {error}") from error
    return settle(row.arm, pose)


def experiment_arm(
    experiment: Experiment,
    payload: str | None = None,
    *,
    worksite: bool = False,
    load: Callable[..., Arm] = load_arm,
) -> Arm:
    """Return the arm of an experiment.

    Args:
        experiment: The experiment.
        payload: One of its payloads; the first by default.
        worksite: Whether an experiment at the worksite gets the arm with contact; otherwise it is in free space.
        load: `load_arm` or a function that returns its arms.

    Raises:
        TwinError: The laboratory has no such arm.
    """
    payload = experiment.payload if payload is None else payload
    # Before `load`, which may need hashable arguments: invalid ones may not be.
    check_arm(
        experiment.variant,
        payload,
        experiment.plant,
        worksite=bool(experiment.worksite),
        specimen=experiment.specimen,
    )
    return load(
        experiment.variant,
        payload,
        plant=experiment.plant,
        specimen=experiment.specimen,
        friction=experiment.chain.friction,
        worksite=worksite and bool(experiment.worksite),
    )


def _description(experiment: Experiment, station: ControlStation) -> dict[str, str]:
    """Return the classes of operator and joint controller, and the TOML text if it alone can rebuild the experiment."""
    classes = {}
    if station.operator is not None:
        classes["operator"] = _class_name(station.operator)
    if station.loop is not None:
        classes["controller"] = _class_name(station.loop.controller)
    write = getattr(experiment, "to_toml", None)
    # A text cannot hold the code of a joint controller or of an operator that the caller has written.
    if not callable(write) or station.loop is not None or getattr(experiment, "has_own_operator", False):
        return classes
    return {"scenario": write(), **classes}


def _class_name(instance: object) -> str:
    return f"{type(instance).__module__}.{type(instance).__qualname__}"
