"""Bus record: joints and wrench as received, with lost messages and without the true states of a simulation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from hmtb_twin.bus.joint_log import WRENCH, JointLog
from hmtb_twin.files.errors import TwinError
from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_format, write_format
from hmtb_twin.parameters.variants import JOINTS, joint_index
from sysid import IOData

FORMAT = "hmtb bus record 1"
"""Marks the NetCDF files of this version."""

_COMMANDED = tuple(f"{joint}_commanded" for joint in JOINTS)
_MEASURED = tuple(f"{joint}_measured" for joint in JOINTS)

CHANNELS = {
    "commanded": (_COMMANDED, ("rad",) * len(JOINTS)),
    "measured": (_MEASURED, ("rad",) * len(JOINTS)),
    "wrench": (WRENCH, ("N",) * 3 + ("N m",) * 3),
    "status": (("status",), ("1",)),
    "saturated": (("saturated",), ("1",)),
}
"""Channels in the order of their columns: names and units of each."""

COLUMNS = tuple(chain.from_iterable(names for names, _ in CHANNELS.values()))
"""Names of all columns after the time."""

UNITS = tuple(chain.from_iterable(units for _, units in CHANNELS.values()))
"""Their units."""


def _stretches(complete: np.ndarray) -> Iterator[slice]:
    """Yield a slice for each uninterrupted stretch of complete ticks (N,)."""
    # Padding with incomplete ticks closes stretches at either end.
    steps = np.diff(np.concatenate(([False], complete, [False])).astype(int))
    for start, stop in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        yield slice(start, stop)


@dataclass(frozen=True)
class BusRecord:
    """One test as it came over the bus, at 50 Hz; NaN where a message was lost.

    Attributes:
        name: The test.
        dt: Sampling time, s.
        axes: Excited axes according to the set-up record; empty if unknown.
        commanded: Commanded angles (N, 7), rad: the analyst's input.
        measured: Measured angles (N, 7), rad: the analyst's output.
        wrench: Wrist force and torque (N, 6), N and N m.
        status: Flags of the control computer, whole numbers held as floats (N,); NaN where the command was lost.
        saturated: Values outside the range of their words, bits 0 to 6 commanded, 7 to 13 measured, 14 to 19 wrench;
            whole numbers held as floats (N,). Bits of lost messages are zero.
    """

    name: str
    dt: float
    axes: tuple[str, ...]
    commanded: np.ndarray
    measured: np.ndarray
    wrench: np.ndarray
    status: np.ndarray
    saturated: np.ndarray

    def __post_init__(self) -> None:
        if not 0 < self.dt < np.inf:
            raise TwinError(f"a sampling time of {self.dt} s given, expected one above 0 s")
        length = len(np.atleast_1d(self.commanded))
        for channel, (names, _) in CHANNELS.items():
            array = np.array(getattr(self, channel), dtype=float)
            shape = (length, len(names)) if len(names) > 1 else (length,)
            if array.shape != shape:
                raise TwinError(f"{channel} of shape {array.shape} given, expected {shape}")
            # NaN is a lost value; words of 16 bits can express no infinity.
            if np.isinf(array).any():
                raise TwinError(f"{channel} has infinite values; expected numbers, or NaN where one was lost")
            array.setflags(write=False)
            object.__setattr__(self, channel, array)
        for channel, bits in (("status", 16), ("saturated", 20)):
            flags = getattr(self, channel)[np.isfinite(getattr(self, channel))]
            if ((flags != np.rint(flags)) | (flags < 0) | (flags >= 2**bits)).any():
                raise TwinError(f"{channel} holds flags: whole numbers from 0 to {2**bits - 1}")

    def __len__(self) -> int:
        return len(self.commanded)

    @classmethod
    def of(cls, log: JointLog) -> "BusRecord":
        """Return the part of a log that passes over the bus, not yet rounded to 16-bit words.

        Raises:
            TwinError: A log of another arm: the words of the bus are those of the joints of the test bed.
        """
        if log.joints != JOINTS:
            raise TwinError(
                f"{log.name}: joints {', '.join(log.joints)} given, expected those of the test bed, which the words of "
                "its bus are named after; logs of other arms are kept as NetCDF (nc)"
            )
        flags = np.zeros(len(log))
        return cls(log.name, log.dt, tuple(log.axes), log.commanded, log.measured, log.wrench, log.status, flags)

    @classmethod
    def from_columns(cls, name: str, dt: float, axes: Sequence[str], table: np.ndarray) -> "BusRecord":
        """Return the record of a test from a table with one column for each of `COLUMNS` (N, 22)."""
        channels, start = {}, 0
        for channel, (names, _) in CHANNELS.items():
            columns = table[:, start : start + len(names)]
            channels[channel] = columns if len(names) > 1 else columns[:, 0]
            start += len(names)
        return cls(name=name, dt=dt, axes=tuple(axes), **channels)

    def columns(self) -> np.ndarray:
        """Return all values, one column for each of `COLUMNS` (N, 22)."""
        return np.column_stack([getattr(self, channel) for channel in CHANNELS])

    @property
    def time(self) -> np.ndarray:
        """Sampling instants (N,), s."""
        return np.arange(len(self)) * self.dt

    @property
    def lost(self) -> np.ndarray:
        """Ticks with lost values (N,), bool."""
        values = np.column_stack([self.commanded, self.measured, self.wrench])
        return np.asarray(np.isnan(values).any(axis=1))

    def parts(self, joints: str | Sequence[str] | None = None) -> tuple[IOData, ...]:
        """Return commands and measurements of one joint, or of several, split where commands were lost.

        Inputs must be complete and are never interpolated. Lost measurements stay in the parts, declared as missing.

        Args:
            joints: The joint, or several; the excited one by default.

        Returns:
            Commanded angles as inputs, measured angles as outputs, rad, in the order of the joints; as many records as
            there are stretches of commands with any measurement beside them.

        Raises:
            TwinError: Unknown joint, none named where the record does not excite just one, or nothing left.
        """
        if joints is None:
            joints = self._excited()
        chosen = (joints,) if isinstance(joints, str) else tuple(joints)
        columns = [joint_index(joint) for joint in chosen]
        commands, measurements = self.commanded[:, columns], self.measured[:, columns]
        parts = []
        for stretch in _stretches(np.isfinite(commands).all(axis=1)):
            inputs, outputs = commands[stretch], measurements[stretch]
            # Nothing can be estimated from commands alone.
            if not np.isfinite(outputs).any():
                continue
            record = IOData(
                inputs,
                outputs,
                self.dt,
                input_names=tuple(f"{joint} commanded" for joint in chosen),
                output_names=tuple(f"{joint} measured" for joint in chosen),
                input_units=("rad",) * len(chosen),
                output_units=("rad",) * len(chosen),
                missing=bool(np.isnan(outputs).any()),
            )
            parts.append(record)
        if not parts:
            raise TwinError(f"{self.name}: no sample of {', '.join(chosen)} is left of {len(self)}")
        return tuple(parts)

    def iodata(self, joint: str | None = None) -> IOData:
        """Return one joint's command and measurement as one record.

        Args:
            joint: The joint; the excited one by default.

        Returns:
            As `parts`, of which there must be one; commands lost at either end are left out.

        Raises:
            TwinError: As `parts`, or commands were lost in between.
        """
        records = self.parts(joint)
        if len(records) > 1:
            ticks = np.flatnonzero(np.isnan(self.commanded).any(axis=1))
            raise TwinError(
                f"{self.name}: {len(ticks)} commands were lost between ticks {ticks[0]} and {ticks[-1]}; an input must "
                f"be complete: take the {len(records)} parts"
            )
        return records[0]

    def _excited(self) -> str:
        """Return the one excited joint; raises `TwinError` unless there is exactly one."""
        if len(self.axes) == 1 and self.axes[0] in JOINTS:
            return self.axes[0]
        excited = f"excites {', '.join(self.axes)}" if self.axes else "does not say what it excites"
        raise TwinError(f"{self.name} {excited}: name the joint")

    def save(self, path: str | Path) -> Path:
        """Write the record as NetCDF4 and return its path; raises `TwinError` where it cannot be written."""
        dimensions = {"commanded": ("joint",), "measured": ("joint",), "wrench": ("component",)}
        coordinates = {"sample": np.arange(len(self)), "joint": np.array(JOINTS), "component": np.array(WRENCH)}
        variables = {name: Variable((name,), values, {}) for name, values in coordinates.items()}
        for name, (_, units) in CHANNELS.items():
            dims = ("sample", *dimensions.get(name, ()))
            different_units = ", ".join(dict.fromkeys(units))
            variables[name] = Variable(dims, getattr(self, name), {"units": different_units})
        attributes: dict[str, Attribute] = {
            "title": self.name,
            "format": FORMAT,
            "sampling_time": self.dt,
            "intersample": "zoh",
            "excited": " ".join(self.axes),
            "missing": "NaN",
        }
        return write_format(path, "record", Contents(variables, attributes))

    @classmethod
    def load(cls, path: str | Path) -> "BusRecord":
        """Read a record written by `save`; raises `TwinError` where the file is missing, damaged or no bus record."""
        contents = read_format(path, "bus record", FORMAT, CHANNELS)
        attributes = contents.attributes
        try:
            return cls(
                name=str(attributes["title"]),
                dt=float(attributes["sampling_time"]),
                axes=tuple(str(attributes["excited"]).split()),
                **{channel: contents.variables[channel].values for channel in CHANNELS},
            )
        except (KeyError, ValueError, TypeError) as error:
            raise TwinError(f"{path} is a damaged bus record: {error}") from error
