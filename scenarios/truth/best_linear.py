"""Best linear approximation of the twin for one class and amplitude of excitation."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hmtb_twin import (
    Arm,
    Chain,
    Experiment,
    JointLog,
    Status,
    Truth,
    linearize,
    load_arm,
    simulate,
)
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.parameters.arm_description import ArmDescription
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from sysid import Bandwidth, BestLinearApproximation, IOData, SysidWarning, bla
from sysid.frequency.bla import ResponseAgreement, response_agreement
from sysid.frequency.silent_lines import SilentLines, silent_lines
from sysid.models.bandwidth import response_bandwidth
from sysid.records.arrays import FloatArray, Locked

REALISATIONS = 8
"""Realisations that suffice for a joint that slides: four seconds of one core, intervals of one or two percent."""

MOST = 64
"""Most realisations that an interval may take: half a minute of one core."""

NARROW = 1.2
"""Factor between the ends of a bandwidth's interval that is narrow enough."""

SLOWEST = 0.3
"""Lines up to this frequency tell the gain at low frequency, Hz."""

DISTORTED = 10.0
"""Nonlinear distortion from which on no one linear model is good, percent."""

WIDE = 1.5
"""Factor between the ends of an interval from which on the bandwidth in it is a rough guess."""

STUCK = 0.7
"""Gain at low frequency, over the truth's, below which the joint sticks: its bandwidth is relative to that gain."""


@dataclass(frozen=True, eq=False)
class BestLinearTruth(Locked):
    """The best linear approximation of the twin, its uncertainty and its nonlinear distortion.

    `servo` has the commanded angle of the record as its input, after converters, hold and velocity limit: it is known
    without error, and this is what an estimator identifies from records of this class. `chain` has the angle asked for
    at the stick, the multisine itself: quantisation, noise of the wires and velocity limit are part of the system.

    Attributes:
        experiment: The first record: arm, payload, plant, pose, axes, chain and excitation class.
        measured: The joints whose angles are the outputs.
        servo: From commanded angles to measured angles.
        chain: From angles asked for to measured angles.
        silent: Distortion at the silent lines of an odd-random grid; None on a full grid.
        command_rms: Root mean square of each commanded offset over the steady periods (n_axes,), rad.
        slewing: Share of the steady samples in which a command moved at its velocity limit.
        limited: Share in which one stood at an end of a joint's or converter's range.
        physics_seconds: Wall time in the physics, s.
        provenance: Origin and software.
    """

    experiment: MultisineExperiment
    measured: tuple[str, ...]
    servo: BestLinearApproximation
    chain: BestLinearApproximation
    silent: SilentLines | None
    command_rms: FloatArray
    slewing: float
    limited: float
    physics_seconds: float
    provenance: Mapping[str, str]

    @property
    def bandwidth(self) -> Bandwidth:
        """Half-power bandwidths of `servo` with 95 % intervals, Hz."""
        return response_bandwidth(self.servo.response)

    @property
    def distortion_percent(self) -> FloatArray:
        """Nonlinear distortion of each measured angle, of one realisation of `servo`, in percent of its linear part."""
        return self.servo.distortion_percent

    @cached_property
    def small_signal(self) -> Truth:
        """The small-signal truth of the same arm under the same conditions."""
        first = self.experiment
        arm = load_arm(
            first.variant,
            first.payload,
            plant=first.plant,
            specimen=first.specimen,
            friction=first.chain.friction,
        )
        return linearize(arm, first.pose)

    def servo_agreement(self, truth: Truth | None = None) -> ResponseAgreement:
        """Compare `servo` line by line with a small-signal truth, by default that of the same arm."""
        return self.agreement(self.servo, truth)

    def agreement(self, approximation: BestLinearApproximation, truth: Truth | None = None) -> ResponseAgreement:
        """Compare `servo` or `chain` line by line with a small-signal truth, by default that of the same arm."""
        truth = truth or self.small_signal
        response = truth.model.frequency_response(approximation.response.frequencies)
        arm = truth.arm
        rows, columns = _columns(arm, self.measured), _columns(arm, self.experiment.axes)
        return response_agreement(approximation, response[:, rows][:, :, columns])


def best_linear(
    setting: Experiment,
    multisines: Multisines | None = None,
    *,
    measured: Sequence[str] | None = None,
    threads: int | None = None,
) -> BestLinearTruth:
    """Measure the best linear approximation of the twin by the robust method [Pintelon2012, sec. 4.3].

    G_BLA is the linear system that is closest, in mean square, to the twin under inputs of one spectrum and amplitude
    distribution: E(Y conj U) / E(|U|^2). It is estimated as the mean of Y / U over R realisations of the multisine;
    the scatter over periods is noise, that over realisations noise and nonlinear distortion, and the standard errors
    are those of both together. The same seeds give the same result, bit for bit.

    Args:
        setting: Any experiment in single-joint mode; see `multisine_experiments`. Several axes are excited at once,
            with orthogonal phases.
        multisines: The excitation class and amplitude; by default 0.05 to 5 Hz at 0.01 rad, 16 realisations of two
            periods of 10.24 s, some seconds of one core.
        measured: Outputs, joints; by default the excited ones.
        threads: Threads for the physics; all processors by default.

    Raises:
        ScenarioError: See `multisine_experiments`; `measured` is no sequence of joints, each once; the physics
            diverged; a multisine beyond the converter's range.
        TwinError: The setting asks for something that the laboratory does not have.
        SysidError: The command does not move at a line, for instance because the stick stays in its deadband.
    """
    experiments = multisine_experiments(setting, multisines or Multisines())
    if measured is None:
        measured = experiments[0].axes
    # A string is a sequence too, of letters.
    elif isinstance(measured, str) or not isinstance(measured, Sequence) or not 0 < len(measured) == len(set(measured)):
        joints = ", ".join(arm_named(setting.variant).joints)
        raise ScenarioError(f"measured = {measured!r} given, expected one or more of {joints}, each once")
    logs, seconds = _simulated(experiments, threads)
    return approximated(experiments, logs, measured, physics_seconds=seconds, origin=_origin(setting))


def best_linear_as_needed(
    setting: Experiment,
    multisines: Multisines,
    *,
    narrow: float = NARROW,
    most: int = MOST,
    threads: int | None = None,
) -> BestLinearTruth:
    """Measure as `best_linear` with as many realisations as the interval of the bandwidth needs.

    Their number is doubled until the ends of the 95 % interval differ by no more than a factor; the first ones are
    those of `best_linear`. Where no bandwidth shows, it is not.

    Args:
        setting: See `best_linear`; one axis.
        multisines: The excitation class, with the number to begin with.
        narrow: The factor.
        most: Largest number of realisations.
        threads: Threads for the physics; all processors by default.

    Raises:
        ScenarioError: See `best_linear`.
        TwinError: See `best_linear`.
        SysidError: See `best_linear`.
    """
    logs: list[JointLog] = []
    seconds, count = 0.0, multisines.realisations
    while True:
        # The first realisations of a larger number are those of a smaller one, phases and noise.
        experiments = multisine_experiments(setting, replace(multisines, realisations=count))
        more, more_seconds = _simulated(experiments[len(logs) :], threads)
        logs += more
        seconds += more_seconds
        found = approximated(experiments, logs, setting.axes, physics_seconds=seconds, origin=_origin(setting))
        _, low, high = found.bandwidth.path()
        # An end that is NaN is no interval that more realisations would narrow.
        if not high > narrow * low or 2 * count > most:
            return found
        count *= 2


def _simulated(experiments: Sequence[MultisineExperiment], threads: int | None) -> tuple[list[JointLog], float]:
    """The logs of experiments, and the wall time in the physics, s."""
    result = simulate(experiments, threads=threads)
    # A mean over the realisations that are left would be another estimate than the one asked for.
    for name, reason in result.failed.items():
        raise ScenarioError(f"{name}: {reason}")
    return list(result), result.physics_seconds


def _origin(setting: Experiment) -> dict[str, str]:
    """What the provenance says of an experiment."""
    return {"setting": setting.name, "seed": str(setting.seed)}


def measured_best_linear(
    arm: Arm,
    pose: str,
    multisines: Multisines,
    *,
    chain: Chain | None = None,
    as_needed: bool = False,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, BestLinearTruth]:
    """Measure the best linear approximation of each studied joint, of another arm of every joint, excited alone.

    Args:
        arm: The arm.
        pose: Keyframe about which it moves.
        multisines: The excitation class; its seed draws the noise too.
        chain: The chain of signals; by default as the laboratory records.
        as_needed: Take as many realisations as the interval of a bandwidth needs, see `best_linear_as_needed`.
        threads: Threads for the physics; all processors by default.
        progress: Called with the joints done and those in all.

    Raises:
        ScenarioError: See `best_linear`.
    """
    approximations: dict[str, BestLinearTruth] = {}
    joints = arm.description.compared
    for joint in joints:
        setting = MultisineExperiment(
            joint,
            (joint,),
            variant=arm.variant,
            payload=arm.payload,
            plant=arm.plant,
            specimen=arm.specimen,
            pose=pose,
            chain=chain or Chain(),
            seed=multisines.seed,
        )
        measure = best_linear_as_needed if as_needed else best_linear
        approximations[joint] = measure(setting, multisines, threads=threads)
        if progress is not None:
            progress(len(approximations), len(joints))
    return approximations


def approximated(
    experiments: Sequence[MultisineExperiment],
    logs: Sequence[JointLog],
    measured: Sequence[str],
    *,
    physics_seconds: float,
    origin: Mapping[str, str],
) -> BestLinearTruth:
    """Compute the best linear approximation from existing records; see `best_linear`.

    Args:
        experiments: Realisations of one class of excitation under one set of conditions; of several axes as many
            records each, one after the other.
        logs: Their logs.
        measured: Outputs, joints, each once.
        physics_seconds: Wall time of the records in the physics, s.
        origin: Their origin, for the provenance.

    Raises:
        SysidError: The command does not move at a line.
    """
    first, multisines = experiments[0], experiments[0].multisines
    columns = _columns(logs[0], first.axes)
    servo_records = [_record(first, measured, log, log.commanded[:, columns]) for log in logs]
    chain_records = []
    for log, experiment in zip(logs, experiments, strict=True):
        chain_records.append(_record(first, measured, log, experiment.offsets()))
    with warnings.catch_warnings():
        # Noise of the wires makes the commands of two periods differ; the record holds them, so they are known.
        warnings.filterwarnings("ignore", message=".* is not periodic with", category=SysidWarning)
        servo = bla(servo_records, first.period, lines=multisines.lines)
        chain = bla(chain_records, first.period, lines=multisines.lines)
    steady = [record.scored for record in servo_records]
    silent = None
    if multisines.odd:
        silent = silent_lines(steady, servo, first.period, multisines.band)
    variances = [record.u.var(axis=0) for record in steady]
    # What comes before the steady periods is no part of the approximation.
    steady_status = []
    for log, record in zip(logs, steady, strict=True):
        steady_status.append(log.status[len(log) - len(record) :])
    status = np.concatenate(steady_status)
    at_limit = status & (Status.JOINT_LIMITED | Status.CONVERTER_SATURATED)
    class_of_excitation = {f"multisines_{name}": str(value) for name, value in vars(multisines).items()}
    return BestLinearTruth(
        experiment=first,
        measured=tuple(measured),
        servo=servo,
        chain=chain,
        silent=silent,
        command_rms=np.sqrt(np.mean(variances, axis=0)),
        slewing=float(np.mean((status & Status.VELOCITY_LIMITED) != 0)),
        limited=float(np.mean(at_limit != 0)),
        physics_seconds=physics_seconds,
        provenance={
            "method": "robust method, random-phase multisines",
            **origin,
            **class_of_excitation,
            **logs[0].provenance,
            **versions(),
        },
    )


def _columns(arm: ArmDescription | JointLog, joints: Sequence[str]) -> list[int]:
    """Columns of joints among those of an arm or a log."""
    return [arm.joint_index(joint) for joint in joints]


def _record(first: MultisineExperiment, measured: Sequence[str], log: JointLog, inputs: FloatArray) -> IOData:
    """Pair inputs (N, n_axes), rad, with the measured angles of a log; the window holds what is not steady yet."""
    # The first periods hold the transient from rest.
    return IOData(
        inputs,
        log.measured[:, _columns(log, measured)],
        log.dt,
        input_names=tuple(f"{name} commanded" for name in first.axes),
        output_names=tuple(f"{name} measured" for name in measured),
        input_units=("rad",) * len(first.axes),
        output_units=("rad",) * len(measured),
        window=first.settling,
    )


def slow_gain(approximation: BestLinearTruth, truth: Truth) -> float:
    """Return the gain from commanded to measured angle over that of the small-signal truth, lines up to `SLOWEST`.

    Args:
        approximation: The approximation of one joint, excited alone.
        truth: The small-signal truth of the same arm.
    """
    response, joint = approximation.servo.response, approximation.measured[0]
    slow = response.frequencies <= SLOWEST
    expected = truth.channel(joint, joint).frequency_response(response.frequencies[slow])[:, 0, 0]
    return float(np.abs(response.response[slow, 0, 0] / expected).mean())


def cautions(approximation: BestLinearTruth, truth: Truth) -> tuple[str, ...]:
    """Return in words why the bandwidth of an approximation says little; nothing where it may be relied upon.

    Args:
        approximation: The approximation of one joint, excited alone.
        truth: The small-signal truth of the same arm.
    """
    gain = slow_gain(approximation, truth)
    distortion = float(approximation.distortion_percent[0])
    hz, low, high = approximation.bandwidth.path()
    remarks = []
    if gain < STUCK:
        remarks.append(f"it follows {100 * gain:.0f} % of a slow command, and the bandwidth is relative to that")
    if distortion > DISTORTED:
        remarks.append(f"distortion is {distortion:.0f} %, so no linear model is good")
    if not np.isfinite(hz):
        remarks.append("no bandwidth shows")
    # Written so that an end that is NaN counts as wide too.
    elif not high <= WIDE * low:
        remarks.append(f"the interval's ends differ by a factor of {high / low:.1f}")
    return tuple(remarks)
