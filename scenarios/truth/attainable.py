"""Attainable errors: the smallest that a model can achieve on one record of the twin."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, log, sqrt

import numpy as np
from scipy.stats import chi2

from hmtb_twin import Arm, JointLog, JointTruth, Status, Truth, linearize
from hmtb_twin.bus.recorder import delayed
from hmtb_twin.truth.logged_arm import check_truth, logged_arm
from scenarios.files.errors import ScenarioError
from scenarios.truth.linear_fits import high_order_simulations, one_step_regression, pulse_responses, right_order_fits
from scenarios.truth.noise_free import noise_free
from sysid import IOData, StateSpace, predict
from sysid.records.arrays import FloatArray

FADED = 1e-6
"""A pulse response has died out where its slowest mode is down to this part."""

STILL = 1e-14
"""Spread of an angle, over its largest value, up to which it is no more than rounding."""


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
        # On a record of few samples chance may explain everything.
        return rmse * sqrt(max(1.0 - chi2.ppf(0.95, parameters + 1) / self.samples, 0.0))


def attainable(
    record: JointLog,
    joint: str | None = None,
    *,
    truth: Truth | None = None,
    window: int = 0,
    steps: int | None = None,
) -> Attainable:
    """Return the smallest errors that models of one joint can attain on one record.

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
    joint = _joint_to_score(record, joint)
    _check_scorable(record, window)
    arm = logged_arm(record)
    if truth is None:
        truth = linearize(arm, record.provenance["pose"], amplitudes=())
    check_truth(record, arm, truth)
    motion = _motion(record, arm, truth, joint, window)
    small_signal = truth.subset(motion.commanded, (joint,))
    lengths = _lengths(record.name, motion, truth.joint(joint))
    if motion.spread <= STILL * float(np.abs(motion.scored).max()):
        raise ScenarioError(f"{record.name}: {joint} does not move; a fit is not defined")

    simulation = motion.from_rest(small_signal, steps=None)
    one_step = motion.from_rest(small_signal, steps=1)
    order, right_order_outputs = right_order_fits(small_signal, motion.noise_free_record, steps)
    right_order_outputs = [motion.whole(output) for output in right_order_outputs]
    best = _best_linear_simulation(motion, lengths, right_order_outputs)
    predicted = _best_linear_prediction(motion, lengths)
    # The truth itself is a system of its order; where it fits best, no search may come out worse.
    right_order_floors = [motion.centred_floor(output) for output in (simulation, *right_order_outputs)]
    provenance = {"record": record.name, "seed": str(record.seed), "noise-free angles": motion.origin}
    if steps is not None:
        provenance["steps of each search for the right order"] = str(steps)
    simulation_floors = Horizon(
        any_model=motion.floor(motion.expected, variance=motion.mean_variance),
        best_linear=motion.floor(best),
        small_signal=motion.centred_floor(simulation),
    )
    one_step_floors = Horizon(
        any_model=motion.floor(motion.noise_free),
        best_linear=motion.floor(predicted),
        small_signal=motion.centred_floor(one_step),
    )
    return Attainable(
        joint=joint,
        samples=len(motion.scored),
        spread=motion.spread,
        simulation=simulation_floors,
        one_step=one_step_floors,
        right_order=min(right_order_floors, key=lambda floor: floor.rmse),
        order=order,
        distortion=motion.rms(motion.expected - best),
        mean_error=sqrt(motion.mean_variance),
        settling=lengths.settling,
        memory=lengths.memory,
        parameters=(lengths.pulse_coefficients, lengths.regression_coefficients),
        provenance={**provenance, **record.provenance},
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """The angle of one joint over a record, as measured, without noise and as theory expects it.

    Attributes:
        commanded: The joint itself and every other joint whose command moves.
        measured: Measured angle (N,), rad.
        noise_free: Angle without the recorder's noise, as it reaches the record (N,), rad.
        expected: Mean of the angle given the commands, as it reaches the record (N,), rad.
        mean_variance: Mean square of the standard error of `expected` over the scored samples, rad^2.
        origin: Origin of `expected`, in words.
        start: Angle at which the arm rests before the record, rad.
        offsets: Commands of the joints in `commanded` about the pose, and the measured angle about `start`, rad.
        window: Samples at the start that are not scored.
    """

    commanded: tuple[str, ...]
    measured: FloatArray
    noise_free: FloatArray
    expected: FloatArray
    mean_variance: float
    origin: str
    start: float
    offsets: IOData
    window: int

    @property
    def scored(self) -> FloatArray:
        """Measured angle over the scored samples, rad."""
        return self.measured[self.window :]

    @property
    def spread(self) -> float:
        """Standard deviation of the measured angle over the scored samples, rad."""
        return float(np.std(self.scored))

    @property
    def noise_free_record(self) -> IOData:
        """Scored samples of the commands and of the expected angle, both without their means."""
        return replace(self.offsets, y=self.expected[:, None], window=0)[self.window :].detrend()

    def from_rest(self, model: StateSpace, steps: int | None) -> FloatArray:
        """Predict the angle with a model that starts at rest (N,), rad; `steps` None simulates."""
        return predict(model, self.offsets, steps=steps, x0=np.zeros(model.order))[:, 0] + self.start

    def whole(self, output: FloatArray) -> FloatArray:
        """Complete an output of a model of `noise_free_record` to the whole record, in absolute angles (N,), rad."""
        before = self.expected[: self.window]
        return np.concatenate([before, output + self.expected[self.window :].mean()])

    def centred(self, output: FloatArray) -> FloatArray:
        """Move an output so that its mean error against the expected angle is zero (N,), rad."""
        return np.asarray(output - np.mean((output - self.expected)[self.window :]))

    def rms(self, error: FloatArray) -> float:
        """Root mean square of an error (N,) over the scored samples, rad."""
        return float(np.sqrt(np.mean(error[self.window :] ** 2)))

    def floor(self, output: FloatArray, variance: float = 0.0) -> Floor:
        """Error of an output (N,); `variance`, rad^2, is that of the output itself, which is no error of the model."""
        return self._floor((self.measured - output)[self.window :], variance)

    def centred_floor(self, output: FloatArray) -> Floor:
        """Error of an output (N,) whose operating point is free."""
        error = (self.measured - output)[self.window :]
        return self._floor(error - error.mean(), 0.0)

    def _floor(self, error: FloatArray, variance: float) -> Floor:
        # Chance may bring the mean square of a short record below the variance that is taken off.
        rmse = sqrt(max(float(np.mean(error**2)) - variance, 0.0))
        return Floor(rmse, 100.0 * (1.0 - rmse / self.spread))


@dataclass(frozen=True)
class _Lengths:
    """Lengths of the linear systems that are fitted to a record.

    Attributes:
        settling: Samples in which the small-signal arm settles.
        memory: Samples of the pulse responses.
        pulse_coefficients: Coefficients of the pulse responses, constant included.
        regression_coefficients: Coefficients of the regression one step ahead, constant included.
    """

    settling: int
    memory: int
    pulse_coefficients: int
    regression_coefficients: int


def _joint_to_score(record: JointLog, joint: str | None) -> str:
    """Return the joint that was named, or else the only one that the record excites."""
    if joint is None:
        if len(record.axes) != 1:
            raise ScenarioError(f"{record.name} excites {', '.join(record.axes)}: name the joint")
        joint = record.axes[0]
    # A joint that does not exist is refused before anything is computed.
    record.joint_index(joint)
    return joint


def _check_scorable(record: JointLog, window: int) -> None:
    """Refuse a record that has no linear truth, and a window that leaves nothing to score."""
    # In contact, and after a shutdown, the arm is not the one that was linearised.
    if record.unit_pose is not None or (record.status & Status.SHUT_DOWN).any():
        raise ScenarioError(f"{record.name}: a shutdown, or work in contact, has no linear truth")
    if not 0 <= window < len(record):
        raise ScenarioError(f"window = {window} given, expected 0 to {len(record) - 1} samples")


def _motion(record: JointLog, arm: Arm, truth: Truth, joint: str, window: int) -> _Motion:
    """Take one joint's angles and all commands that move from a record."""
    column = record.joint_index(joint)
    measured = record.measured[:, column]
    delayed_angles = delayed(record.true_angles, arm.delays)
    mean, variance, origin = noise_free(record, arm, truth, delayed_angles)
    # Servo valves under load stand a little off the commanded pose; the linear model counts from where they stand.
    start = arm.rest(truth.angles).qpos[column]
    # A command that never moves has no lags to fit: its columns would all be the constant.
    moves = np.ptp(record.felt, axis=0) > 0.0
    commanded = tuple(name for name, moving in zip(record.joints, moves, strict=True) if moving or name == joint)
    columns = [record.joint_index(name) for name in commanded]
    commands = record.commanded[:, columns] - truth.angles[columns]
    return _Motion(
        commanded=commanded,
        measured=measured,
        noise_free=delayed_angles[:, column],
        expected=mean[:, column],
        mean_variance=variance[window:, column].mean(),
        origin=origin,
        start=start,
        offsets=IOData(commands, measured - start, record.dt),
        window=window,
    )


def _lengths(record_name: str, motion: _Motion, joint_truth: JointTruth) -> _Lengths:
    """Choose how many past samples the linear systems see: as long as the arm remembers and the record allows."""
    # A pulse has died out with its slowest mode; one that carries less than what counts as faded never shows.
    slowest = float(np.abs(joint_truth.poles[joint_truth.shares > FADED]).max())
    settling = ceil(log(FADED) / log(slowest)) + joint_truth.delay_samples
    commands, samples = len(motion.commanded), len(motion.scored)
    # Lags 0 to `settling` of each command, lags 1 to `settling` of the angle, and the constant.
    regression_coefficients = (commands + 1) * settling + commands + 1
    # Fewer samples would leave the regression less than half of them as degrees of freedom of its error.
    if samples < 2 * regression_coefficients:
        raise ScenarioError(
            f"{record_name} has {samples} samples to score, expected {2 * regression_coefficients} or more: the "
            f"linear systems that it is compared with have {regression_coefficients} coefficients"
        )
    # About two samples for each coefficient of the pulse responses too.
    memory = max(settling, min(2 * settling, samples // (2 * commands + 2)))
    return _Lengths(settling, memory, commands * (memory + 1) + 1, regression_coefficients)


def _best_linear_simulation(motion: _Motion, lengths: _Lengths, right_order_outputs: list[FloatArray]) -> FloatArray:
    """Return the simulation nearest to the expected angle among those of the fitted linear systems (N,), rad."""
    first = max(motion.window, lengths.memory)
    of_pulses = pulse_responses(motion.offsets.u, motion.expected, lengths.memory, first)
    of_high_order = high_order_simulations(motion.noise_free_record, (lengths.settling, lengths.memory))
    searched = (*right_order_outputs, *(motion.whole(output) for output in of_high_order))
    candidates = [of_pulses, *(motion.centred(output) for output in searched)]
    return min(candidates, key=lambda output: motion.rms(motion.expected - output))


def _best_linear_prediction(motion: _Motion, lengths: _Lengths) -> FloatArray:
    """Predict one step ahead by regression, the error enlarged to that on fresh data (N,), rad."""
    measured, samples = motion.measured, len(motion.measured)
    first = max(motion.window, lengths.settling)
    predicted = one_step_regression(motion.offsets, measured, lengths.settling, first)
    # What is fitted to the noise itself lowers its own errors; those before the regression begins are not fitted.
    fitted_samples = samples - first
    enlargement = sqrt(fitted_samples / (fitted_samples - lengths.regression_coefficients))
    enlarged = measured - (measured - predicted) * enlargement
    return np.where(np.arange(samples) < first, motion.noise_free, enlarged)
