"""Continuous-time transfer functions from records."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from numpy.typing import ArrayLike

from sysid.continuous.fit_response import fit_response
from sysid.continuous.output_error import output_error_estimate
from sysid.continuous.structures import PerPath, RationalPath, per_path
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.records.arguments import real_number, whole_number
from sysid.records.data import IOData
from sysid.records.errors import SysidError

MOST_POLES = 100  # of one path; the coefficients of higher degrees are no numbers of double precision


def tfest(
    data: IOData | Sequence[IOData] | FrequencyResponse,
    poles: PerPath,
    zeros: PerPath | None = None,
    *,
    delay: float | Sequence[float | None] | Sequence[Sequence[float | None]] | None = 0.0,
    max_delay: float | None = None,
    max_iterations: int = 100,
    coloured: bool = True,
    initial_conditions: InitialConditions | str = InitialConditions.ESTIMATED,
    offset: bool = False,
    start: ArrayLike | None = None,
    fixed: Mapping[str, float] | None = None,
) -> ContinuousEstimate:
    """Fit y = sum_j exp(-s Td_j) B_j(s)/A_j(s) u_j + e, e white at the samples, by maximum likelihood.

    Initial estimates by SRIVC [YoungJakeman1980; GarnierWang2008] and from discrete-time models; then output errors are
    minimised with exact sensitivities of the exactly sampled system. The input is held or linear between samples, as
    `data.intersample` says. Poles stay stable; `procest` has integrators. A delay is any real number: its criterion has
    several minima, of which the lowest from several initial delays is taken. Where a held input jumps exactly at the
    delayed samples (true delays of whole samples), the interval of the delay of a first-order lag is approximate. So
    are all intervals where the standard deviation of a delay exceeds half a sampling interval: 0.85 instead of 0.95 at
    one. A delay estimated as 0 has the standard deviation of one that could be negative.

    Args:
        data: One experiment, or several that share the model; missing outputs are left out. Several outputs are fitted
            one by one, each from all inputs. A frequency response is passed on to `fit_response`; of the options below
            `delay` it takes `max_iterations` alone.
        poles: Degree of the denominators: a number for all paths, one per input, or with several outputs a row per
            output of one per input.
        zeros: Degree of the numerators, likewise; one less than `poles` by default.
        delay: Delay in s, likewise; None is estimated.
        max_delay: Limit on estimated delays in s; by default 30 samples, at most a tenth of the shortest record, and
            more where a single input shows a longer one.
        max_iterations: Limit on the steps of each search.
        coloured: Whether the covariance allows for a disturbance that is not white (but independent of the input), by
            an autoregressive model of it whose order BIC selects [Ljung1999, ch. 9]. The estimate itself is the same.
        initial_conditions: "estimated", a free initial state of each experiment, or "zero", rest with zero input before
            the record: an input that is constant throughout is then a step at the first sample. With a free state the
            input before the record is unknown, and the first samples up to the delay do not count; where it moves
            there above all, as in a step test, it is taken as held at its first value before (`diagnostics`,
            "input_before") if BIC prefers that.
        offset: Whether every output of every experiment has an unknown constant beside the response of the model; it
            becomes part of `operating_point`, and the covariance allows for it. For a step test about an unknown level.
        start: Parameters near the answer (p,), in the sequence of their names, as `parameters` of an estimate of this
            structure; the search begins there alone. None finds its own starts.
        fixed: Parameters that are known, values by their names in the result, e.g. {"b0": 2.0, "a0": 4.0}; with several
            paths the name has its path, such as "b0[2]". They have no variance and do not count in criteria.

    Returns:
        The estimate; parameters b1, b0, a1, a0 ... by power of s, and Td. `continuous` is the model, `damp` gives its
        natural frequencies, damping and time constants with intervals.

    Raises:
        SysidError: Constant input but from rest, more zeros than poles, orders or delays too large for the data, an
            input that is band-limited between samples, options of records with a frequency response.

    Warns:
        SysidWarning: Poor excitation, no convergence, bad conditioning, a delay at its limit, a constant input.
    """

    def structures(ny: int, nu: int) -> tuple[tuple[RationalPath, ...], ...]:
        tables = [per_path("poles", poles, ny, nu), per_path("zeros", zeros, ny, nu), per_path("delay", delay, ny, nu)]
        return _structures(*tables)

    if isinstance(data, FrequencyResponse):
        _refuse_options_of_records(
            max_delay, coloured, initial_conditions, offset or start is not None or fixed is not None
        )
        rows = structures(*data.response.shape[1:])
        return _fit_to_response(data, rows, max_iterations)
    # what the estimate reports: with tables of poles the default has no single number
    orders: dict[str, object] = {"poles": poles, "zeros": zeros}
    if zeros is None:
        orders["zeros"] = max(poles - 1, 0) if isinstance(poles, int) else "poles - 1"
    return output_error_estimate(
        "tfest",
        data,
        structures,
        orders,
        max_delay=max_delay,
        max_iterations=max_iterations,
        coloured=coloured,
        initial_conditions=initial_conditions,
        offset=offset,
        start=start,
        fixed=fixed,
    )


def _structures(
    poles: list[list[Any]], zeros: list[list[Any]], delays: list[list[Any]]
) -> tuple[tuple[RationalPath, ...], ...]:
    """Structure of every path, a row per output, from tables of what the caller gives."""
    rows = []
    for row in zip(poles, zeros, delays, strict=True):
        rows.append(tuple(_structure(*orders) for orders in zip(*row, strict=True)))
    return tuple(rows)


def _structure(poles: object, zeros: object, delay: object) -> RationalPath:
    """Check the orders of one path."""
    n = whole_number("poles", poles, 0, MOST_POLES)
    # one zero less than poles by default: no direct term
    m = max(n - 1, 0) if zeros is None else whole_number("zeros", zeros, 0, n)
    if delay is None:
        return RationalPath(n, m, None)
    return RationalPath(n, m, real_number("delay", delay, "be a time >= 0 in s, or None", lambda d: d >= 0.0))


def _refuse_options_of_records(
    max_delay: float | None, coloured: bool, initial_conditions: InitialConditions | str, offset: bool
) -> None:
    """Refuse options that a frequency response has not, where they differ from the defaults."""
    at_default = (max_delay, coloured, offset) == (None, True, False)
    if not at_default or InitialConditions.of(initial_conditions) is not InitialConditions.ESTIMATED:
        raise SysidError(
            "a frequency response has no options max_delay, coloured, initial_conditions, offset, start and fixed, "
            "which are of records; see fit_response"
        )


def _fit_to_response(
    response: FrequencyResponse, rows: tuple[tuple[RationalPath, ...], ...], max_iterations: int
) -> ContinuousEstimate:
    """Fit the same structures to a frequency response."""
    nb, nf, delays = [], [], []
    for row in rows:
        nb.append([path.zeros + 1 for path in row])
        nf.append([path.poles for path in row])
        delays.append([path.delay for path in row])
    estimate = fit_response(response, nb, nf, delay=delays, continuous=True, max_iterations=max_iterations)
    return cast(ContinuousEstimate, estimate)
