"""Markdown tables on standard output, row by row, and the options, clock and environment that most benchmarks share.

A benchmark runs from the root of the repository with `PYTHONPATH=.`; `python tests/benchmarks/verification.py NAME`
runs it and renews its tables in `docs` and `docs/measured`.
"""

import argparse
import os
from pathlib import Path
from time import process_time

from scipy.stats import binomtest

ROOT = Path(__file__).parents[2]


def options(doc):
    """A parser that shows the docstring of a benchmark as its help."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def timed(function, *arguments, clock=process_time, **options):
    """Result of a call and its time, s: processor time unless another clock is named."""
    begin = clock()
    result = function(*arguments, **options)
    return result, clock() - begin


def bare_seconds(arm, log):
    """Processor time of MuJoCo's own steps of one experiment with the controls it had: the limit of a simulation."""
    import mujoco

    data, controls = arm.rest(arm.pose(log.provenance["pose"])), arm.controls(log.commanded)
    substeps = round(log.dt / arm.model.opt.timestep)

    def steps():
        for values in controls:
            data.ctrl[:] = values
            mujoco.mj_step(arm.model, data, nstep=substeps)

    return timed(steps)[1]


def environment():
    """Environment of a process that imports this checkout and computes on one thread."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": str(ROOT)}


def percentage(hits, trials, digits=1):
    """Percentage with its 95 % interval, by Wilson's score."""
    interval = binomtest(hits, trials).proportion_ci(0.95, "wilson")
    return "{:.{d}f} ({:.{d}f} to {:.{d}f})".format(*(100 * p for p in (hits / trials, *interval)), d=digits)


def heading(*names):
    """Print the heading of a table."""
    row(*names)
    print("|---" * len(names) + "|", flush=True)


def row(*cells):
    """Print a row of a table, at once."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)
