"""Panels over lag: correlations, residual tests, Markov parameters, Hankel singular values, errors of observers."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scenarios.record_figures.observer_errors import ObserverError
from scenarios.report.chart import Panel, Series
from scenarios.report.figure_style import points
from sysid import ResidualTest
from sysid.frequency import CovarianceFunction
from sysid.plots import PALETTE, Style

LAG = "lag / samples"

AFTER = "samples after the pulse"
"""Label of the axis of pulse responses: another than that of lags, as axes of one label are linked on the page."""

LOG_MARGIN = 1.3
"""Factor by which a logarithmic axis extends beyond its values."""

Mark = tuple[str, float, str]
"""Axis that a line stands on, its value there and its name."""


def autocorrelation_panel(tests: Iterable[tuple[str, ResidualTest, Style]], output: int, title: str = "") -> Panel:
    """Autocorrelation of the residuals of an output with its bounds, models side by side at each lag."""
    series, bound, level = [], 0.0, ""
    for index, (label, test, look) in enumerate(tests):
        # Lag 0 is one by definition and would set the scale.
        coefficients = test.autocorrelation[1:, output, output]
        series.append(Series(label, test.lags[1:] + _shift(index), coefficients, look, kind="stem"))
        # Tests of one record share its bounds.
        bound, level = float(test.whiteness_bound), _level(test)
    return Panel(LAG, "autocorrelation", series, title, marks=_bounds(bound, level))


def cross_correlation_panel(
    tests: Iterable[tuple[str, ResidualTest, Style]], output: int, input: int, title: str = ""
) -> Panel:
    """Correlation of the residuals of an output with an input, with its bounds, models side by side at each lag."""
    series, bound, level = [], 0.0, ""
    for index, (label, test, look) in enumerate(tests):
        coefficients = test.cross_correlation[:, output, input]
        series.append(Series(label, test.cross_lags + _shift(index), coefficients, look, kind="stem"))
        # The bound depends on the colour of the residuals: that of the last model is drawn.
        bound, level = float(test.independence_bound[output, input]), _level(test)
    return Panel(LAG, "with the input", series, title, marks=_bounds(bound, level))


def _shift(index: int) -> float:
    """Horizontal shift of one model's stems, so that those of several models stand side by side."""
    return 0.4 * index


def _level(test: ResidualTest) -> str:
    return f"{100.0 * test.level:g} %"


def _bounds(bound: float, level: str) -> tuple[Mark, Mark]:
    """Lines at both bounds, the upper one named."""
    return ("y", bound, level), ("y", -bound, "")


def correlation_panel(functions: Iterable[tuple[str, CovarianceFunction, str]], row: int, column: int) -> Panel:
    """Correlation coefficients of two channels, the first later, as label, function and colour of several records."""
    series = []
    for label, function, colour in functions:
        series.append(Series(label, function.lags, function.normalised[:, row, column], Style(colour, "-", 1.0)))
    return Panel(LAG, "correlation", series)


def observer_markov_series(diagnostics: Mapping[str, Any], output: int = 0, input: int = 0) -> list[Series]:
    """Markov parameters of an observer from a command and from a measurement, side by side at each lag.

    Args:
        diagnostics: Those of an estimate by `okid`.
        output: Number of the output.
        input: Number of the input.
    """
    series = []
    for signal, column, label, shift, colour in (
        ("u", input, "of the command", -0.2, PALETTE["okid"].colour),
        ("y", output, "of the measurement", 0.2, "#7a5195"),
    ):
        values = np.asarray(diagnostics[f"observer_markov_{signal}"])[:, output, column]
        series.append(Series(label, np.arange(1, len(values) + 1) + shift, values, Style(colour), kind="stem"))
    return series


def hankel_panel(singular_values: ArrayLike, count: int, marks: tuple[Mark, ...] = ()) -> Panel:
    """The first Hankel singular values, relative to the largest."""
    # Over the largest: absolute sizes depend on the scaling of the channels.
    values = np.asarray(singular_values, dtype=float)[:count]
    sizes = Series("Hankel singular value", np.arange(1, len(values) + 1), values / values[0], points("okid", "D"))
    return Panel("number", "over the largest", [sizes], "Hankel singular values", "y", marks=marks)


def observer_error_panel(errors: Sequence[ObserverError], marks: tuple[Mark, ...]) -> Panel:
    """Prediction and smoothing errors of observers over their number of Markov parameters, percent of the output."""
    numbers = [error.p for error in errors]
    curves = [
        Series("prediction error", numbers, [100 * error.prediction for error in errors], PALETTE["okid"]),
        Series("smoothing error", numbers, [100 * error.smoothing for error in errors], PALETTE["oe"]),
    ]
    values = [100 * error.prediction for error in errors] + [100 * error.smoothing for error in errors]
    limits = (min(values) / LOG_MARGIN, max(values) * LOG_MARGIN) if min(values) > 0.0 else None
    label = "observer Markov parameters p"
    return Panel(label, "% of the output", curves, "errors over p", "y", y_limits=limits, marks=marks)
