"""ARX models by linear least squares."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.constraints import Constraint, FixedRows, fixed_coefficients
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.error_threshold import checked_error_threshold, huber_fit
from sysid.polynomial.focus import Focus, checked_focus
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import LeastSquares, solve, solve_triangle, triangle_of_blocks
from sysid.polynomial.orders import Orders, make_orders, orders_apart
from sysid.polynomial.polynomial_estimate import (
    check_enough_data,
    check_single_output,
    make_estimate,
    prediction_error_estimate,
    trend_diagnostics,
    trends_of_outputs,
)
from sysid.polynomial.regressors import arx_equations, complete_rows, equation_blocks
from sysid.polynomial.regularisation import Kernel, Posterior, checked_kernel, empirical_bayes, posterior_of_triangle
from sysid.polynomial.response_fits import arx_of_response
from sysid.polynomial.robust_covariance import sandwich
from sysid.polynomial.rounding import rounding_messages
from sysid.polynomial.trends import Levelled, equations_with_trends, trend_degree
from sysid.records.arguments import truth_value
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import Message, SysidError, warn_each

SIMULATION_STEPS = 100  # limit on those of the search with focus='simulation'
HYPER_PARAMETERS = 3  # of each block of coefficients with a prior, at most
NOT_DECAYED = "not-decayed"  # code of the message on an impulse response that ends before it has decayed
UNDECAYED = 0.1  # of its peak, that a truncated response still has
SIGNIFICANT = 4.0  # standard deviations, of the largest of several coefficients


@orders_apart
def arx(
    data: IOData | Sequence[IOData] | FrequencyResponse,
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    coloured: bool = False,
    regularisation: Kernel | None = None,
    offset: bool = False,
    trend: bool = False,
    error_threshold: float = 0.0,
    fixed: FixedRows | None = None,
    focus: Focus = "prediction",
) -> Estimate:
    """Fit A(q) y = B(q) u + e by least squares [Ljung1999, sec. 4.2, 7.3], or by regularised ones.

    Args:
        data: One experiment, or several that share the model. Equations with a missing output are omitted.
            Of a frequency response of one input, with its variance, B/A is the most likely one, as by `fit_response`;
            1/A of the disturbance is no more than the structure.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        coloured: Whether the covariance allows for prediction errors that are not white, as with too small orders, by
            the "sandwich" formula [Ljung1999, ch. 9]. It is then the spread about the limit of the estimate, which need
            not be the true parameters. The estimate itself is the same.
        regularisation: Kernel "tc", "dc" or "ss" of a Gaussian prior of A and of each B as decaying responses, which
            allows high orders on short records; see `impulseest`. The covariance is that of the posterior.
        offset: Whether the output of every experiment has an unknown constant beside the response of the model. It
            becomes part of `operating_point`, and the covariance allows for it. For records whose beginning is far from
            the rest: their means are no operating point.
        trend: Whether it has an unknown straight line, which includes the constant, likewise: a drift.
        error_threshold: Errors beyond this many robust standard deviations count linearly instead of by their squares,
            as in `oe`. An outlier of a sensor is also a regressor of the next errors, which no weight mends: `oe`, or
            a missing output, does.
        fixed: Coefficients that are known, by polynomial as `Polynomials` has them, NaN for those that are estimated:
            `{"A": [1, nan, 0.5]}`; with several inputs a row per input, or None. Their covariance is zero.
        focus: "prediction", "simulation" (the path minimises simulation errors, the noise model follows), or a band
            (low, high) in Hz: inputs and outputs then pass the same Butterworth filter, whose transients do not count.
            The noise model and its variance are those of the filtered record; `coloured` holds.

    Returns:
        The estimate; parameters a1.., b1...

    Raises:
        SysidError: Constant input, several outputs, orders negative or too many for the data, an unknown kernel, or one
            together with `coloured`, `error_threshold` or `fixed`, or the first two together.

    Warns:
        SysidWarning: The input excites too little, means that do not fit the dynamics, rank deficient regressors, an
            output whose rounding biases A.
    """
    if isinstance(data, FrequencyResponse):
        options: dict[str, tuple[object, object]] = {"coloured": (coloured, False), "offset": (offset, False)}
        options |= {"trend": (trend, False), "regularisation": (regularisation, None), "fixed": (fixed, None)}
        options |= {"error_threshold": (error_threshold, 0.0), "focus": (focus, "prediction")}
        return arx_of_response(data, na, nb, nk, options)
    band, simulates = checked_focus(focus)
    if simulates:
        if regularisation is not None:
            raise SysidError("focus='simulation' needs regularisation=None: a prior is one of prediction errors")
        return _simulated_arx(
            data,
            {"na": na, "nb": nb, "nk": nk},
            coloured=coloured,
            offset=offset,
            trend=trend,
            error_threshold=error_threshold,
            fixed=fixed,
        )
    kernel = checked_kernel("regularisation", regularisation)
    coloured = truth_value("coloured", coloured) or band is not None
    if coloured and kernel is not None:
        raise SysidError(
            "coloured=True, or a band as focus, needs regularisation=None: a posterior covariance rests on white errors"
        )
    threshold = checked_error_threshold(error_threshold)
    if threshold and (coloured or kernel is not None):
        raise SysidError("error_threshold needs coloured=False, no band as focus, and regularisation=None")
    experiments = as_experiments(data, missing=not coloured, series=True)
    orders = make_orders(experiments[0].nu, na=na, nb=nb, nk=nk, trend=trend_degree(offset, trend))
    recorded = experiments
    if band is not None:
        experiments = band.filtered(experiments, InitialConditions.ESTIMATED, orders.trend)
    constraint = fixed_coefficients(fixed, orders, "AB")
    if constraint is not None and kernel is not None:
        raise SysidError("fixed needs regularisation=None: a prior is one of whole responses")
    order_values = orders.select("na", "nb", "nk")
    return regression_estimate(
        "arx",
        experiments,
        orders,
        order_values,
        coloured=coloured,
        kernel=kernel,
        threshold=threshold,
        constraint=constraint,
        recorded=recorded,
    )


def _simulated_arx(
    data: IOData | Sequence[IOData],
    order_values: Mapping[str, Any],
    *,
    coloured: bool,
    offset: bool,
    trend: bool,
    error_threshold: float,
    fixed: FixedRows | None,
) -> Estimate:
    """A and B by the simulation errors, which takes a search."""
    return prediction_error_estimate(
        "arx",
        data,
        order_values,
        start=None,
        max_iterations=SIMULATION_STEPS,
        coloured=coloured,
        initial_conditions=InitialConditions.ESTIMATED,
        offset=offset,
        trend=trend,
        error_threshold=error_threshold,
        fixed=fixed,
        focus="simulation",
    )


def regression_estimate(
    method: str,
    experiments: Sequence[IOData],
    orders: Orders,
    order_values: Mapping[str, Any],
    *,
    coloured: bool = False,
    kernel: Kernel | None = None,
    threshold: float = 0.0,
    constraint: Constraint | None = None,
    recorded: Sequence[IOData] | None = None,
) -> Estimate:
    """Check the data, solve for A and B by least squares or with a prior, and return the estimate.

    `order_values` are the orders as the estimate reports them, `recorded` the records that it recognises as its own, by
    default the experiments.
    """
    check_single_output(experiments)
    # a prior takes the place of excitation and of samples
    needed_excitation = orders.nb if kernel is None else [1] * len(orders.nb)
    messages = check_excitation(experiments, needed_excitation)
    if not orders.trend_terms:
        messages += check_means(experiments, orders.na)
    if kernel is None:
        check_enough_data(experiments, orders, transients=0)
    starts = [orders.first_row(e.window) for e in experiments]
    sizes = [n for n in (orders.na, *orders.nb) if n]
    unknown = orders.count if kernel is None else HYPER_PARAMETERS * len(sizes)
    shortest = min(len(e) for e in experiments)
    if shortest <= max(starts):
        raise SysidError(f"the lags reach back {max(starts)} samples, the shortest experiment has {shortest}")
    y, u = [e.y[:, 0] for e in experiments], [e.u for e in experiments]
    equations = Equations(y, u, orders, starts, unknown)
    if kernel is not None and sizes:
        posterior = equations.posterior(sizes, kernel)
        theta, covariance, variance = posterior.mean, posterior.covariance, posterior.variance
        diagnostics = {"iterations": 0, "kernel": kernel, **posterior.diagnostics}
        if not diagnostics["converged"]:
            messages.append("the search of the hyper-parameters did not converge")
        if not orders.na:
            # with an A, the end of B is not the end of the response
            deviations = np.sqrt(np.diag(covariance))
            messages += _undecayed_responses(theta, deviations, orders.nb, experiments[0].input_names or ())
    else:
        fit, rows = equations.least_squares(constraint)
        theta, variance = fit.solution[:, 0], float(fit.residual_gram[0, 0]) / (rows - len(fit.solution))
        messages += fit.rank_message()
        covariance = variance * fit.inverse_gram
        if constraint is not None:
            theta, covariance = constraint.full(theta), constraint.basis @ covariance @ constraint.basis.T
        messages += rounding_messages(experiments, orders, theta, covariance, variance)
        if coloured:
            covariance = sandwich(experiments, orders, theta, covariance, variance)
        diagnostics = fit.diagnostics
        if constraint is not None:
            diagnostics["effective_parameters"] = constraint.count
    huber = None
    if threshold:
        huber = huber_fit(experiments, orders, theta, threshold, constraint=constraint)
        theta, covariance, variance = huber.theta, huber.covariance(0), huber.scale**2
        messages += huber.messages
        diagnostics = {**diagnostics, **huber.diagnostics}
    warn_each(messages, stacklevel=3)
    recorded = experiments if recorded is None else recorded
    if orders.trend_terms:
        trends = trends_of_outputs(experiments, orders, theta) if huber is None else huber.trends_of_outputs
        levelled = Levelled.of(experiments).subtract(trends)
        experiments = levelled.experiments
        diagnostics = {**diagnostics, **trend_diagnostics(levelled)}
    return make_estimate(
        method,
        experiments,
        orders,
        order_values,
        theta=theta,
        covariance=covariance,
        variance=variance,
        diagnostics=diagnostics,
        messages=messages,
        recorded=recorded,
        looked_for_offset=huber is not None,
        looks_for_outliers=True,
        is_robust=huber is not None,
    )


LARGEST_TABLE = 16_000_000  # entries of the regressors up to which they are formed at once, 128 MB


@dataclass(frozen=True, eq=False)
class Equations:
    """The complete equations of an ARX model; those of long records are formed in blocks.

    Attributes:
        y: Outputs of each experiment (N_i,).
        u: Inputs (N_i, nu).
        orders: Orders of A and B.
        starts: First row of each experiment.
        unknown: Unknown coefficients, which need more equations.
    """

    y: Sequence[FloatArray]
    u: Sequence[FloatArray]
    orders: Orders
    starts: Sequence[int]
    unknown: int

    @property
    def _are_long(self) -> bool:
        rows = sum(len(yi) - start for yi, start in zip(self.y, self.starts, strict=True))
        return rows * (self.orders.count + 1) > LARGEST_TABLE

    @property
    def _as_triangle(self) -> bool:
        """Whether the equations are reduced to a triangle first: long ones, and those with trends to project out."""
        return self._are_long or self.orders.trend_terms > 0

    def least_squares(self, constraint: Constraint | None = None) -> tuple[LeastSquares, int]:
        """Solution, of the free parameters, and the number of equations, less those that trends use up."""
        if self._as_triangle:
            triangle, lengths, rows = self._triangle()
            if constraint is not None:
                triangle = triangle * lengths
                phi, target = triangle[:, :-1], triangle[:, -1]
                fit = solve(phi @ constraint.basis, (target - phi @ constraint.base)[:, None])
                return fit, rows
            return solve_triangle(triangle, lengths, self.orders.count, rows), rows
        phi, target = self._at_once()
        if constraint is not None:
            phi, target = phi @ constraint.basis, target - phi @ constraint.base
        return solve(phi, target[:, None]), len(phi)

    def posterior(self, sizes: Sequence[int], kernel: Kernel) -> Posterior:
        """Solution with a prior on blocks of coefficients of these sizes."""
        if self._as_triangle:
            triangle, lengths, rows = self._triangle()
            return posterior_of_triangle(triangle, lengths, rows, float(lengths[-1] ** 2), sizes, kernel)
        phi, target = self._at_once()
        return empirical_bayes(phi, target, sizes, kernel)

    def _at_once(self) -> tuple[FloatArray, FloatArray]:
        orders = self.orders
        phi, target = arx_equations(self.y, self.u, orders.na, orders.nb, orders.nk, self.starts)
        complete = complete_rows(phi, target, self.unknown)
        # indexing copies the regressors, the largest array of the fit
        return (phi, target) if complete.all() else (phi[complete], target[complete])

    def _triangle(self) -> tuple[FloatArray, FloatArray, int]:
        orders = self.orders
        blocks: Callable[[], Iterable[FloatArray]] = partial(
            equation_blocks, self.y, self.u, orders.na, orders.nb, orders.nk, self.starts
        )
        if orders.trend_terms:
            blocks = partial(equations_with_trends, self.y, self.u, orders, self.starts)
        triangle, lengths, rows = triangle_of_blocks(blocks)
        # behind the leading columns stands the triangle of the others, projected onto the complement of these
        of_trends = orders.trend_terms * len(self.y)
        triangle, lengths, rows = triangle[of_trends:, of_trends:], lengths[of_trends:], rows - of_trends
        if rows <= self.unknown:
            raise SysidError(
                f"too many missing samples: {rows} equations are complete, {self.unknown} coefficients need more"
            )
        return triangle, lengths, rows


def _undecayed_responses(g: FloatArray, deviations: FloatArray, nb: Sequence[int], names: Sequence[str]) -> list[str]:
    """Messages on impulse responses that end before they have decayed.

    The responses to all inputs, one after the other, and their standard deviations are (sum(nb),).
    """
    messages: list[str] = []
    first = 0
    for name, n in zip(names, nb, strict=True):
        end = first + n
        # the last tenth: a response that rings may cross zero at its very last coefficient
        tail = slice(end - max(n // 10, min(n, 1)), end)
        peak = np.abs(g[first:end]).max(initial=0.0)
        negligible = np.maximum(UNDECAYED * peak, SIGNIFICANT * deviations[tail])
        if (np.abs(g[tail]) > negligible).any():
            text = f"the impulse response to {name} has not decayed after {n} coefficients: raise n"
            messages.append(Message(text, NOT_DECAYED, n="raise n"))
        first = end
    return messages
