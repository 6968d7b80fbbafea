"""What is attainable on the thesis' records, what estimators attain, and whether any goes below a floor.

Run by hand: `PYTHONPATH=. python tests/benchmarks/attainable.py` (some minutes). Models are fitted to the record of
test 5 of each joint and scored on fresh records of all tests, whose noise other seeds draw.
"""

import argparse
import sys
import warnings
from dataclasses import replace

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Chain, simulate
from scenarios import load
from scenarios.attainable import attainable
from sysid import Estimate, IOData, armax, compare, oe

FITTED = 7
"""What is fitted to a fresh record: the initial state of a model of order five with its delay, and the mean."""


def error(record: IOData, hat: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean((record.y - hat) ** 2)))


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--duration", type=float, default=240.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--no-friction", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    chain = Chain(friction=not arguments.no_friction)
    print("| joint | test | any model, % | best linear | right order | small signal | OE 5 5 | ARMAX 5 5 5, one step |")
    print("|---|---|---|---|---|---|---|---|")
    below, compared = 0, 0
    for joint in STUDIED_JOINTS:
        own = replace(load(f"siso-5-{joint}"), duration=arguments.duration, chain=chain)
        data = simulate([replace(own, seed=10**6)])[0].iodata().detrend()
        models: list[Estimate] = [oe(data, 5, 5), armax(data, 5, 5, 5)]
        tests = [
            replace(load(f"siso-{number}-{joint}"), duration=arguments.duration, chain=chain) for number in range(1, 9)
        ]
        for seed in range(arguments.seeds):
            for number, log in enumerate(simulate([test.reseeded(seed) for test in tests]), start=1):
                found, record = attainable(log), log.iodata().detrend()
                output_error, one_step = compare(models, record)
                for fit in (output_error, one_step):
                    pairs = ((fit.simulated, found.simulation), (fit.predicted, found.one_step))
                    for hat, horizon in pairs:
                        for floor in (horizon.any_model, horizon.best_linear):
                            below += error(record, hat) < found.by_chance(floor.rmse, FITTED)
                            compared += 1
                if seed == 0:
                    sim = found.simulation
                    values = (sim.any_model, sim.best_linear, found.right_order, sim.small_signal)
                    fits = [*(f"{floor.fit:.2f}" for floor in values), f"{output_error.simulation[0]:.2f}"]
                    print(f"| {joint} | {number} | {' | '.join(fits)} | {one_step.one_step[0]:.2f} |", flush=True)
    print(f"\nbelow a floor by more than chance allows once in twenty times: {below} of {compared}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
