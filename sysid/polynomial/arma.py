"""ARMA models of time series by the prediction-error method."""

from collections.abc import Sequence

from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials
from sysid.polynomial.ar import as_series
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import orders_apart
from sysid.polynomial.polynomial_estimate import prediction_error_estimate
from sysid.records.arguments import truth_value
from sysid.records.data import IOData


@orders_apart
def arma(
    data: IOData | Sequence[IOData],
    na: int,
    nc: int,
    *,
    max_iterations: int = 100,
    coloured: bool = False,
    initial_conditions: InitialConditions | str = InitialConditions.ESTIMATED,
    start: Polynomials | None = None,
) -> Estimate:
    """Fit A(q) y = C(q) e to a time series by its one-step prediction errors [Ljung1999, sec. 4.2, ch. 10].

    The same as `armax` without input: C stays stable at every step, and the unknown initial conditions are projected
    out. The first `na` samples only initialise A.

    Args:
        data: One experiment without input, or several that share the model. With missing outputs, the likelihood of the
            known ones is maximised.
        na: Degree of A.
        nc: Degree of C.
        max_iterations: Limit on the steps of the final minimisation.
        coloured: Whether the covariance allows for prediction errors that are not white, as in `arx`.
        initial_conditions: Assumption about the time before each experiment, or its name.
        start: Polynomials of a further initial estimate, no longer than the orders.

    Returns:
        The estimate; parameters a1.., c1...

    Raises:
        SysidError: Data with an input, several outputs, orders negative or too many for the data.

    Warns:
        SysidWarning: A mean that dominates, no convergence, bad conditioning, C at the edge of stability, A and
            C that nearly cancel.
    """
    coloured = truth_value("coloured", coloured)
    return prediction_error_estimate(
        "arma",
        as_series(data, missing=not coloured),
        {"na": na, "nc": nc},
        series=True,
        max_iterations=max_iterations,
        coloured=coloured,
        initial_conditions=initial_conditions,
        start=start,
    )
