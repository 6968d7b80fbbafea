"""Polynomial models of any structure by the prediction-error method."""

from collections.abc import Sequence

from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials
from sysid.polynomial.constraints import FixedRows
from sysid.polynomial.focus import Focus
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import orders_apart
from sysid.polynomial.polynomial_estimate import prediction_error_estimate
from sysid.records.data import IOData


@orders_apart
def polyest(
    data: IOData | Sequence[IOData],
    na: int,
    nb: int | Sequence[int],
    nc: int,
    nd: int,
    nf: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    start: Polynomials | None = None,
    max_iterations: int = 100,
    coloured: bool = False,
    initial_conditions: InitialConditions | str = InitialConditions.ESTIMATED,
    offset: bool = False,
    trend: bool = False,
    error_threshold: float = 0.0,
    fixed: FixedRows | None = None,
    focus: Focus = "prediction",
) -> Estimate:
    """Fit A(q) y = B(q)/F(q) u + C(q)/D(q) e by minimising the prediction errors [Ljung1999, sec. 4.2, ch. 10].

    The general structure: `arx`, `armax`, `oe` and `bj` are the cases in which some orders are 0. With A beside D and
    F, the dynamics of A belong to both paths, those of F to the input's alone, those of D to the disturbance's. C, D
    and F stay stable at every step; A, and with it the model, may be unstable. By default the unknown initial
    conditions of each experiment are projected out.

    Args:
        data: One experiment, or several that share the model. With missing outputs, the likelihood of the known ones is
            maximised.
        na: Degree of A.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nc: Degree of C.
        nd: Degree of D.
        nf: Degree of F, one for all inputs or one per input.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        start: A further initial estimate, also of a smaller structure, as in `armax`.
        max_iterations: Limit on the steps of the final minimisation.
        coloured: Whether the covariance allows for prediction errors that are not white, as in `arx`.
        initial_conditions: Assumption about the time before each experiment, or its name ("zero", "backcast").
        offset: Whether the output of every experiment has an unknown constant beside the response of the model. It
            becomes part of `operating_point`, and the covariance allows for it. For records whose beginning is far from
            the rest: their means are no operating point.
        trend: Whether it has an unknown straight line, which includes the constant, likewise: a drift.
        error_threshold: Errors beyond this many robust standard deviations count linearly instead of by their squares
            (Huber's loss, MATLAB's ErrorThreshold), as of records with outliers; 1.6 is usual, 0 stands for squares
            alone. The noise variance is then the squared robust deviation, and the covariance that of [Huber1981, sec.
            7.6].
        fixed: Coefficients that are known, by polynomial as `Polynomials` has them, NaN for those that are estimated:
            `{"F": [1, nan, 0.5]}`; with several inputs a row per input, or None. Their covariance is zero.
        focus: "prediction", "simulation" (the path minimises simulation errors, the noise model follows), or a band
            (low, high) in Hz: inputs and outputs then pass the same Butterworth filter, whose transients do not count.
            The noise model and its variance are those of the filtered record; `coloured` holds.

    Returns:
        The estimate; parameters a1.., b1.., c1.., d1.., f1...

    Raises:
        SysidError: No or a constant input, several outputs, orders negative or too many for the data, a start that does
            not fit.

    Warns:
        SysidWarning: Poor excitation, no convergence, bad conditioning (also where A, D and F have roots in common), C,
            D or F at the edge of stability, C and D that nearly cancel.
    """
    return prediction_error_estimate(
        "polyest",
        data,
        {"na": na, "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk},
        start=start,
        max_iterations=max_iterations,
        coloured=coloured,
        initial_conditions=initial_conditions,
        offset=offset,
        trend=trend,
        error_threshold=error_threshold,
        fixed=fixed,
        focus=focus,
    )
