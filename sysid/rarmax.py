"""Recursive ARMAX models: parameters that follow the data."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.adaptation import Adaptation, Forgetting
from sysid.data import IOData
from sysid.orders import make_orders
from sysid.recursive_estimate import RecursiveEstimate
from sysid.recursive_prediction_error import recurse

ALL_BUT_THE_FIRST = Forgetting(1.0, initial=0.95)


def rarmax(
    data: IOData,
    na: int,
    nb: int | Sequence[int],
    nc: int,
    nk: int | Sequence[int] = 1,
    *,
    adaptation: Adaptation = ALL_BUT_THE_FIRST,
    start: ArrayLike | None = None,
) -> RecursiveEstimate:
    """Fit A(q) y = B(q) u + C(q) e sample by sample [Ljung1999, sec. 11.4].

    Recursive maximum likelihood: C stays stable. Where nothing is forgotten in the end the parameters tend to those of
    `armax`; a model that is poorly determined needs a good `start`, or a longer record than `armax`.

    Args:
        data: One experiment.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nc: Degree of C.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        adaptation: `Forgetting(factor, initial)`, `Kalman(R1, R2)` or `Gradient(gain, normalised)`.
        start: Parameters to begin with (p,): a1.., b1.., c1...; zero when None.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit, a start that is not stable.
    """
    orders = make_orders(data.nu if isinstance(data, IOData) else 1, na=na, nb=nb, nc=nc, nk=nk)
    asked = {"na": orders.na, "nb": orders.nb, "nc": orders.nc, "nk": orders.nk}
    return recurse("rarmax", data, orders, asked, adaptation, start)
