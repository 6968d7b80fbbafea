"""Study of control: scenarios with each law and without, and where the laws break."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from hmtb_twin import Plant
from scenarios.control.campaign import CONTROLLED, REFERENCE, IdentifiedPair
from scenarios.control.design import METHODS, WrongModel
from scenarios.control.joint_controller import Law
from scenarios.control.runs import ScenarioRuns, Tested, run_scenarios
from scenarios.control.score import FREQUENCIES, Score, score
from scenarios.files.errors import ScenarioError
from sysid import SysidError

WORN = Plant(friction_level=8.0)
"""Seals with eight times the nominal dry friction."""

CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "payload none": {"payload": "none"},
    "payload ballast": {"payload": "ballast"},
    "payload mdm": {"payload": "mdm"},
    "worn seals": {"plant": WORN},
}
"""Changes of the arm behind the controller's back: laws and reference stay."""

WRONG: Mapping[str, WrongModel] = {
    "model's gain 0.8": WrongModel(gain=0.8),
    "model's gain 1.25": WrongModel(gain=1.25),
    "model's delay + 1": WrongModel(delay=1),
    "model's delay + 3": WrongModel(delay=3),
}
"""Errors of the model: laws are designed anew from it, the arm stays."""


@dataclass(frozen=True, eq=False)
class ControlResult:
    """One scenario with one law.

    Attributes:
        method: Name of the law.
        condition: What was changed; empty where nothing was.
        runs: The logs.
        without: Score without control.
        controlled: Score with the law; None if its run failed.
    """

    method: str
    condition: str
    runs: ScenarioRuns
    without: Score
    controlled: Score | None

    def record(self) -> dict[str, object]:
        """Return the result as plain values for JSON, angles in rad."""
        log = self.controlled
        both = {"without": self.without} | ({"with": log} if log else {})
        totals = ("total_arm", "force", "force_99")
        values = {f"{name}_{key}": getattr(one, name) for name in totals for key, one in both.items()}
        joints = {}
        for k, joint in enumerate(CONTROLLED):
            row = {f"{name}_{key}": getattr(one, name)[k] for name in ("rmse", "effort") for key, one in both.items()}
            seen = {key: one.response for key, one in both.items()} | {"reference": self.without.reference_response}
            for name in ("bandwidth_hz", "gains", "phases"):
                row[name] = {key: getattr(one, name)[..., k] for key, one in seen.items()}
            joints[joint] = row
        return {
            "scenario": self.runs.scenario.name,
            "seed": self.runs.scenario.seed,
            "method": self.method,
            "condition": self.condition,
            "rmse_without": self.without.total,
            "rmse_with": None if log is None else log.total,
            "saturated_percent": None if log is None else 100.0 * log.limited,
            "stable": log is not None and log.stable,
            **values,
            "failed": self.runs.failed.get(self.method, ""),
            "frequencies_hz": FREQUENCIES,
            "joints": joints,
        }


def results(
    pair: IdentifiedPair, runs: Sequence[ScenarioRuns], methods: Sequence[str], condition: str = ""
) -> tuple[ControlResult, ...]:
    """Score the runs of scenarios, one `ControlResult` for each scenario and method.

    Raises:
        ScenarioError: A run without control failed: there is nothing to compare with.
    """
    scored = []
    for run in runs:
        if run.without is None:
            raise ScenarioError(f"{run.scenario.name} fails without control: {run.failed.get('', 'no reason')}")
        none = score(run.without, pair.reference, run.reference)
        for method in methods:
            log = run.controlled.get(method)
            own = None if log is None else score(log, pair.reference, run.reference)
            scored.append(ControlResult(method, condition, run, none, own))
    return tuple(scored)


def stress(
    scenario: Tested,
    pair: IdentifiedPair,
    laws: Mapping[str, Law],
    *,
    reference: str | None = REFERENCE,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ControlResult, ...]:
    """Run a scenario in free space on changed arms, and with laws designed anew from wrong models.

    Args:
        scenario: The scenario.
        pair: The identified models.
        laws: Laws by name; those named after a method are designed anew.
        reference: Variant of the reference arm; None runs none.
        threads: Threads for the physics.
        progress: Called with the completed ticks and the total of each half.

    Returns:
        Results by condition; a method without a design from a wrong model has none.
    """
    changed = [replace(scenario, **change) for change in CONDITIONS.values()]
    runs = run_scenarios(changed, laws, reference=reference, threads=threads, progress=progress)
    found = [one for name, run in zip(CONDITIONS, runs, strict=True) for one in results(pair, [run], list(laws), name)]
    wrong: dict[tuple[str, str], Law] = {}
    for name, error in WRONG.items():
        other = error.applied(pair)
        for method in set(laws) & set(METHODS):
            with suppress(SysidError):
                wrong[name, method] = METHODS[method](other)
    by_label = {f"{name}: {method}": law for (name, method), law in wrong.items()}
    (run,) = run_scenarios([scenario], by_label, reference=reference, threads=threads, progress=progress)
    for name, method in wrong:
        log, why = run.controlled.get(f"{name}: {method}"), run.failed.get(f"{name}: {method}")
        own = replace(run, controlled={method: log} if log else {}, failed={method: why} if why else {})
        found += results(pair, [own], [method], name)
    return tuple(found)
