"""Output-error models by the prediction-error method."""

from collections.abc import Sequence

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.polynomials import Polynomials
from sysid.polynomial.constraints import FixedRows
from sysid.polynomial.focus import Focus
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.orders import orders_apart
from sysid.polynomial.polynomial_estimate import prediction_error_estimate
from sysid.polynomial.response_fits import oe_of_response
from sysid.polynomial.weighted_output_errors import UNWEIGHTED, checked_weighting, weighted_oe
from sysid.records.data import IOData
from sysid.records.errors import SysidError


@orders_apart
def oe(
    data: IOData | Sequence[IOData] | FrequencyResponse,
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    start: Polynomials | None = None,
    max_iterations: int = 100,
    coloured: bool = True,
    initial_conditions: InitialConditions | str = InitialConditions.ESTIMATED,
    offset: bool = False,
    trend: bool = False,
    error_threshold: float = 0.0,
    fixed: FixedRows | None = None,
    focus: Focus = "prediction",
    weighting: Sequence[int] = UNWEIGHTED,
) -> Estimate:
    """Fit y = B(q)/F(q) u + e by minimising the simulation error [Ljung1999, sec. 4.2, ch. 10].

    F stays stable at every step; by default the unknown initial conditions of each experiment are projected out. The
    covariance holds for a disturbance of any colour that is independent of the input.

    Args:
        data: One experiment, or several that share the model. With missing outputs, the likelihood of the known ones is
            maximised. A frequency response with its variance is fitted as by `fit_response`; of the options it takes
            `max_iterations` alone.
        nb: Number of coefficients of B, one for all inputs or one per input.
        nf: Degree of F, likewise.
        nk: Delay in samples, likewise; nk = 1 means y(t) depends on u(t-1) first, nk = 0 gives a direct term.
        start: A further initial estimate, also of a smaller structure, as in `armax`.
        max_iterations: Limit on the steps of the final minimisation.
        coloured: Whether the covariance allows for a disturbance that is not white (but independent of the input), by
            an autoregressive model of it whose order BIC selects [Ljung1999, ch. 9]. The estimate itself is the same.
            Of a second-order path with an input held 10 samples, beside a disturbance of 20 dB less power, intervals of
            95 % cover, without and with it, 0.93 and 0.93 if it is white and 0.64 and 0.80 if its pole is 0.9, from 100
            samples; 0.94, 0.94, 0.74 and 0.93 from 250; 0.94, 0.94, 0.77 and 0.95 from 1,000; the same with a tenth of
            the outputs missing but for 0.90 at 250. It takes a tenth more time.
        initial_conditions: Assumption about the time before each experiment, or its name, as in `armax`.
        offset: Whether the output of every experiment has an unknown constant beside the response of the model. It
            becomes part of `operating_point`, and the covariance allows for it. For records whose beginning is far from
            the rest: their means are no operating point.
        trend: Whether it has an unknown straight line, which includes the constant, likewise: a drift.
        error_threshold: Errors beyond this many robust standard deviations count linearly instead of by their squares
            (Huber's loss, MATLAB's ErrorThreshold), as of records with outliers; 1.6 is usual, 0 stands for squares
            alone. The noise variance is then the squared robust deviation, and the covariance that of [Huber1981, sec.
            7.6].
        fixed: Coefficients that are known, by polynomial as `Polynomials` has them, NaN for those that are estimated:
            `{"F": [1, nan, 0.5]}`; with several inputs a row per input, or None. Their covariance is zero. A known
            integrator is `{"F": [1, -1]}`; one beside other poles is fitted by sums of the input and offset=True.
        focus: "prediction", "simulation" (here the same), or a band
            (low, high) in Hz: inputs and outputs then pass the same Butterworth filter, whose transients do not count.
            The noise model and its variance are those of the filtered record.
        weighting: Degrees (nc, nd) of a model C/D of the disturbance that is estimated beside the path and left out of
            the result: D/C whitens the errors, so that frequencies at which the disturbance is strong count less
            [Ljung1999, sec. 14.4]. The path is then that of `bj`, with its accuracy: beside a slow sine of 10 dB less
            power the gain deviates by 1 % instead of 12 % at 400 samples. (0, 0) counts all errors alike: right where
            the structure is too simple, and the best simulation is wanted. `coloured` has no effect beside it.

    Returns:
        The estimate; parameters b1.., f1... Diagnostics: with a weighting, `weighting` is the model of path and
        disturbance.

    Raises:
        SysidError: Constant input, several outputs, orders negative or too many for the data, a start that
            does not fit; of a frequency response no variance, continuous time, options of records.

    Warns:
        SysidWarning: Poor excitation, no convergence, bad conditioning, F at the edge of stability.
    """
    if isinstance(data, FrequencyResponse):
        options: dict[str, tuple[object, object]] = {
            "start": (start, None),
            "coloured": (coloured, True),
            "offset": (offset, False),
        }
        options |= {"trend": (trend, False), "error_threshold": (error_threshold, 0.0), "fixed": (fixed, None)}
        options["initial_conditions"] = (InitialConditions.of(initial_conditions), InitialConditions.ESTIMATED)
        options |= {"focus": (focus, "prediction"), "weighting": (checked_weighting(weighting), UNWEIGHTED)}
        return oe_of_response(data, nb, nf, nk, max_iterations, options)
    path = {"nb": nb, "nf": nf, "nk": nk}
    degrees = checked_weighting(weighting)
    if degrees != UNWEIGHTED:
        if focus == "simulation":
            raise SysidError("focus='simulation' counts all errors alike: expected weighting=(0, 0) beside it")
        bj_options: dict[str, object] = {
            "start": start,
            "max_iterations": max_iterations,
            "initial_conditions": initial_conditions,
        }
        bj_options |= {"offset": offset, "trend": trend, "error_threshold": error_threshold, "fixed": fixed}
        return weighted_oe(data, path, degrees, {**bj_options, "focus": focus})
    return prediction_error_estimate(
        "oe",
        data,
        path,
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
