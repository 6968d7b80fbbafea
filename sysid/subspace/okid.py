"""Observer/Kalman filter identification."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.predict import predict, residuals
from sysid.models.recursion import free_response
from sysid.models.repeated_errors import (
    RepeatedErrors,
    beyond_independent,
    mean_period,
    repeated_errors,
    sum_over_periods,
)
from sysid.models.state_space import StateSpace
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import LeastSquares
from sysid.records.arguments import function, truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import Message, SysidError, SysidWarning, warn_each
from sysid.records.trends import ROUNDING
from sysid.subspace.era import Realisation, era
from sysid.subspace.observer_gain import deadbeat_gain, spectral_radius, stable_gain
from sysid.subspace.observer_regression import ObserverRegression
from sysid.subspace.predictor import Scales
from sysid.subspace.predictor_estimate import RealiseLocally
from sysid.validation.compare import fit_percent

CHECKED = 800  # samples of each experiment whose fit is checked: as informative as all, and cheap
WORTHLESS = -5.0  # fit in simulation, percent; below 0, since strong noise may make a good fit slightly negative
LARGEST_HANKEL = 2.5e7  # entries of the Hankel matrix, 200 MB
N4SID_ADVICE = " or n4sid(data, order, stable=True)"  # the advice that names a call in Python
LARGEST_MARKOV = 1e120  # magnitude: products of larger ones overflow
AMPLE = 8  # samples per coefficient above which a larger p can help an unstable model
LARGEST_COVARIANCE = 4000  # observer parameters with a covariance, 128 MB: intervals of more would take many minutes


class Realiser(Protocol):
    """Realisation of a model from Markov parameters: `era` or `era_dc`."""

    def __call__(self, markov: FloatArray, order: int, *, dt: float) -> Realisation:
        """Realise `order` states from Markov parameters (K, ny, nu)."""
        ...


@dataclass(frozen=True)
class Realise:
    """Pure function from observer Markov parameters to the model.

    Attributes:
        p: Number of observer Markov parameters.
        order: Number of states.
        count: Number of Markov parameters to realise from.
        direct: Whether D is estimated.
        realiser: `era` or `era_dc`.
        input_scale: Inputs are divided by it (nu,).
        output_scale: Outputs are divided by it (ny,).
        data: Sampling interval and names.
        covariance: Innovation covariance for the model, in output units squared (ny, ny).
        deadbeat: Whether the gain is that of a deadbeat observer.
    """

    p: int
    order: int
    count: int
    direct: bool
    realiser: Callable[..., Realisation]
    input_scale: FloatArray
    output_scale: FloatArray
    data: DataSummary
    covariance: FloatArray
    deadbeat: bool = False

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for observer Markov parameters, flattened output by output."""
        with warnings.catch_warnings():
            # the estimate itself has warned of a reduced order
            warnings.simplefilter("ignore", SysidWarning)
            system, gain = self.markov(theta)
            return self.model(self.realisation(system), gain)

    def markov(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Markov parameters of system and gain by recursion [Juang1993].

        D, CB, CAB, ... (K, ny, nu), and CK, CAK, ... of the innovation gain K = -G (K - 1, ny, ny).
        """
        direct, from_u, from_y = self.blocks(theta)
        ny, nu = direct.shape
        y = np.zeros((self.count, ny, nu + ny))
        # the sequence of the gain starts at k = 1
        y[0, :, :nu] = direct
        observer_markov = np.concatenate((from_u, from_y), axis=2)
        for k in range(1, self.count):
            past = min(k, self.p)
            latest_first = y[k - past : k][::-1]
            y[k] = np.einsum("iab,ibc->ac", from_y[:past], latest_first)
            if k <= self.p:
                y[k] += observer_markov[k - 1]
        return y[:, :, :nu], y[1:, :, nu:]

    def blocks(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """D (ny, nu), coefficients of u(t-i) (p, ny, nu) and of y(t-i) (p, ny, ny)."""
        nu, ny = len(self.input_scale), len(self.output_scale)
        table = theta.reshape(ny, -1)
        if self.direct:
            direct, lagged = table[:, :nu], table[:, nu:]
        else:
            direct, lagged = np.zeros((ny, nu)), table
        by_lag = lagged.reshape(ny, self.p, nu + ny).transpose(1, 0, 2)
        return direct, by_lag[:, :, :nu], by_lag[:, :, nu:]

    def realisation(self, system: FloatArray) -> Realisation:
        """Realisation of the Markov parameters in scaled channels."""
        scaled = system * self.input_scale / self.output_scale[:, None]
        return self.realiser(scaled, self.order, dt=self.data.dt)

    def model(self, realised: Realisation, gain: FloatArray) -> StateSpace:
        """Undo the scaling, and add K [Juang1993]."""
        C = realised.model.C * self.output_scale[:, None]
        B = realised.model.B / self.input_scale
        D = realised.model.D * self.output_scale[:, None] / self.input_scale
        A = realised.model.A
        if self.deadbeat:
            K = deadbeat_gain(A, C)
        else:
            K = stable_gain(A, C, self.observer_gain(realised, gain), self.covariance)
        return StateSpace(
            realised.model.A,
            B,
            C,
            D,
            K,
            self.data.dt,
            self.covariance,
            **self.data.labels,
        )

    def observer_gain(self, realised: Realisation, gain: FloatArray) -> FloatArray:
        """K = -G by least squares on the observability matrix, in output units (n, ny)."""
        C = realised.model.C * self.output_scale[:, None]
        # rows that have died out carry no information on K
        observability = free_response(realised.model.A, C, len(gain))
        rows = len(observability)
        weighted = (observability / self.output_scale[:, None]).reshape(rows * len(C), -1)
        target = (gain[:rows] / self.output_scale[:, None]).reshape(rows * len(C), -1)
        return np.asarray(np.linalg.lstsq(weighted, target, rcond=None)[0], dtype=np.float64)


def okid(
    data: IOData | Sequence[IOData],
    order: int,
    *,
    p: int,
    realiser: Realiser = era,
    block_rows: int | None = None,
    normalise: bool = True,
    direct: bool = True,
    at_rest: bool = False,
    deadbeat: bool = False,
) -> Estimate:
    """Identify an observer, then the system behind it [Juang1993; Juang1992].

    Least squares y(t) = D u(t) + sum_i Ybar_i [u(t-i); y(t-i)], i = 1..p, without the first p samples, whose past is
    unknown; system and gain Markov parameters by recursion; a realisation of `order` states; K = -G. K is a Kalman gain
    only if the residuals are white. If it makes the predictor unstable (an order too small for the observer), the gain
    of the same disturbance spectrum with a stable predictor replaces it.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs and outputs. Equations with a
            missing output are omitted.
        order: Number of states.
        p: Number of observer Markov parameters; p * ny >= order.
        realiser: `era` or `era_dc`, or either with options fixed by `functools.partial`.
        block_rows: Block rows and columns of the Hankel matrix; by default max(40, p, 2 order).
        normalise: Whether to divide channels by their largest magnitude for the realisation, as SOCIT does.
        direct: Whether D is estimated; otherwise it is zero.
        at_rest: Whether every experiment starts at rest (all zero before its first sample): no sample is dropped.
        deadbeat: Whether K is the deadbeat gain of the model instead of the identified one; useful only without noise.

    Returns:
        The estimate. `parameters` and `covariance` are those of the observer Markov parameters, output by output; the
        covariance does not include the bias of too small a p. Beyond 4,000 of them, as many outputs make them,
        `parameters` are the entries of the predictor's matrices, and their covariance and all intervals are NaN
        (unknown). Diagnostics: `observer_markov_u`, `observer_markov_y`, `system_markov`, `gain_markov`,
        `hankel_singular_values`, `percent_described` (SOCIT's, of squared values), `percent_described_unsquared`,
        `modal_singular_values`.

    Raises:
        SysidError: Constant input, p * ny < order, too little data.

    Warns:
        SysidWarning: Poor excitation, rank deficient regressors, unstable model or predictor, a fit to the own data
            worse than their mean, unknown intervals.
    """
    experiments = as_experiments(data, missing=True)
    nu, ny = experiments[0].nu, experiments[0].ny
    flags = {"normalise": normalise, "direct": direct, "at_rest": at_rest, "deadbeat": deadbeat}
    normalise, direct, at_rest, deadbeat = (truth_value(name, value) for name, value in flags.items())
    function("realiser", realiser, "such as era or era_dc")
    order, p = whole_number("order", order, 1), whole_number("p", p, 1)
    if p * ny < order:
        raise SysidError(f"p * ny must be at least the order {order}: got p = {p} with {ny} output(s)")
    hankel_rows = _hankel_rows(block_rows, order, p, nu, ny)
    excited_lags = p + 1 if direct else p
    messages = check_excitation(experiments, [excited_lags] * nu)
    regression = ObserverRegression(experiments, int(p), direct, at_rest)
    rows = regression.rows()
    fit = regression.solve()
    variance = fit.residual_gram / (rows - regression.width)
    messages += fit.rank_message()

    input_scale, output_scale = _channel_scales(experiments, normalise)
    realise = Realise(
        p=int(p),
        order=int(order),
        count=2 * hankel_rows + 1,
        direct=direct,
        realiser=realiser,
        input_scale=input_scale,
        output_scale=output_scale,
        data=DataSummary.of(experiments),
        covariance=variance,
        deadbeat=deadbeat,
    )
    theta = fit.solution.T.ravel()
    # those of an unstable model grow from lag to lag
    with np.errstate(over="ignore", invalid="ignore"):
        system_markov, gain_markov = realise.markov(theta)
    _check_markov_parameters(system_markov, gain_markov)
    realised, rank_messages = _realised_with_messages(realise, system_markov)
    messages += rank_messages
    # perturbed parameters must not be realised at another order than the estimate
    realise = replace(realise, order=realised.model.order)
    model = realise.model(realised, gain_markov)
    messages += _stability_messages(model, realised, gain_markov, regression, realise)
    messages += _poor_fits(model, experiments)
    if len(theta) > LARGEST_COVARIANCE:
        messages.append(_too_many_parameters(regression, len(theta), order))
    warn_each(messages)
    diagnostics = {
        **_diagnostics(fit, realise, realised, system_markov, gain_markov),
        "warnings": tuple(messages),
    }
    return _make_estimate(model, experiments, regression, fit, realise, int(order), diagnostics)


def _check_markov_parameters(*sequences: FloatArray) -> None:
    """Refuse Markov parameters that overflow when squared, as their Hankel matrix is."""
    for sequence in sequences:
        if not (np.abs(sequence) < LARGEST_MARKOV).all():
            raise SysidError(
                "the Markov parameters overflow, as those of a model that is far from stable: expected a smaller p, "
                "more samples, or inputs that excite more"
            )


def _realised_with_messages(realise: Realise, system_markov: FloatArray) -> tuple[Realisation, list[str]]:
    """The realisation, and a warning of a lower order to be given with the others."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        realised = realise.realisation(system_markov)
    rank = realised.model.order
    if rank >= realise.order:
        return realised, []
    return realised, [
        f"the system Markov parameters have numerical rank {rank}: the model has that order instead of {realise.order}"
    ]


def _hankel_rows(asked: int | None, order: int, p: int, nu: int, ny: int) -> int:
    """Block rows and columns of the Hankel matrix, the default if none are asked for.

    Refuse a matrix that is too large for the memory, or too small for the order.
    """
    block_rows = max(40, p, 2 * order) if asked is None else whole_number("block_rows", asked, 1)
    if block_rows**2 * nu * ny > LARGEST_HANKEL:
        raise SysidError(
            f"block_rows = {block_rows} makes a Hankel matrix of {block_rows * ny} x {block_rows * nu} numbers, "
            f"expected {LARGEST_HANKEL:g} at most"
        )
    if block_rows * min(ny, nu) < order:
        raise SysidError(f"block_rows = {block_rows} is too small for order {order}")
    return block_rows


def _channel_scales(experiments: Sequence[IOData], normalise: bool) -> tuple[FloatArray, FloatArray]:
    """Largest magnitude of each input (nu,) and output (ny,), as SOCIT scales them; ones without `normalise`."""
    if not normalise:
        return np.ones(experiments[0].nu), np.ones(experiments[0].ny)
    inputs = np.max([np.abs(e.u).max(axis=0) for e in experiments], axis=0)
    outputs = np.max([np.nanmax(np.abs(e.y), axis=0) for e in experiments], axis=0)
    # a silent channel stays as it is
    return np.where(inputs > 0.0, inputs, 1.0), np.where(outputs > 0.0, outputs, 1.0)


def _diagnostics(
    fit: LeastSquares,
    realise: Realise,
    realised: Realisation,
    system_markov: FloatArray,
    gain_markov: FloatArray,
) -> dict[str, Any]:
    """Diagnostics of regression and realisation."""
    _, from_u, from_y = realise.blocks(fit.solution.T.ravel())
    return {
        "condition": fit.condition,
        "rank": fit.rank,
        "iterations": 0,
        "converged": True,
        "observer_markov_u": from_u,
        "observer_markov_y": from_y,
        "system_markov": system_markov,
        "gain_markov": gain_markov,
        "hankel_singular_values": realised.hankel_singular_values,
        "percent_described": realised.percent_described,
        "percent_described_unsquared": realised.percent_described_unsquared,
        "modal_singular_values": realised.modal_singular_values,
    }


def _stability_messages(
    model: StateSpace,
    realised: Realisation,
    gain_markov: FloatArray,
    regression: ObserverRegression,
    realise: Realise,
) -> list[str]:
    """Warnings of an unstable model, with a remedy, and of an unstable predictor."""
    messages: list[str] = []
    radius = spectral_radius(model.A)
    if radius >= 1.0:
        remedy = _remedy(regression, realise)
        text = f"the model is unstable: largest pole modulus {radius:.6g}; {remedy}"
        messages.append(Message(text, "unstable-model", stable=N4SID_ADVICE))
    identified_gain = model.gain if realise.deadbeat else realise.observer_gain(realised, gain_markov)
    return messages + _predictor_stability(model, spectral_radius(model.A - identified_gain @ model.C))


def _make_estimate(
    model: StateSpace,
    experiments: Sequence[IOData],
    regression: ObserverRegression,
    fit: LeastSquares,
    realise: Realise,
    order: int,
    diagnostics: Mapping[str, Any],
) -> Estimate:
    """Assemble the estimate; its parameters are the observer Markov parameters, unless they are too many."""
    theta = fit.solution.T.ravel()
    parameters, names = theta, regression.names(realise.data)
    to_model: Realise | RealiseLocally = realise
    if len(theta) <= LARGEST_COVARIANCE:
        covariance = np.asarray(np.kron(realise.covariance, fit.inverse_gram), dtype=np.float64)
        repeated = _repeated(regression, fit, realise.covariance)
        if repeated is not None:
            before = {"covariance_of_independent_errors": covariance}
            diagnostics = {**diagnostics, **repeated[1].diagnostics, **before}
            covariance = covariance + repeated[0]
    else:
        to_model = RealiseLocally.of_all_entries(model, Scales.of(experiments), realise.data)
        parameters = to_model.parameters
        names = tuple(f"entry{i + 1}" for i in range(len(parameters)))
        covariance = np.full((len(parameters),) * 2, np.nan)
    with warnings.catch_warnings():
        # reported by the estimator
        warnings.simplefilter("ignore", SysidWarning)
        errors = np.concatenate([residuals(model, e) for e in experiments])
    return Estimate(
        model=model,
        polynomials=None,
        parameters=parameters,
        parameter_names=names,
        covariance=covariance,
        noise_variance=realise.covariance,
        residuals=errors,
        method="okid",
        orders={"order": order, "p": realise.p},
        diagnostics=diagnostics,
        data=realise.data,
        realise=to_model,
    )


def _repeated(
    regression: ObserverRegression, fit: LeastSquares, innovation: FloatArray
) -> tuple[FloatArray, RepeatedErrors] | None:
    """What errors that repeat with the input add to the covariance of the parameters, output by output, and which.

    The covariance of independent errors is `innovation` (ny, ny).
    """
    errors = regression.errors(fit.solution)
    repeated = repeated_errors(regression.experiments, errors)
    if repeated is None or not repeated.is_significant:
        return None
    total: FloatArray | float = 0.0
    independent: FloatArray | float = 0.0
    for group in repeated.groups:
        # the equations of an output see the errors of that output alone
        weighted = regression.mean_regressors(group) @ fit.inverse_gram
        slopes = np.stack([np.kron(row, weighted) for row in np.eye(errors[0].shape[1])], axis=1)
        total = total + sum_over_periods(group, slopes, mean_period(group, errors))
        independent = independent + group.count * np.einsum("tiq,ij,tjr->qr", slopes, innovation, slopes)
    return beyond_independent(np.asarray(total), np.asarray(independent)), repeated


def _too_many_parameters(regression: ObserverRegression, count: int, order: int) -> str:
    """Warning that the intervals are unknown, with the largest p that keeps them if it suffices for the order."""
    first = regression.experiments[0]
    nu, ny, p = first.nu, first.ny, regression.p
    message = (
        f"{ny} outputs and p = {p} make {count} observer parameters; only up to {LARGEST_COVARIANCE} have a "
        "covariance: the intervals of this estimate are unknown"
    )
    per_output = LARGEST_COVARIANCE // ny
    if regression.direct:
        per_output -= nu
    largest_p = per_output // (nu + ny)
    return f"{message}; p = {largest_p} keeps them" if largest_p * ny >= order else message


def _poor_fits(model: StateSpace, experiments: Sequence[IOData]) -> list[str]:
    """Warning of outputs of the own data with a fit worse than that of their mean."""
    if not model.is_stable():
        return []
    experiments = [e[: e.window + CHECKED] for e in experiments]
    simulated = np.concatenate([predict(model, e, steps=None)[e.window :] for e in experiments])
    y = np.concatenate([e.y[e.window :] for e in experiments])
    # the fit of an output that does not vary is that of rounding
    varying = np.nanmax(y, axis=0) - np.nanmin(y, axis=0) > ROUNDING * np.nanmax(np.abs(y), axis=0)
    fits = fit_percent(y[:, varying], simulated[:, varying])
    varying_names = np.array(experiments[0].output_names)[varying]
    poor = [f"{name} {fit:.0f} %" for name, fit in zip(varying_names, fits, strict=True) if fit < WORTHLESS]
    if not poor:
        return []
    return [
        f"the simulated fit of the model to its own data is worse than that of their mean: {', '.join(poor)}; try "
        "another p or order, or remove the means by data.detrend()"
    ]


def _remedy(regression: ObserverRegression, realise: Realise) -> str:
    """Advice on an unstable model: a smaller p if it gives a stable one, as with few samples per coefficient."""
    rows, width = regression.rows(), regression.width
    for p in (regression.p // 2, regression.p // 4):
        # too few to hold the states
        if p * len(realise.output_scale) < realise.order:
            break
        theta = replace(regression, p=p).solve().solution.T.ravel()
        smaller = replace(realise, p=p)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            model = smaller.realisation(smaller.markov(theta)[0]).model
        if model.is_stable():
            return f"p = {p} gives a stable one (p = {regression.p} leaves {rows / width:.1f} samples per coefficient)"
    advice = "a larger p, another order" if rows > AMPLE * width else "more samples, another order"
    return f"try {advice}{N4SID_ADVICE}"


def _predictor_stability(model: StateSpace, observer: float) -> list[str]:
    """Warning of an unstable predictor, and what became of its gain."""
    if observer < 1.0:
        return []
    if spectral_radius(model.A - model.gain @ model.C) < 1.0:
        remedy = "replaced by the gain of the same disturbance spectrum with a stable predictor"
    else:
        remedy = "use the model for simulation only"
    return [f"K = -G makes the predictor unstable (A + G C has spectral radius {observer:.6g}): {remedy}"]
