"""Order selection: singular values, canonical correlations, criteria over the number of parameters."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, LogLocator, NullLocator

from sysid.models.estimate import Estimate
from sysid.models.reduction import hankel_singular_values
from sysid.models.state_space import StateSpace
from sysid.plots.palette import BOUND, PALETTE, Style
from sysid.plots.panels import finish, panels
from sysid.plots.traces import StyleChooser, named_items
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError
from sysid.subspace.era import Realisation
from sysid.validation.structure_scan import StructureTable

Spectrum = Realisation | Estimate | StateSpace
"""Anything with singular values that indicate an order."""

NARROW = 5.0  # range of a logarithmic axis, as a factor, below which its ticks are evenly spaced
INVISIBLE = 1e-14  # singular values, relative to the largest, that are rounding


def singular_values(
    models: Spectrum | Sequence[Spectrum] | Mapping[str, Spectrum],
    *,
    limit: int = 30,
    size: tuple[float, float] = (7.0, 3.8),
) -> Figure:
    """Singular values over their number, those within the model filled: a gap indicates the order.

    Of `okid`, `era` and `era_dc` those of the Hankel matrix of Markov parameters, of `n4sid` the canonical correlations
    of past and future, of any other stable model its `hankel_singular_values`. Each is divided by its largest, except
    canonical correlations, which lie between 0 and 1.

    Args:
        models: Realisations, estimates or models: one, several, or several by name.
        limit: Largest number of values drawn.
        size: Width and height, inch.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, another type, a model that is not stable.
    """
    limit = whole_number("limit", limit, 1)
    styles = StyleChooser()
    figure, grid = panels(1, 1, size)
    axes = grid[0, 0]
    longest = 1
    for name, item in named_items(models, (Realisation, Estimate, StateSpace)):
        matrix, values, order = _values(item)
        if isinstance(item, Realisation):
            shown, method = name or "realisation", "okid"
        else:
            shown, method = name or styles.label(item), getattr(item, "method", "")
        style = styles.next(method)
        values = np.where(values > INVISIBLE * values.max(initial=0.0), values, np.nan)[:limit]
        positions = np.arange(1, len(values) + 1)
        # Values that are rounding are not drawn; they do not lengthen the axis either.
        longest = max(longest, int(positions[np.isfinite(values)].max(initial=1)))
        axes.plot(positions, values, color=style.colour, lw=0.8, ls=style.line or ":")
        look = {"ls": "none", "marker": style.marker, "ms": 5, "color": style.colour}
        # Full markers are the states that the model keeps.
        kept = positions <= order
        axes.plot(positions[kept], values[kept], **look, mfc=style.colour, label=f"{shown}: {matrix}")
        axes.plot(positions[~kept], values[~kept], **look, mfc="white")
    axes.set_yscale("log")
    axes.set_xlim(0.5, longest + 0.5)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel("singular value")
    return finish(figure, grid, "number (filled: in the model)")


def _values(item: Spectrum) -> tuple[str, FloatArray, int]:
    if isinstance(item, Realisation):
        values, matrix, order = item.hankel_singular_values, "Hankel", item.model.order
    elif isinstance(item, Estimate) and "canonical_correlations" in item.diagnostics:
        return "canonical correlations", np.asarray(item.diagnostics["canonical_correlations"]), item.model.order
    elif isinstance(item, Estimate) and "hankel_singular_values" in item.diagnostics:
        values, matrix, order = np.asarray(item.diagnostics["hankel_singular_values"]), "Hankel", item.model.order
    else:
        model = item.model if isinstance(item, Estimate) else item
        values, matrix, order = hankel_singular_values(model), "Hankel, of the model", model.order
    # A model without dynamics has only zero values: the divisor must not vanish.
    return matrix, values / max(float(values.max(initial=0.0)), np.finfo(float).tiny), order


def structures(table: StructureTable, *, size: tuple[float, float] = (7.0, 4.2)) -> Figure:
    """Criteria of candidate structures over their number of parameters: every candidate, and the best of each number.

    All in units of the mean square error: the loss itself, exp(AIC), exp(BIC), and the error on validation data. With
    several outputs the criteria are divided by their number ny first, so that their exponentials have these units too.

    Args:
        table: Result of `selstruc` or `structure_scan`.
        size: Width and height, inch.

    Returns:
        The figure.

    Raises:
        SysidError: Not a table.
    """
    if not isinstance(table, StructureTable):
        raise SysidError(
            f"cannot draw a {type(table).__name__}; expected a StructureTable of selstruc or structure_scan"
        )
    figure, grid = panels(1, 1, size)
    axes = grid[0, 0]
    ny = table.outputs
    # Divided by the number of outputs, the exponentials of the criteria have the units of the loss.
    root = "" if ny == 1 else f"/{ny}"
    curves: list[tuple[str, FloatArray, Style, bool]] = [
        ("loss", table.loss, PALETTE["measured"], False),
        (f"exp(AIC{root})", np.exp(table.aic / ny), PALETTE["pem_ss"], True),
        (f"exp(BIC{root})", np.exp(table.bic / ny), PALETTE["armax"], True),
        ("validation", table.validation, PALETTE["oe"], True),
    ]
    counts = np.unique(table.parameters)
    for name, values, style, judged in curves:
        shown = np.isfinite(values) & (values > 0.0)
        if not shown.any():
            continue
        axes.plot(table.parameters[shown], values[shown], ls="none", marker=".", ms=4, alpha=0.4, color=style.colour)
        smallest = np.array([values[shown & (table.parameters == count)].min(initial=np.inf) for count in counts])
        fitted = np.isfinite(smallest)
        legend = name
        if judged:
            best = int(np.argmin(np.where(shown, values, np.inf)))
            orders = zip(table.names, table.orders[best], strict=True)
            legend = f"{name}: " + ", ".join(f"{order} {value}" for order, value in orders)
            axes.plot(table.parameters[best], values[best], marker="o", ms=9, mfc="none", mew=1.6, color=style.colour)
        axes.plot(counts[fitted], smallest[fitted], color=style.colour, ls=style.line, lw=style.width, label=legend)
    axes.set_yscale("log")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel("mean square error")
    bottom, top = axes.get_ylim()
    # Labels of all nine digits of a decade would overlap.
    if top / bottom < NARROW:
        axes.yaxis.set_major_locator(AutoLocator())
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    for which in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        which(lambda value, _: f"{value:g}")
    axes.tick_params(which="minor", labelsize=7, colors=BOUND.colour)
    return finish(figure, grid, "number of parameters (ring: the least)")
