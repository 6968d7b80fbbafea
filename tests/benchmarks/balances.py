"""Books of oil and energy of a binary test on the elbow, by kind of friction and by step.

Run by hand from the root of the repository: `PYTHONPATH=. python tests/benchmarks/balances.py` (half a minute).
"""

import sys
from dataclasses import replace

import numpy as np

from hmtb_twin import JOINTS, NOMINAL_PLANT, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE
from tests.hmtb_twin.balances import linear_balances

AMPLITUDE = 0.067
"""Of the command, rad."""


def command(pose: np.ndarray) -> np.ndarray:
    """Pseudo-random binary commands (N, 7) on the elbow for 5 s, then 2 s of rest, rad."""
    made = np.tile(pose, (350, 1))
    bits = np.random.default_rng(3).choice([-AMPLITUDE, AMPLITUDE], 50)
    made[1:250, JOINTS.index("elbow_pitch")] += np.repeat(bits, 5)[1:]
    return made


def main() -> None:
    """Write the table to standard output."""
    heads = [
        "friction",
        "step, ms",
        "oil",
        "energy",
        "supplied, J",
        "throttled, J",
        "leaked, J",
        "rubbed, J",
        "dragged, J",
        "stored, J",
        "residual, J",
    ]
    sys.stdout.write(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|\n")
    for friction in ("none", "viscous", "coulomb", "lugre"):
        arm = load_arm(plant=replace(NOMINAL_PLANT, friction=friction))
        for refined in (1, 2, 4):
            oil, energy = linear_balances(arm, command(arm.pose(OPERATING_POSE)), refined=refined)
            stored = energy.compressed + energy.kinetic + energy.potential
            cells = [friction, f"{1e3 * arm.model.opt.timestep / refined:g}"]
            cells += [f"{oil.closure:.0e}", f"{energy.closure:.1e}", f"{energy.supplied:.1f}"]
            cells += [f"{x:.2f}" for x in (energy.throttled, energy.leaked, energy.rubbed, energy.dragged, stored)]
            cells += [f"{energy.residual:+.3f}"]
            sys.stdout.write(f"| {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main()
