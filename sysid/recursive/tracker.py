"""Identification of a plant that changes, sample by sample: bandwidth and delay with intervals, and the changes."""

from dataclasses import dataclass

import numpy as np

from sysid.polynomial.correlation import autoregression
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.polynomial_estimate import check_single_output
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, warn_each
from sysid.records.repetition import Repetition, repetitions
from sysid.recursive.adaptation import DirectionalForgetting
from sysid.recursive.change_test import ChangeTest
from sysid.recursive.repeated_distortion import half_widths
from sysid.recursive.servo_quantities import LAGS, LOWEST, ServoQuantities
from sysid.recursive.stretch_fit import (
    StretchFit,
    fit_degrees,
    gradient_rows,
    model_weights,
    preferred,
)

PER_PARAMETER = 8  # samples per parameter from which a model is fitted to the data after a change
ARMED = 4  # lengths of the first stretch after which the test is armed again
GROWTH = 1.4  # of the stretch from one fit to the next: steps of the recursion between them stay small
NOISE_ORDER = 10  # largest order of D
BLOCKS = 10  # parts of a stretch whose scatter tells its errors: 9 degrees of freedom
STUDENT_95 = 2.2621571627409915  # 97.5 % quantile of BLOCKS - 1 degrees of freedom
LEAST_SCATTER = 0.75  # over that of white errors: less is the chance of ten blocks
AROUND = 2  # degrees above and below the last one that a fit tries
WIDEST = 20.0  # logarithm of a factor by which nothing is known
HISTORY = 4.0  # s of inputs before a stretch that its simulation takes in
LONGEST_DELAY = 1000  # samples
SHORTEST = 20  # samples per parameter in the calibration


@dataclass(frozen=True)
class Change:
    """A detected change.

    Attributes:
        time: Most likely time of the change, s.
        detected: Time of the alarm, s.
        statistic: Statistic of `ChangeTest` at the alarm.
        threshold: Its threshold.
    """

    time: float
    detected: float
    statistic: float
    threshold: float


@dataclass(frozen=True)
class TrackSample:
    """Estimates after one sample.

    Attributes:
        time: Time of the sample, s, the first of the calibration at 0.
        bandwidth: Frequency at which the gain falls to 0.707 of that at 0 Hz, Hz; NaN without one, and after an alarm
            until enough data follow.
        bandwidth_ci95: 95 % interval.
        delay: Phase delay at the bandwidth, s.
        delay_ci95: 95 % interval.
        change: The change that this sample revealed, or None.
        settled: Whether the model is of data since the last alarm.
    """

    time: float
    bandwidth: float
    bandwidth_ci95: tuple[float, float]
    delay: float
    delay_ci95: tuple[float, float]
    change: Change | None
    settled: bool


class Tracker:
    """Recursive prediction-error estimate that notices changes and then starts afresh.

    Model: y = B(q)/F(q) u + constant + 1/D(q) e. The calibration, a stretch without a change, gives D. Then every
    sample makes one step of recursive least squares with `DirectionalForgetting` along the gradient at the last fit;
    fits, by Gauss-Newton steps on the stretch since the last change, come at lengths that grow by 1.4, up to twice the
    memory. An alarm of `ChangeTest` ends the stretch: nothing is known of the new plant then (the covariance is opened
    wholly), the first model follows after eight samples per parameter, and the test is armed again at four times that
    length: the first models are rough.

    Memory: the variance of an estimate with memory T is c / (2 T), c that of the calibration times its length; the lag
    behind a random walk that moves q per second has the variance q T / 2. Their sum is least at T = sqrt(c / q)
    [LjungGunnarsson1990]; lambda = 1 - dt / T.

    Degrees: bandwidth and delay are means over models of several degrees, see `model_weights`. The recursion moves the
    one that the criterion prefers; by how much the others differ from the mean at the fit widens the intervals until
    the next one [Buckland1997].

    Intervals: the covariance follows every gain, Pi = (I - L psi') Pi (I - L psi')' + variance L L'. Dry friction makes
    errors that depend on the motion, which no whitening removes. So Pi is scaled, for bandwidth and delay each, by the
    scatter of the scores of ten blocks over that of white errors: batch means of the sandwich estimate [White1982].
    Intervals take Student's quantile of nine degrees of freedom. Short blocks miss what is slower than they are: a
    stretch shorter than the calibration takes at least the scatter of the last one that was not. Where the input
    repeats, friction makes the same errors in every period, which add up: a block is then a tenth of the period, with
    all its plays in the stretch, and the interval is at least that of the lines of the mean period, which counts too
    low an order and distortion that the parameters take up (`half_widths`).
    """

    def __init__(
        self,
        record: IOData,
        order: int = 8,
        nk: int = 1,
        *,
        gain: float | None = None,
        drift: float = 1e-3,
        false_alarms: float = 0.1,
    ) -> None:
        """Fit the calibration, and begin the recursion at its end.

        Args:
            record: Calibration: one input, one output, no change. Half a minute of a servo of 1 Hz suffices.
            order: Largest degree of F.
            nk: Delay in samples, at least 1.
            gain: Gain at 0 Hz where it is known, 1 for a position servo; by default that of the model.
            drift: Drift to be followed between changes: standard deviation of the bandwidth's relative change in a
                minute.
            false_alarms: Wanted false alarms per hour; dry friction raises more than normal errors would.

        Raises:
            SysidError: Several inputs or outputs, missing samples, a constant input, a short calibration, arguments out
                of range, a calibration without a bandwidth.
        """
        if not isinstance(record, IOData):
            raise SysidError(f"track takes one IOData record, got {type(record).__name__}")
        check_single_output([record])
        if record.nu != 1 or not np.isfinite(record.y).all():
            raise SysidError(f"{record.nu} inputs given, expected one, and no missing outputs")
        self.order = whole_number("order", order, 1, LAGS - 1)
        self._nk = whole_number("nk", nk, 1, LONGEST_DELAY)
        positive = "be positive", lambda value: 0.0 < value < np.inf
        self._gain = None if gain is None else real_number("gain", gain, *positive)
        drift = real_number("drift", drift, "lie between 1e-9 and 1e3", lambda value: 1e-9 <= value <= 1e3)
        # a rate that rounds to none or to all leaves no threshold
        reasonable = "lie between 1e-100 and 1e100", lambda value: 1e-100 <= value <= 1e100
        alarm_rate = real_number("false_alarms", false_alarms, *reasonable) / 3600.0
        least_samples = SHORTEST * (3 * min(self.order, 2) + 1)
        if len(record) < least_samples:
            raise SysidError(f"{len(record)} samples of calibration given, expected {least_samples} or more")
        warn_each(check_excitation([record], [2]), stacklevel=2)
        self.dt = record.dt
        # relative to the first sample: the constant of the model is then no large number
        self._zero = record.u[0, 0], record.y[0, 0]
        self._u, self._y = list(record.u[:, 0] - self._zero[0]), list(record.y[:, 0] - self._zero[1])
        self._begin, self._samples = 0, len(record)
        self._quantities = ServoQuantities(self._nk, self.dt, self._gain)
        fits = self._calibration_fits()
        fit = preferred(fits)
        value, gradients = self._quantities(fit.B, fit.F)
        if not np.isfinite(value).all():
            raise SysidError(
                "the model fitted to the calibration has no bandwidth: its gain does not fall through 0.707 of that at "
                "0 Hz, or of `gain`"
            )
        self._period = 0
        self._group: Repetition | None = None
        self._counts_order = False
        self._find_period()
        self._inflation = self._score_scatter(fit, gradients)
        self._scatter_of_long = self._inflation / self._plays(len(fit.errors))
        # variance of the relative bandwidth, which falls with time, against that by which it drifts in a minute
        unit_steps = gradients[0] @ fit.directions[: 2 * fit.order]
        relative_variance = self._inflation[0] * fit.variance * float(np.sum(unit_steps**2))
        memory = np.sqrt(relative_variance * len(record) * self.dt / (drift**2 / 60.0))
        self.memory = float(max(memory, PER_PARAMETER * len(fit.directions) * self.dt))
        self._rule = DirectionalForgetting(1.0 - min(self.dt / self.memory, 0.5))
        # a period of the bandwidth: shorter windows scatter more, longer ones notice later
        window = max(round(1.0 / np.exp(value[0]) / self.dt), 2)
        self._test = ChangeTest(fit.errors, fit.variance, window, alarm_rate, self.dt)
        self._calibration = len(record)
        self._longest = max(round(2.0 * self.memory / self.dt), self._calibration)
        self._begin_recursion(fits)

    def _calibration_fits(self) -> list[StretchFit]:
        """Fit models of each degree to the calibration stretch, after estimating the disturbance's colour from it."""
        u, y = np.array(self._u), np.array(self._y)
        highest = max(len(y) // SHORTEST // 3, 2)
        degrees = range(min(2, self.order), min(self.order, highest) + 1)
        white = preferred(fit_degrees(u, y, 0, degrees, self._nk, np.ones(1)))
        self._D = autoregression(white.errors, NOISE_ORDER, select=True)[0]
        return fit_degrees(u, y, 0, degrees, self._nk, self._D)

    def _begin_recursion(self, fits: list[StretchFit]) -> None:
        """Begin the recursion at the fits of the stretch that ends now."""
        length, fit = len(self._u) - self._begin, preferred(fits)
        self._fit: StretchFit | None = fit
        self._last = fit
        rows, errors = gradient_rows(np.array(self._u), np.array(self._y), self._begin, self._nk, fit.B, fit.F)
        self._row = rows[-1].copy()
        self._rows = np.column_stack((rows, errors))[-len(self._D) :]
        self._directions, self._offset = fit.directions, np.concatenate((np.zeros(2 * fit.order), fit.nuisance))
        # steps of one standard deviation, independent and of unit variance
        unit = np.eye(fit.directions.shape[1])
        self._delta, self._memory, self._Pi = np.zeros(len(unit)), self._rule.enter(unit), fit.variance * unit
        self._gradients = self._quantities(fit.B, fit.F)[1]
        self._value, self._between = self._average_models(fits, fit)
        # beyond the longest stretch, half of it must be new
        self._due = round(GROWTH * length) if length < self._longest else length + self._longest // 2

    def _average_models(self, fits: list[StretchFit], fit: StretchFit) -> tuple[FloatArray, FloatArray]:
        """Mean of log bandwidth and delay over the models (2,), and the excess of its variance over that of `fit` (2,).

        The deviation of the mean is the mean of sqrt(variance + (value - mean)^2) [Buckland1997].
        """
        weights, values, variances = [], [], []
        variance_of_fit = np.zeros(2)
        for candidate, weight in zip(fits, model_weights(fits), strict=True):
            value, gradients = self._quantities(candidate.B, candidate.F)
            if not np.isfinite(value).all():
                continue
            unit_steps = gradients @ candidate.directions[: 2 * candidate.order]
            variance = candidate.variance * (unit_steps**2).sum(axis=1)
            weights.append(weight)
            values.append(value)
            variances.append(variance)
            if candidate is fit:
                variance_of_fit = variance
        if not values:
            return np.full(2, np.nan), np.zeros(2)
        shares = np.array(weights)[:, None] / sum(weights)
        mean = (shares * values).sum(axis=0)
        if self._counts_order:
            return mean, np.zeros(2)
        spread = self._inflation * np.array(variances) + (np.array(values) - mean) ** 2
        deviation = (shares * np.sqrt(spread)).sum(axis=0)
        return mean, np.maximum(deviation**2 - self._inflation * variance_of_fit, 0.0)

    def _score_scatter(self, fit: StretchFit, gradients: FloatArray) -> FloatArray:
        """Scatter over blocks of the scores of bandwidth and delay, over that of white errors (2,)."""
        along = gradients @ fit.directions[: 2 * fit.order]
        scores = fit.gradients @ (fit.directions @ along.T) * fit.errors[:, None]
        sums = self._block_sums(scores)
        # the scores are those of steps of unit variance: over the stretch, white errors give this sum of squares
        white = fit.variance * (along**2).sum(axis=1) + np.finfo(float).tiny
        scatter = np.maximum((sums**2).sum(axis=0) / white * BLOCKS / (BLOCKS - 1), LEAST_SCATTER)
        self._counts_order = False
        if self._group is None:
            return np.asarray(scatter)
        stretch = np.array(self._u), np.array(self._y), self._begin
        half = half_widths(fit, stretch, self._group, self._quantities)
        if half is None:
            return np.asarray(scatter)
        # too low an order is in these already: what models of other degrees differ by is not added
        self._counts_order = True
        return np.asarray(np.maximum(scatter, (half / STUDENT_95) ** 2 / white))

    def _block_sums(self, scores: FloatArray) -> FloatArray:
        """Sums of the scores (rows, 2) over ten blocks: parts of the stretch, or of the period of the input."""
        rows = len(scores)
        if not 0 < self._period < rows:
            size = rows // BLOCKS
            return np.asarray(scores[: BLOCKS * size].reshape(BLOCKS, size, 2).sum(axis=1))
        block = np.arange(rows) % self._period * BLOCKS // self._period
        return np.column_stack([np.bincount(block, column, BLOCKS) for column in scores.T])

    def _plays(self, rows: int) -> float:
        """How often a stretch plays the period of the input; 1 where it does not repeat."""
        return max(rows / self._period, 1.0) if self._period else 1.0

    def _find_period(self) -> None:
        """Find the period of the input in the stretch, samples, 0 where it does not repeat, and its plays.

        A stretch too short to show one is taken to continue with the last that was found.
        """
        u = np.array(self._u[self._begin :])
        found = repetitions([IOData(u, u, self.dt)])
        self._group = found[0] if found else None
        if found:
            self._period = found[0].period
        elif len(u) >= 2 * self._period:
            self._period = 0

    def step(self, u: float, y: float) -> TrackSample:
        """Take one more sample of input and output.

        Raises:
            SysidError: A sample that is no number, not finite, or beyond 1e60.
        """
        finite = "be finite, at most 1e60", lambda value: abs(value) <= 1e60
        u, y = real_number("u", u, *finite), real_number("y", y, *finite)
        self._u.append(u - self._zero[0])
        self._y.append(y - self._zero[1])
        self._samples += 1
        change = None if self._fit is None else self._recursion_step(self._fit)
        if len(self._u) - self._begin >= self._due:
            self._refit()
        return self._newest_estimates(change)

    @property
    def parameters(self) -> FloatArray:
        """Present b1..bn, f1..fn (2n,); empty after an alarm until enough data follow."""
        if self._fit is None:
            return np.zeros(0)
        change = self._directions[: 2 * self._fit.order] @ self._delta
        return np.concatenate((self._fit.B, self._fit.F[1:])) + change

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters (2n, 2n), scaled as that of the bandwidth."""
        count = 0 if self._fit is None else 2 * self._fit.order
        directions = self._directions[:count]
        return np.asarray(self._inflation[0] * directions @ self._Pi @ directions.T)

    def _recursion_step(self, fit: StretchFit) -> Change | None:
        """One step of the recursion; the change if the sample reveals one."""
        self._enter_sample(fit)
        white = self._D[::-1] @ self._rows
        # in steps of one standard deviation the recursion is well conditioned, however nearly poles and zeros cancel
        psi = self._directions.T @ white[:-1]
        error = float(white[-1] - white[:-1] @ self._offset - psi @ self._delta)
        gain, self._memory = self._rule.step(self._memory, psi, 0)
        self._delta = self._delta + gain * error
        # (I - L psi') Pi (I - L psi')' + variance L L', multiplied out
        spread = self._Pi @ psi
        by_gain = gain[:, None] * ((float(psi @ spread) + fit.variance) * gain - spread)
        self._Pi = self._Pi + by_gain - spread[:, None] * gain
        return self._detected_change(error, fit)

    def _enter_sample(self, fit: StretchFit) -> None:
        """Shift the gradients of the prediction by the newest sample, as `gradient_rows` computes them.

        They are n lags each of u/F, -B u/F^2 and the free response; a recursion by F gives the first of each.
        """
        n, row, F = fit.order, self._row, fit.F[1:]
        inputs, by_f, free = row[:n], row[n : 2 * n], row[2 * n : 3 * n]
        first_input = self._u[-1 - self._nk] - F @ inputs
        first_by_f = F @ -by_f - fit.B @ inputs
        first_free = -(F @ free)
        row[1 : 3 * n] = row[: 3 * n - 1]
        row[[0, n, 2 * n]] = first_input, first_by_f, first_free
        self._rows[:-1] = self._rows[1:]
        self._rows[-1, :-1], self._rows[-1, -1] = row, self._y[-1] - fit.B @ row[:n]

    def _detected_change(self, error: float, fit: StretchFit) -> Change | None:
        """Update the test for a change of the system with a prediction error; a detected change ends the stretch."""
        statistic = self._test.update(error, fit.variance)
        length, parameters = len(self._u) - self._begin, 3 * fit.order + 1
        threshold = self._test.threshold(length, parameters)
        if statistic < threshold or length < ARMED * PER_PARAMETER * parameters:
            return None
        time = (self._samples - 1) * self.dt
        change = Change(time - self._test.age(fit.variance) * self.dt, time, statistic, threshold)
        self._fit = None
        self._begin = len(self._u)
        self._due = PER_PARAMETER * parameters
        return change

    def _refit(self) -> None:
        """Fit the stretch anew, at most twice the memory, and begin the recursion there."""
        self._begin = max(self._begin, len(self._u) - self._longest)
        unused = max(self._begin - round(HISTORY / self.dt), 0)
        del self._u[:unused], self._y[:unused]
        self._begin -= unused
        degree = self._last.order
        degrees = range(max(degree - AROUND, min(2, self.order)), min(degree + AROUND, self.order) + 1)
        fits = fit_degrees(np.array(self._u), np.array(self._y), self._begin, degrees, self._nk, self._D, self._fit)
        if self._fit is None:
            self._test.restart()
        fit = preferred(fits)
        self._test.learn(fit.errors, fit.variance)
        gradients = self._quantities(fit.B, fit.F)[1]
        if np.isfinite(gradients).all():
            self._find_period()
            scatter, plays = self._score_scatter(fit, gradients), self._plays(len(fit.errors))
            if len(self._u) - self._begin >= self._calibration:
                # of a single play: in a stretch of several their errors add up
                self._scatter_of_long = scatter / plays
            self._inflation = np.maximum(scatter, self._scatter_of_long * plays)
        self._begin_recursion(fits)

    def _newest_estimates(self, change: Change | None) -> TrackSample:
        """Estimates after the newest sample."""
        time, unknown = (self._samples - 1) * self.dt, (np.nan, np.nan)
        if self._fit is None:
            return TrackSample(time, np.nan, unknown, np.nan, unknown, change, False)
        # linear in the parameters as the recursion is: where poles and zeros nearly cancel, they move far together
        along = self._gradients @ self._directions[: 2 * self._fit.order]
        log_f, delay = self._value + along @ self._delta
        variances = np.maximum(np.einsum("ij,jk,ik->i", along, self._Pi, along), 0.0)
        log_f_reach, delay_reach = STUDENT_95 * np.sqrt(self._inflation * variances + self._between)
        # nothing is seen above half the sampling frequency, nor below the grid
        lowest, highest = LOWEST / self.dt, 0.5 / self.dt
        limits = (np.log(lowest), 0.0), (np.log(highest), WIDEST)
        f, factor = np.exp(np.clip((log_f, log_f_reach), *limits)).tolist()
        f_interval = f / factor, min(f * factor, highest)
        delay_interval = float(delay - delay_reach), float(delay + delay_reach)
        return TrackSample(time, f, f_interval, float(delay), delay_interval, change, True)
