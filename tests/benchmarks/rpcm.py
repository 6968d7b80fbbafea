"""The exchange of the replacement unit, seed by seed: how many insertions succeed, with what force, in what time.

Twenty seeds that served nothing else: the operator's script was written on others. The second row is an operator who
sees and moves twice as badly.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import Operator, Status, simulate
from hmtb_twin.control.modes import axis_gains
from scenarios import Scenario, load
from scenarios.experiments.operator import ScriptedOperator, Skill
from scenarios.experiments.rpcm import TASKS, rpcm_outcome

SEEDS = range(1000, 1020)

LIMITED = Status.VELOCITY_LIMITED | Status.JOINT_LIMITED | Status.SINGULAR | Status.CONVERTER_SATURATED


def worse(skill: Skill, times: float) -> Skill:
    """Return an operator whose every error is so many times larger."""
    return replace(
        skill,
        blur=times * skill.blur,
        tilt=times * skill.tilt,
        weber=times * skill.weber,
        spread=times * skill.spread,
        stray=times * skill.stray,
    )


@dataclass(frozen=True)
class Clumsy(Scenario):
    """The exchange by an operator who is twice as clumsy."""

    def operator(self) -> Operator | None:
        """Return the operator."""
        gains = axis_gains(self.mode, self.axes, self.hand_controller)
        return ScriptedOperator(TASKS[self.task](), gains, self.seed, worse(Skill(), 2.0))


def row(name: str, scenario: Scenario) -> str:
    """Run a scenario with every seed and return its row of the table."""
    logs = simulate([replace(scenario, name=f"exchange-{seed}", seed=seed) for seed in SEEDS])
    outcomes = [rpcm_outcome(log) for log in logs]
    inserted = sum(outcome.inserted for outcome in outcomes)
    returned = sum(outcome.returned for outcome in outcomes)
    limited = sum(bool((log.status & LIMITED).any()) for log in logs)
    peak = np.array([outcome.peak_contact_force for outcome in outcomes])
    largest = max(outcome.largest_contact_force for outcome in outcomes)
    released = np.array([outcome.phases["insert"][1] for outcome in outcomes if "insert" in outcome.phases])
    back = np.array([outcome.phases["return"][1] for outcome in outcomes if outcome.returned])
    cells = [name, f"{inserted} of {len(SEEDS)}", f"{returned} of {len(SEEDS)}", middle(peak), f"{largest:.0f}"]
    return f"| {' | '.join([*cells, middle(released), middle(back), str(limited)])} |"


def middle(values: np.ndarray) -> str:
    """Return median and largest value as text."""
    return f"{np.median(values):.0f} ({values.max():.0f})"


def main() -> int:
    """Print the table."""
    exchange = load("rpcm")
    print(
        "| operator | inserted | brought back | peak contact force while inserting: median (largest), N | in all, N | "
        "released: median (last), s | back: median (last), s | runs with a command at a limit |"
    )
    print("|---|---|---|---|---|---|---|---|")
    print(row("as assumed", exchange))
    print(row("twice as clumsy", Clumsy(**vars(exchange))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
