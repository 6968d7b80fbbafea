"""Fits to measured data beside the peers, at equal orders.

Run by hand in an environment that has the peers: `python tests/benchmarks/real_data.py --data FOLDER [WORD ...]`, or
all benches by `make verification DATA=FOLDER`. Words choose sets by their names. The folder holds the files of `SETS`
that are at hand; they belong to their authors and are not part of this repository. Models are fitted to the first half
of each record, its means removed from both halves, and judged on both halves by `compare`, one step ahead and in
simulation, the initial state fitted to each half for every model alike; of several outputs, fits are means. Our methods
compete with the peers' under three rules, which docs/measured/real-data.md states.
"""

import contextlib
import importlib
import multiprocessing
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
KINDS = ("one_step", "simulation")
DUELS = (
    ("armax", "one_step", ("armax",)),
    ("oe", "simulation", ("oe",)),
    ("pem_ss", "one_step", ("gain",)),
    ("pem_ss, K = 0", "simulation", ("gain", "no gain")),
)
"""Of rule (a): our method, the kind of fit, and the peers' kinds of models."""
RULES = {
    "a": "estimator by estimator, the best peer by the validation half",
    "b": "toolbox by toolbox, both by the validation half",
    "c": "toolbox by toolbox, neither by the validation half",
}
LEAD = 0.5
"""Points of held-out fit."""
LONG = 40
"""Order of the regularised ARX model that is reduced: the prior takes the place of a choice."""
USELESS = -100.0
"""Fit, percent, that counts for all below it and for failures."""
LIMIT = 300.0
"""Time of a fit, s."""
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


def horizon(order):
    """Samples of past and future: 2.5 times the order, at least 10, as by default in `n4sid`."""
    return max(10, -(-5 * order // 2))


def own_methods(nu, ny):
    """Our estimators of a model of a certain order, by name: functions of data and order."""

    def pem(data, order, **options):
        start = sysid.n4sid(data, order, stable=True, direct=options.get("direct", True))
        return sysid.pem_ss(data, start, **options)

    def long_n4sid(data, order, **options):
        rows = state_space_peers.block_rows(Task("ss", {"order": order}, order, np.ones(1)))
        return sysid.n4sid(data, order, stable=True, block_rows=rows, **options)

    def okid(data, order):
        return sysid.okid(data, order, p=horizon(order))

    def reduced(data, order):
        return sysid.balred(sysid.arx(data, LONG, LONG, 1, regularisation="tc"), order)

    methods = {
        "pem_ss": pem,
        "pem_ss, K = 0": partial(pem, gain=False),
        "pem_ss, D = 0": partial(pem, direct=False),
        "pem_ss, K = 0, D = 0": partial(pem, gain=False, direct=False),
        "n4sid": partial(sysid.n4sid, stable=True),
        "n4sid, D = 0": partial(sysid.n4sid, stable=True, direct=False),
        "n4sid, MOESP": partial(sysid.n4sid, stable=True, weighting="moesp"),
        "n4sid, long": long_n4sid,
        "n4sid, MOESP, long": partial(long_n4sid, weighting="moesp"),
        "okid": okid,
        "pbsid": sysid.pbsid,
        "pbsid, D": partial(sysid.pbsid, direct=True),
    }
    if ny > 1:
        # the squares of all outputs as `compare` weighs them; with one output the criterion is the same
        def squares(data, order, **options):
            return pem(data, order, output_weight=np.diag(1.0 / data.y.var(axis=0)), **options)

        methods |= {"pem_ss, squares": squares, "pem_ss, K = 0, squares": partial(squares, gain=False)}
    if ny == 1:
        methods |= {
            "armax": lambda data, order: sysid.armax(data, order, order, order, 1),
            "arx": lambda data, order: sysid.arx(data, order, order, 1),
            "arx, TC": lambda data, order: sysid.arx(data, order, order, 1, regularisation="tc"),
            "long arx, TC, reduced": reduced,
            "impulseest, TC, reduced": lambda data, order: sysid.balred(sysid.impulseest(data), order),
            "iv4": lambda data, order: sysid.iv4(data, order, order, 1),
        }
    if ny == nu == 1:
        # of several inputs each has its own F, which makes the order that of all together
        methods["oe"] = lambda data, order: sysid.oe(data, order, order, 1)
        methods["tfest"] = lambda data, order: sysid.tfest(data, order, order - 1)
    return methods


def peer_methods(nu, ny):
    """The peers' methods by kind of model: `gain` and `no gain` are state space."""

    def of(structure, fit, data, order):
        orders = [order] * (len(ORDER_NAMES[structure]) - 1) + ([1] if structure != "ss" else [order])
        return fit(data, Task(structure, dict(zip(ORDER_NAMES[structure], orders, strict=True)), order, np.ones(1)))

    def state_space(name, **options):
        return partial(of, "ss", partial(getattr(state_space_peers, name), **options))

    def jax(data, order, direct):
        return state_space_peers.jax_output_error(data, order, direct=direct)

    weightings = ("N4SID", "MOESP", "CVA", "PARSIM-K", "PARSIM-S", "PARSIM-P")
    kinds = {
        "gain": {
            "nfoursid": state_space("nfoursid_n4sid"),
            **{f"sippy {name}": state_space("sippy_n4sid", weighting=name, direct=True) for name in weightings},
            **{f"sippy {name}, D = 0": state_space("sippy_n4sid", weighting=name) for name in weightings[:3]},
        },
        "no gain": {
            "SLICOT N4SID": state_space("slicot_n4sid"),
            "SLICOT moen4": state_space("slicot_moen4"),
            "control ERA": state_space("control_era"),
            "jax-sysid": partial(jax, direct=True),
        },
    }
    if ny == 1:
        kinds["no gain"]["jax-sysid, D = 0"] = partial(jax, direct=False)
        for structure in ("arx", "armax", "oe"):
            fit = partial(polynomial_peers.sippy_polynomials, structure)
            kinds[structure] = {f"sippy {structure}": partial(of, structure, fit)}
            if structure == "armax":
                kinds[structure]["sippy armax ILLS"] = partial(of, structure, partial(fit, mode="ILLS"))
            if nu == 1:
                fit = getattr(polynomial_peers, f"pysib_{structure}")
                kinds[structure][f"pysib {structure}"] = partial(of, structure, fit)
    return kinds


def work(sender, method, order, first, second):
    """In a process of its own: send fits on the halves by kind and processor time, then those of the first half's cut.

    An error is sent as its text.
    """
    cut = 2 * len(first) // 3
    for part, rest in ((first, second), (first[:cut], first[cut:])):
        try:
            with silence(), np.errstate(all="ignore"):
                answer, seconds = timed(method, part, order)
                model = getattr(answer, "model", answer)
                on_part, on_rest = (sysid.compare(model, half)[0] for half in (part, rest))
            fits = {k: [float(np.mean(getattr(on, k))) for on in (on_part, on_rest)] for k in KINDS}
            sender.send((fits, seconds))
        except Exception as error:
            sender.send(f"{type(error).__name__}: {error}")


def attempt(method, order, first, second):
    """What `work` sends, in a process that is killed after LIMIT seconds a fit; texts in place of failures."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=work, args=(sender, method, order, first, second))
    child.start()
    sender.close()
    results = []
    try:
        for _ in range(2):
            results.append(receiver.recv() if receiver.poll(LIMIT) else f"more than {LIMIT:.0f} s")
            if isinstance(results[-1], str):
                break
    except EOFError:
        results.append("the process died")
    child.kill()
    child.join()
    return [*results, "not fitted"][:2]


def held_out(result, kind, place=0):
    """Fit of the second part, percent: of the validation half, or (`place` 1) of the last third of the first half."""
    return USELESS if isinstance(result[place], str) else max(USELESS, result[place][0][kind][1])


def duel(results, ours, theirs, kind, place):
    """Names and held-out fits of both sides; methods chosen by the fit of the validation half, or without it."""
    chosen = [max(names, key=lambda name: held_out(results[name], kind, place)) for names in (ours, theirs)]
    return [(name, held_out(results[name], kind)) for name in chosen]


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
    return f"{percent:.2f}" if percent > USELESS else f"{USELESS:.0f} or less"


def main():
    parser = options(__doc__)
    parser.add_argument("words", nargs="*", help="parts of names of sets; all when none is given")
    parser.add_argument("--data", type=Path, required=True, help="folder with the files")
    parser.add_argument("--every", action="store_true", help="print each method's fits, times and failures too")
    parser.add_argument("--nested", action="store_true", help="compare structures with those that they contain instead")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    versions = []
    for name in ("numpy", "scipy", "pysib", "sippy-unipi", "jax-sysid", "nfoursid", "ctrlsys", "control"):
        # children inherit what is loaded; the threads of jax would not survive that
        with contextlib.suppress(ImportError), silence():
            if name != "jax-sysid":
                importlib.import_module(name.replace("-", "_"))
        with contextlib.suppress(PackageNotFoundError):
            versions.append(f"{name} {version(name)}")
    print(", ".join(versions) + "\n")
    missing, leads = [], {rule: [] for rule in RULES}
    if asked.nested:
        heading("data", "structure", "pairs", "more than 1 % worse", "largest ratio", "time / s")
    else:
        sides = ("ours", "held out", "peer", "held out", "lead")
        heading("data", "order", "kind", *(f"({rule}) {side}" for rule in "bc" for side in sides))
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
        own, kinds = own_methods(first.nu, first.ny), peer_methods(first.nu, first.ny)
        peers = {name: method for methods in kinds.values() for name, method in methods.items()}
        for order in one.orders:
            results = {}
            for method, fit in (own | peers).items():
                results[method] = attempt(fit, order, first, second)
                if asked.every:
                    print("   ", name, order, method, *results[method], sep=" | ", flush=True)
            for ours, kind, theirs in DUELS:
                names = [peer for group in theirs for peer in kinds.get(group, ())]
                if ours in own and names:
                    (_, own_fit), (_, peer_fit) = duel(results, [ours], names, kind, 0)
                    leads["a"].append(peer_fit - own_fit)
            for kind in KINDS:
                cells = []
                for place, rule in enumerate("bc"):
                    sides = duel(results, own, peers, kind, place)
                    leads[rule].append(sides[1][1] - sides[0][1])
                    cells += [cell for side, fit in sides for cell in (side, number(fit))]
                    cells.append(f"{leads[rule][-1]:+.2f}")
                row(name, order, kind.replace("_", " "), *cells)
    if not asked.nested:
        print()
        heading("rule", "comparisons", f"a peer ahead by more than {LEAD}", f"ours ahead by more than {LEAD}")
        for rule, text in RULES.items():
            points = np.array(leads[rule])
            row(f"({rule}) {text}", len(points), (points > LEAD).sum(), (points < -LEAD).sum())
    print("\n".join(["", *(f"Not at hand: {text}" for text in missing)]))


if __name__ == "__main__":
    main()
