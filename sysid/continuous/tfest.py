"""Continuous-time transfer functions from records."""

from collections.abc import Sequence
from typing import cast

from sysid.continuous.fit_response import fit_response
from sysid.continuous.output_error import output_error_estimate
from sysid.continuous.structures import PathStructure, PerPath, RationalPath, per_path
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
        max_delay: Limit on estimated delays in s; by default 30 samples, at most a tenth of the shortest record.
        max_iterations: Limit on the steps of each search.
        coloured: Whether the covariance allows for a disturbance that is not white (but independent of the input), by
            an autoregressive model of it whose order BIC selects [Ljung1999, ch. 9]. The estimate itself is the same.
        initial_conditions: "estimated", a free initial state of each experiment, or "zero", rest.
        offset: Whether every output of every experiment has an unknown constant beside the response of the model; it
            becomes part of `operating_point`, and the covariance allows for it. For a step test about an unknown level.

    Returns:
        The estimate; parameters b1, b0, a1, a0 ... by power of s, and Td. `continuous` is the model, `damp` gives its
        natural frequencies, damping and time constants with intervals.

    Raises:
        SysidError: Constant input, more zeros than poles, orders or delays too large for the data, an input that is
            band-limited between samples, options of records with a frequency response.

    Warns:
        SysidWarning: Poor excitation, no convergence, bad conditioning, a delay at its limit.
    """

    def structures(ny: int, nu: int) -> tuple[tuple[PathStructure, ...], ...]:
        tables = [per_path(name, value, ny, nu) for name, value in values.items()]
        return tuple(tuple(_structure(*(table[i][j] for table in tables)) for j in range(nu)) for i in range(ny))

    values = {"poles": poles, "zeros": zeros, "delay": delay}
    if isinstance(data, FrequencyResponse):
        if (max_delay, coloured, offset) != (None, True, False) or (
            InitialConditions.of(initial_conditions) is not InitialConditions.ESTIMATED
        ):
            raise SysidError(
                "a frequency response has no options max_delay, coloured, initial_conditions and offset, which are of "
                "records; see fit_response"
            )
        rows = structures(*data.response.shape[1:])
        return cast(
            ContinuousEstimate,
            fit_response(
                data,
                [[path.zeros + 1 for path in row] for row in rows],
                [[path.poles for path in row] for row in rows],
                delay=[[path.delay for path in row] for row in rows],
                continuous=True,
                max_iterations=max_iterations,
            ),
        )
    fewer = max(poles - 1, 0) if isinstance(poles, int) else "poles - 1"
    orders = {"poles": poles, "zeros": fewer if zeros is None else zeros}
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
    )


def _structure(poles: object, zeros: object, delay: object) -> RationalPath:
    n = whole_number("poles", poles, 0, MOST_POLES)
    m = max(n - 1, 0) if zeros is None else whole_number("zeros", zeros, 0, n)
    late = None if delay is None else real_number("delay", delay, "be a time >= 0 in s, or None", lambda d: d >= 0.0)
    return RationalPath(n, m, late)
