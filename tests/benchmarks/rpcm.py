"""The exchange of the replacement unit, seed by seed: how many insertions succeed, with what force, in what time.

Twenty seeds that served nothing else: the operator's script was written on others. The second row is an operator who
sees and moves twice as badly.
"""

from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import Status, simulate
from hmtb_twin.control.modes import axis_gains
from scenarios import Scenario, load
from scenarios.experiments.operator import ScriptedOperator, Skill
from scenarios.experiments.rpcm import TASKS, rpcm_outcome
from tests.benchmarks.tables import heading, row

SEEDS = range(1000, 1020)

LIMITED = Status.VELOCITY_LIMITED | Status.JOINT_LIMITED | Status.SINGULAR | Status.CONVERTER_SATURATED


@dataclass(frozen=True)
class Clumsy(Scenario):
    """The exchange by an operator who is twice as clumsy."""

    def operator(self):
        skill = Skill()
        errors = ("blur", "tilt", "weber", "spread", "stray")
        skill = replace(skill, **{name: 2.0 * getattr(skill, name) for name in errors})
        gains = axis_gains(self.mode, self.axes, self.hand_controller)
        return ScriptedOperator(TASKS[self.task](), gains, self.seed, skill)


def operator_row(name, scenario):
    """Run a scenario with every seed and print its row of the table."""
    logs = simulate([replace(scenario, name=f"exchange-{seed}", seed=seed) for seed in SEEDS])
    outcomes = [rpcm_outcome(log) for log in logs]
    inserted = sum(outcome.inserted for outcome in outcomes)
    returned = sum(outcome.returned for outcome in outcomes)
    limited = sum(bool((log.status & LIMITED).any()) for log in logs)
    peak = np.array([outcome.peak_contact_force for outcome in outcomes])
    largest = max(outcome.largest_contact_force for outcome in outcomes)
    released = np.array([outcome.phases["insert"][1] for outcome in outcomes if "insert" in outcome.phases])
    back = np.array([outcome.phases["return"][1] for outcome in outcomes if outcome.returned])
    counts = f"{inserted} of {len(SEEDS)}", f"{returned} of {len(SEEDS)}"
    row(name, *counts, middle(peak), f"{largest:.0f}", middle(released), middle(back), limited)


def middle(values):
    """Return median and largest value as text."""
    return f"{np.median(values):.0f} ({values.max():.0f})"


def main():
    exchange = load("rpcm")
    force = "peak contact force while inserting: median (largest), N"
    times = ("released: median (last), s", "back: median (last), s")
    heading("operator", "inserted", "brought back", force, "in all, N", *times, "runs with a command at a limit")
    operator_row("as assumed", exchange)
    operator_row("twice as clumsy", Clumsy(**vars(exchange)))


if __name__ == "__main__":
    main()
