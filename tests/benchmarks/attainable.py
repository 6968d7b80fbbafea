"""What is attainable on the thesis' records, what estimators attain, and whether any goes below a floor.

Low orders are fitted to the record of test 5 of each joint and scored on fresh records of all tests, whose noise other
seeds draw; an ARX model of order 200 is fitted to another record of the very test that it is scored on.
"""

import warnings
from dataclasses import replace

import numpy as np

from hmtb_twin import STUDIED_JOINTS, simulate
from scenarios import load
from scenarios.truth.attainable import attainable
from sysid import Estimate, armax, arx, compare, oe
from tests.benchmarks.tables import heading, options, row

FITTED = 7  # what is fitted to a fresh record: the initial state of a model of order five with its delay, and the mean
LONG = 200  # order of a model that remembers longer than files of 100 points last; its initial state is fitted as well


def error(record, hat):
    return float(np.sqrt(np.mean((record.y - hat) ** 2)))


def main():
    parser = options(__doc__)
    parser.add_argument("--duration", type=float, default=240.0)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    simulated = ("any model, %", "best linear", "right order", "small signal", "OE 5 5", "ARX 200 200, same test")
    predicted = ("best linear, one step", "ARMAX 5 5 5, one step", "ARX 200 200, one step")
    heading("joint", "test", *simulated, *predicted)
    below, compared = 0, 0
    for joint in STUDIED_JOINTS:
        own = replace(load(f"siso-5-{joint}"), duration=arguments.duration)
        data = simulate([replace(own, seed=10**6)])[0].iodata().detrend()
        models: list[Estimate] = [oe(data, 5, 5), armax(data, 5, 5, 5)]
        tests = [replace(load(f"siso-{number}-{joint}"), duration=arguments.duration) for number in range(1, 9)]
        others = simulate([replace(test, seed=10**6) for test in tests])
        long = [arx(log.iodata().detrend(), LONG, LONG) for log in others]
        for number, log in enumerate(simulate([test.reseeded(0) for test in tests]), start=1):
            floors, record = attainable(log), log.iodata().detrend()
            output_error, one_step, high = compare([*models, long[number - 1]], record)
            for fit, fitted in ((output_error, FITTED), (one_step, FITTED), (high, LONG + 1)):
                pairs = ((fit.simulated, floors.simulation), (fit.predicted, floors.one_step))
                for hat, horizon in pairs:
                    for floor in (horizon.any_model, horizon.best_linear):
                        below += error(record, hat) < floors.by_chance(floor.rmse, fitted)
                        compared += 1
            sim = floors.simulation
            values = (sim.any_model, sim.best_linear, floors.right_order, sim.small_signal)
            fits = [*(floor.fit for floor in values), output_error.simulation[0], high.simulation[0]]
            fits += [floors.one_step.best_linear.fit, one_step.one_step[0], high.one_step[0]]
            row(joint, number, *(f"{fit:.2f}" for fit in fits))
    print(f"\nbelow a floor by more than chance allows once in twenty times: {below} of {compared}")


if __name__ == "__main__":
    main()
