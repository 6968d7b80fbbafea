"""Best linear approximation of the twin for one class and amplitude of excitation."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from hmtb_twin import JOINTS, Experiment, JointLog, Status, Truth, linearize, load_arm, simulate
from hmtb_twin.control.modes import joint_index
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from sysid import Bandwidth, BestLinearApproximation, IOData, SysidWarning, bla
from sysid.frequency.bla import ResponseAgreement, response_agreement
from sysid.models.bandwidth import response_bandwidth
from sysid.records.arrays import FloatArray

SLOWEST = 0.3
"""Lines up to this frequency tell the gain at low frequency, Hz."""

DISTORTED = 10.0
"""Nonlinear distortion from which on no one linear model is good, percent."""

WIDE = 1.5
"""Factor between the ends of an interval from which on the bandwidth in it is a rough guess."""

STUCK = 0.7
"""Gain at low frequency, over the truth's, below which the joint sticks: its bandwidth is relative to that gain."""


@dataclass(frozen=True, eq=False)
class SilentLines:
    """Distortion at the silent lines of an odd-random grid, as root mean square over the excited band.

    Attributes:
        even: Of even order, and all else that falls on even lines (ny,), rad.
        odd: Of odd order (ny,), rad: the silent odd lines stand for all odd ones.
        noise: Noise of one period over the same band (ny,), rad.
    """

    even: FloatArray
    odd: FloatArray
    noise: FloatArray


def silent_lines(
    records: Sequence[IOData], approximation: BestLinearApproximation, multisines: Multisines
) -> SilentLines:
    """Read even and odd distortion at the silent lines [Pintelon2012, sec. 4.3].

    The command itself has some power at those lines, because it is rounded or limited. It passes through the system and
    is subtracted first, with the response interpolated between the excited lines.

    Args:
        records: Steady, whole periods.
        approximation: The response.
        multisines: The excitation class, on an odd-random grid.

    Returns:
        The levels less noise, not below zero.
    """
    period, band = multisines.samples, multisines.band
    silent = np.setdiff1d(band, multisines.lines)
    g = approximation.response.response
    at = np.empty((len(silent), *g.shape[1:]), dtype=complex)
    for i, j in np.ndindex(g.shape[1:]):
        real, imaginary = (np.interp(silent, multisines.lines, part) for part in (g[:, i, j].real, g[:, i, j].imag))
        at[:, i, j] = real + 1j * imaginary
    power, noise = [], []
    for record in records:
        u, y = (
            np.fft.rfft(part.reshape(-1, period, part.shape[1]), axis=1)[:, silent] for part in (record.u, record.y)
        )
        errors = y - np.einsum("fij,pfj->pfi", at, u)
        scatter = errors.var(axis=0, ddof=1)
        power.append(np.abs(errors.mean(axis=0)) ** 2 - scatter / len(errors))
        noise.append(scatter)
    # A line X_k of numpy's transform carries the mean square 2 |X_k|^2 / N^2.
    level, floor = (2.0 * np.mean(part, axis=0) / period**2 for part in (power, noise))
    is_odd = silent % 2 == 1
    return SilentLines(
        even=_rms(level[~is_odd].sum(axis=0)),
        odd=_rms(level[is_odd].sum(axis=0) * np.sum(band % 2 == 1) / max(np.sum(is_odd), 1)),
        noise=_rms(floor.sum(axis=0) * len(band) / len(silent)),
    )


def _rms(mean_square: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(mean_square, 0.0)))


@dataclass(frozen=True, eq=False)
class BestLinearTruth:
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

    def __post_init__(self) -> None:
        rms = np.array(self.command_rms)
        rms.setflags(write=False)
        object.__setattr__(self, "command_rms", rms)
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    @property
    def multisines(self) -> Multisines:
        """The excitation class."""
        return self.experiment.multisines

    @property
    def bandwidth(self) -> Bandwidth:
        """Half-power bandwidths of `servo` with 95 % intervals, Hz."""
        return response_bandwidth(self.servo.response)

    @property
    def distortion_percent(self) -> FloatArray:
        """Nonlinear distortion of each measured angle, of one realisation of `servo`, in percent of its linear part."""
        return distortion_percent(self.servo)

    @cached_property
    def small_signal(self) -> Truth:
        """The small-signal truth of the same arm under the same conditions."""
        e = self.experiment
        arm = load_arm(e.variant, e.payload, plant=e.plant, specimen=e.specimen, friction=e.chain.friction)
        return linearize(arm, e.pose)

    def servo_agreement(self, truth: Truth | None = None) -> ResponseAgreement:
        """Compare `servo` line by line with a small-signal truth, by default that of the same arm."""
        return response_agreement(self.servo, self._expected(truth or self.small_signal))

    def chain_agreement(self, truth: Truth | None = None) -> ResponseAgreement:
        """Compare `chain` line by line with a small-signal truth, by default that of the same arm."""
        return response_agreement(self.chain, self._expected(truth or self.small_signal))

    def _expected(self, truth: Truth) -> np.ndarray:
        rows, columns = ([joint_index(name) for name in names] for names in (self.measured, self.experiment.axes))
        return truth.model.frequency_response(self.servo.response.frequencies)[:, rows][:, :, columns]


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

    Returns:
        The approximation.

    Raises:
        ScenarioError: See `multisine_experiments`; `measured` is no sequence of joints, each once; the physics
            diverged; a multisine beyond the converter's range.
        TwinError: The setting asks for something that the laboratory does not have.
        SysidError: The command does not move at a line, for instance because the stick stays in its deadband.
    """
    experiments = multisine_experiments(setting, multisines or Multisines())
    outputs = _outputs(experiments[0].axes if measured is None else measured)
    result = simulate(experiments, threads=threads)
    for name, reason in result.failed.items():
        raise ScenarioError(f"{name}: {reason}")
    origin = {"setting": setting.name, "seed": str(setting.seed)}
    return approximated(experiments, result, measured=outputs, physics_seconds=result.physics_seconds, origin=origin)


def approximated(
    experiments: Sequence[MultisineExperiment],
    logs: Sequence[JointLog],
    *,
    measured: Sequence[str],
    physics_seconds: float = 0.0,
    origin: Mapping[str, str] = MappingProxyType({}),
) -> BestLinearTruth:
    """Compute the best linear approximation from existing records; see `best_linear`.

    Args:
        experiments: Realisations of one class of excitation under one set of conditions; of several axes as many
            records each, one after the other.
        logs: Their logs.
        measured: Outputs, joints.
        physics_seconds: Wall time of the records in the physics, s.
        origin: Their origin, for the provenance.

    Raises:
        ScenarioError: `measured` is no sequence of joints, each once.
        SysidError: The command does not move at a line.
    """
    first = experiments[0]
    outputs = _outputs(measured)
    rows = [joint_index(name) for name in outputs]
    excited = [joint_index(name) for name in first.axes]
    servo = [_record(first, outputs, log, log.commanded[:, excited], rows) for log in logs]
    chain = [
        _record(first, outputs, log, experiment.offsets(), rows)
        for log, experiment in zip(logs, experiments, strict=True)
    ]
    of_servo = _bla(servo, first.multisines)
    steady = [record.scored for record in servo]
    status = np.concatenate([log.status[len(log) - len(part) :] for log, part in zip(logs, steady, strict=True)])
    return BestLinearTruth(
        experiment=first,
        measured=outputs,
        servo=of_servo,
        chain=_bla(chain, first.multisines),
        silent=silent_lines(steady, of_servo, first.multisines) if first.multisines.odd else None,
        command_rms=np.sqrt(np.mean([part.u.var(axis=0) for part in steady], axis=0)),
        slewing=float(np.mean((status & Status.VELOCITY_LIMITED) != 0)),
        limited=float(np.mean((status & (Status.JOINT_LIMITED | Status.CONVERTER_SATURATED)) != 0)),
        physics_seconds=physics_seconds,
        provenance={
            "method": "robust method, random-phase multisines",
            **origin,
            **{f"multisines_{name}": str(value) for name, value in vars(first.multisines).items()},
            **logs[0].provenance,
            **versions(),
        },
    )


def distortion_percent(approximation: BestLinearApproximation) -> FloatArray:
    """Return the nonlinear distortion of each output, in percent of its linear part, root mean squares (ny,).

    Both are sums over the lines, on which an input of equal lines has equal power.
    """
    excess = approximation.realisations * (approximation.total_variance - approximation.noise_variance)
    linear = np.abs(approximation.response.response) ** 2 - approximation.total_variance
    return np.asarray(100.0 * np.sqrt(np.maximum(excess.sum(axis=(0, 2)), 0.0) / linear.sum(axis=(0, 2))))


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
    remarks = []
    band, gain = approximation.bandwidth, slow_gain(approximation, truth)
    distortion = float(approximation.distortion_percent[0])
    hz, low, high = (float(part[0, 0]) for part in (band.hz, *band.ci95))
    if gain < STUCK:
        remarks.append(f"it follows {100 * gain:.0f} % of a slow command, and the bandwidth is relative to that")
    if distortion > DISTORTED:
        remarks.append(f"distortion is {distortion:.0f} %, so no linear model is good")
    if not np.isfinite(hz):
        remarks.append("no bandwidth shows")
    elif not high <= WIDE * low:
        remarks.append(f"the interval's ends differ by a factor of {high / low:.1f}")
    return tuple(remarks)


def _outputs(measured: Sequence[str]) -> tuple[str, ...]:
    fine = isinstance(measured, Sequence) and not isinstance(measured, str) and len(measured) > 0
    if not fine or any(list(measured).count(name) > 1 for name in measured):
        raise ScenarioError(f"measured = {measured!r} given, expected one or more of {', '.join(JOINTS)}, each once")
    return tuple(measured)


def _record(
    experiment: MultisineExperiment, outputs: tuple[str, ...], log: JointLog, inputs: np.ndarray, rows: list[int]
) -> IOData:
    return IOData(
        inputs,
        log.measured[:, rows],
        log.dt,
        input_names=tuple(f"{name} commanded" for name in experiment.axes),
        output_names=tuple(f"{name} measured" for name in outputs),
        input_units=("rad",) * len(experiment.axes),
        output_units=("rad",) * len(outputs),
        window=experiment.multisines.settling * experiment.multisines.samples,
    )


def _bla(records: list[IOData], multisines: Multisines) -> BestLinearApproximation:
    with warnings.catch_warnings():
        # Noise of the wires makes the commands of two periods differ; the record holds them, so they are known.
        warnings.filterwarnings("ignore", message=".* is not periodic with", category=SysidWarning)
        return bla(records, multisines.samples, lines=multisines.lines)
