"""How often intervals hold the gain of the best linear system, on records of the arm that repeat and rub.

Criterion of 30 November 2026, before any fresh record was drawn: the 95 % intervals "with distortion and order" hold
that gain at 0.5, 1 and 2 Hz in at least 90 % of 900 records of 60 s (three joints, peaks of 0.5, 1 and 2 V, three kinds
of commands), each identified by five estimators with the orders of the thesis; and their median width is at most three
times the distance within which 95 % of an estimator's gains lie from sequence to sequence.

The truth is the mean of E(Y conj U) / E(|U|^2) over other sequences of the same kind, joint and amplitude, with the
noise of the wires, both of the mean period of 6 s: a file of 2 s meets the hold of three samples in the same way after
three plays. A chirp is a sweep, up or down by chance, from a random phase.

`--bandwidth` asks for the frequency 3.01 dB below the gain at 0.5 Hz besides, the lowest strong line: how often its
interval holds that of the best linear system, between whose lines a cubic spline runs. Criterion of the same day,
before any record was asked: at least 90 % over all; no width is asked for, as both ends of the interval are cautious.

`--order` identifies the same records by `oe`, `pem_ss` and `n4sid` of another order, without a criterion.
"""

import itertools
import warnings
from dataclasses import replace
from functools import partial
from multiprocessing import Pool

import numpy as np
from scipy.interpolate import CubicSpline

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, simulate
from scenarios import load
from scenarios.experiments.excitation import TIME
from scenarios.experiments.log_review import settled
from scenarios.experiments.model_structures import every_structure
from scenarios.experiments.waveform import WINDOW
from sysid import SysidError, model_error
from tests.benchmarks import tables
from tests.benchmarks.tables import heading, row

KINDS = ("prbs", "multisine", "chirp", "short prbs")
AMPLITUDES = (0.5, 1.0, 2.0)
COLUMNS = ("with distortion and order, %", "errors that repeat once, %", "noise alone, %", "width / spread", "fits")
HZ = np.array([0.5, 1.0, 2.0])
DURATION = 60.0
PERIOD = 300
LOWEST, HIGHEST = 0.5, 10.0
GRID = np.unique(np.concatenate((HZ, np.geomspace(LOWEST, HIGHEST, 60))))
"""Frequencies at which `--bandwidth` computes the intervals, Hz."""


def excitation(kind, amplitude, seed, entry):
    """One sequence of a kind, as an entry of a scenario."""
    match kind:
        case "prbs":
            # A longer register than the file needs: its sequences are truly different ones.
            changes = {"amplitude": amplitude, "clock": 2, "seed": seed, "register": 12}
            return replace(entry, kind="prbs", parameters=changes)
        case "short prbs":
            return replace(entry, kind="prbs", parameters={"amplitude": amplitude, "clock": 2, "seed": seed})
        case "multisine":
            changes = {"f_min": LOWEST, "f_max": HIGHEST, "amplitude": amplitude, "seed": seed}
            return replace(entry, kind="multisine", parameters=changes)
    rng = np.random.default_rng([77, seed])
    first, last = (LOWEST, HIGHEST) if rng.random() < 0.5 else (HIGHEST, LOWEST)
    phase = 2.0 * np.pi * (first * TIME + (last - first) * TIME**2 / (2.0 * WINDOW) + rng.random())
    points = tuple(float(value) for value in amplitude * np.cos(phase))
    return replace(entry, kind="points", parameters={"points": points})


def records(kind, joint, amplitude, seeds):
    """Settled records of a joint, one for each seed of sequence and noise."""
    test = load(f"siso-5-{joint}")
    (entry,) = test.excitation
    runs = []
    for seed in seeds:
        changed = excitation(kind, amplitude, seed, entry)
        runs.append(replace(test, name=f"record-{seed}", seed=seed, duration=DURATION, excitation=(changed,)))
    logs = simulate(runs, threads=1)
    if logs.failed:
        raise SystemExit(f"failed: {dict(logs.failed)}")
    return [settled(log, joint) for log in logs]


def mean_period_lines(data):
    """Transforms of input and output over the mean of the last whole periods."""
    lines = []
    for signal in (data.u[:, 0], data.y[:, 0]):
        count = len(signal) // PERIOD
        lines.append(np.fft.rfft(signal[-count * PERIOD :].reshape(count, PERIOD).mean(axis=0)))
    return lines


def best_linear_gain(sequences):
    """Gain at the lines of the command, and their frequencies, of the linear system nearest to the arm under them."""
    spectra = np.array([mean_period_lines(data) for data in sequences])
    u, y = spectra[:, 0], spectra[:, 1]
    gain = np.abs(np.sum(y * u.conj(), axis=0) / np.sum(np.abs(u) ** 2, axis=0))
    # a file of 2 s has lines at every third of those of 6 s
    step = round(LOWEST * PERIOD * sequences[0].dt)
    rows = np.arange(step, round(HIGHEST * PERIOD * sequences[0].dt) + 1, step)
    return np.arange(1, len(rows) + 1) * LOWEST, gain[rows]


def bandwidth_of(f, gain):
    """First frequency 3.01 dB below the gain at the first one, by a cubic spline on logarithmic axes."""
    fine = np.geomspace(f[0], f[-1], 20_001)
    below = CubicSpline(np.log(f), np.log(gain))(np.log(fine)) < np.log(np.sqrt(0.5) * gain[0])
    return fine[np.argmax(below)] if below.any() else np.inf


def holds(band, hz):
    """Whether an interval that may have no end upwards holds a bandwidth; where the model has none, nothing is said."""
    low, high = (float(end.item()) for end in band.ci95)
    if not np.isfinite(band.hz.item()):
        return np.nan
    return float((hz >= low) & (hz <= (high if np.isfinite(high) else np.inf)))


def estimated(structure, data):
    """A model of the thesis' orders."""
    if structure.estimator == "okid":
        order, p = structure.orders
        return sysid.okid(data, order, p=p)
    return getattr(sysid, structure.estimator)(data, *structure.orders)


def estimators(joint, order):
    """Estimators of a joint by name, with the thesis' orders or with a given one."""
    if order is None:
        return {structure.method: partial(estimated, structure) for structure in every_structure(joint)}
    return {
        "oe": lambda data: sysid.oe(data, order, order, 2),
        "pem_ss": lambda data: sysid.pem_ss(data, order),
        "n4sid": lambda data: sysid.n4sid(data, order),
    }


def interval_of_parameters(estimate):
    """Ends of the interval of the gain at `HZ` from the parameters; NaN where the estimator gives no covariance."""
    response = estimate.frequency_response(HZ)
    if response.covariance is None:
        return np.full((2, len(HZ), 1, 1), np.nan)
    return response.magnitude_ci95()


def combination(task):
    """Identify the records of one kind, joint and amplitude by every method, and judge the intervals."""
    kind, joint, amplitude, count, sequences, seed, bandwidth, order = task
    f, gain = best_linear_gain(records(kind, joint, amplitude, range(seed, seed + sequences)))
    truth = gain[np.searchsorted(f, HZ)]
    hz = bandwidth_of(f, gain) if bandwidth else None
    fresh = records(kind, joint, amplitude, range(seed + 10_000, seed + 10_000 + count))
    return (kind, joint, amplitude), outcomes(fresh, estimators(joint, order), truth, hz)


def outcomes(recorded, fits, truth, hz=None):
    """Logarithms of gain over truth, and which interval holds it, of every record and method.

    Args:
        recorded: Records of the joint.
        fits: Estimators by name.
        truth: Gain of the best linear system at `HZ`.
        hz: Its bandwidth from the lowest strong line; None asks for none.
    """
    asked = HZ if hz is None else GRID
    rows = np.searchsorted(asked, HZ)
    found = {method: [] for method in fits}
    for data in recorded:
        about_mean = data.detrend()
        for method, fit in fits.items():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    estimate = fit(about_mean)
                    error = model_error(estimate, about_mean, asked)
                except SysidError:
                    # IV4 is unstable now and then, and says so.
                    continue
            once = interval_of_parameters(estimate)
            of_error = [[end[rows, 0, 0] for end in ends] for ends in (error.interval, error.noise_alone)]
            intervals = [of_error[0], [end[:, 0, 0] for end in once], of_error[1]]
            held = [(low <= truth) & (truth <= high) for low, high in intervals]
            low, high = intervals[0]
            of_bandwidth = np.full(len(HZ), np.nan if hz is None else holds(error.bandwidth(LOWEST), hz))
            ratio = np.log(error.gain[rows, 0, 0] / truth)
            found[method].append((ratio, *held, np.log(high / low), of_bandwidth))
    return {method: np.array(list_of) for method, list_of in found.items()}


def print_rows(label, cells):
    """Rates of the three intervals, width over spread, and the number of fits, of some of the cells."""
    fits = sum(len(cell) for cell in cells)
    rates = [np.concatenate([cell[:, k] for cell in cells]).mean(axis=0) for k in (1, 2, 3)]
    # 95 % of normal values lie within 3.92 deviations
    ratios = np.median([np.median(cell[:, 4], axis=0) / (3.92 * cell[:, 0].std(axis=0)) for cell in cells], axis=0)
    texts = [" / ".join(f"{100.0 * rate:.1f}" for rate in each) for each in rates]
    of_bandwidth = np.concatenate([cell[:, 5, 0] for cell in cells])
    of_bandwidth = of_bandwidth[np.isfinite(of_bandwidth)]
    last = [f"{100.0 * of_bandwidth.mean():.1f}"] if len(of_bandwidth) else []
    row(label, *texts, " / ".join(f"{ratio:.2f}" for ratio in ratios), fits, *last)


def main():
    parser = tables.options(__doc__)
    parser.add_argument("--records", type=int, default=34, help="records of each joint, amplitude and kind")
    parser.add_argument("--sequences", type=int, default=40, help="other sequences that the truth is the mean of")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS[:3])
    parser.add_argument("--joints", nargs="+", choices=JOINTS, default=STUDIED_JOINTS, help="others need --order")
    parser.add_argument("--order", type=int, help="of oe, pem_ss and n4sid, in place of the thesis' models")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--bandwidth", action="store_true", help="the bandwidth from the gain at 0.5 Hz besides")
    arguments = parser.parse_args()
    shared = (arguments.records, arguments.sequences, arguments.seed, arguments.bandwidth, arguments.order)
    wanted = [(*key, *shared) for key in itertools.product(arguments.kinds, arguments.joints, AMPLITUDES)]
    with Pool(arguments.processes) as pool:
        results = dict(pool.imap(combination, wanted))
    heading("", *COLUMNS, *(["bandwidth from 0.5 Hz, %"] if arguments.bandwidth else []))

    def chosen(position, value):
        return [
            cell for key, cells in results.items() if key[position] == value for cell in cells.values() if len(cell)
        ]

    for position, values in enumerate((arguments.kinds, arguments.joints, AMPLITUDES)):
        for value in values:
            label = f"{value:g} V" if isinstance(value, float) else value.replace("_", " ")
            print_rows(label, chosen(position, value))
    for method in estimators(arguments.joints[0], arguments.order):
        print_rows(method, [cells[method] for cells in results.values() if len(cells[method])])
    print_rows("all", [cell for cells in results.values() for cell in cells.values() if len(cell)])


if __name__ == "__main__":
    main()
