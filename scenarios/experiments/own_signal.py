"""Signals of one's own from files: a text file of numbers, or columns of a table with times or without."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hmtb_twin.parameters.payloads import OWN, load_of
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.waveform import read_samples
from scenarios.files.errors import ScenarioError
from sysid import SysidError
from sysid.records.importers import SAME_INTERVAL, Choice, records_of
from sysid.records.text_columns import text_columns
from sysid.records.time_stamps import interval_unit, is_time

if TYPE_CHECKING:
    from scenarios.experiments.scenario import Scenario

PLAYED = "played once more"
"""Name of the output that a record needs to be checked as any other one; no file has such a column."""


@dataclass(frozen=True)
class Signal:
    """A signal of one channel.

    Attributes:
        samples: Its samples (n,), V.
        sample_rate: Samples per second, Hz.
    """

    samples: tuple[float, ...]
    sample_rate: float


def read_signals(path: Path, columns: Sequence[str] = (), sample_rate: float | None = None) -> tuple[Signal, ...]:
    """Read signals from a file.

    Args:
        path: A text file of one number in V per line; or a table with a header, of which `columns` name the signals.
        columns: Names of columns, V. A column of times, as t, gives the sampling rate.
        sample_rate: Samples per second, Hz; by default that of the times, without times 50 Hz.

    Raises:
        ScenarioError: No such file or column, a sample that is no finite number, times that are not uniform, or a
            rate that contradicts them.
    """
    if not columns:
        return (Signal(read_samples(path), float(SAMPLE_RATE) if sample_rate is None else float(sample_rate)),)
    if not path.is_file():
        raise ScenarioError(f"no file {str(path)!r}; expected a table with the column {columns[0]!r}")
    try:
        table, place = text_columns(path, columns)
        times = any(is_time(name) or interval_unit(name) is not None for name in table)
        # Times may only be confirmed by a stated rate, which an interval beside them would replace.
        interval = None if times else 1.0 / (sample_rate or SAMPLE_RATE)
        missing = [name for name in columns if name not in table]
        # Its own error names the columns that there are.
        everything = table if missing else {**table, PLAYED: table[columns[0]]}
        choice = Choice(tuple(columns), (PLAYED,), None, None, interval, missing=False)
        (record,) = records_of(everything, choice, path, place)
    except SysidError as error:
        raise ScenarioError(f"{error}; of the record {path.name} that is to be played") from error
    rate = 1.0 / float(record.dt)
    if sample_rate is not None and abs(rate - sample_rate) > SAME_INTERVAL * rate:
        raise ScenarioError(
            f"{path.name}: a sampling rate of {sample_rate:g} Hz given, its times have {rate:.6g} Hz; expected one"
        )
    # Times are written with few digits: a rate of 49.9999 Hz would drift against the position loop.
    whole = round(rate)
    if abs(rate - whole) <= SAME_INTERVAL * rate:
        rate = float(whole)
    return tuple(Signal(tuple(column.tolist()), rate) for column in np.asarray(record.u).T)


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

    def made(self, scenario: "Scenario") -> "Scenario":
        """Return an experiment with the changes."""
        if self.payload is not None:
            own = self.payload.startswith(OWN)
            scenario = replace(scenario, payload=load_of(self.payload).text if own else self.payload)
        if self.record is not None:
            scenario = with_record(scenario, self.record, self.columns, self.sample_rate)
        return scenario


def with_record(
    scenario: "Scenario", path: Path, columns: Sequence[str] = (), sample_rate: float | None = None
) -> "Scenario":
    """Return an experiment that plays the signals of a file, one for each of its axes, in place of its own excitation.

    Args:
        scenario: The experiment.
        path: The file; see `read_signals`.
        columns: Names of columns, one for each axis.
        sample_rate: Samples per second, Hz.

    Raises:
        ScenarioError: An operator moves the stick, or there are not as many signals as axes.
    """
    from scenarios.experiments.excitation_computer import Excitation

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
