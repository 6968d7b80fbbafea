"""Coverage of intervals for the gain of the best linear system, on records of the arm without repetition.

Criterion of 30 November 2026, when twenty records of the yaw and ten of the elbow pitch of other seeds had been seen,
on which the intervals were mended: the 95 % intervals "with distortion and order" hold that gain at 0.5, 1 and 2 Hz in
at least 90 % of records of 60 s (three joints, 5, 10 and 20 mrad rms), each identified by five estimators with the
orders of the thesis. No width is asked for: an interval reaches from the gain of the model to that of the best linear
system, and the orders of the thesis are too low by many times the spread from record to record.

Each record is one period of a random-phase multisine of 0.05 to 5 Hz, from rest. The truth is E(Y conj U) / E(|U|^2)
over other seeds, under a Hann window behind the first seconds, and there a cubic in the logarithm of the frequency
through the lines near.
"""

import itertools
from multiprocessing import Pool

import numpy as np

from hmtb_twin import STUDIED_JOINTS, simulate
from scenarios.experiments.multisines import Multisines
from tests.benchmarks import tables
from tests.benchmarks.best_linear_intervals import COLUMNS, HZ, estimators, outcomes, print_rows
from tests.benchmarks.tables import heading
from tests.benchmarks.tracking import Exchange

RMS = (0.005, 0.01, 0.02)
DURATION = 60.0
HIGHEST = 5.0
SETTLING = 2.0  # s, left out of the truth
NEAR = 1.3  # ratio of frequencies within which lines tell the truth
BATCH = 24  # records simulated at once


def records(joint, rms, seeds):
    """Records of a joint, one for each seed of sequence and noise, batch by batch."""
    for first in range(0, len(seeds), BATCH):
        runs = []
        for seed in seeds[first : first + BATCH]:
            played = Multisines(rms=rms, f_max=HIGHEST, period=DURATION, seed=seed)
            runs.append(Exchange(f"record-{seed}", (joint,), played, seed=seed))
        logs = simulate(runs, threads=1)
        if logs.failed:
            raise SystemExit(f"failed: {dict(logs.failed)}")
        for log in logs:
            yield log.iodata(joint)


def best_linear_gain(sequences):
    """Gain at `HZ` of the linear system nearest to the arm under the commands of some records."""
    cross, power = 0.0, 0.0
    for data in sequences:
        first = round(SETTLING / data.dt)
        window = np.hanning(len(data) - first)
        u, y = (np.fft.rfft(window * signal[first:, 0]) for signal in (data.u, data.y))
        cross, power, f = cross + y * u.conj(), power + np.abs(u) ** 2, np.fft.rfftfreq(len(window), data.dt)
    gains = []
    for hz in HZ:
        near = (f > hz / NEAR) & (f < hz * NEAR)
        root = np.sqrt(power[near])
        terms = np.vander(np.log(f[near] / hz), 4, increasing=True)
        # the constant is the value at hz itself
        gains.append(np.abs(np.linalg.lstsq(terms * root[:, None], cross[near] / root, rcond=None)[0][0]))
    return np.array(gains)


def combination(task):
    """Outcomes of every method on the records of one combination."""
    joint, rms, count, sequences, seed = task
    truth = best_linear_gain(records(joint, rms, range(seed, seed + sequences)))
    fits = estimators(joint, None)
    return (joint, rms), outcomes(records(joint, rms, range(seed + 10_000, seed + 10_000 + count)), fits, truth)


def main():
    parser = tables.options(__doc__)
    parser.add_argument("--records", type=int, default=24, help="records of each joint and size")
    parser.add_argument("--sequences", type=int, default=96, help="other records that the truth is the mean of")
    parser.add_argument("--seed", type=int, default=50_000)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    shared = (arguments.records, arguments.sequences, arguments.seed)
    wanted = [(*key, *shared) for key in itertools.product(STUDIED_JOINTS, RMS)]
    with Pool(arguments.processes) as pool:
        results = dict(pool.imap(combination, wanted))
    heading("", *COLUMNS)
    for position, values in enumerate((STUDIED_JOINTS, RMS)):
        for value in values:
            label = f"{1e3 * value:g} mrad rms" if isinstance(value, float) else value.replace("_", " ")
            chosen = [cells for key, cells in results.items() if key[position] == value]
            print_rows(label, [cell for cells in chosen for cell in cells.values() if len(cell)])
    for method in estimators(STUDIED_JOINTS[0], None):
        print_rows(method, [cells[method] for cells in results.values() if len(cells[method])])
    print_rows("all", [cell for cells in results.values() for cell in cells.values() if len(cell)])


if __name__ == "__main__":
    main()
