"""Joint log: the record of one experiment on the 1553 bus, and the quantities that only a simulation knows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.bus.log_figure import JointCurves, log_figure
from hmtb_twin.control.experiment import Status
from hmtb_twin.files.errors import TwinError
from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_format, write_format
from hmtb_twin.parameters.variants import JOINTS
from sysid import IOData

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

MOST_DRAWN = 3
"""Joints that a figure shows where none is named and none is excited alone."""

WRENCH = ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
"""Components of the wrist force/torque sensor, in its own frame."""

_FLAGS = ", ".join(f"{flag.value} {str(flag.name).lower()}" for flag in Status)

_CHANNELS = {
    "commanded": ("joint", "rad", "commanded joint angle after quantisation, hold and velocity limit, as recorded"),
    "measured": ("joint", "rad", "resolver angle, read before the command of the same tick acts"),
    "wrench": ("component", "N, N m", "wrist force/torque sensor, force then torque, sensor frame"),
    "true_angles": ("joint", "rad", "joint angle without noise and quantisation"),
    "load_pressure": ("joint", "MPa", "pressure across each actuator"),
    "volts": ("axis", "V", "voltage at the hand-controller converter"),
    "counts": ("axis", "1", "hand-controller counts"),
    "status": (None, "1", f"flags of the tick: {_FLAGS}"),
}

_ELECTRIC_CHANNELS = {"load_pressure": ("joint", "A", "current of each motor, in the place of a pressure")}
"""Channels with another meaning for an arm with electric drives."""

_OPTIONAL_CHANNELS = {
    "sent": ("joint", "rad", "command that the arm felt, without the noise of the record"),
    "requested": ("joint", "rad", "command that the operator requested, ahead of the joint controller"),
    "unit_pose": ("pose", "m, 1", "position and quaternion (w, x, y, z) of the replacement unit in the world"),
    "contact_force": (
        None,
        "N",
        "sum of the normal forces between unit and worksite, largest over the physics steps of the tick before",
    ),
    "spool": ("joint", "1", "spool position of each servo valve, part of full stroke"),
    "supply_pressure": (None, "MPa", "pressure of the supply that all joints share"),
}
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
"""Components of a pose."""


@dataclass(frozen=True)
class JointLog:
    """Log of one experiment at 50 Hz; row k holds what was read at tick k and the command that then acted.

    Attributes:
        name: The experiment.
        seed: Its seed.
        dt: Sampling time, s.
        axes: The excited joints.
        commanded: Commanded angles as recorded (N, 7), rad: the analyst's input.
        measured: Measured angles (N, 7), rad: the analyst's output.
        wrench: Wrist force and torque (N, 6), N and N m.
        true_angles: Joint angles as they are (N, 7), rad.
        load_pressure: Load pressures (N, 7), MPa; of electric drives, motor currents, A.
        volts: Voltage at the hand-controller converter (N, n_axes), V.
        counts: Hand-controller counts (N, n_axes).
        status: Limits and shutdowns at each tick, bits of `Status` (N,), integers.
        provenance: Software versions, arm and settings of the simulation.
        sent: Where the record of the commands has noise, the commands that the arm felt (N, 7), rad; None elsewhere.
        requested: With a joint controller, the commands that the operator requested of it (N, 7), rad; None elsewhere.
        unit_pose: At the worksite, position (m) and quaternion of the replacement unit (N, 7); None elsewhere.
        contact_force: At the worksite, sum of the normal forces between the unit and the worksite (N,), N: the largest
            since the tick before; None elsewhere.
        spool: With servo valves, spool positions (N, 7), part of full stroke; None elsewhere.
        supply_pressure: With servo valves, pressure of the supply (N,), MPa; None elsewhere.
        joints: Names of the joints from the base outward, in the sequence of the columns.
    """

    name: str
    seed: int
    dt: float
    axes: tuple[str, ...]
    commanded: np.ndarray
    measured: np.ndarray
    wrench: np.ndarray
    true_angles: np.ndarray
    load_pressure: np.ndarray
    volts: np.ndarray
    counts: np.ndarray
    status: np.ndarray
    provenance: Mapping[str, str] = field(default_factory=dict)
    sent: np.ndarray | None = None
    requested: np.ndarray | None = None
    unit_pose: np.ndarray | None = None
    contact_force: np.ndarray | None = None
    spool: np.ndarray | None = None
    supply_pressure: np.ndarray | None = None
    joints: tuple[str, ...] = JOINTS

    def __post_init__(self) -> None:
        widths = {"joint": len(self.joints), "component": len(WRENCH), "axis": len(self.axes), "pose": len(POSE)}
        for channel, (dimension, _, _) in self._channels().items():
            dtype = np.int64 if channel == "status" else float
            array = np.array(getattr(self, channel), dtype=dtype)
            samples = len(np.atleast_1d(self.commanded))
            shape = (samples, widths[dimension]) if dimension else (samples,)
            if array.shape != shape:
                raise TwinError(f"{channel} of shape {array.shape} given, expected {shape}")
            # The arrays are copies: locking them leaves the caller's own ones writable.
            array.setflags(write=False)
            object.__setattr__(self, channel, array)
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def __len__(self) -> int:
        return len(self.commanded)

    def __repr__(self) -> str:
        """Name the experiment and its length, not its samples."""
        arm = self.provenance.get("variant", "unknown")
        seconds = len(self) * self.dt
        return f"JointLog({self.name!r}, arm {arm!r}, axes {', '.join(self.axes)}, {len(self)} samples, {seconds:g} s)"

    def __reduce__(self) -> "tuple[Callable[[], JointLog], tuple[()]]":
        # Locked mappings cannot be pickled.
        return partial(JointLog, **{**vars(self), "provenance": dict(self.provenance)}), ()

    def _channels(self) -> "dict[str, tuple[str | None, str, str]]":
        """Return the channels of this log: dimension besides time, unit and meaning."""
        present = {name: channel for name, channel in _OPTIONAL_CHANNELS.items() if getattr(self, name) is not None}
        electric = _ELECTRIC_CHANNELS if self.provenance.get("drives") == "electric" else {}
        return {**_CHANNELS, **electric, **present}

    @property
    def time(self) -> np.ndarray:
        """Sampling instants (N,), s."""
        return np.arange(len(self)) * self.dt

    @property
    def felt(self) -> np.ndarray:
        """Commanded angles that the arm felt (N, 7), rad; the recorded ones may have noise beside."""
        return self.commanded if self.sent is None else self.sent

    def joint_index(self, name: str) -> int:
        """Return the column of a joint; raises `TwinError` for an unknown one."""
        if not isinstance(name, str) or name not in self.joints:
            raise TwinError(f"unknown joint {name!r}, available: {', '.join(self.joints)}")
        return self.joints.index(name)

    def iodata(self, joints: str | Sequence[str] | None = None) -> IOData:
        """Return commands and measurements of one joint, or of several, as a record for identification.

        Args:
            joints: The joint, or several; the excited one by default.

        Returns:
            Commanded angles as inputs, measured angles as outputs, rad, in the order of the joints.

        Raises:
            TwinError: Unknown or repeated joint, or no joint named although several are excited.
        """
        if joints is None:
            if len(self.axes) != 1:
                raise TwinError(f"{self.name} excites {', '.join(self.axes)}: name the joint")
            joints = self.axes[0]
        chosen = (joints,) if isinstance(joints, str) else tuple(joints)
        columns = [self.joint_index(joint) for joint in chosen]
        if not columns or len(set(columns)) < len(columns):
            raise TwinError(f"joints = {chosen} given, expected one or more of {', '.join(self.joints)}, each once")
        return IOData(
            self.commanded[:, columns],
            self.measured[:, columns],
            self.dt,
            input_names=tuple(f"{joint} commanded" for joint in chosen),
            output_names=tuple(f"{joint} measured" for joint in chosen),
            input_units=("rad",) * len(chosen),
            output_units=("rad",) * len(chosen),
        )

    @property
    def effort(self) -> np.ndarray:
        """Torque of each drive on its joint (N, n), N m, ahead of friction, from its load pressure or its current.

        Raises:
            TwinError: The log does not say of which arm it is, or that arm's files are gone.
        """
        arm = arm_named(self.provenance.get("variant", ""))
        motors = [arm.actuators[joint].motor for joint in self.joints]
        largest = np.array([motor.maximum_torque for motor in motors])
        return np.clip(self.load_pressure * [motor.constant for motor in motors], -largest, largest)

    def plot(self, joints: str | Sequence[str] | None = None) -> "Figure":
        """Draw commands, angles, errors and efforts over time.

        Args:
            joints: The joint, or several; by default those that are excited, or where none is, those that move most.

        Returns:
            A figure of matplotlib, a row of panels for each joint; `figure.savefig("log.png")` writes it.

        Raises:
            TwinError: An unknown joint, or one that is named twice.
        """
        chosen = self._drawn_joints() if joints is None else (joints,) if isinstance(joints, str) else tuple(joints)
        columns = [self.joint_index(joint) for joint in chosen]
        if not columns or len(set(columns)) < len(columns):
            raise TwinError(f"joints = {chosen} given, expected one or more of {', '.join(self.joints)}, each once")
        effort = self.effort
        curves = []
        for joint, column in zip(chosen, columns, strict=True):
            curves.append(JointCurves(joint, self.felt[:, column], self.measured[:, column], effort[:, column]))
        title = f"{self.name}, arm {self.provenance.get('variant', 'unknown')}, seed {self.seed}"
        limited = (self.status & (Status.VELOCITY_LIMITED | Status.JOINT_LIMITED)) != 0
        return log_figure(title, self.time, curves, limited)

    def _drawn_joints(self) -> tuple[str, ...]:
        """The excited joints; of axes of the tool, which are none, the joints that move most."""
        excited = tuple(axis for axis in self.axes if axis in self.joints)
        most = np.argsort(-np.ptp(self.true_angles, axis=0), kind="stable")[:MOST_DRAWN]
        return excited or tuple(self.joints[column] for column in sorted(most.tolist()))

    def to_xarray(self) -> "xarray.Dataset":
        """Return all channels as a data set of xarray, with names, units and the time in s."""
        import xarray

        labels: dict[str, Sequence[str]] = {"joint": self.joints, "component": WRENCH, "axis": self.axes, "pose": POSE}
        variables, used = {}, set[str]()
        for name, (along, unit, meaning) in self._channels().items():
            dims = ("time", along) if along else ("time",)
            used.update(dims)
            variables[name] = (dims, getattr(self, name), {"units": unit, "long_name": meaning})
        variables["effort"] = (("time", "joint"), self.effort, {"units": "N m", "long_name": "torque of each drive"})
        coordinates: dict[str, tuple[str, object, dict[str, str]]] = {"time": ("time", self.time, {"units": "s"})}
        coordinates |= {name: (name, list(values), {}) for name, values in labels.items() if name in used}
        return xarray.Dataset(variables, coordinates, {"title": self.name, "seed": self.seed, **self.provenance})

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return all channels as a table of pandas: a column for each number of a sample, the time in s as index."""
        import pandas

        labels: dict[str | None, Sequence[str]] = {
            "joint": self.joints,
            "component": WRENCH,
            "axis": self.axes,
            "pose": POSE,
        }
        columns: dict[str, np.ndarray] = {}
        for name, (along, _, _) in {**self._channels(), "effort": ("joint", "", "")}.items():
            values = getattr(self, name)
            if along is None:
                columns[name] = values
                continue
            for label, column in zip(labels[along], values.T, strict=True):
                columns[f"{label}_{name}"] = column
        return pandas.DataFrame(columns, index=pandas.Index(self.time, name="time"))

    def save(self, path: str | Path) -> Path:
        """Write the log as NetCDF4 and return its path; raises `TwinError` where it cannot be written."""
        labels = {"joint": self.joints, "component": WRENCH, "axis": self.axes}
        if self.unit_pose is not None:
            labels["pose"] = POSE
        variables = {"sample": Variable(("sample",), np.arange(len(self)), {})}
        for dimension, names in labels.items():
            # The type is given for logs without an excited axis: an empty array would be one of numbers.
            variables[dimension] = Variable((dimension,), np.array(names, dtype=str), {})
        for name, (along, unit, meaning) in self._channels().items():
            dims = ("sample", along) if along else ("sample",)
            variables[name] = Variable(dims, getattr(self, name), {"units": unit, "long_name": meaning})
        attributes: dict[str, Attribute] = {
            "title": self.name,
            "format": FORMAT,
            "seed": self.seed,
            "sampling_time": self.dt,
            "intersample": "zoh",
            **{f"provenance_{key}": value for key, value in self.provenance.items()},
        }
        return write_format(path, "log", Contents(variables, attributes))

    @classmethod
    def load(cls, path: str | Path) -> "JointLog":
        """Read a log written by `save`; raises `TwinError` where the file is missing, damaged or no joint log."""
        contents = read_format(path, "joint log", FORMAT, _CHANNELS)
        try:
            return cls._from_contents(contents)
        # All that missing or foreign attributes and variables can raise.
        except (KeyError, ValueError, TypeError, IndexError) as error:
            raise TwinError(f"{path} is a damaged joint log: {error}") from error

    @classmethod
    def _from_contents(cls, contents: Contents) -> "JointLog":
        """Return the log that the contents of a file describe; damage raises errors of any kind."""
        stored, attributes = contents.variables, contents.attributes
        joints = tuple(map(str, stored["joint"].values))
        # The joints of the test bed have one sequence, which other files of it rely on.
        if joints != JOINTS and set(joints) & set(JOINTS):
            raise TwinError(f"a joint log with joints {', '.join(joints)}; expected {', '.join(JOINTS)} in this order")
        prefix = "provenance_"
        provenance = {}
        for key, value in attributes.items():
            if key.startswith(prefix):
                provenance[key.removeprefix(prefix)] = str(value)
        present = [name for name in (*_CHANNELS, *_OPTIONAL_CHANNELS) if name in stored]
        return cls(
            name=str(attributes["title"]),
            seed=int(attributes["seed"]),
            dt=float(attributes["sampling_time"]),
            axes=tuple(map(str, stored["axis"].values)),
            provenance=provenance,
            joints=joints,
            **{name: stored[name].values for name in present},
        )


FORMAT = "hmtb joint log 2"
"""Marks the files of this version."""


def software_versions() -> dict[str, str]:
    """Return the versions of the packages that determine a log."""
    return {package.replace("-", "_"): _version(package) for package in ("hmtb-twin", "mujoco", "numpy", "pin")}


@cache
def _version(package: str) -> str:
    """Return the version of an installed package."""
    # Parsing the metadata of a package takes milliseconds.
    try:
        return version(package)
    except PackageNotFoundError:
        return "checkout"
