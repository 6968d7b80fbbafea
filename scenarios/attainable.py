"""The third kind of truth: what a model could at best achieve on one record."""

import contextlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, log, sqrt
from types import MappingProxyType

import numpy as np
from scipy.stats import chi2

from hmtb_twin import JOINTS, Arm, JointLog, Status, Truth, linearize, load_arm
from hmtb_twin.linearization import simulated
from hmtb_twin.modes import joint_index
from hmtb_twin.recorder import delayed
from scenarios.errors import ScenarioError
from scenarios.logged_arm import logged_arm
from sysid import IOData, StateSpace, SysidError, SysidWarning, oe, pem_ss, predict
from sysid.arrays import FloatArray

MATTERS = 1e-4
"""States with a Hankel singular value below this part of the largest change no output beyond the resolver's noise."""

FADED = 1e-6
"""A pulse response has died out where its slowest mode is down to this part."""


@dataclass(frozen=True)
class Floor:
    """How small an error is.

    Attributes:
        rmse: Root mean square of the error, rad.
        fit: 100 (1 - |error| / |y - mean y|), percent.
    """

    rmse: float
    fit: float


@dataclass(frozen=True)
class Horizon:
    """What is attainable over one horizon, in simulation or one step ahead.

    Attributes:
        any_model: By any model whatever, with the right initial state: what is left is noise that nothing foretells.
        best_linear: By the linear time-invariant system that does best on this very record; the operating point is
            free. In simulation the best of two families: pulse responses of any shape as long as the arm takes to
            settle, and systems of the truth's order; one step ahead, regressions on as many past commands and angles.
            Where the command repeats within that time, such a system takes most distortion along, for it shows at
            excited lines only.
        small_signal: By the small-signal truth; the operating point is free.
    """

    any_model: Floor
    best_linear: Floor
    small_signal: Floor


@dataclass(frozen=True)
class Attainable:
    """What a model of one joint could at best achieve on one record.

    Attributes:
        joint: The joint.
        samples: Samples scored.
        spread: Standard deviation of the measured angle over them, rad.
        simulation: From commands alone.
        one_step: From commands and from this joint's measurements up to the sample before.
        right_order: In simulation, by the linear system of the truth's order that does best on this very record: the
            best that several searches found.
        order: That order: states of the small-signal truth that matter.
        distortion: Root mean square of what the best linear system leaves of the noise-free angle, rad.
        memory: Samples in which the arm settles, and so the length of pulse responses and regressions.
        parameters: Coefficients of the pulse responses and of the regression, constant included.
        provenance: The record, and how the floors were obtained.
    """

    joint: str
    samples: int
    spread: float
    simulation: Horizon
    one_step: Horizon
    right_order: Floor
    order: int
    distortion: float
    memory: int
    parameters: tuple[int, int]
    provenance: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def by_chance(self, rmse: float, parameters: int = 0) -> float:
        """Return how small chance can make the error of a model that is as good as a floor, rad.

        White noise e of variance s^2 and an error m of the model that does not depend on it give the sum of squares
        |e|^2 + |m|^2 + 2 e'm, which is below |e|^2 - s^2 x with the probability that chi-square with one degree of
        freedom exceeds x at worst; each parameter that was fitted to the very record adds one degree
        [Ljung1999, sec. 16.4].

        Args:
            rmse: The floor, rad.
            parameters: What was fitted to this very record; on fresh data the initial state alone, where it is fitted.

        Returns:
            The root mean square that is undercut by chance once in twenty times at most.
        """
        return rmse * sqrt(max(1.0 - chi2.ppf(0.95, parameters + 1) / self.samples, 0.0))


def attainable(
    record: JointLog, joint: str | None = None, *, truth: Truth | None = None, window: int = 0
) -> Attainable:
    """Return the floors of one joint on one record.

    Args:
        record: A log of the twin: it knows the noise-free angles, the arm and its conditions.
        joint: The joint; the excited one by default.
        truth: The small-signal truth; by default that of the log's arm at its pose.
        window: Samples at the start that are not scored.

    Returns:
        The floors.

    Raises:
        ScenarioError: No joint named where several are excited, a log that does not tell of its arm, that holds a
            shutdown or work in contact, or that is too short for the linear systems; a joint that does not move.
        TwinError: Unknown joint.
    """
    if joint is None:
        if len(record.axes) != 1:
            raise ScenarioError(f"{record.name} excites {', '.join(record.axes)}: name the joint")
        joint = record.axes[0]
    column = joint_index(joint)
    if record.unit_pose is not None or (record.status & Status.SHUT_DOWN).any():
        raise ScenarioError(f"{record.name}: a shutdown, or work in contact, has no linear truth")
    if not 0 <= window < len(record):
        raise ScenarioError(f"window = {window} given, expected 0 to {len(record) - 1} samples")
    arm = logged_arm(record)
    truth = truth or linearize(arm, record.provenance["pose"], amplitudes=())
    measured = record.measured[:, column]
    true = delayed(record.true_angles, arm.delays)[:, column]
    quiet = _without_process_noise(record, arm, truth)[:, column] if arm.plant.process_noise else true
    # Servo valves under load stand a little off the commanded pose; the linear model counts from where they stand.
    start = arm.rest(truth.angles).qpos[column]

    moved = [name for k, name in enumerate(JOINTS) if name == joint or np.ptp(record.commanded[:, k]) > 0.0]
    columns = [joint_index(name) for name in moved]
    offsets = IOData(record.commanded[:, columns] - truth.angles[columns], measured - start, record.dt)
    model = truth.subset(moved, (joint,))
    rest = np.zeros(model.order)
    simulation, one_step = (predict(model, offsets, steps=steps, x0=rest)[:, 0] + start for steps in (None, 1))
    memory = _memory(truth, joint)
    lags = [_lagged(signal, memory, first=0) for signal in offsets.u.T]
    past = _lagged(offsets.y[:, 0], memory, first=1)
    commands = np.hstack([*lags, np.ones((len(record), 1))])
    both = np.hstack([commands, past])
    if len(record) - window < 2 * both.shape[1]:
        raise ScenarioError(
            f"{record.name} has {len(record) - window} samples to score, expected {2 * both.shape[1]} or more: the "
            f"linear systems that it is compared with have {both.shape[1]} coefficients"
        )
    order, fitted = _right_order(truth.subset(moved, (joint,)), offsets, quiet, window)
    linear = _fitted(commands, quiet, window)
    foretold = _fitted(both, measured, window)
    scored = measured[window:]
    spread = float(np.std(scored))
    if spread <= 1e-14 * float(np.abs(scored).max()):
        raise ScenarioError(f"{record.name}: {joint} does not move; a fit is not defined")

    def rms(error: FloatArray) -> float:
        return float(np.sqrt(np.mean(error[window:] ** 2)))

    def floor(prediction: FloatArray, *, centred: bool = False, coefficients: int = 0) -> Floor:
        error = (measured - prediction)[window:]
        rmse = float(np.sqrt(np.mean((error - error.mean() if centred else error) ** 2)))
        rmse *= sqrt(len(error) / (len(error) - coefficients))
        return Floor(rmse, 100.0 * (1.0 - rmse / spread))

    right_order = min((floor(one, centred=True) for one in (simulation, *fitted)), key=lambda one: one.rmse)
    best = min((linear, *(one - np.mean((one - quiet)[window:]) for one in fitted)), key=lambda one: rms(quiet - one))
    return Attainable(
        joint=joint,
        samples=len(scored),
        spread=spread,
        simulation=Horizon(floor(quiet), floor(best), floor(simulation, centred=True)),
        one_step=Horizon(floor(true), floor(foretold, coefficients=both.shape[1]), floor(one_step, centred=True)),
        right_order=right_order,
        order=order,
        distortion=rms(quiet - best),
        memory=memory,
        parameters=(commands.shape[1], both.shape[1]),
        provenance={
            "record": record.name,
            "seed": str(record.seed),
            "noise-free angles": "simulated anew without process noise" if arm.plant.process_noise else "of the record",
            **record.provenance,
        },
    )


def _without_process_noise(record: JointLog, arm: Arm, truth: Truth) -> FloatArray:
    """Noise-free angles (N, 7) as they reach the record, under the same commands and without process noise, rad."""
    quiet = load_arm(arm.variant, arm.payload, plant=replace(arm.plant, process_noise=0.0))
    return simulated(quiet, truth.angles, record.commanded) + quiet.rest(truth.angles).qpos[: len(JOINTS)]


def _right_order(
    model: StateSpace, record: IOData, quiet: FloatArray, window: int
) -> tuple[int, tuple[FloatArray, ...]]:
    """Order of the truth, and what output-error models of this order that are fitted to noise-free angles simulate."""
    start = replace(model, K=None).minimal(MATTERS)
    exact = replace(record, y=quiet[:, None], window=0)[window:].detrend()
    found: list[FloatArray] = []
    with warnings.catch_warnings():
        # What is said of poor excitation is about parameters; here only the output counts.
        warnings.simplefilter("ignore", SysidWarning)
        # The criterion has several minima where the record is distorted, so the search begins at several places.
        fits = [lambda: pem_ss(exact, start, direct=False, gain=False, search=False)]
        if record.nu == 1:
            fits.append(lambda: oe(exact, start.order, start.order, 1))
        for fit in fits:
            with contextlib.suppress(SysidError):
                hat = predict(fit(), exact, steps=None)[:, 0]
                found.append(np.concatenate([quiet[:window], hat + quiet[window:].mean()]))
    return start.order, tuple(found)


def _memory(truth: Truth, joint: str) -> int:
    """Samples after which a pulse has died out, bus delay included."""
    slowest = float(np.abs(truth.joint(joint).poles).max())
    return ceil(log(FADED) / log(slowest)) + truth.joint(joint).delay_samples


def _lagged(signal: FloatArray, memory: int, *, first: int) -> FloatArray:
    """Columns signal(t - first), ..., signal(t - memory); zero before the record, which starts at rest at its pose."""
    padded = np.concatenate([np.zeros(memory), signal])
    windows = np.lib.stride_tricks.sliding_window_view(padded, memory + 1)[:, ::-1]
    return windows[:, first:]


def _fitted(regressors: FloatArray, target: FloatArray, window: int) -> FloatArray:
    """Least squares over the scored samples; the prediction of all."""
    solution, *_ = np.linalg.lstsq(regressors[window:], target[window:], rcond=None)
    return regressors @ solution
