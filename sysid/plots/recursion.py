"""Parameters of recursive estimators over time."""

import numpy as np
from matplotlib.figure import Figure

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import NORMAL_95
from sysid.plots.palette import PALETTE
from sysid.plots.panels import apart, finish, panels, size_of
from sysid.records.errors import SysidError
from sysid.recursive.recursive_estimate import RecursiveEstimate

LOOKS = tuple(PALETTE[name] for name in ("armax", "oe", "okid", "bj", "arx", "iv4", "n4sid", "spa"))
"""Styles of the coefficients of a polynomial, in their sequence."""

LINE = 0.14  # height of a line of a label, inch
SETTLING = 0.05  # initial part of the record whose parameters may exceed the axis: they are arbitrary


def recursion(
    estimate: RecursiveEstimate, *, reference: Estimate | None = None, size: tuple[float, float] | None = None
) -> Figure:
    """Parameters sample by sample, a panel per polynomial; at the end the last ones with their 95 % intervals.

    Args:
        estimate: Result of `rarx`, `rarmax` or `roe`.
        reference: An estimate from the whole record; its parameters are drawn as dotted lines where it has the same.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Not a recursive estimate.
    """
    if not isinstance(estimate, RecursiveEstimate):
        raise SysidError(
            f"cannot draw a {type(estimate).__name__}; expected a RecursiveEstimate of rarx, rarmax or roe"
        )
    letters = list(dict.fromkeys(name[0] for name in estimate.parameter_names))
    dt = estimate.state.dt
    count = len(estimate.parameters)
    # the record may be the last part of a longer recursion
    time = (np.arange(count) + estimate.state.samples - count) * dt
    # Rounding may leave a variance just below zero.
    deviations = np.sqrt(np.maximum(np.diag(estimate.final.covariance), 0.0))
    truth = {} if reference is None else dict(zip(reference.parameter_names, reference.parameters, strict=True))
    figure, grid = panels(len(letters), 1, size_of(size, len(letters), 1, (7.0, 2.8), (0.0, 1.8)), sharex=True)
    for axes, letter in zip(grid[:, 0], letters, strict=True):
        of_letter = [k for k, name in enumerate(estimate.parameter_names) if name[0] == letter]
        settled = estimate.parameters[int(SETTLING * count) :, of_letter]
        low, high = float(settled.min()), float(settled.max())
        values = [truth[estimate.parameter_names[k]] for k in of_letter if estimate.parameter_names[k] in truth]
        low, high = min([low, *values]), max([high, *values])
        # A parameter that stays constant has no range of its own: a thousandth of its size stands for it.
        margin = 0.15 * max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-12)
        axes.set_ylim(low - margin, high + margin)
        height = 0.75 * figure.get_figheight() / len(letters)
        # Names of nearly equal parameters would be written over each other.
        label_heights = apart(estimate.final.parameters[of_letter], LINE / height * (high - low + 2.0 * margin))
        for rank, k in enumerate(of_letter):
            style = LOOKS[rank % len(LOOKS)]
            name = estimate.parameter_names[k]
            axes.plot(time, estimate.parameters[:, k], color=style.colour, lw=1.3)
            # Intervals stand side by side: those of nearly equal parameters would cover each other.
            end = time[-1] + 0.015 * (time[-1] - time[0]) * (1 + rank)
            last, reach = estimate.final.parameters[k], NORMAL_95 * deviations[k]
            axes.errorbar(end, last, yerr=reach, color=style.colour, fmt=".", ms=5, capsize=3)
            axes.annotate(
                name,
                (1.0, label_heights[rank]),
                xycoords=("axes fraction", "data"),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
                color=style.colour,
            )
            if name in truth:
                axes.axhline(truth[name], color=style.colour, ls=":", lw=1.1)
        axes.set_ylabel(f"{letter} coefficients")
    return finish(figure, grid, "time / s")
