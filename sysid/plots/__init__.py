"""Figures: one palette, axes with units, frequency in Hz on a logarithmic axis.

Every function takes results of estimators and tests, one, several, or several by name, and returns a matplotlib
`Figure` without window: save it by `figure.savefig(path)`, let a notebook show it as the last line of a cell, or open a
window by `sysid.plots.show(figure)` (`figure.show()` needs a figure of pyplot). With several inputs and outputs all are
drawn, or those selected by `input` and `output`.

    import sysid

    estimate = sysid.oe(data, 2, 2, 1)
    sysid.plots.record(data).savefig("data.png")
    sysid.plots.bode([sysid.spa(data), estimate]).savefig("bode.png")
    sysid.plots.step([estimate, sysid.cra(data)]).savefig("step.png")
    sysid.plots.pzmap({"identified": estimate}).savefig("roots.png")
    sysid.plots.correlations(sysid.resid(estimate, data)).savefig("residuals.png")
    sysid.plots.output_comparison(data, sysid.compare(estimate, data)).savefig("outputs.png")

`Curve`, `Roots` and `Trace` give an item its own name and `Style`.
"""

from sysid.plots.bode import bode
from sysid.plots.correlations import correlations
from sysid.plots.orders import singular_values, structures
from sysid.plots.palette import BOUND, GRID, INK, PALETTE, Style
from sysid.plots.panels import show
from sysid.plots.pzmap import pzmap
from sysid.plots.recursion import recursion
from sysid.plots.signals import output_comparison, record
from sysid.plots.spectra import spectra
from sysid.plots.traces import Curve, Level, Roots, Trace
from sysid.plots.transients import impulse, step

__all__ = [
    "BOUND",
    "GRID",
    "INK",
    "PALETTE",
    "Curve",
    "Level",
    "Roots",
    "Style",
    "Trace",
    "bode",
    "correlations",
    "impulse",
    "output_comparison",
    "pzmap",
    "record",
    "recursion",
    "show",
    "singular_values",
    "spectra",
    "step",
    "structures",
]
