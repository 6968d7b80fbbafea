"""Correlations over lag: of residuals with their bounds, and of the channels of a record."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sysid.frequency.covf import CovarianceFunction
from sysid.plots.palette import GRID, INK, PALETTE, Style
from sysid.plots.panels import channel_indices, channel_names, finish, panels, size_of
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError
from sysid.validation.resid import ResidualTest

Panel = tuple[str, FloatArray | NDArray[np.int_], FloatArray, FloatArray | float]
"""Label of the vertical axis, lags (n,) in samples, coefficients (n,), bound, one or (n,)."""


def correlations(
    test: ResidualTest | CovarianceFunction | Sequence[Panel],
    style: Style = PALETTE["oe"],
    *,
    output: int | str | None = None,
    input: int | str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Correlation coefficients over lag: whiteness and independence of residuals with their bounds, or of a record.

    Of a residual test a column per output: its autocorrelation, and below it the correlation with every input. Of
    covariance functions a panel per pair of channels, divided by the standard deviations: row later than column.

    Args:
        test: A residual test of `resid`, covariance functions of `covf`, or any panels.
        style: Colour of the method.
        output: Output of the residual test, by index or name; all when None.
        input: Input of the residual test, likewise.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, another type, no such channel.
    """
    if isinstance(test, CovarianceFunction):
        return _of_record(test, style, size)
    bounds, columns = "99 % bounds", []
    if isinstance(test, ResidualTest):
        bounds = f"{100 * test.level:g} % bounds"
        columns = _of_test(test, output, input)
    elif isinstance(test, Sequence) and not isinstance(test, str) and all(isinstance(p, tuple) for p in test):
        columns = [list(test)] if test else []
    else:
        raise SysidError(
            f"cannot draw a {type(test).__name__}; expected a ResidualTest, a CovarianceFunction, or panels of "
            "(label, lags, coefficients, bound)"
        )
    if not columns:
        raise SysidError("nothing to draw; expected one or more panels")
    height, width = len(columns[0]), len(columns)
    figure, grid = panels(height, width, size_of(size, height, width, (7.0, 2.6), (2.6, 1.8)))
    label_size = 10 if width == 1 and height < 4 else 8
    for b, column in enumerate(columns):
        for axes, (label, lags, values, bound) in zip(grid[:, b], column, strict=True):
            limit = np.broadcast_to(np.asarray(bound, dtype=float), lags.shape)
            axes.fill_between(lags, -limit, limit, color=GRID, alpha=0.7, lw=0, label=bounds)
            _stems(axes, lags, values, style)
            # The axis is scaled without lag zero, where an autocorrelation is one by definition.
            shown = values[lags != 0] if label.startswith("auto") else values
            # Zero coefficients with a zero bound would leave an axis without height.
            top = 1.25 * max(float(np.abs(shown).max(initial=0.0)), float(limit.max()), 1e-6)
            axes.set_ylim(-top, top)
            axes.set_ylabel(label, fontsize=label_size)
            if isinstance(test, ResidualTest) and not label.startswith("auto"):
                axes.set_title("residuals as they are; the test whitens them", loc="left", fontsize=7)
    return finish(figure, grid, "lag / samples")


def _stems(axes: Axes, lags: FloatArray | NDArray[np.int_], values: FloatArray, style: Style) -> None:
    axes.vlines(lags, 0.0, values, color=style.colour, lw=1.3)
    axes.plot(lags, values, ls="none", marker="o", ms=2.6, color=style.colour)
    axes.axhline(0.0, color=INK, lw=0.8)


def _of_record(covariance: CovarianceFunction, style: Style, size: tuple[float, float] | None) -> Figure:
    count = len(covariance.names)
    figure, grid = panels(count, count, size_of(size, count, count, (3.5, 2.4), (2.6, 1.8)), sharex=True)
    values = covariance.normalised
    for i, j in np.ndindex(count, count):
        axes: Axes = grid[i, j]  # type: ignore[assignment]
        _stems(axes, covariance.lags, values[:, i, j], style)
        # Normalised coefficients lie between -1 and 1; on one scale the panels can be compared.
        axes.set_ylim(-1.1, 1.1)
        title = f"{covariance.names[i]}" if i == j else f"{covariance.names[i]} after {covariance.names[j]}"
        axes.set_title(title, loc="left", fontsize=9)
    for axes in grid[:, 0]:
        axes.set_ylabel("correlation", fontsize=9)
    return finish(figure, grid, "lag / samples")


def _of_test(test: ResidualTest, output: int | str | None, input: int | str | None) -> list[list[Panel]]:
    ny, nu = test.independence_bound.shape
    outputs, inputs = channel_names(test.output_names, ny, "y"), channel_names(test.input_names, nu, "u")
    columns = []
    for i in channel_indices("output", output, outputs):
        title = "autocorrelation" if ny == 1 else f"autocorrelation\nof {outputs[i]}"
        column: list[Panel] = [(title, test.lags, test.autocorrelation[:, i, i], test.whiteness_bound)]
        for j in channel_indices("input", input, inputs):
            title = "correlation with input" if ny == nu == 1 else f"{outputs[i]} with\n{inputs[j]}"
            bound = float(test.independence_bound[i, j])
            column.append((title, test.cross_lags, test.cross_correlation[:, i, j], bound))
        columns.append(column)
    return columns
