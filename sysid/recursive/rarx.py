"""Recursive ARX models: parameters that follow the data."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.polynomial.orders import make_orders
from sysid.records.data import IOData
from sysid.recursive.adaptation import Adaptation, Forgetting
from sysid.recursive.initial_state import Start
from sysid.recursive.recursion import recurse
from sysid.recursive.recursive_estimate import RecursiveEstimate

DEFAULT = Forgetting(1.0)


def rarx(
    data: IOData,
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    adaptation: Adaptation | None = None,
    start: Start = None,
    P0: ArrayLike | None = None,
) -> RecursiveEstimate:
    """Fit A(q) y = B(q) u + e sample by sample, by recursive least squares [Ljung1999, sec. 11.2].

    With `Forgetting(1.0)` the last parameters are those of `arx`, except for the vanishing weight of the start.

    Args:
        data: One experiment.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        adaptation: `Forgetting`, `Kalman` or `Gradient` of `sysid.recursive`. By default that of the continued
            recursion, else `Forgetting(1.0)`.
        start: Initial parameters (p,), a1.., b1...; an `arx` estimate from earlier samples, with its covariance; or the
            result of a recursion, which is continued as if both records were one. Zero by default.
        P0: Initial P instead of that of `start`: a number, one per parameter, or a matrix (p, p). For `Forgetting` the
            covariance of the start over the variance of the errors, for `Kalman` the covariance. By default that of the
            estimate; else 1e12 (`Forgetting`) or 1e6 (`Kalman`) over the mean square of each regressor's signal in this
            record, so that parts of a record reproduce the whole only with a common P0.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit.

    Warns:
        SysidWarning: Poor excitation, an unstable model.
    """
    orders = make_orders(data.nu if isinstance(data, IOData) else 1, na=na, nb=nb, nk=nk)
    return recurse(
        "rarx", data, orders, orders.select("na", "nb", "nk"), DEFAULT, adaptation=adaptation, start=start, P0=P0
    )
