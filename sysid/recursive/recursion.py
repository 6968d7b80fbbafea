"""The recursion behind `rarx`, `rarmax` and `roe`: prediction errors, sample by sample.

Regressors are lags of outputs and inputs, and of signals that the model generates: its errors (ARMAX) or its
simulated outputs (OE). The gradient consists of the same regressors, filtered by the present 1/C or 1/F [Ljung1999,
sec. 11.4].
"""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.prediction_error import linearise
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.recursive.adaptation import Adaptation, Forgetting, Gradient
from sysid.recursive.initial_state import Channel, Start, regressed_channels, stable, starting_state
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState

HALVINGS = 12  # limit on the halvings of a step that would make the predictor unstable
OFF = 20.0  # N dV / V, beyond one per parameter, above which a recursion is reported as far from the minimum
FAR = 1e12  # prediction error, relative to the largest output, at which the recursion is stopped as divergent
WOUND_UP = 1e50  # growth of the memory of the rule (a square root of P for least squares) at which it is stopped
LOOK = 16  # samples between two checks of the memory, which cost as much as a step
QUIET = 1e-20  # sum of squares, relative to that of the output, below which the fit is exact


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
    channels = regressed_channels(data, orders)
    state = starting_state(data, orders, channels, rule, origin, P0)

    y, samples = data.y[:, 0], len(data)
    first = max(data.window, orders.first_row(0) - state.samples)
    denominators = {c.denominator for c in channels}
    entering, tails = [], []
    for c, tail in zip(channels, state.tails, strict=True):
        delayed = np.concatenate((tail, c.signal)) if c.signal is not None else np.zeros(samples)
        entering.append(delayed[:samples].tolist())
        tails.append(delayed[samples:])
    theta, memory, phi, psi = (np.array(part) for part in (state.theta, state.memory, state.phi, state.psi))
    filters = [part.tolist() for part in state.filters]
    generated = list(state.generated)
    squares, weight, energy = state.squares, state.weight, state.energy
    steps, shortened = state.steps, state.shortened
    trajectory = np.empty((samples, orders.count))
    predicted, residuals = np.full((samples, 1), np.nan), np.zeros((samples, 1))
    largest, unit = float(np.abs(y).max()) or 1.0, float(np.abs(memory).max()) or 1.0
    for t in range(samples):
        phi[1:], psi[1:] = phi[:-1].copy(), psi[:-1].copy()
        for c, own, past, known in zip(channels, generated, filters, entering, strict=True):
            value = filtered = own if c.signal is None else known[t]
            if past:
                coefficients = theta[c.denominator[0] : c.denominator[1]].tolist()
                filtered -= sum(f * x for f, x in zip(coefficients, past, strict=True))
                past.insert(0, filtered)
                past.pop()
            phi[c.place.start], psi[c.place.start] = c.sign * value, c.sign * filtered
        after = 0.0
        if t >= first:
            predicted[t] = phi @ theta
            error = float(y[t] - predicted[t, 0])
            gain, memory = rule.step(memory, psi, steps)
            wound_up = t % LOOK == 0 and not float(np.abs(memory).max()) < WOUND_UP * unit
            if wound_up or not abs(error) < FAR * largest:
                raise _divergence(method, rule, t, error)
            step = gain * error
            halvings = 0
            while halvings < HALVINGS and not stable(theta + step, denominators):
                step = 0.5 * step
                halvings += 1
            shortened += halvings > 0
            if halvings < HALVINGS:
                theta = theta + step
            residuals[t] = error
            after = float(y[t] - phi @ theta)
            # for least squares, the sum of prior times posterior errors is the sum of squares of the whole fit
            decay = rule.decay(steps)
            squares = decay * squares + error * after
            weight = decay * weight + 1.0
            energy += float(psi @ psi)
            steps += 1
        trajectory[t] = theta
        # with a single path, its output before the first prediction is measured: a better start than zero
        output = float(y[t]) if t < first and len(orders.nb) == 1 else None
        generated = [_simulated(phi, theta, c, output) if c.paths else after for c in channels]
    end = replace(
        state,
        theta=theta,
        memory=memory,
        phi=phi,
        psi=psi,
        filters=tuple(np.array(part) for part in filters),
        generated=tuple(generated),
        tails=tuple(tails),
        samples=state.samples + samples,
        steps=steps,
        squares=squares,
        weight=weight,
        energy=energy,
        shortened=shortened,
    )
    variance = max(squares, 0.0) / max(weight - orders.count, 1.0)
    nonlinear = orders.nc > 0 or any(orders.nf)
    left = _promised_decrease([data], orders, theta) if nonlinear and not resumes else np.nan
    if left > OFF + orders.count and not rule.forgets:
        messages.append(
            f"after {steps} steps {method} is still far from the minimum: one Gauss-Newton step on the whole record "
            f"promises N dV/V = {left:.3g}; use start={method[1:]}(data[:n], ...), an estimate from the first "
            "samples, or a longer record"
        )
        warnings.warn(messages[-1], SysidWarning, stacklevel=3)
    P = end.scaled_covariance
    final = make_estimate(
        method,
        [data],
        orders,
        orders.select(*order_values),
        theta=theta,
        covariance=rule.covariance(P, energy / max(steps, 1), variance, steps),
        variance=variance,
        diagnostics={"adaptation": rule, "shortened": shortened, "steps": steps, "left": left},
        messages=messages,
    )
    return RecursiveEstimate(trajectory, orders.names, predicted, residuals, P, final, end, shortened)


def _divergence(method: str, rule: Adaptation, t: int, error: float) -> SysidError:
    if rule.forgets and not isinstance(rule, Gradient):
        remedy = "P winds up without excitation: use a larger forgetting factor, or a smaller R1"
    else:
        remedy = "the steps are too long: use a smaller gain, or a smaller P0"
    return SysidError(f"{method} diverges at sample {t} (prediction error {error:.3g}): {remedy}")


def _simulated(phi: FloatArray, theta: FloatArray, channel: Channel, output: float | None) -> float:
    return sum(float(phi[s] @ theta[s]) for s in channel.paths) if output is None else output


def _promised_decrease(experiments: list[IOData], orders: Orders, theta: FloatArray) -> float:
    """N dV / V of one Gauss-Newton step on the whole record."""
    at = linearise(experiments, orders, theta)
    directions, values, _ = np.linalg.svd(at.triangle)
    g = directions.T @ at.target
    known = values > 1e-13 * values.max(initial=0.0)
    energy = sum(float(np.sum(e.y**2)) for e in experiments)
    return at.errors * float(g[known] @ g[known]) / at.cost if at.cost > QUIET * energy else 0.0
