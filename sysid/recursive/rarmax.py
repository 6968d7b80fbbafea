"""Recursive ARMAX models: parameters that follow the data."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.polynomial.orders import make_orders
from sysid.records.data import IOData
from sysid.recursive.adaptation import Adaptation, Forgetting
from sysid.recursive.initial_state import Start
from sysid.recursive.recursion import recurse
from sysid.recursive.recursive_estimate import RecursiveEstimate

ALL_BUT_THE_FIRST = Forgetting(1.0, initial=0.95)


def rarmax(
    data: IOData,
    na: int,
    nb: int | Sequence[int],
    nc: int,
    nk: int | Sequence[int] = 1,
    *,
    adaptation: Adaptation | None = None,
    start: Start = None,
    P0: ArrayLike | None = None,
) -> RecursiveEstimate:
    """Fit A(q) y = B(q) u + C(q) e sample by sample [Ljung1999, sec. 11.4].

    Recursive maximum likelihood: C stays stable. Where nothing is forgotten in the end the parameters tend to those of
    `armax`, at a rate that near the minimum is as good as can be. From zero, and for a model that is poorly determined,
    they get there far too late: one pass is about one Gauss-Newton step. Then begin with an estimate from the first
    samples, `rarmax(data[600:], ..., start=armax(data[:600], ...))`, which uses its covariance too. The diagnostic
    `left` is N dV/V that one more step on the whole record promises; where it is large a warning says so.

    Args:
        data: One experiment.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nc: Degree of C.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        adaptation: `Forgetting(factor, initial, settling)`, `Kalman(R1, R2)` or `Gradient(gain, normalised)`. None
            takes that of the recursion that is gone on with, else `Forgetting(1.0, 0.95)`, from an estimate
            `Forgetting(1.0)`.
        start: Where to begin: parameters (p,), a1.., b1.., c1...; an estimate by `armax` from earlier samples, with
            its covariance; or the result of a recursion, which goes on as if both records were one. Zero when None.
        P0: Initial P in place of that of `start`: a number for all parameters, one per parameter, or a matrix (p, p).
            For `Forgetting` the covariance of the start over the variance of the errors, for `Kalman` the covariance.
            By default that of the estimate; else 100 over the mean square
            of each regressor's signal in this record. Pieces of a record give what the whole gives where both begin
            with the same P0.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit, a start that is not stable.

    Warns:
        SysidWarning: Poor excitation, an unstable model, parameters that have not come near the minimum.
    """
    orders = make_orders(data.nu if isinstance(data, IOData) else 1, na=na, nb=nb, nc=nc, nk=nk)
    asked = {"na": orders.na, "nb": orders.nb, "nc": orders.nc, "nk": orders.nk}
    return recurse("rarmax", data, orders, asked, ALL_BUT_THE_FIRST, adaptation=adaptation, start=start, P0=P0)
