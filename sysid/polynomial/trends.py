"""Constants and straight lines in the outputs, as part of a polynomial model.

y = k0 + k1 t + B/F u + C/D e, each experiment with k0 and k1 of its own. They enter the prediction errors linearly, as
free initial conditions do, and are projected out with them [GolubPereyra2003].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from sysid.polynomial.least_squares import solve_blocks, triangle_of_blocks
from sysid.polynomial.orders import NO_TREND, Orders
from sysid.polynomial.regressors import equation_blocks
from sysid.records.arguments import truth_value
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.trends import trend

OFFSET, LINE = 0, 1  # degrees
LAGS = 10  # of outputs and inputs in the ARX model that tells a trend from a transient
ROWS_PER_COEFFICIENT = 5  # least number of samples per coefficient of that model
EXACT = 1e-22  # sum of squares, relative to that of the output, that is rounding of data without noise
DOUBT = 2.0  # penalty of a term of a trend beside log(N): every record is looked at for one
UNIT_ROOT = 1e-6  # A(1), relative to the coefficients, below which an output drifts instead of having a level


def trend_degree(offset: bool = False, trend: bool = False) -> int:
    """Degree of the trend that the options of an estimator ask for; a straight line includes a constant.

    Raises:
        SysidError: Options that are neither True nor False.
    """
    offset, line = truth_value("offset", offset), truth_value("trend", trend)
    if line:
        return LINE
    return OFFSET if offset else NO_TREND


def trend_terms(degree: int, samples: int) -> FloatArray:
    """A constant 1 and a line from -1 to 1, as far as the degree asks for them (samples, degree + 1)."""
    time = np.linspace(-1.0, 1.0, samples)
    return np.stack([time**power for power in range(degree + 1)], axis=1) if degree >= 0 else np.zeros((samples, 0))


@dataclass(frozen=True)
class Levelled:
    """Records without their trends.

    Attributes:
        experiments: What remains of them.
        trends: What was subtracted from the output of each experiment (N_i,).
    """

    experiments: tuple[IOData, ...]
    trends: tuple[FloatArray, ...]

    @staticmethod
    def of(experiments: Sequence[IOData]) -> "Levelled":
        """The records as they are, nothing subtracted yet."""
        return Levelled(tuple(experiments), tuple(np.zeros(len(e)) for e in experiments))

    def subtract(self, trends: Sequence[FloatArray]) -> "Levelled":
        """Subtract further trends (N_i,)."""
        experiments, total = [], []
        for experiment, so_far, further in zip(self.experiments, self.trends, trends, strict=True):
            experiments.append(experiment.subtract(y=further[:, None]))
            total.append(so_far + further)
        return Levelled(tuple(experiments), tuple(total))


def subtract_lines(
    experiments: Sequence[IOData], offsets: Sequence[Sequence[float]], slopes: Sequence[Sequence[float]] | None = None
) -> tuple[IOData, ...]:
    """The experiments without constants or straight lines in their outputs, as estimates with a trend give them.

    Args:
        experiments: The experiments.
        offsets: Of each experiment the mean of the line in every output (experiments, ny).
        slopes: Of each the slopes per second, likewise; None of constants.
    """
    without = []
    for k, experiment in enumerate(experiments):
        line = np.broadcast_to(np.array(offsets[k]), experiment.y.shape)
        if slopes is not None:
            # the offset of a line is its mean
            time = (np.arange(len(experiment)) - 0.5 * (len(experiment) - 1)) * experiment.dt
            line = line + time[:, None] * np.array(slopes[k])
        without.append(experiment.subtract(y=line))
    return tuple(without)


def best_degree(experiments: Sequence[IOData]) -> int:
    """Degree of the trend that an ARX model of many lags needs, by BIC [Schwarz1978] and `DOUBT`; -1 if none.

    Without noise it is the lowest degree that fits exactly. Too few samples for such a model need none.

    Args:
        experiments: Records without gaps.
    """
    nu, count = experiments[0].nu, len(experiments)
    lags = _arx_lags(experiments)
    if lags < 1:
        return NO_TREND
    orders = Orders(lags, (lags + 1,) * nu, 0, 0, (0,) * nu, (0,) * nu, LINE)
    starts = [orders.first_row(e.window) for e in experiments]
    y, u = [e.y[:, 0] for e in experiments], [e.u for e in experiments]
    # behind the lags stand all constants, then all lines: the triangle holds the sum of squares with each added
    terms = orders.trend_terms * count
    by_degree = np.argsort(np.arange(terms) % orders.trend_terms, kind="stable")
    places = np.concatenate((terms + np.arange(orders.count), by_degree, [terms + orders.count]))

    def blocks() -> Iterator[FloatArray]:
        for block in equations_with_trends(y, u, orders, starts):
            yield block[:, places]

    triangle, lengths, rows = triangle_of_blocks(blocks)
    if rows <= terms + orders.count:
        return NO_TREND
    remainder = triangle[:, -1] * lengths[-1]
    squares = [float(np.sum(remainder[orders.count + k * count :] ** 2)) for k in range(LINE + 2)]
    exact = [k for k, value in enumerate(squares) if value <= EXACT * lengths[-1] ** 2]
    if exact:
        return exact[0] + NO_TREND
    criteria = [rows * np.log(value) + k * count * (np.log(rows) + DOUBT) for k, value in enumerate(squares)]
    return int(np.argmin(criteria)) + NO_TREND


def _arx_lags(experiments: Sequence[IOData]) -> int:
    """Lags of the ARX model that tells a trend from a transient, as many as the samples allow."""
    shortest = min(len(e) - e.window for e in experiments)
    return min(LAGS, shortest // (ROWS_PER_COEFFICIENT * (1 + experiments[0].nu)))


def level(experiments: Sequence[IOData], degree: int) -> Levelled:
    """Subtract the trends that an ARX model with trends finds; the fit that follows only has to refine them.

    A mean would include a transient from far away. So few samples that they determine no ARX model lose their mean, or
    the line through them.
    """
    shapes = [trend_terms(degree, len(experiment)) for experiment in experiments]
    rough = [
        trend(shape, experiment.y, experiment.window)[:, 0]
        for shape, experiment in zip(shapes, experiments, strict=True)
    ]
    levelled = Levelled.of(experiments).subtract(rough)
    return levelled.subtract(_trends_beside_arx(levelled.experiments, degree))


def _trends_beside_arx(experiments: Sequence[IOData], degree: int) -> list[FloatArray]:
    """Trends of an ARX model of many lags (N_i,) each; zeros where the data do not determine it."""
    nu = experiments[0].nu
    lags = _arx_lags(experiments)
    zeros = [np.zeros(len(e)) for e in experiments]
    if lags < 1:
        return zeros
    # lag 0 of the inputs too: the delay is not known here
    orders = Orders(lags, (lags + 1,) * nu, 0, 0, (0,) * nu, (0,) * nu, degree)
    starts = [orders.first_row(e.window) for e in experiments]
    y, u = [e.y[:, 0] for e in experiments], [e.u for e in experiments]
    of_trends = orders.trend_terms * len(experiments)
    blocks = partial(equations_with_trends, y, u, orders, starts)
    if sum(len(yi) - start for yi, start in zip(y, starts, strict=True)) <= of_trends + orders.count:
        return zeros
    solution = solve_blocks(blocks, of_trends + orders.count).solution[:, 0]
    a = np.concatenate(([1.0], solution[of_trends : of_trends + lags]))
    # an output that drifts has no level, and its drift is left to the fit
    if abs(a.sum()) <= UNIT_ROOT * np.abs(a).sum():
        return zeros
    trends = []
    for experiment, of_equation in zip(experiments, solution[:of_trends].reshape(len(experiments), -1), strict=True):
        terms = trend_terms(degree, len(experiment))
        trends.append(terms @ _trend_of_equation(a, of_equation, len(experiment)))
    return trends


def equations_with_trends(
    y: Sequence[FloatArray], u: Sequence[FloatArray], orders: Orders, starts: Sequence[int]
) -> Iterator[FloatArray]:
    """Equations of an ARX model as blocks of rows [terms of the trend of every experiment, Phi, y].

    Rows with a missing sample are left out, as by `equation_blocks`.
    """
    terms = orders.trend_terms
    for k, (yi, ui, start) in enumerate(zip(y, u, starts, strict=True)):
        # a term of the trend is an input without lags
        inputs = np.column_stack((ui, trend_terms(orders.trend, len(yi))))
        nb, nk = (*orders.nb, *(1,) * terms), (*orders.nk, *(0,) * terms)
        for block in equation_blocks([yi], [inputs], orders.na, nb, nk, [start]):
            of_phi = orders.na + sum(orders.nb)
            of_trends = np.zeros((len(block), len(y) * terms))
            of_trends[:, k * terms : (k + 1) * terms] = block[:, of_phi : of_phi + terms]
            yield np.hstack((of_trends, block[:, :of_phi], block[:, -1:]))


def _trend_of_equation(a: FloatArray, coefficients: FloatArray, samples: int) -> FloatArray:
    """Coefficients of the trend k of the output for which A k is the trend of the equation."""
    gain = float(a.sum())
    if len(coefficients) == 1:
        return coefficients / gain
    # a line that is delayed by i samples is lower by i steps of it
    step = 2.0 / max(samples - 1, 1)
    slope = coefficients[1] / gain
    return np.array([(coefficients[0] + slope * step * float(a @ np.arange(len(a)))) / gain, slope])
