"""What a command replaces in an experiment: its payload, and its excitation by a record of one's own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hmtb_twin.parameters.payloads import OWN, load_of
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.scenario import Scenario
from scenarios.experiments.waveform import read_signals
from scenarios.files.errors import ScenarioError


@dataclass(frozen=True)
class Changes:
    """What a command replaces in experiments.

    Attributes:
        payload: Payload of the end effector; None keeps the experiment's own.
        record: File of the signals that are played; None keeps the excitation.
        columns: Names of columns of a table.
        sample_rate: Samples of the record per second, Hz.
    """

    payload: str | None = None
    record: Path | None = None
    columns: tuple[str, ...] = ()
    sample_rate: float | None = None

    def __post_init__(self) -> None:
        """Raise `ScenarioError` for a column or a rate of no record."""
        if self.record is None and (self.columns or self.sample_rate is not None):
            raise ScenarioError("a column or a rate of a record given, expected --record FILE beside it")

    def made(self, scenario: Scenario) -> Scenario:
        """Return an experiment with the changes."""
        if self.payload is not None:
            own = self.payload.startswith(OWN)
            scenario = replace(scenario, payload=load_of(self.payload).text if own else self.payload)
        if self.record is not None:
            scenario = with_record(scenario, self.record, self.columns, self.sample_rate)
        return scenario


def with_record(
    scenario: Scenario, path: Path, columns: Sequence[str] = (), sample_rate: float | None = None
) -> Scenario:
    """Return an experiment that plays the signals of a file, one for each of its axes, in place of its own excitation.

    Args:
        scenario: The experiment.
        path: The file; see `read_signals`.
        columns: Names of columns, one for each axis.
        sample_rate: Samples per second, Hz.

    Raises:
        ScenarioError: An operator moves the stick, or there are not as many signals as axes.
    """
    if scenario.task or not scenario.excitation:
        raise ScenarioError(f"{scenario.name}: a record to play given, but an operator moves the stick")
    signals = read_signals(path, columns, sample_rate)
    if len(signals) != len(scenario.axes):
        raise ScenarioError(
            f"{scenario.name} with {len(scenario.axes)} axes ({', '.join(scenario.axes)}) and {len(signals)} signals "
            f"of {path.name} given, expected one signal for each axis"
        )
    played = tuple(Excitation.from_signal(signal.samples, signal.sample_rate) for signal in signals)
    several = scenario.independent_channels or len(played) > 1
    return replace(scenario, excitation=played, independent_channels=several)
