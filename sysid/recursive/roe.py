"""Recursive OE models: parameters that follow the data."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.polynomial.orders import make_orders
from sysid.records.data import IOData
from sysid.recursive.adaptation import Adaptation, Forgetting
from sysid.recursive.initial_state import Start
from sysid.recursive.recursion import recurse
from sysid.recursive.recursive_estimate import RecursiveEstimate

DEFAULT = Forgetting(1.0, initial=0.95)


def roe(
    data: IOData,
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    adaptation: Adaptation | None = None,
    start: Start = None,
    P0: ArrayLike | None = None,
) -> RecursiveEstimate:
    """Fit y = B(q)/F(q) u + e sample by sample [Ljung1999, sec. 11.4].

    Recursive prediction-error method; F stays stable. Without forgetting, the parameters converge to those of `oe`; see
    `rarmax` for the conditions.

    Args:
        data: One experiment.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nf: Degree of F, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        adaptation: `Forgetting`, `Kalman` or `Gradient` of `sysid.recursive`. By default that of the continued
            recursion, else `Forgetting(1.0, 0.95)`, from an estimate `Forgetting(1.0)`.
        start: Initial parameters (p,), b1.., f1...; an `oe` estimate from earlier samples, with its covariance; or the
            result of a recursion, which is continued as if both records were one. Zero by default.
        P0: Initial P instead of that of `start`: a number, one per parameter, or a matrix (p, p). For `Forgetting` the
            covariance of the start over the variance of the errors, for `Kalman` the covariance. By default that of
            the estimate; else 100 over the mean square of each regressor's signal in this record, so that parts
            of a record reproduce the whole only with a common P0.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit, a start that is not stable.

    Warns:
        SysidWarning: Poor excitation, an unstable model, parameters far from the minimum.
    """
    orders = make_orders(data.nu if isinstance(data, IOData) else 1, nb=nb, nf=nf, nk=nk)
    return recurse(
        "roe", data, orders, orders.select("nb", "nf", "nk"), DEFAULT, adaptation=adaptation, start=start, P0=P0
    )
