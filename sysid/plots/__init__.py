"""Figures: one palette, axes with units, frequency in Hz on a logarithmic axis.

Every function takes records as estimators and tests return them, one or several or several by name, and returns a
matplotlib `Figure`. It belongs to no window: save it by `figure.savefig(path)`, let a notebook show it as the last line
of a cell, or open a window by `sysid.plots.show(figure)` (`figure.show()` is for figures that pyplot has made).
With several inputs and outputs all are drawn, or those chosen by `input` and `output`.

    import sysid

    found = sysid.oe(data, 2, 2, 1)
    sysid.plots.record(data).savefig("data.png")
    sysid.plots.bode([sysid.spa(data), found]).savefig("bode.png")
    sysid.plots.step([found, sysid.cra(data)]).savefig("step.png")
    sysid.plots.pzmap({"identified": found}).savefig("roots.png")
    sysid.plots.correlations(sysid.resid(found, data)).savefig("residuals.png")
    sysid.plots.output_comparison(data, sysid.compare(found, data)).savefig("outputs.png")

`Curve`, `Roots` and `Trace` give a record a name and a `Style` of its own.
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
