"""Fits of polynomial models to frequency responses, under the names of the estimators from records.

The fit itself belongs to a room above this one, which registers it when it is loaded.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.orders import make_orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.errors import SysidError

_REGISTERED: list[Callable[..., Estimate]] = []


def register_response_fit(fit: Callable[..., Estimate]) -> None:
    """Keep the function `fit_response`, as which it is called."""
    _REGISTERED[:] = [fit]


def oe_of_response(
    response: FrequencyResponse,
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int],
    max_iterations: int,
    options: Mapping[str, tuple[Any, Any]],
) -> Estimate:
    """B/F of each input by maximum likelihood, as by `fit_response`.

    Args:
        response: Response of sampled data, with its covariance.
        nb: Number of coefficients of B.
        nf: Degree of F.
        nk: Delay in samples.
        max_iterations: Limit on the steps.
        options: Other options by name, as they are and by default: they are of records.

    Raises:
        SysidError: No covariance, continuous time, options of records, or as `fit_response`.
    """
    return replace(_fitted("oe", response, nb, nf, nk, max_iterations, options), method="oe")


def arx_of_response(
    response: FrequencyResponse,
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int],
    options: Mapping[str, tuple[Any, Any]],
) -> Estimate:
    """B/A of one input by maximum likelihood, as `oe_of_response`; 1/A of the disturbance is that of the structure."""
    inputs = response.response.shape[2]
    if inputs != 1:
        raise SysidError(
            "arx has one A for all inputs, and a response is fitted with a denominator per input: expected one input, "
            f"got {inputs}; oe takes several, response.select(inputs=[0]) one of them"
        )
    orders = make_orders(1, na=na, nb=nb, nk=nk)
    fit = _fitted("arx", response, nb, na, nk, MOST_STEPS, options)
    # B before F becomes A before B
    sequence = np.roll(np.arange(orders.count), orders.na)
    theta = fit.parameters[sequence]
    realise = Realise(orders, fit.data, None)
    return replace(
        fit,
        model=realise(theta),
        polynomials=orders.polynomials(theta),
        parameters=theta,
        parameter_names=orders.names,
        covariance=fit.covariance[np.ix_(sequence, sequence)],
        method="arx",
        orders=orders.select("na", "nb", "nk"),
        realise=realise,
    )


MOST_STEPS = 100  # of the search of an ARX model


def _fitted(
    method: str,
    response: FrequencyResponse,
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int],
    max_iterations: int,
    options: Mapping[str, tuple[Any, Any]],
) -> Estimate:
    """The fit in discrete time, without options of records."""
    changed = [name for name, (value, default) in options.items() if value is not default and value != default]
    if changed:
        raise SysidError(
            f"{', '.join(changed)} of {method}: expected the defaults with a frequency response, they are of records"
        )
    if response.covariance is None:
        raise SysidError(
            f"the response has no variance, on which the intervals of {method} rest: expected one of bla, spa, spafdr, "
            "welch or etfe with smoothing, or FrequencyResponse.from_data(..., variance=...); fit_response takes equal "
            "errors at all frequencies"
        )
    (fit,) = _REGISTERED
    return fit(response, nb, nf, nk, continuous=False, max_iterations=max_iterations)
