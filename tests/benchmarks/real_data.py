"""Fits to measured data beside the peers, at equal orders.

Run by hand in an environment that has the peers: `python tests/benchmarks/real_data.py --data FOLDER [WORD ...]`, or
all benches by `make verification DATA=FOLDER`. Words choose sets by their names. The folder holds the files of `SETS`
that are at hand; they belong to their authors and are not part of this repository. Models are fitted to the first half
of each record, its means removed from both halves, and judged on both halves by `compare`, the initial state fitted to
each half for every model alike; of several outputs, fits are means. Models with a noise model are judged one step
ahead, others, and the path from input to output of all state-space models, in simulation.
"""

import contextlib
import os
import sys
import warnings
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import scipy

import sysid
from scenarios.estimators import polynomial_peers, state_space_peers
from scenarios.estimators.task import Task
from sysid.polynomial.structures import STRUCTURES as ORDER_NAMES
from tests.benchmarks.tables import heading, options, row, timed

DAISY = "DaISy [DeMoor1997], under this name but for capitals"
RGP = "GitHub, zhenwendai/RGP, datasets/system_identification"
HSM = "GitHub, malik-robert/HSM150-data, Data/Identification"


@dataclass(frozen=True)
class MeasuredSet:
    """A record: its file and where that is public, inputs and outputs, and the orders of the models.

    Attributes:
        file: In the folder.
        inputs: Columns of a table, or names of variables of a .mat file.
        outputs: Likewise.
        dt: Sampling interval, s; 1 where it is not known.
        orders: Of the models.
        source: Who publishes it.
        validation: Another file, of a second run, to judge by; empty: the second half is.
    """

    file: str
    inputs: tuple
    outputs: tuple
    dt: float
    orders: tuple[int, ...] = (2, 4)
    source: str = DAISY
    validation: str = ""


def columns(first, count):
    """Numbers of `count` columns."""
    return tuple(range(first, first + count))


SETS = {
    "hydraulic actuator": MeasuredSet("actuator.mat", ("u",), ("p",), 1.0, source=RGP),
    "heating system": MeasuredSet("heating_system.dat", (1,), (2,), 2.0),
    "wing flutter": MeasuredSet("flutter.dat", (0,), (1,), 1.0),
    "thermic wall": MeasuredSet("thermic_res_wall.dat", (0, 1), (2,), 1.0),
    "HSM150 motor": MeasuredSet("idf_pos_0.06_1.mat", (4,), (3,), 0.02, (1, 2), HSM, "idf_pos_0.06_2.mat"),
    "coupled drives 1": MeasuredSet("drive.mat", ("u1",), ("z1",), 0.02, source=RGP),
    "coupled drives 2": MeasuredSet("drive.mat", ("u2",), ("z2",), 0.02, source=RGP),
    "coupled drives 3": MeasuredSet("drive.mat", ("u3",), ("z3",), 0.02, source=RGP),
    "robot arm": MeasuredSet("robot_arm.dat", (0,), (1,), 1.0),
    "hair dryer": MeasuredSet("hair_dryer.dat", (0,), (1,), 0.08),
    "heat exchanger": MeasuredSet("heat_exchanger.dat", (1,), (2,), 1.0),
    "evaporator": MeasuredSet("evaporator.dat", columns(0, 3), columns(3, 3), 1.0, (4, 8)),
    "steam generator": MeasuredSet("steamgen.dat", columns(1, 4), columns(5, 4), 3.0, (4, 8)),
    "glass furnace": MeasuredSet("glassfurnace.dat", columns(1, 3), columns(4, 6), 1.0, (4, 8)),
    "winding": MeasuredSet("winding.dat", columns(0, 5), columns(5, 2), 0.1, (4, 8)),
    "power plant": MeasuredSet("powerplant.dat", columns(1, 5), columns(6, 3), 1228.8, (2, 4)),
    "CD player": MeasuredSet("cd_player_arm.dat", (0, 1), (2, 3), 1.0, (4, 8)),
    "flexible structure": MeasuredSet("flexible_structure.dat", (0, 1), columns(2, 28), 1.0 / 1024.0, (10, 20)),
}
RIVAL = ("best peer", "its fit", "held out", "time / s", "lead")
SETTLED, EVERY = 5000, 20
"""Of the runs of HSM150: samples before the motor turns steadily, and between those that are used."""


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


def read(folder, one, file):
    """Input and output (N, nu) and (N, ny)."""
    if not file.endswith(".mat"):
        table = np.loadtxt(folder / file)
    elif isinstance(one.inputs[0], str):
        table = scipy.io.loadmat(folder / file)
        return tuple(np.hstack([table[name] for name in names]).astype(float) for names in (one.inputs, one.outputs))
    else:
        table = scipy.io.loadmat(folder / file)["data"][SETTLED::EVERY]
    return table[:, one.inputs], table[:, one.outputs]


def halves(folder, name):
    """For estimation and for validation, the means of the first removed from both."""
    one = SETS[name]
    first = read(folder, one, one.file)
    if one.validation:
        second = read(folder, one, one.validation)
    else:
        half = len(first[0]) // 2
        first, second = [part[:half] for part in first], [part[half:] for part in first]
    means = [part.mean(axis=0) for part in first]
    return tuple(sysid.IOData(*(p - m for p, m in zip(part, means, strict=True)), one.dt) for part in (first, second))


def fits(model, first, second, kind):
    """Mean fits on both halves, percent; `kind` is `one_step` or `simulation`."""
    parts = [getattr(sysid.compare(model, half)[0], kind) for half in (first, second)]
    return [float(np.mean(part)) for part in parts]


def polynomial_peers_of(structure, order, data):
    """Peers of a polynomial structure by name."""
    orders = [order] * (len(ORDER_NAMES[structure]) - 1) + [1]
    task = Task(structure, dict(zip(ORDER_NAMES[structure], orders, strict=True)), order, np.ones(1))
    peers = {"sippy-unipi": partial(polynomial_peers.sippy_polynomials, structure)}
    if structure == "armax":
        peers["sippy-unipi, ILLS"] = partial(polynomial_peers.sippy_polynomials, structure, mode="ILLS")
    if data.nu == 1:
        peers["pysib"] = getattr(polynomial_peers, f"pysib_{structure}")
    if structure == "oe":
        peers["jax-sysid"] = state_space_peers.jax_sysid_oe
    return orders, {name: partial(fit, data, task) for name, fit in peers.items()}


def state_space_peers_of(order, data):
    """Peers with K, and those of the path from input to output, by name."""
    task = Task("ss", {"order": order}, order, np.ones(1))
    with_gain = {"nfoursid": partial(state_space_peers.nfoursid_n4sid, data, task)}
    for weighting in ("N4SID", "MOESP", "CVA", "PARSIM-K"):
        fit = partial(state_space_peers.sippy_n4sid, data, task, weighting=weighting, direct=True)
        with_gain[f"sippy-unipi, {weighting}"] = fit
    without = {
        "SLICOT": partial(state_space_peers.slicot_n4sid, data, task),
        "SLICOT, moen4": partial(state_space_peers.slicot_moen4, data, task),
        "control": partial(state_space_peers.control_era, data, task),
        "jax-sysid": lambda: state_space_peers.jax_output_error(data, order, direct=True),
    }
    return with_gain, without | with_gain


def comparisons(data, order):
    """Title, kind of fit, our estimator, and the peers by name."""
    if data.ny == 1:
        for structure, kind in (("armax", "one_step"), ("oe", "simulation")):
            orders, peers = polynomial_peers_of(structure, order, data)
            title = f"{structure} ({', '.join(map(str, orders))})"
            yield title, kind, partial(getattr(sysid, structure), data, *orders), peers
    with_gain, all_peers = state_space_peers_of(order, data)

    def ours(gain):
        return sysid.pem_ss(data, sysid.n4sid(data, order, stable=True), gain=gain)

    yield f"state space, {order}", "one_step", partial(ours, True), with_gain
    yield f"state space, {order}, K = 0", "simulation", partial(ours, False), all_peers


def attempt(fit, first, second, kind):
    """Fits on both halves and processor time, s; or why there is none."""
    try:
        with silence(), np.errstate(all="ignore"):
            answer, seconds = timed(fit)
            return [*fits(getattr(answer, "model", answer), first, second, kind), seconds]
    except Exception as error:
        return [-np.inf, -np.inf, 0.0, f"{type(error).__name__}: {error}"]


def nested(name, data):
    """Rows of a table: do larger polynomial structures of one output, orders 1 to 6, fit worse than smaller ones?"""
    data = data.select(outputs=[data.output_names[0]])
    for structure, names in ORDER_NAMES.items():
        if structure not in ("armax", "oe", "bj"):
            continue
        costs, total = [], 0.0
        for order in range(1, 7):
            fit, seconds = timed(getattr(sysid, structure), data, *[order] * (len(names) - 1), 1)
            costs.append(fit.diagnostics["sum_of_squares"])
            total += seconds
        ratios = [large / small for k, large in enumerate(costs) for small in costs[:k]]
        row(name, structure, len(ratios), sum(r > 1.01 for r in ratios), f"{max(ratios):.4f}", f"{total:.1f}")


def number(percent):
    """A fit of two digits after the point."""
    return f"{percent:.2f}" if percent > -100.0 else "below -100"


def main():
    parser = options(__doc__)
    parser.add_argument("words", nargs="*", help="parts of names of sets; all when none is given")
    parser.add_argument("--data", type=Path, required=True, help="folder with the files")
    parser.add_argument("--every", action="store_true", help="print each peer's fits, times and failures too")
    parser.add_argument("--nested", action="store_true", help="compare structures with those that they contain instead")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    versions = []
    for name in ("numpy", "scipy", "pysib", "sippy-unipi", "jax-sysid", "nfoursid", "ctrlsys", "control"):
        with contextlib.suppress(PackageNotFoundError):
            versions.append(f"{name} {version(name)}")
    print(", ".join(versions) + "\n")
    missing = []
    heading(
        "data", "model", "fit", "ours", "held out", "time / s", "best peer", "its fit", "held out", "time / s", "lead"
    )
    for name, one in SETS.items():
        if asked.words and not any(word in name for word in asked.words):
            continue
        if not all((asked.data / file).exists() for file in (one.file, one.validation)):
            missing.append(f"{name}: {one.file} ({one.source})")
            continue
        first, second = halves(asked.data, name)
        if asked.nested:
            nested(name, first)
            continue
        for order in one.orders:
            for title, kind, fit, peers in comparisons(first, order):
                ours = attempt(fit, first, second, kind)
                theirs = {peer: attempt(theirs, first, second, kind) for peer, theirs in peers.items()}
                if asked.every:
                    for peer, result in {"ours": ours, **theirs}.items():
                        print("   ", name, title, peer, *result, sep=" | ", flush=True)
                best = max(theirs, key=lambda peer: theirs[peer][1])
                cells = [[number(r[0]), number(r[1]), f"{r[2]:.2f}"] for r in (ours, theirs[best])]
                lead = theirs[best][1] - ours[1]
                row(name, title, kind.replace("_", " "), *cells[0], best, *cells[1], f"{lead:+.2f}")
    print("\n".join(["", *(f"Not at hand: {text}" for text in missing)]))


if __name__ == "__main__":
    main()
