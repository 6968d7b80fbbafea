"""From the parameters of a polynomial model to the public record."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.models.estimate import DataSummary, Estimate
from sysid.models.polynomials import innovations_form
from sysid.models.residuals import residuals
from sysid.models.state_space import StateSpace
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning


@dataclass(frozen=True)
class Realise:
    """Pure function from parameters to the innovation form; a class, so that estimates can be pickled.

    Attributes:
        orders: Layout of the parameters.
        data: Sampling interval and names for the model.
        variance: Innovation variance that the model carries.
    """

    orders: Orders
    data: DataSummary
    variance: float

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for parameters (p,)."""
        bare = innovations_form(self.orders.polynomials(theta), self.data.dt, self.variance)
        return StateSpace(
            bare.A,
            bare.B,
            bare.C,
            bare.D,
            bare.K,
            bare.dt,
            bare.innovation_covariance,
            input_names=self.data.input_names,
            output_names=self.data.output_names,
            input_units=self.data.input_units,
            output_units=self.data.output_units,
        )


def make_estimate(
    method: str,
    experiments: Sequence[IOData],
    orders: Orders,
    asked: Mapping[str, Any],
    *,
    theta: FloatArray,
    covariance: FloatArray,
    variance: float,
    diagnostics: Mapping[str, Any],
    texts: Sequence[str],
) -> Estimate:
    """Assemble the record: model, polynomials, residuals of the model on its own data."""
    summary = DataSummary.of(experiments)
    realise = Realise(orders, summary, variance)
    model = realise(theta)
    if not model.is_stable():
        radius = float(np.abs(model.poles()).max())
        text = (
            f"the model is not stable, its largest pole has modulus {radius:.6g}: "
            "its frequency response and bandwidth describe no steady state"
        )
        texts = (*texts, text)
        warnings.warn(text, SysidWarning, stacklevel=4)
    with warnings.catch_warnings():
        # an unstable predictor has been kept out by the estimator
        warnings.simplefilter("ignore", SysidWarning)
        errors = np.concatenate([residuals(model, e) for e in experiments])
    return Estimate(
        model=model,
        polynomials=orders.polynomials(theta),
        parameters=theta,
        parameter_names=orders.names,
        covariance=covariance,
        noise_variance=np.array([[variance]]),
        residuals=errors,
        method=method,
        orders={key: _single(value) for key, value in asked.items()},
        diagnostics={**diagnostics, "warnings": tuple(texts)},
        data=summary,
        realise=realise,
    )


def check_single_output(experiments: Sequence[IOData]) -> None:
    """Polynomial models have one output.

    Raises:
        SysidError: The data have several.
    """
    if experiments[0].ny != 1:
        names = ", ".join(experiments[0].output_names or ())
        raise SysidError(
            f"expected one output, got {experiments[0].ny} ({names}): "
            "identify them one by one with data.select(outputs=[...])"
        )


def check_enough_data(experiments: Sequence[IOData], orders: Orders, transients: int) -> int:
    """Number of prediction errors available.

    Args:
        experiments: The data set.
        orders: The model.
        transients: Initial conditions fitted per experiment.

    Raises:
        SysidError: Not more than parameters and initial conditions.
    """
    slow = max((*orders.nk, 0))
    if any(2 * slow > len(e) for e in experiments):
        raise SysidError(
            f"nk = {slow} given, expected a delay of at most half the record: the shortest experiment has "
            f"{min(len(e) for e in experiments)} samples"
        )
    usable = [int(e.known[orders.first_row(e.window) :].sum()) for e in experiments]
    rows = sum(usable)
    unknown = orders.count + transients * len(experiments)
    short = [count for count in usable if count <= transients]
    if rows <= unknown or short:
        raise SysidError(
            f"too many orders for the data: {orders.count} parameters and {transients} initial conditions "
            f"per experiment from {rows} usable samples in {len(experiments)} experiment(s)"
        )
    return rows


def _single(value: Any) -> Any:
    return value[0] if isinstance(value, tuple) and len(value) == 1 else value
