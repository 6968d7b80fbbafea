"""What is attainable on the thesis' records, what estimators attain, and whether any goes below a floor.

Run by hand: `PYTHONPATH=. python tests/benchmarks/attainable.py` (some minutes). Low orders are fitted to the record of
test 5 of each joint and scored on fresh records of all tests, whose noise other seeds draw; an ARX model of order 200
is fitted to another record of the very test that it is scored on. `--level 8` multiplies friction.
"""

import argparse
import sys
import warnings
from dataclasses import replace

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Chain, Plant, simulate
from scenarios import load
from scenarios.truth.attainable import attainable
from sysid import Estimate, IOData, armax, arx, compare, oe

FITTED = 7
"""What is fitted to a fresh record: the initial state of a model of order five with its delay, and the mean."""

LONG = 200
"""Order of a model that remembers longer than files of 100 points last; its initial state is fitted as well."""


def error(record: IOData, hat: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean((record.y - hat) ** 2)))


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--duration", type=float, default=240.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--no-friction", action="store_true")
    parser.add_argument("--level", type=float, default=1.0, help="of friction")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    chain, plant = Chain(friction=not arguments.no_friction), Plant(friction_level=arguments.level)
    print(
        "| joint | test | any model, % | best linear | right order | small signal | OE 5 5 | ARX 200 200, same test "
        "| best linear, one step | ARMAX 5 5 5, one step | ARX 200 200, one step |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    below, compared = 0, 0
    for joint in STUDIED_JOINTS:
        own = replace(load(f"siso-5-{joint}"), duration=arguments.duration, chain=chain, plant=plant)
        data = simulate([replace(own, seed=10**6)])[0].iodata().detrend()
        models: list[Estimate] = [oe(data, 5, 5), armax(data, 5, 5, 5)]
        tests = [
            replace(load(f"siso-{number}-{joint}"), duration=arguments.duration, chain=chain, plant=plant)
            for number in range(1, 9)
        ]
        others = simulate([replace(test, seed=10**6) for test in tests])
        long = [arx(log.iodata().detrend(), LONG, LONG) for log in others]
        for seed in range(arguments.seeds):
            for number, log in enumerate(simulate([test.reseeded(seed) for test in tests]), start=1):
                found, record = attainable(log), log.iodata().detrend()
                output_error, one_step, high = compare([*models, long[number - 1]], record)
                for fit, fitted in ((output_error, FITTED), (one_step, FITTED), (high, LONG + 1)):
                    pairs = ((fit.simulated, found.simulation), (fit.predicted, found.one_step))
                    for hat, horizon in pairs:
                        for floor in (horizon.any_model, horizon.best_linear):
                            below += error(record, hat) < found.by_chance(floor.rmse, fitted)
                            compared += 1
                if seed == 0:
                    sim = found.simulation
                    values = (sim.any_model, sim.best_linear, found.right_order, sim.small_signal)
                    fits = [*(floor.fit for floor in values), output_error.simulation[0], high.simulation[0]]
                    fits += [found.one_step.best_linear.fit, one_step.one_step[0], high.one_step[0]]
                    print(f"| {joint} | {number} | {' | '.join(f'{fit:.2f}' for fit in fits)} |", flush=True)
    print(f"\nbelow a floor by more than chance allows once in twenty times: {below} of {compared}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
