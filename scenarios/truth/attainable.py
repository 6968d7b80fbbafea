"""Attainable errors: the smallest that a model can achieve on one record of the twin."""

import contextlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, log, sqrt

import numpy as np
from scipy.stats import chi2

from hmtb_twin import JOINTS, JointLog, Status, Truth, linearize
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.control.modes import joint_index
from hmtb_twin.truth.logged_arm import check_truth, logged_arm
from scenarios.files.errors import ScenarioError
from scenarios.truth.noise_free import noise_free
from sysid import IOData, StateSpace, SysidError, SysidWarning, oe, pem_ss, predict
from sysid.polynomial.least_squares import tall_least_squares
from sysid.polynomial.long_arx import long_arx_simulation
from sysid.records.arrays import FloatArray

MATTERS = 1e-4
"""States with a Hankel singular value below this part of the largest change no output beyond the resolver's noise."""

FADED = 1e-6
"""A pulse response has died out where its slowest mode is down to this part."""

MOST_STEPS = 100
"""Steps after which a search ends, the minimum or not."""


@dataclass(frozen=True)
class Floor:
    """An error that no model of a class undercuts, but by chance.

    Attributes:
        rmse: Root mean square of the error, rad.
        fit: 100 (1 - |error| / |y - mean y|), percent.
    """

    rmse: float
    fit: float


@dataclass(frozen=True)
class Horizon:
    """Attainable errors over one horizon, in simulation or one step ahead.

    Attributes:
        any_model: In simulation, of the mean of the angle given the commands, the start at rest included: what is left
            is noise that commands do not predict. Where that mean is an average over draws of process noise, the floor
            is corrected for its error `Attainable.mean_error`. One step ahead, of one who knows the noise-free angle:
            what is left is the recorder's noise; no model attains that under process noise.
        best_linear: In simulation, the least of these, fitted to the noise-free angle of this very record with a free
            initial state and constant: pulse responses of `Attainable.memory` samples, ARX models of order `settling`
            and of order `memory`, and output-error models of the truth's order. One step ahead, of the regression on
            `settling` past commands and angles. Linear systems of other classes may do better, and a free initial
            state leaves out the distortion of the first `memory` or `settling` samples.
        small_signal: Of the small-signal truth; the operating point is free.
    """

    any_model: Floor
    best_linear: Floor
    small_signal: Floor


@dataclass(frozen=True)
class Attainable:
    """Smallest errors that a model of one joint can achieve on one record.

    Attributes:
        joint: The joint.
        samples: Samples scored.
        spread: Standard deviation of the measured angle over them, rad.
        simulation: From commands alone.
        one_step: From commands and from this joint's measurements up to the sample before.
        right_order: In simulation, of the best linear system of the truth's order that the searches found.
        order: That order: states of the small-signal truth that matter.
        distortion: Root mean square of what the best linear system leaves of the noise-free angle, rad.
        mean_error: Standard error of the noise-free angle, root mean square, rad; 0 where it is exact.
        settling: Samples in which the small-signal arm settles, the length of the regression.
        memory: Length of the pulse responses: twice that, or less where the record is short.
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
    mean_error: float
    settling: int
    memory: int
    parameters: tuple[int, int]
    provenance: Mapping[str, str]

    def by_chance(self, rmse: float, parameters: int = 0) -> float:
        """Return the error that a model as good as a floor undercuts by chance once in twenty times at most, rad.

        White noise e of variance s^2 and an error m of the model that does not depend on it give the sum of squares
        |e|^2 + |m|^2 + 2 e'm, which is below |e|^2 - s^2 x with the probability that chi-square with one degree of
        freedom exceeds x at worst; each fitted parameter adds one degree [Ljung1999, sec. 16.4].

        Args:
            rmse: The floor, rad.
            parameters: Number fitted to this very record; on fresh data the initial state alone, where it is fitted.
        """
        return rmse * sqrt(max(1.0 - chi2.ppf(0.95, parameters + 1) / self.samples, 0.0))


def attainable(
    record: JointLog,
    joint: str | None = None,
    *,
    truth: Truth | None = None,
    window: int = 0,
    steps: int | None = None,
) -> Attainable:
    """Return the floors of one joint on one record.

    Args:
        record: A log of the twin: it knows the noise-free angles, the arm and its conditions.
        joint: The joint; the excited one by default.
        truth: The small-signal truth of the log's arm at its pose; linearised here by default.
        window: Samples at the start that are not scored.
        steps: Most steps of each search for the linear system of the truth's order; by default each goes to its end.
            Ten take a tenth of the time and leave up to a few percent more.

    Raises:
        ScenarioError: No joint named where several are excited; a log with a shutdown or work in contact, or too short
            for the linear systems; a joint that does not move.
        TwinError: Unknown joint, a log without its arm, or a truth of another arm, other conditions or another pose.
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
    if truth is None:
        truth = linearize(arm, record.provenance["pose"], amplitudes=())
    check_truth(record, arm, truth)
    measured = record.measured[:, column]
    delayed_angles = delayed(record.true_angles, arm.delays)
    true = delayed_angles[:, column]
    mean, variance, origin = noise_free(record, arm, truth, delayed_angles)
    quiet, uncertain = mean[:, column], variance[window:, column].mean()
    # Servo valves under load stand a little off the commanded pose; the linear model counts from where they stand.
    start = arm.rest(truth.angles).qpos[column]

    moved = [name for k, name in enumerate(JOINTS) if name == joint or np.ptp(record.felt[:, k]) > 0.0]
    columns = [joint_index(name) for name in moved]
    offsets = IOData(record.commanded[:, columns] - truth.angles[columns], measured - start, record.dt)
    model = truth.subset(moved, (joint,))
    rest = np.zeros(model.order)
    simulation, one_step = (predict(model, offsets, steps=steps, x0=rest)[:, 0] + start for steps in (None, 1))
    known = truth.joint(joint)
    # A pulse has died out with its slowest mode; one that carries less than what counts as faded never shows.
    slowest = float(np.abs(known.poles[known.shares > FADED]).max())
    settling = ceil(log(FADED) / log(slowest)) + known.delay_samples
    first = max(window, settling)
    coefficients = (len(moved) + 1) * settling + len(moved) + 1
    if len(record) - window < 2 * coefficients:
        raise ScenarioError(
            f"{record.name} has {len(record) - window} samples to score, expected {2 * coefficients} or more: the "
            f"linear systems that it is compared with have {coefficients} coefficients"
        )
    memory = max(settling, min(2 * settling, (len(record) - window) // (2 * len(moved) + 2)))
    constant = np.ones((len(record), 1))
    commands = np.hstack([*(_lagged(signal, memory, first=0) for signal in offsets.u.T), constant])
    both = [*(_lagged(signal, settling, first=0) for signal in offsets.u.T), constant]
    both.append(_lagged(offsets.y[:, 0], settling, first=1))
    exact = replace(offsets, y=quiet[:, None], window=0)[window:].detrend()
    order, of_order = _right_order(model, exact, steps)
    # ARX models remember longer than pulse responses of as many coefficients, and their fit needs no search.
    long = [long_arx_simulation(exact.u, exact.y[:, 0], n) for n in (settling, memory)]
    fitted, high = (
        [np.concatenate([quiet[:window], hat + quiet[window:].mean()]) for hat in hats if hat is not None]
        for hats in (of_order, long)
    )
    linear = _fitted(commands, quiet, max(window, memory))
    predicted = _fitted(np.hstack(both), measured, first)
    # What is fitted to the noise itself lowers its own errors; those before the regression begins are not fitted.
    predicted = np.where(
        np.arange(len(record)) < first,
        true,
        measured - (measured - predicted) * sqrt((len(record) - first) / (len(record) - first - coefficients)),
    )
    scored = measured[window:]
    spread = float(np.std(scored))
    if spread <= 1e-14 * float(np.abs(scored).max()):
        raise ScenarioError(f"{record.name}: {joint} does not move; a fit is not defined")

    def rms(error: FloatArray) -> float:
        return float(np.sqrt(np.mean(error[window:] ** 2)))

    def floor(prediction: FloatArray, *, centred: bool = False, variance: float = 0.0) -> Floor:
        error = (measured - prediction)[window:]
        square = np.mean((error - error.mean() if centred else error) ** 2)
        rmse = sqrt(max(float(square) - variance, 0.0))
        return Floor(rmse, 100.0 * (1.0 - rmse / spread))

    right_order = min((floor(one, centred=True) for one in (simulation, *fitted)), key=lambda one: one.rmse)
    centred = (one - np.mean((one - quiet)[window:]) for one in (*fitted, *high))
    best = min((linear, *centred), key=lambda one: rms(quiet - one))
    return Attainable(
        joint=joint,
        samples=len(scored),
        spread=spread,
        simulation=Horizon(floor(quiet, variance=uncertain), floor(best), floor(simulation, centred=True)),
        one_step=Horizon(floor(true), floor(predicted), floor(one_step, centred=True)),
        right_order=right_order,
        order=order,
        distortion=rms(quiet - best),
        mean_error=sqrt(uncertain),
        settling=settling,
        memory=memory,
        parameters=(commands.shape[1], coefficients),
        provenance={
            "record": record.name,
            "seed": str(record.seed),
            "noise-free angles": origin,
            **({} if steps is None else {"steps of each search for the right order": str(steps)}),
            **record.provenance,
        },
    )


def _right_order(model: StateSpace, exact: IOData, steps: int | None) -> tuple[int, list[FloatArray]]:
    """Simulate output-error models of the truth's order fitted to noise-free angles; return the order too."""
    start = replace(model, K=None).minimal(MATTERS)
    most = steps or MOST_STEPS
    # The criterion has several minima where the record is distorted, so the search begins at several places.
    fits = [lambda: pem_ss(exact, start, direct=False, gain=False, search=False, max_iterations=most)]
    if exact.nu == 1:
        # It has initial estimates of its own, which often lead further down than the truth does.
        fits.insert(0, lambda: oe(exact, start.order, start.order, 1, max_iterations=most, coloured=False))
    outputs: list[FloatArray] = []
    with warnings.catch_warnings():
        # Warnings of poor excitation are about parameters; here only the output counts.
        warnings.simplefilter("ignore", SysidWarning)
        for fit in fits:
            with contextlib.suppress(SysidError):
                outputs.append(predict(fit(), exact, steps=None)[:, 0])
                if steps is not None:
                    break
    return start.order, outputs


def _lagged(signal: FloatArray, memory: int, *, first: int) -> FloatArray:
    """Columns signal(t - first), ..., signal(t - memory); zero before the record."""
    padded = np.concatenate([np.zeros(memory), signal])
    windows = np.lib.stride_tricks.sliding_window_view(padded, memory + 1)[:, ::-1]
    return windows[:, first:]


def _fitted(regressors: FloatArray, target: FloatArray, first: int) -> FloatArray:
    """Least squares from a sample on; the prediction of all, before that sample the target itself."""
    solution = tall_least_squares(regressors[first:], target[first:], cond=1e-12)
    return np.concatenate([target[:first], regressors[first:] @ solution])
