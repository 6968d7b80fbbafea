"""Study of control: scenarios with each law and without, and where the laws break."""

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from hmtb_twin import Plant
from scenarios.control.campaign import CONTROLLED, IdentifiedPair
from scenarios.control.design import METHODS, wrong_model
from scenarios.control.runs import Law, ScenarioRuns, Tested, run_scenarios
from scenarios.control.score import FREQUENCIES, Score, score
from scenarios.files.errors import ScenarioError
from sysid import SysidError

CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "payload none": {"payload": "none"},
    "payload ballast": {"payload": "ballast"},
    "payload mdm": {"payload": "mdm"},
    # Eight times the nominal dry friction.
    "worn seals": {"plant": Plant(friction_level=8.0)},
}
"""Changes of the arm behind the controller's back: laws and reference stay."""

WRONG: Mapping[str, Mapping[str, Any]] = {
    "model's gain 0.8": {"gain": 0.8},
    "model's gain 1.25": {"gain": 1.25},
    "model's delay + 1": {"delay": 1},
    "model's delay + 3": {"delay": 3},
}
"""Errors of the model, for `wrong_model`: laws are designed anew from it, the arm stays."""


@dataclass(frozen=True, eq=False)
class ControlResult:
    """Comparison of one run under a control law with the same run without control.

    Attributes:
        method: How the law was designed.
        condition: What was changed; empty where nothing was.
        runs: The runs of the scenario.
        without: Score without control.
        controlled: Score with the law; None if its run failed.
        failed: Why it failed.
    """

    method: str
    condition: str
    runs: ScenarioRuns
    without: Score
    controlled: Score | None
    failed: str

    def record(self) -> dict[str, object]:
        """Return the result as plain values for JSON, angles in rad; None where the run failed."""
        own, both = self.controlled, {"without": self.without, "with": self.controlled}
        seen = {key: one and one.response for key, one in both.items()}
        seen["reference"] = self.without.reference_response
        joints: dict[str, dict[str, object]] = {}
        for k, joint in enumerate(CONTROLLED):
            joints[joint] = {
                f"{name}_{key}": one and getattr(one, name)[k]
                for name in ("rmse", "effort")
                for key, one in both.items()
            }
            joints[joint] |= {
                name: {key: one and getattr(one, name)[..., k] for key, one in seen.items()}
                for name in ("bandwidth_hz", "gains", "phases")
            }
        return {
            "scenario": self.runs.scenario.name,
            "seed": self.runs.scenario.seed,
            "method": self.method,
            "condition": self.condition,
            "rmse_without": self.without.total,
            "rmse_with": own and own.total,
            "saturated_percent": own and 100.0 * own.limited,
            "stable": own is not None and own.stable,
            **{
                f"{name}_{key}": one and getattr(one, name)
                for name in ("total_arm", "force", "force_99")
                for key, one in both.items()
            },
            "failed": self.failed,
            "frequencies_hz": FREQUENCIES,
            "joints": joints,
        }


def results(pair: IdentifiedPair, run: ScenarioRuns, laws: Mapping[str, tuple[str, str]]) -> tuple[ControlResult, ...]:
    """Score the runs of a scenario with each law.

    Args:
        pair: The identified models.
        run: The runs.
        laws: Method and condition of each law, by its name.

    Raises:
        ScenarioError: The run without control failed: there is nothing to compare with.
    """
    if "without" in run.failed:
        raise ScenarioError(f"{run.scenario.name} fails without control: {run.failed['without']}")
    arm = run.logs.get("reference")
    scores = {name: score(log, pair.reference, arm) for name, log in run.logs.items() if name != "reference"}
    return tuple(
        ControlResult(*of, run, scores["without"], scores.get(name), run.failed.get(name, ""))
        for name, of in laws.items()
    )


def stress(
    scenario: Tested,
    pair: IdentifiedPair,
    laws: Mapping[str, Law],
    redesigned: Collection[str],
    *,
    reference: str | None = "flight",
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ControlResult, ...]:
    """Run a scenario in free space on changed arms, and with laws designed anew from wrong models.

    Args:
        scenario: The scenario.
        pair: The identified models.
        laws: Laws by name.
        redesigned: Methods that are designed anew.
        reference: Variant of the reference arm; None runs none.
        threads: Threads for the physics.
        progress: Called with the completed ticks and the total of each half.

    Returns:
        Results by condition; a method without a design from a wrong model has none.
    """
    wrong: dict[str, Law] = {}
    labels: dict[str, tuple[str, str]] = {}
    for condition, error in WRONG.items():
        for method in redesigned:
            label = f"{condition}: {method}"
            with suppress(SysidError):
                wrong[label] = METHODS[method](wrong_model(pair, **error))
                labels[label] = method, condition
    changed = [replace(scenario, **change) for change in CONDITIONS.values()]
    runs = run_scenarios(changed, laws, reference=reference, threads=threads, progress=progress)
    runs += run_scenarios([scenario], wrong, reference=reference, threads=threads, progress=progress)
    named = [{name: (name, condition) for name in laws} for condition in CONDITIONS]
    return tuple(one for run, own in zip(runs, [*named, labels], strict=True) for one in results(pair, run, own))
