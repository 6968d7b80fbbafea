"""Estimates from frequency responses: checks, covariance, and the test of the fit."""

from collections.abc import Callable, Mapping
from dataclasses import replace
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


def likelihood_of(
    response: FrequencyResponse, continuous: bool | None, known_variance: bool
) -> tuple[Likelihood, bool, DataSummary]:
    """Weighted response, whether the model is in continuous time, and the description of the data.

    Raises:
        SysidError: No response, too few frequencies, a discrete-time model of a continuous-time response.
    """
    if not isinstance(response, FrequencyResponse):
        raise SysidError(f"expected one FrequencyResponse, got {type(response).__name__}; merge joins several")
    continuous = not response.dt if continuous is None else truth_value("continuous", continuous)
    if not (continuous or response.dt):
        raise SysidError("a discrete-time model needs the sampling interval: the response has dt = 0, continuous time")
    data = Likelihood.of(
        replace(response, dt=0.0) if continuous else response, truth_value("known_variance", known_variance)
    )
    nf, ny, nu = data.response.response.shape
    f = data.response.frequencies
    summary = DataSummary(
        samples=(2 * nf * nu,),
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
    method: str,
    data: Likelihood,
    summary: DataSummary,
    best: Maximum[Any],
    orders: Mapping[str, Any],
    *,
    theta: FloatArray,
    directions: FloatArray,
    names: tuple[str, ...],
    realise: Callable[[FloatArray], StateSpace],
    realise_continuous: Callable[[FloatArray], ContinuousModel] | None = None,
    polynomials: Polynomials | None = None,
) -> Estimate:
    """Assemble the estimate; `directions` (p, r) are steps of one standard deviation each."""
    freedom = data.rows - best.rank
    expected, p_value, factor = np.nan, np.nan, best.cost / freedom
    if data.known:
        mean, factor, own = 1.0, 1.0, data.response.degrees_of_freedom
        if own is not None:
            # a complex error over its estimated variance has an F(2, own) distribution [Pintelon2012, sec. 12.3]
            mean, factor = (own / (own - k) if own > k else np.nan for k in (2.0, 4.0))
        expected = mean * freedom
        p_value = float(scipy.stats.gamma.sf(best.cost, 0.5 * freedom / factor, scale=2.0 * mean * factor))
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
    warn_each(messages, stacklevel=2)
    nf, ny, nu = data.response.response.shape
    errors = data.errors(best.model.response()).reshape(nf, ny, nu, 2)
    estimate = Estimate(
        model=realise(theta),
        polynomials=polynomials,
        parameters=theta,
        parameter_names=names,
        covariance=factor * directions @ directions.T,
        noise_variance=np.full((ny, ny), np.nan),
        residuals=errors.transpose(0, 2, 3, 1).reshape(-1, ny),
        method=method,
        orders=orders,
        diagnostics={
            "condition": best.condition,
            "iterations": best.iterations,
            "converged": best.converged,
            "sum_of_squares": best.cost,
            "expected_sum_of_squares": expected,
            "p_value": p_value,
            "warnings": tuple(messages),
        },
        data=summary,
        realise=realise,
    )
    return continuous_estimate(estimate, realise_continuous) if realise_continuous else estimate
