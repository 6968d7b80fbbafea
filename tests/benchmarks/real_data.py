"""Fits to measured data beside the peers, at equal orders.

Run by hand in an environment that has the peers, with a folder that holds the DaISy files [DeMoor1997]:
`python tests/benchmarks/real_data.py FOLDER`, or all benches by `make verification DATA=FOLDER`. Models are fitted to
the first half of each record, mean removed, and judged on both halves by this package's `residuals` and `compare`, the
initial state fitted to each half for every model alike. A loss is the root mean square of the errors; of two outputs,
the fourth root of the determinant of their covariance.
"""

import contextlib
import os
import sys
import warnings
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

import sysid
from scenarios.estimators import polynomial_peers
from scenarios.estimators.state_space_peers import (
    jax_output_error,
    jax_sysid_oe,
    nfoursid_n4sid,
    sippy_n4sid,
    slicot_n4sid,
)
from scenarios.estimators.task import Task
from sysid.polynomial.structures import STRUCTURES as ORDER_NAMES
from tests.benchmarks.tables import heading, row

SETS = {
    "robot arm": ("robot_arm.dat", (0,), (1,), 1.0),
    "hair dryer": ("hair_dryer.dat", (0,), (1,), 0.08),
    "heat exchanger": ("heat_exchanger.dat", (1,), (2,), 1.0),
    "CD player, y1": ("cd_player_arm.dat", (0, 1), (2,), 1.0),
    "CD player, y2": ("cd_player_arm.dat", (0, 1), (3,), 1.0),
    "CD player": ("cd_player_arm.dat", (0, 1), (2, 3), 1.0),
}
STRUCTURES = (
    ("robot arm", "armax", (4, 4, 4, 1)),
    ("robot arm", "oe", (4, 4, 1)),
    ("hair dryer", "armax", (2, 2, 2, 3)),
    ("hair dryer", "oe", (2, 2, 3)),
    ("heat exchanger", "armax", (2, 2, 2, 1)),
    ("heat exchanger", "oe", (2, 2, 1)),
    ("CD player, y1", "armax", (4, 4, 4, 1)),
    ("CD player, y2", "armax", (4, 4, 4, 1)),
)
ORDERS = (2, 4, 6, 8, 10)
BLOCK_ROWS = (10, 15, 20, 30, 40)
"""Of the N4SID models among which prediction-error fits begin."""


@contextlib.contextmanager
def silence():
    """Send what compiled code prints to nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            sys.stdout.flush()
            os.dup2(kept, 1)
            os.close(kept)


def halves(folder, name):
    """For estimation and for validation, the means of the first removed from both."""
    file, inputs, outputs, dt = SETS[name]
    table = np.loadtxt(folder / file)
    half = len(table) // 2
    table = table - table[:half].mean(axis=0)
    data = sysid.IOData(table[:, inputs], table[:, outputs], dt)
    return data[:half], data[half:]


def attempt(fit):
    """The model, or why there is none."""
    try:
        with silence(), np.errstate(all="ignore"):
            return fit()
    except Exception as error:
        return error


def loss(errors):
    """Root mean square, of several outputs the geometric mean of the principal ones."""
    return float(np.linalg.det(np.atleast_2d(errors.T @ errors / len(errors))) ** (0.5 / errors.shape[1]))


def scores(model, first, second):
    """Losses and fits on both halves."""
    if isinstance(model, Exception):
        return f"failed: {type(model).__name__}", "", "", ""
    predictor = np.abs(np.linalg.eigvals(model.A - model.gain @ model.C)).max(initial=0.0)
    losses = [f"unstable predictor, radius {predictor:.3f}", ""]
    if not model.gain.any():
        losses = ["–", "–"]
    elif predictor <= 1.0:
        losses = [f"{loss(sysid.residuals(model, half)):.6g}" for half in (first, second)]
    if not model.is_stable():
        return *losses, f"unstable, radius {np.abs(model.poles()).max():.3f}", ""
    ours, theirs = (sysid.compare(model, half)[0] for half in (first, second))
    fits = ", ".join(f"{percent:.2f} %" for percent in theirs.simulation)
    return *losses, f"{loss(first.y - ours.simulated):.6g}", fits


def polynomial_fits(method, orders, data):
    """Who fitted a polynomial structure, and the model in innovations form."""
    task = Task(method, dict(zip(ORDER_NAMES[method], orders, strict=True)), max(orders), np.ones(1))
    peers = {"sippy-unipi": partial(polynomial_peers.sippy_polynomials, method)}
    if data.nu == 1:
        peers["pysib"] = getattr(polynomial_peers, f"pysib_{method}")
    if method == "armax" and data.nu > 1:
        peers["sippy-unipi, ILLS"] = partial(polynomial_peers.sippy_polynomials, method, mode="ILLS")
    if method == "oe" and orders[-1] == 1:
        peers["jax-sysid"] = jax_sysid_oe
    yield "this package", attempt(lambda: getattr(sysid, method)(data, *orders).model)
    for peer, fit in peers.items():
        yield peer, attempt(lambda fit=fit: fit(data, task).model)


def states(order):
    """The task of a state-space model."""
    return Task("ss", {"order": order}, order, np.ones(1))


def control_era(data, order):
    """python-control: pulse response by least squares, 200 values, and the eigensystem realization algorithm."""
    import control

    pulses = control.markov(data.y.T, data.u.T, 200)
    m = control.eigensys_realization(pulses, order)[0]
    return sysid.StateSpace(m.A, m.B, m.C, m.D, None, data.dt)


def state_space_fits(data, order):
    """Who fitted a state-space model of some order: those with an innovation gain, then those without.

    SLICOT's options that ask for the gain are left alone (`test_state_space.py`).
    """

    def starts():
        return [sysid.n4sid(data, order, block_rows=rows, stable=True) for rows in BLOCK_ROWS]

    yield "this package, pem_ss", attempt(lambda: sysid.pem_ss(data, starts()).model)
    yield "this package, n4sid", attempt(lambda: sysid.n4sid(data, order).model)
    yield "this package, okid", attempt(lambda: sysid.okid(data, order, p=20).model)
    for weighting in ("N4SID", "MOESP", "CVA", "PARSIM-K"):
        fit = partial(sippy_n4sid, data, states(order), weighting=weighting, direct=True)
        yield f"sippy-unipi, {weighting}", attempt(lambda fit=fit: fit().model)
    yield "nfoursid", attempt(lambda: nfoursid_n4sid(data, states(order)).model)
    yield "this package, pem_ss, no gain", attempt(lambda: sysid.pem_ss(data, starts(), gain=False).model)
    yield "ctrlsys, SLICOT's N4SID", attempt(lambda: slicot_n4sid(data, states(order)).model)
    yield "control, markov and era", attempt(lambda: control_era(data, order))
    yield "jax-sysid", attempt(lambda: jax_output_error(data, order, direct=True))


def main():
    folder = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    names = ("numpy", "scipy", "pysib", "sippy-unipi", "jax-sysid", "nfoursid", "ctrlsys", "control")
    print(", ".join(f"{name} {version(name)}" for name in names) + "\n")
    scored = ("one-step loss", "held out", "simulation loss", "simulation fit, held out")
    heading("data", "structure", "method", *scored)
    for name, method, orders in STRUCTURES:
        first, second = halves(folder, name)
        for who, model in polynomial_fits(method, orders, first):
            row(name, f"{method} {orders}", who, *scores(model, first, second))
    print()
    heading("data", "order", "method", *scored)
    first, second = halves(folder, "CD player")
    for order in ORDERS:
        for who, model in state_space_fits(first, order):
            row("CD player", order, who, *scores(model, first, second))


if __name__ == "__main__":
    main()
