"""Books of oil and energy of a binary test on the elbow, by kind of friction and by step."""

from dataclasses import asdict, replace

import numpy as np

from hmtb_twin import JOINTS, NOMINAL_PLANT, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE
from tests.benchmarks.tables import heading, row
from tests.hmtb_twin.balances import linear_balances

AMPLITUDE = 0.067
"""Of the command, rad."""


def command(pose):
    """Pseudo-random binary commands (N, 7) on the elbow for 5 s, then 2 s of rest, rad."""
    made = np.tile(pose, (350, 1))
    bits = np.random.default_rng(3).choice([-AMPLITUDE, AMPLITUDE], 50)
    made[1:250, JOINTS.index("elbow_pitch")] += np.repeat(bits, 5)[1:]
    return made


def main():
    terms = ("supplied", "throttled", "leaked", "rubbed", "dragged", "stored", "residual")
    heading("friction", "step, ms", "oil", "energy", *(f"{term}, J" for term in terms))
    for friction in ("none", "viscous", "coulomb", "lugre"):
        arm = load_arm(plant=replace(NOMINAL_PLANT, friction=friction))
        for refined in (1, 2, 4):
            oil, energy = linear_balances(arm, command(arm.pose(OPERATING_POSE)), refined=refined)
            stored = energy.compressed + energy.kinetic + energy.potential
            residual = 2.0 * energy.supplied - sum(asdict(energy).values())
            losses = [f"{x:.2f}" for x in (energy.throttled, energy.leaked, energy.rubbed, energy.dragged, stored)]
            step = f"{1e3 * arm.model.opt.timestep / refined:g}"
            closures = f"{oil.closure:.0e}", f"{energy.closure:.1e}"
            row(friction, step, *closures, f"{energy.supplied:.1f}", *losses, f"{residual:+.3f}")


if __name__ == "__main__":
    main()
