"""The recursion behind `rarx`, `rarmax` and `roe`: prediction errors, sample by sample.

Regressors are lags of outputs and inputs, and of signals that the model generates: its errors (ARMAX) or its
simulated outputs (OE). The gradient consists of the same regressors, filtered by the present 1/C or 1/F [Ljung1999,
sec. 11.4].
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.repeated_errors import repeated_in_weighted_sum
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.interval_warnings import interval_messages
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.prediction_error import SIGNIFICANT, linearise
from sysid.polynomial.rounding import rounding_messages
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.repetition import repetitions
from sysid.records.singular_values import svd
from sysid.recursive.adaptation import Adaptation, Forgetting, Gradient
from sysid.recursive.error_weights import error_weights
from sysid.recursive.initial_state import Channel, Start, has_stable_denominators, regressed_channels, starting_state
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState

HALVINGS = 12  # limit on the halvings of a step that would make the predictor unstable
OFF = 20.0  # N dV / V, beyond one per parameter, above which a recursion is reported as far from the minimum
FAR = 1e12  # prediction error, relative to the largest output, at which the recursion is stopped as divergent
WOUND_UP = 1e50  # growth of the memory of the rule (a square root of P for least squares) at which it is stopped
LOOK = 16  # samples between two checks of the memory, which cost as much as a step
SAME_SEQUENCE_BEFORE = (
    "errors repeat with the input: intervals take those of the start as independent of them, and are too narrow if its "
    "record plays the same sequence"
)
NOISE_FREE = 1e-20  # sum of squares, relative to that of the output, below which the fit is exact


def recurse(
    method: str,
    data: IOData,
    order_values: Mapping[str, Any],
    default: Adaptation,
    *,
    adaptation: Adaptation | None,
    start: Start,
    P0: ArrayLike | None,
) -> RecursiveEstimate:
    """Estimate ARX, ARMAX or OE parameters along a record of one output, the orders by name.

    A step that would make C or an F unstable is halved until it does not. `default` is the rule of a recursion from
    zero or from parameters; see `rarx` for the other arguments.
    """
    if not isinstance(data, IOData):
        raise SysidError(f"recursive estimators take one IOData record, got {type(data).__name__}")
    as_experiments(data)
    check_single_output([data])
    orders = make_orders(data.nu, **order_values)
    origin = start.state if isinstance(start, RecursiveEstimate) else start
    resumes = isinstance(origin, RecursiveState)
    messages: list[str] = []
    if not resumes:
        # a further part of a record may be short and its input constant: no checks there
        messages += check_excitation([data], orders.nb)
        check_enough_data([data], orders, transients=0)
        messages += check_means([data], max(orders.na, *orders.nf))
        warn_each(messages, stacklevel=2)
    rule = _adaptation_rule(origin, default, adaptation)
    channels = regressed_channels(data, orders)
    state = starting_state(data, orders, channels, rule, origin, P0)
    recursion = Recursion(method, state, channels, data)
    trajectory = np.empty((len(data), orders.count))
    for t in range(len(data)):
        recursion.take_sample(t)
        trajectory[t] = recursion.theta

    end = recursion.state()
    before = sum(start.data.samples) if isinstance(start, Estimate) else 0
    final = _last_estimate(method, data, order_values, end, messages, resumes, before)
    final = _count_repetition_once(final, data, recursion)
    if "periods" in final.diagnostics and isinstance(start, Estimate | RecursiveEstimate | RecursiveState):
        warnings.warn(SAME_SEQUENCE_BEFORE, SysidWarning, stacklevel=3)
        told = (*final.diagnostics["warnings"], SAME_SEQUENCE_BEFORE)
        final = replace(final, diagnostics={**final.diagnostics, "warnings": told})
    return RecursiveEstimate(
        trajectory,
        orders.names,
        recursion.predicted,
        recursion.residuals,
        end.scaled_covariance,
        final,
        end,
        end.shortened,
    )


def _last_estimate(
    method: str,
    data: IOData,
    order_values: Mapping[str, Any],
    end: RecursiveState,
    messages: list[str],
    resumes: bool,
    before: int,
) -> Estimate:
    """The last parameters as an estimate, with warnings of their distance to the minimum and of their intervals.

    `before` is the number of samples behind an estimate as start.
    """
    orders, rule = end.orders, end.adaptation
    variance = max(end.squares, 0.0) / max(end.weight - orders.count, 1.0)
    covariance = rule.covariance(end.scaled_covariance, end.energy / max(end.steps, 1), variance, end.steps)
    nonlinear = orders.nc > 0 or any(orders.nf)
    left = _promised_decrease([data], orders, end.theta) if nonlinear and not resumes else np.nan
    doubts = []
    if left > OFF + orders.count and not rule.forgets:
        doubts.append(
            f"after {end.steps} steps {method} is still far from the minimum: one Gauss-Newton step on the whole "
            f"record promises N dV/V = {left:.3g}; use start={method[1:]}(data[:n], ...), an estimate from the first "
            "samples, or a longer record"
        )
    if not (resumes or rule.forgets):
        if nonlinear:
            doubts += interval_messages(orders, end.theta, end.steps + before, covariance)
        else:
            doubts += rounding_messages([data], orders, end.theta, covariance, variance)
    warn_each(doubts, stacklevel=3)
    return make_estimate(
        method,
        [data],
        orders,
        orders.select(*order_values),
        theta=end.theta,
        covariance=covariance,
        variance=variance,
        diagnostics={"adaptation": rule, "shortened": end.shortened, "steps": end.steps, "left": left},
        messages=[*messages, *doubts],
        repetition_counted=True,
    )


def _count_repetition_once(final: Estimate, data: IOData, recursion: "Recursion") -> Estimate:
    """Widen the covariance of the last parameters where their errors repeat with the input of this record."""
    if not repetitions([data]):
        return final
    weights = error_weights(recursion.gains, recursion.gradients)
    errors = final.residuals[:, 0].copy()
    errors[~weights.any(axis=1)] = 0.0
    repeated = repeated_in_weighted_sum([data], [weights], [errors], final.covariance)
    if repeated is None:
        return final
    diagnostics = {**repeated[1].diagnostics, "covariance_of_independent_errors": final.covariance}
    return replace(final, covariance=final.covariance + repeated[0], diagnostics={**final.diagnostics, **diagnostics})


def _adaptation_rule(origin: Start, default: Adaptation, adaptation: Adaptation | None) -> Adaptation:
    """Rule of a recursion: the one asked for, else that of the recursion it continues, else the default."""
    if isinstance(origin, RecursiveState):
        default = origin.adaptation
    elif isinstance(origin, Estimate):
        # no initial forgetting: the covariance is valid
        default = Forgetting(1.0)
    rule = default if adaptation is None else adaptation
    if not isinstance(rule, Adaptation):
        raise SysidError(
            f"adaptation must be a rule such as Forgetting(0.99), Kalman(1e-4) or Gradient(0.1), got {shown(rule)}"
        )
    return rule


class Recursion:
    """A recursion along a record: a `RecursiveState` that every sample changes.

    Attributes:
        theta: Present parameters (p,).
        predicted: Predictions so far (N, 1), NaN where there is none.
        residuals: Prediction errors so far (N, 1), zero where there is none.
        gains: Gain of every step so far (N, p), zero where there is none.
        gradients: Gradients psi, likewise.
    """

    def __init__(self, method: str, state: RecursiveState, channels: Sequence[Channel], data: IOData) -> None:
        """Begin at a state before the first sample of a record; the channels are those of its regressors."""
        self._method, self._begin, self._channels = method, state, channels
        self._rule, self._y = state.adaptation, data.y[:, 0]
        # the first prediction needs samples from before it, of this record or of the earlier one
        self._first = max(data.window, state.orders.first_row(0) - state.samples)
        self._denominators = {channel.denominator for channel in channels}
        self._entering, self._tails = _delayed_signals(channels, state.tails, len(data))
        self.theta, self._memory = np.array(state.theta), np.array(state.memory)
        self._phi, self._psi = np.array(state.phi), np.array(state.psi)
        self._filters = [past.tolist() for past in state.filters]
        self._generated = list(state.generated)
        self._squares, self._weight, self._energy = state.squares, state.weight, state.energy
        self._steps, self._shortened = state.steps, state.shortened
        self.predicted, self.residuals = np.full((len(data), 1), np.nan), np.zeros((len(data), 1))
        self.gains, self.gradients = np.zeros((2, len(data), len(self.theta)))
        self._error_limit = FAR * (float(np.abs(self._y).max()) or 1.0)
        self._memory_limit = WOUND_UP * (float(np.abs(self._memory).max()) or 1.0)

    def take_sample(self, t: int) -> None:
        """Predict a sample of the output, correct the parameters by the error, and generate the model's signals."""
        self._enter_regressors(t)
        posterior_error = 0.0
        # with a single path, its output before the first prediction is measured: a better start than zero
        measured_output = None
        if t >= self._first:
            posterior_error = self._correct(t)
        elif len(self._begin.orders.nb) == 1:
            measured_output = float(self._y[t])
        for k, channel in enumerate(self._channels):
            if not channel.paths:
                self._generated[k] = posterior_error
            elif measured_output is not None:
                self._generated[k] = measured_output
            else:
                self._generated[k] = sum(float(self._phi[path] @ self.theta[path]) for path in channel.paths)

    def _enter_regressors(self, t: int) -> None:
        """Shift the regressors by a sample, and their gradients, which are filtered by the present 1/C or 1/F."""
        phi, psi = self._phi, self._psi
        phi[1:], psi[1:] = phi[:-1].copy(), psi[:-1].copy()
        by_channel = zip(self._channels, self._generated, self._filters, self._entering, strict=True)
        for channel, generated, past, measured in by_channel:
            value = filtered = generated if channel.signal is None else measured[t]
            # numbers one by one: for so few of them, arrays are slower
            if past:
                begin, end = channel.denominator
                coefficients = self.theta[begin:end].tolist()
                filtered -= sum(f * x for f, x in zip(coefficients, past, strict=True))
                past.insert(0, filtered)
                past.pop()
            phi[channel.place.start] = channel.sign * value
            psi[channel.place.start] = channel.sign * filtered

    def _correct(self, t: int) -> float:
        """Correct the parameters by the prediction error of a sample; the error with the new parameters."""
        phi, psi, rule, theta = self._phi, self._psi, self._rule, self.theta
        predicted = phi @ theta
        error = float(self._y[t] - predicted)
        gain, self._memory = rule.step(self._memory, psi, self._steps)
        wound_up = t % LOOK == 0 and not float(np.abs(self._memory).max()) < self._memory_limit
        if wound_up or not abs(error) < self._error_limit:
            raise _divergence_error(self._method, rule, t, error)
        step = gain * error
        halvings = 0
        while halvings < HALVINGS and not has_stable_denominators(theta + step, self._denominators):
            step = 0.5 * step
            halvings += 1
        self._shortened += halvings > 0
        if halvings < HALVINGS:
            theta = theta + step
            self.gains[t], self.gradients[t] = 0.5**halvings * gain, psi
        self.theta, self.predicted[t], self.residuals[t] = theta, predicted, error
        posterior_error = float(self._y[t] - phi @ theta)
        # for least squares, the sum of prior times posterior errors is the sum of squares of the whole fit
        decay = rule.decay(self._steps)
        self._squares = decay * self._squares + error * posterior_error
        self._weight = decay * self._weight + 1.0
        self._energy += float(psi @ psi)
        self._steps += 1
        return posterior_error

    def state(self) -> RecursiveState:
        """State after the last sample of the record."""
        return replace(
            self._begin,
            theta=self.theta,
            memory=self._memory,
            phi=self._phi,
            psi=self._psi,
            filters=tuple(np.array(past) for past in self._filters),
            generated=tuple(self._generated),
            tails=tuple(self._tails),
            samples=self._begin.samples + len(self._y),
            steps=self._steps,
            squares=self._squares,
            weight=self._weight,
            energy=self._energy,
            shortened=self._shortened,
        )


def _delayed_signals(
    channels: Sequence[Channel], tails: Sequence[FloatArray], samples: int
) -> tuple[list[list[float]], list[FloatArray]]:
    """Signal of each channel with its delay, and its last samples, which enter after the end of the record."""
    entering, remaining = [], []
    for channel, tail in zip(channels, tails, strict=True):
        signal = np.zeros(samples) if channel.signal is None else np.concatenate((tail, channel.signal))
        entering.append(signal[:samples].tolist())
        remaining.append(signal[samples:])
    return entering, remaining


def _divergence_error(method: str, rule: Adaptation, t: int, error: float) -> SysidError:
    """Exception for a recursion that diverges, with a remedy."""
    if rule.forgets and not isinstance(rule, Gradient):
        remedy = "P winds up without excitation: use a larger forgetting factor, or a smaller R1"
    else:
        remedy = "the steps are too long: use a smaller gain, or a smaller P0"
    return SysidError(f"{method} diverges at sample {t} (prediction error {error:.3g}): {remedy}")


def _promised_decrease(experiments: list[IOData], orders: Orders, theta: FloatArray) -> float:
    """N dV / V of one Gauss-Newton step on the whole record."""
    at = linearise(experiments, orders, theta)
    directions, values, _ = svd(at.triangle)
    along_directions = directions.T @ at.target
    # directions that rounding alone determines promise nothing
    g = along_directions[values > SIGNIFICANT * values.max(initial=0.0)]
    energy = sum(float(np.sum(e.y**2)) for e in experiments)
    return at.errors * float(g @ g) / at.cost if at.cost > NOISE_FREE * energy else 0.0
