"""Study of control: scenarios with each law and without, and where the laws break."""

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from hmtb_twin import VARIANTS
from scenarios.control.campaign import IdentifiedPair, controlled
from scenarios.control.design import METHODS, wrong_model
from scenarios.control.runs import Law, ScenarioRuns, Tested, run_scenarios
from scenarios.control.score import FREQUENCIES, Score, score
from scenarios.experiments.scenario import known_arm
from scenarios.files.errors import ScenarioError
from sysid import SysidError

WORN = 8.0
"""Dry friction of worn seals over that of the scenario."""


def _with_payload(scenario: Tested, payload: str) -> Tested:
    """Return a scenario with another payload at the start."""
    return replace(scenario, payload=payload)


def _with_worn_seals(scenario: Tested) -> Tested:
    """Return a scenario on an arm with `WORN` times its dry friction."""
    # A multiple: seals that a file calls worn wear on, and eight times nothing stays nothing.
    plant = scenario.plant
    return replace(scenario, plant=replace(plant, friction_level=WORN * plant.friction_level))


PAYLOADS = ("none", "ballast", "mdm")
"""Payloads of the test bed in stress tests; another machine has all its own."""

WORN_SEALS = "worn seals"

CONDITIONS = (*(f"payload {name}" for name in PAYLOADS), WORN_SEALS)
"""Names of the stress tests of the test bed; see `conditions`."""


def conditions(scenario: Tested) -> dict[str, Callable[[Tested], Tested]]:
    """Return the changes of the arm behind the controller's back: laws and reference stay."""
    payloads: tuple[str, ...] = PAYLOADS
    if scenario.variant not in VARIANTS:
        payloads = tuple(name for name in known_arm(scenario.variant).payloads if name != scenario.payload)
    changes: dict[str, Callable[[Tested], Tested]] = {}
    for name in payloads:
        changes[f"payload {name}"] = partial(_with_payload, payload=name)
    return {**changes, WORN_SEALS: _with_worn_seals}


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

    @property
    def joints(self) -> tuple[str, ...]:
        """The controlled joints."""
        return controlled(self.runs.scenario.variant)

    @property
    def factor(self) -> float:
        """Error without control over that with it, against the reference model; NaN if the run failed."""
        if self.controlled is None:
            return float("nan")
        return _ratio(self.without.total, self.controlled.total)

    @property
    def factor_arm(self) -> float:
        """Error without control over that with it, against the simulated reference arm; NaN if either did not run."""
        if self.controlled is None:
            return float("nan")
        return _ratio(self.without.total_arm, self.controlled.total_arm)

    def record(self) -> dict[str, object]:
        """Return the result as plain values for JSON, angles in rad; None where the run failed."""
        controlled = self.controlled
        record: dict[str, object] = {
            "scenario": self.runs.scenario.name,
            "seed": self.runs.scenario.seed,
            "method": self.method,
            "condition": self.condition,
            "rmse_without": self.without.total,
            "rmse_with": None if controlled is None else controlled.total,
            "saturated_percent": None if controlled is None else 100.0 * controlled.limited,
            "stable": controlled is not None and controlled.stable,
        }
        for name in ("total_arm", "force", "force_99"):
            record[f"{name}_without"] = getattr(self.without, name)
            record[f"{name}_with"] = None if controlled is None else getattr(controlled, name)
        record["factor"], record["factor_arm"] = self.factor, self.factor_arm
        record["failed"] = self.failed
        record["frequencies_hz"] = FREQUENCIES
        record["joints"] = {joint: self._joint_record(channel) for channel, joint in enumerate(self.joints)}
        return record

    def _joint_record(self, channel: int) -> dict[str, object]:
        """Errors, effort and response of one joint, without control and with it; None where the run failed."""
        controlled = self.controlled
        record: dict[str, object] = {}
        for name in ("rmse", "effort"):
            record[f"{name}_without"] = getattr(self.without, name)[channel]
            record[f"{name}_with"] = None if controlled is None else getattr(controlled, name)[channel]
        for name in ("bandwidth_hz", "gains", "phases"):
            response_with = None if controlled is None else getattr(controlled.response, name)[..., channel]
            record[name] = {
                "without": getattr(self.without.response, name)[..., channel],
                "with": response_with,
                "reference": getattr(self.without.reference_response, name)[..., channel],
            }
        return record


def _ratio(without: float, controlled: float) -> float:
    """Error without control over that with it; infinite where control leaves none."""
    return without / controlled if controlled else float("inf")


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
    reference_arm = run.logs.get("reference")
    scores = {}
    for name, log in run.logs.items():
        # The reference arm is what the other runs are compared with.
        if name != "reference":
            scores[name] = score(log, pair.reference, reference_arm)
    scored = []
    for name, (method, condition) in laws.items():
        failed = run.failed.get(name, "")
        scored.append(ControlResult(method, condition, run, scores["without"], scores.get(name), failed))
    return tuple(scored)


def changed_arms(scenario: Tested) -> list[Tested]:
    """Return a scenario on each of the arms of `conditions`.

    Raises:
        ScenarioError: The scenario cannot have one of them: more friction than the laboratory has, or a payload that
            its own payload changes begin with.
    """
    changed: list[Tested] = []
    for condition, change in conditions(scenario).items():
        try:
            changed.append(change(scenario))
        except ValueError as error:
            raise ScenarioError(f"stress test {condition!r}: {error}") from error
    return changed


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
    wrong_laws: dict[str, Law] = {}
    wrong_law_labels: dict[str, tuple[str, str]] = {}
    for condition, error in WRONG.items():
        for method in redesigned:
            label = f"{condition}: {method}"
            # A method may find no design for so wrong a model: then there is nothing to run.
            with suppress(SysidError):
                wrong_laws[label] = METHODS[method](wrong_model(pair, **error))
                wrong_law_labels[label] = method, condition
    changed = changed_arms(scenario)
    runs_on_changed_arms = run_scenarios(changed, laws, reference=reference, threads=threads, progress=progress)
    (runs_of_wrong_laws,) = run_scenarios(
        [scenario], wrong_laws, reference=reference, threads=threads, progress=progress
    )
    scored: list[ControlResult] = []
    for condition, runs in zip(conditions(scenario), runs_on_changed_arms, strict=True):
        scored += results(pair, runs, {name: (name, condition) for name in laws})
    scored += results(pair, runs_of_wrong_laws, wrong_law_labels)
    return tuple(scored)
