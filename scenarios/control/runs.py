"""Runs of scenarios without control, with it, and of the reference arm on the same requests."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

from hmtb_twin import NOMINAL_PLANT, NOMINAL_SPECIMEN, Experiment, JointLog, simulate
from hmtb_twin.control.experiment import JointController
from scenarios.control.campaign import CONTROLLED
from scenarios.control.joint_controller import DeviationController, Law
from scenarios.experiments.multisines import MultisineExperiment
from scenarios.experiments.scenario import Scenario

Tested = Scenario | MultisineExperiment
"""What is run with control and without."""


@dataclass(frozen=True, eq=False)
class Controlled:
    """An experiment whose arm is under control; all else is as in the experiment.

    Attributes:
        experiment: The experiment.
        law: The control law of the controlled joints.
        name: Name of its log.
    """

    experiment: Experiment
    law: Law
    name: str

    def __getattr__(self, attribute: str) -> Any:
        """Return an attribute of the experiment."""
        if attribute == "experiment":  # not yet there, as while it is copied
            raise AttributeError(attribute)
        return getattr(self.experiment, attribute)

    def controller(self) -> JointController:
        """Return a new controller of the joints."""
        return DeviationController(self.law, CONTROLLED)


@dataclass(frozen=True, eq=False)
class ScenarioRuns:
    """The runs of one scenario.

    Attributes:
        scenario: The scenario.
        without: The log without control; None if that run failed.
        controlled: The log with each control law, by its name, of the runs that did not fail.
        reference: The log of the reference arm on the same requests; None at the worksite, where the operator answers
            to the arm and requests differ, or without such an arm.
        failed: Reasons of failures by name of the run.
    """

    scenario: Tested
    without: JointLog | None
    controlled: Mapping[str, JointLog]
    reference: JointLog | None
    failed: Mapping[str, str] = field(default_factory=dict)


def run_scenarios(
    scenarios: Sequence[Tested],
    laws: Mapping[str, Law],
    *,
    reference: str | None = "flight",
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ScenarioRuns, ...]:
    """Run scenarios side by side without control, with each law, and in free space on the reference arm.

    All runs of a scenario have the same seed, hence the same motion of an operator without view and the same noise.

    Args:
        scenarios: The scenarios.
        laws: Control laws by name.
        reference: Variant of the reference arm, which keeps the payload but has neither the plant nor the specimen of
            the scenario; None runs none.
        threads: Threads for the physics.
        progress: Called with the completed ticks and the total.

    Raises:
        TwinError: A run needs something that the laboratory does not have.
    """
    runs: dict[tuple[int, str], Experiment] = {}
    for place, one in enumerate(scenarios):
        # Numbered: scenarios may share a name and differ in seed, payload or specimen.
        runs[place, ""] = replace(one, name=f"{place}+{one.name}"[:100])
        for number, (name, law) in enumerate(laws.items()):
            runs[place, name] = cast(Experiment, Controlled(one, law, f"{place}+{number}+{one.name}"[:100]))
        if reference is not None and not one.worksite:
            flight = replace(one, variant=reference, plant=NOMINAL_PLANT, specimen=NOMINAL_SPECIMEN)
            runs[place, "reference"] = replace(flight, name=f"{place}+reference+{one.name}"[:100])
    logs = simulate(list(runs.values()), threads=threads, progress=progress, keep_going=True)
    by_name = {log.name: log for log in logs}
    results = []
    for place, one in enumerate(scenarios):
        own = {key: runs[place, key].name for key in ("", *laws, "reference") if (place, key) in runs}
        done = {key: replace(by_name[name], name=one.name) for key, name in own.items() if name in by_name}
        results.append(
            ScenarioRuns(
                one,
                done.get(""),
                {key: done[key] for key in laws if key in done},
                done.get("reference"),
                {key: logs.failed[name] for key, name in own.items() if name in logs.failed},
            )
        )
    return tuple(results)
