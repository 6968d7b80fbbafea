"""Markdown tables on standard output, row by row, and the options, clock and environment that most benchmarks share.

A benchmark runs from the root of the repository with `PYTHONPATH=.`; `python tests/benchmarks/verification.py NAME`
runs it and renews its tables in `docs`.
"""

import argparse
import os
from pathlib import Path
from time import process_time

ROOT = Path(__file__).parents[2]


def options(doc):
    """A parser that shows the docstring of a benchmark as its help."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def timed(function, *arguments, clock=process_time, **options):
    """Result of a call and its time, s: processor time unless another clock is named."""
    begin = clock()
    result = function(*arguments, **options)
    return result, clock() - begin


def environment():
    """Environment of a process that imports this checkout and computes on one thread."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": str(ROOT)}


def heading(*names):
    """Print the heading of a table."""
    row(*names)
    print("|---" * len(names) + "|", flush=True)


def row(*cells):
    """Print a row of a table, at once."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)
