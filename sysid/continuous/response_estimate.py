"""Estimates from frequency responses: checks, covariance, and the test of the fit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from sysid.continuous.response_likelihood import Likelihood, Maximum
from sysid.models.continuous_estimate import continuous_estimate
from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import DataSummary, Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.polynomial.polynomial_estimate import ILL_CONDITIONED
from sysid.records.arguments import truth_value
from sysid.records.arrays import FloatArray
from sysid.records.channels import default_names
from sysid.records.errors import SysidError, warn_each

UNLIKELY = 1e-3  # probability of the weighted sum of squares below which the model or the variance is doubted


@dataclass(frozen=True, eq=False)
class FittedParameters:
    """Parameters of the most likely model, and the functions from parameters to a model.

    Attributes:
        values: (p,).
        directions: Changes of them by one standard deviation each, for errors of unit variance (p, r).
        names: One per parameter.
        orders: By name, as the estimate reports them.
        realise: From parameters to the sampled model.
        realise_continuous: From parameters to the model in continuous time; None in discrete time.
        polynomials: Polynomials of the model, if it has some.
    """

    values: FloatArray
    directions: FloatArray
    names: tuple[str, ...]
    orders: Mapping[str, Any]
    realise: Callable[[FloatArray], StateSpace]
    realise_continuous: Callable[[FloatArray], ContinuousModel] | None = None
    polynomials: Polynomials | None = None


def likelihood_of(
    response: FrequencyResponse, continuous: bool | None, known_variance: bool
) -> tuple[Likelihood, bool, DataSummary]:
    """Weighted response, whether the model is in continuous time, and the description of the data.

    Raises:
        SysidError: No response, too few frequencies, a discrete-time model of a continuous-time response.
    """
    if not isinstance(response, FrequencyResponse):
        raise SysidError(f"expected one FrequencyResponse, got {type(response).__name__}; sysid.merge averages several")
    continuous = not response.dt if continuous is None else truth_value("continuous", continuous)
    if not (continuous or response.dt):
        raise SysidError("a discrete-time model needs the sampling interval: the response has dt = 0, continuous time")
    fitted = replace(response, dt=0.0) if continuous else response
    data = Likelihood.of(fitted, truth_value("known_variance", known_variance))
    _, ny, nu = data.response.response.shape
    f = data.response.frequencies
    summary = DataSummary(
        samples=(2 * len(f) * nu,),
        # the highest frequency is the Nyquist frequency of the sampled model
        dt=response.dt or 0.5 / float(f[-1]),
        input_names=response.input_names or default_names("u", nu),
        output_names=response.output_names or default_names("y", ny),
        input_units=("",) * nu,
        output_units=("",) * ny,
        names=("",),
        frequencies=tuple(f.tolist()),
    )
    return data, continuous, summary


def response_estimate(
    method: str, data: Likelihood, summary: DataSummary, best: Maximum[Any], parameters: FittedParameters
) -> Estimate:
    """Test the fit, warn of what is poor, and assemble the estimate."""
    expected, p_value, factor = _test_of_fit(data, best)
    messages = _messages(method, best, expected, p_value)
    warn_each(messages, stacklevel=2)
    nf, ny, nu = data.response.response.shape
    errors = data.errors(best.model.response()).reshape(nf, ny, nu, 2)
    diagnostics = {
        "condition": best.condition,
        "iterations": best.iterations,
        "converged": best.converged,
        "sum_of_squares": best.cost,
        "expected_sum_of_squares": expected,
        "p_value": p_value,
        "warnings": tuple(messages),
    }
    estimate = Estimate(
        model=parameters.realise(parameters.values),
        polynomials=parameters.polynomials,
        parameters=parameters.values,
        parameter_names=parameters.names,
        covariance=factor * parameters.directions @ parameters.directions.T,
        # the response of the noise is no part of the data
        noise_variance=np.full((ny, ny), np.nan),
        residuals=errors.transpose(0, 2, 3, 1).reshape(-1, ny),
        method=method,
        orders=parameters.orders,
        diagnostics=diagnostics,
        data=summary,
        realise=parameters.realise,
    )
    if parameters.realise_continuous is None:
        return estimate
    return continuous_estimate(estimate, parameters.realise_continuous)


def _test_of_fit(data: Likelihood, best: Maximum[Any]) -> tuple[float, float, float]:
    """Expected sum of squares of a true model, probability of a larger one, and the factor of the covariance.

    With an unknown variance the errors themselves give the factor, and nothing is left to test.
    """
    freedom = data.rows - best.rank
    if not data.known_variance:
        return np.nan, np.nan, best.cost / freedom
    mean, factor = 1.0, 1.0
    of_variance = data.response.degrees_of_freedom
    if of_variance is not None:
        # a complex error over its estimated variance has an F(2, of_variance) distribution [Pintelon2012, sec. 12.3]:
        # its mean exists beyond 2 degrees of freedom, its variance, here over the square of the mean, beyond 4
        mean = of_variance / (of_variance - 2.0) if of_variance > 2.0 else np.nan
        factor = of_variance / (of_variance - 4.0) if of_variance > 4.0 else np.nan
    expected = mean * freedom
    p_value = scipy.stats.gamma.sf(best.cost, 0.5 * freedom / factor, scale=2.0 * mean * factor)
    return expected, float(p_value), factor


def _messages(method: str, best: Maximum[Any], expected: float, p_value: float) -> list[str]:
    """Warnings of a search that did not converge, of parameters in doubt, and of errors larger than expected."""
    messages = []
    if not best.converged:
        messages.append(f"{method} did not converge in {best.iterations} iterations")
    if best.rank < best.model.free or best.condition > ILL_CONDITIONED:
        messages.append(
            f"the parameters are poorly determined: the response determines {best.rank} of {best.model.free}, "
            f"condition number {best.condition:.2g} of the scaled Jacobian"
        )
    if p_value < UNLIKELY:
        messages.append(
            f"the weighted sum of squares {best.cost:.4g} is far above that expected of a true model, {expected:.4g}: "
            "the order is too low, the variance of the response too small, or the response biased, as by smoothing"
        )
    return messages
