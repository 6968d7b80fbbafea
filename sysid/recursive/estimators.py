"""Recursive estimators: ARX, ARMAX and OE models whose parameters follow the data."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.records.data import IOData
from sysid.recursive.adaptation import Adaptation, Forgetting
from sysid.recursive.initial_state import Start
from sysid.recursive.recursion import recurse
from sysid.recursive.recursive_estimate import RecursiveEstimate

LEAST_SQUARES = Forgetting(1.0)
PREDICTION_ERROR = Forgetting(1.0, initial=0.95)  # the first regressors depend on poor parameters: forget them


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
    orders = {"na": na, "nb": nb, "nk": nk}
    return recurse("rarx", data, orders, LEAST_SQUARES, adaptation=adaptation, start=start, P0=P0)


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

    Recursive maximum likelihood; C stays stable. Without forgetting, the parameters converge to those of `armax`, near
    the minimum at the optimal rate. From zero, or with a poorly determined model, one pass is too short: it is about
    one Gauss-Newton step. Start then from an estimate of the first samples with its covariance,
    `rarmax(data[600:], ..., start=armax(data[:600], ...))`. The diagnostic `left` is the N dV/V of a further
    Gauss-Newton step on the whole record; a warning is given if it is large.

    Args:
        data: One experiment.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nc: Degree of C.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        adaptation: As in `rarx`, but by default `Forgetting(1.0, 0.95)`; from an estimate `Forgetting(1.0)`.
        start: As in `rarx`: parameters a1.., b1.., c1..., an estimate by `armax`, or a recursion.
        P0: As in `rarx`, but by default 100 over the mean square of each regressor's signal.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit, an unstable start.

    Warns:
        SysidWarning: Poor excitation, an unstable model, parameters far from the minimum.
    """
    orders = {"na": na, "nb": nb, "nc": nc, "nk": nk}
    return recurse("rarmax", data, orders, PREDICTION_ERROR, adaptation=adaptation, start=start, P0=P0)


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
        adaptation: As in `rarx`, but by default `Forgetting(1.0, 0.95)`; from an estimate `Forgetting(1.0)`.
        start: As in `rarx`: parameters b1.., f1..., an estimate by `oe`, or a recursion.
        P0: As in `rarx`, but by default 100 over the mean square of each regressor's signal.

    Returns:
        Parameters sample by sample, prediction errors, and the last model.

    Raises:
        SysidError: Several experiments or outputs, a constant input, orders negative or too many for the data, a start
            or an adaptation that does not fit, a start that is not stable.

    Warns:
        SysidWarning: Poor excitation, an unstable model, parameters far from the minimum.
    """
    orders = {"nb": nb, "nf": nf, "nk": nk}
    return recurse("roe", data, orders, PREDICTION_ERROR, adaptation=adaptation, start=start, P0=P0)
