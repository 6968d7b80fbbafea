"""Runs of scenarios without control, with it, and of the reference arm on the same requests."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from hmtb_twin import NOMINAL_PLANT, NOMINAL_SPECIMEN, Experiment, JointLog, simulate
from scenarios.control.campaign import channels
from scenarios.experiments.multisines import MultisineExperiment
from scenarios.experiments.scenario import Scenario
from sysid import AdaptiveFollowing, Controller

Law = Controller | AdaptiveFollowing
"""Control law of the controlled joints, in deviations from where it starts."""

Tested = Scenario | MultisineExperiment
"""Experiment that `run_scenarios` plays with each control law and without."""


class DeviationController:
    """Joint controller of the laboratory that runs a law in deviations from the pose at its restart.

    Joints that are not of the law follow their requests.

    Args:
        law: The law.
        columns: Columns of its joints among all joints.
    """

    def __init__(self, law: Law, columns: Sequence[int]) -> None:
        self._law, self._columns = law, list(columns)

    def restart(self, command: np.ndarray) -> None:
        """Begin at rest under a command (n,), rad."""
        self._origin, self._run, self._begun = command[self._columns], self._law.start(), False

    def command(self, requested: np.ndarray, measured: np.ndarray, sent: np.ndarray) -> np.ndarray:
        """Return the joint command (n,), rad; see `hmtb_twin.control.experiment.JointController`."""
        if self._begun:
            # The limits are known one tick later.
            self._run.applied(sent[self._columns] - self._origin)
        self._begun = True
        columns = self._columns
        request_deviation, angle_deviation = (signal[columns] - self._origin for signal in (requested, measured))
        command = requested.copy()
        command[columns] = self._origin + self._run.command(request_deviation, angle_deviation)
        return command


@dataclass(frozen=True, eq=False)
class Controlled:
    """An experiment whose arm is under control; all else is as in the experiment.

    Attributes:
        experiment: The experiment.
        law: The control law of the controlled joints.
    """

    experiment: Experiment
    law: Law

    def __getattr__(self, attribute: str) -> Any:
        """Return an attribute of the experiment."""
        if attribute == "experiment":  # not yet there, as while it is copied
            raise AttributeError(attribute)
        return getattr(self.experiment, attribute)

    def controller(self) -> DeviationController:
        """Return a new controller of the joints."""
        return DeviationController(self.law, channels(self.experiment.variant))


@dataclass(frozen=True, eq=False)
class ScenarioRuns:
    """Runs of one scenario: `without` control, with each law by its name, and of the `reference` arm.

    Attributes:
        scenario: The scenario.
        logs: Logs of the runs that did not fail. The reference arm has none where requests follow the arm; see
            `has_common_requests`.
        failed: Reasons of the failures.
    """

    scenario: Tested
    logs: dict[str, JointLog]
    failed: dict[str, str]


def has_common_requests(scenario: Tested) -> bool:
    """Return whether all arms get the same requests, so that the simulated reference arm can be compared with.

    At the worksite the operator answers to the arm, and after an emergency shutdown requests start where it stands.
    """
    return not scenario.worksite and not scenario.shutdown


def run_scenarios(
    scenarios: Sequence[Tested],
    laws: Mapping[str, Law],
    *,
    reference: str | None = "flight",
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ScenarioRuns, ...]:
    """Run scenarios side by side without control, with each law, and on the reference arm if it has the same requests.

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
    run_of_experiment: dict[str, tuple[int, str]] = {}
    experiments: list[Experiment] = []

    def add(index: int, run_name: str, scenario: Tested, law: Law | None = None) -> None:
        # Numbered: scenarios may share a name and differ in seed, payload or specimen. Names end at 100 characters.
        named = replace(scenario, name=f"{len(experiments)}+{scenario.name}"[:100])
        run_of_experiment[named.name] = index, run_name
        experiment = named if law is None else cast(Experiment, Controlled(named, law))
        experiments.append(experiment)

    for index, scenario in enumerate(scenarios):
        add(index, "without", scenario)
        if reference is not None and has_common_requests(scenario):
            on_reference = replace(scenario, variant=reference, plant=NOMINAL_PLANT, specimen=NOMINAL_SPECIMEN)
            add(index, "reference", on_reference)
        for law_name, law in laws.items():
            add(index, law_name, scenario, law)
    # All in one call, so that the threads share them.
    # A law that drives the arm out of its limits fails in its own run alone.
    result = simulate(experiments, threads=threads, progress=progress, keep_going=True)
    runs = tuple(ScenarioRuns(scenario, {}, {}) for scenario in scenarios)
    for log in result:
        index, run_name = run_of_experiment[log.name]
        runs[index].logs[run_name] = replace(log, name=scenarios[index].name)
    for experiment_name, reason in result.failed.items():
        index, run_name = run_of_experiment[experiment_name]
        runs[index].failed[run_name] = reason
    return runs
