"""Balances of oil and energy of a binary test on the elbow, by kind of friction and by step."""

from dataclasses import asdict, replace

from hmtb_twin import NOMINAL_PLANT, load_arm
from tests.benchmarks.tables import heading, row
from tests.hmtb_twin.balances import binary, linear_balances


def main():
    terms = ("supplied", "throttled", "leaked", "rubbed", "dragged", "stored", "residual")
    heading("friction", "step, ms", "oil", "energy", *(f"{term}, J" for term in terms))
    for friction in ("none", "viscous", "coulomb", "lugre"):
        arm = load_arm(plant=replace(NOMINAL_PLANT, friction=friction))
        for refined in (1, 2):
            oil, energy = linear_balances(arm, binary(arm, ("elbow_pitch",)), refined=refined)
            stored = energy.compressed + energy.kinetic + energy.potential
            residual = 2.0 * energy.supplied - sum(asdict(energy).values())
            losses = [f"{x:.2f}" for x in (energy.throttled, energy.leaked, energy.rubbed, energy.dragged, stored)]
            step = f"{1e3 * arm.model.opt.timestep / refined:.3g}"
            closures = f"{oil.closure:.1e}", f"{energy.closure:.1e}"
            row(friction, step, *closures, f"{energy.supplied:.1f}", *losses, f"{residual:+.1e}")


if __name__ == "__main__":
    main()
