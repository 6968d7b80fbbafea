"""One experiment: an immutable description, read from a TOML file."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from hmtb_twin import (
    MODES,
    NOMINAL_PLANT,
    NOMINAL_SPECIMEN,
    VARIANTS,
    Chain,
    HandController,
    Operator,
    PayloadChange,
    Plant,
    Specimen,
    TwinError,
)
from hmtb_twin.arm.arm import check_arm
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.control_station import payload_exchanges, servo_power
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.control.modes import axis_names
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.payloads import OWN, load_from
from hmtb_twin.parameters.values import HAND_CONTROLLER
from scenarios.experiments.excitation_computer import Excitation, check_outputs
from scenarios.experiments.rpcm import check_task, task_operator
from scenarios.experiments.waveform import LONGEST, check_seed
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import read_toml

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,99}")
"""Valid scenario names."""

NOMINAL: Mapping[str, object] = {
    "plant": NOMINAL_PLANT,
    "specimen": NOMINAL_SPECIMEN,
    "chain": Chain(),
    "hand_controller": HAND_CONTROLLER,
}
"""Nominal records of a scenario; files hold only what differs from them."""


@dataclass(frozen=True)
class Scenario:
    """Complete description of one experiment: arm, operating point, control mode, excitation, chain and seeds.

    Attributes:
        name: Unique name.
        axes: Axes that the stick moves: joints, or directions of the tool in the Cartesian modes; the rest is held.
        excitation: One entry, played on every axis, or one per axis; none if an operator has a task.
        duration: Length of the record, s.
        seed: Draws the noise of the hand controller and of the sensors.
        variant: The arm: a variant of the test bed, e.g. ``"nominal"``, another arm by name, or a path; TOML files may
            call it `arm`.
        payload: Payload of the end effector, e.g. ``"rpcm"``, or the text of one's own; a TOML table of its mass,
            centre and inertia.
        pose: Keyframe of the operating point.
        mode: Control mode, e.g. ``"single_joint"``.
        worksite: Whether the arm stands at the worksite, with contact, instead of in free space.
        task: Task of an operator in place of the excitation computer, e.g. ``"rpcm"``; empty without an operator.
        shutdown: Emergency shutdowns: times of power off and power on, alternating, s.
        payload_changes: Exchanges of the payload in free space; an array of TOML tables with time and payload.
        independent_channels: Whether there may be more different excitations than outputs of the excitation computer.
        plant: Supply, oil, friction and noise of the drives; a TOML table of what differs from the nominal plant.
        specimen: Deviations of this arm from its variant; a TOML table.
        chain: Imperfections of the laboratory that are switched on; a TOML table of truth values.
        hand_controller: The hand-controller interface; a TOML table of what differs from the nominal one.
        description: One line for the list.
        tags: Words to find it by.
    """

    name: str
    axes: tuple[str, ...]
    excitation: tuple[Excitation, ...]
    duration: float = 240.0
    seed: int = 0
    variant: str = "nominal"
    payload: str = "rpcm"
    pose: str = "rpcm_holster_out_approach"
    mode: str = "single_joint"
    worksite: bool = False
    task: str = ""
    shutdown: tuple[float, ...] = ()
    # Not in the text of a scenario, from which stored truths of problems have their keys; no problem changes payloads.
    payload_changes: tuple[PayloadChange, ...] = field(default=(), repr=False)
    independent_channels: bool = False
    plant: Plant = NOMINAL_PLANT
    specimen: Specimen = NOMINAL_SPECIMEN
    chain: Chain = Chain()  # noqa: RUF009
    hand_controller: HandController = HAND_CONTROLLER
    description: str = ""
    tags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise ScenarioError(
                f"scenario name {self.name!r}: expected 1 to 100 letters, digits, '.', '_', '-' or '+', the first a "
                "letter or digit, because files are named after it"
            )
        try:
            self._check()
        except (ScenarioError, TwinError) as error:
            raise ScenarioError(f"scenario {self.name!r}: {error}") from error

    def _check(self) -> None:
        arm = known_arm(self.variant)
        choices: dict[str, Iterable[str]] = {"pose": arm.poses, "mode": MODES}
        # One's own payload is checked with the arm.
        if not self.payload.startswith(OWN):
            choices = {"payload": arm.payloads, **choices}
        for attribute, available in choices.items():
            if getattr(self, attribute) not in available:
                raise ScenarioError(unknown(attribute, getattr(self, attribute), available))
        axes_of_mode = axis_names(self.mode, self.variant)
        for name in self.axes:
            if name not in axes_of_mode:
                raise ScenarioError(f"mode {self.mode}: {unknown('axis', name, axes_of_mode)}")
        if not self.axes or len(set(self.axes)) != len(self.axes):
            raise ScenarioError(f"expected one or more different entries in axes, given {self.axes}")
        if self.task:
            check_task(self.task, self, excited=bool(self.excitation))
        # Subclasses that are driven by hand have an operator and neither task nor excitation.
        elif self.excitation or not self.has_own_operator:
            check_outputs(self.excitation, self.axes, self.independent_channels)
        if not arm.sample_time <= self.duration <= LONGEST:
            raise ScenarioError(f"expected a duration of {arm.sample_time} to {LONGEST:g} s, given {self.duration}")
        ticks = round(arm.sample_rate * self.duration)
        # Called for their errors: a bad time is refused before any simulation.
        servo_power(self.shutdown, ticks, arm.sample_rate)
        payload_exchanges(self, ticks, arm.sample_rate)
        check_seed(self.seed)
        for payload in (self.payload, *(change.payload for change in self.payload_changes)):
            check_arm(self.variant, payload, self.plant, worksite=self.worksite, specimen=self.specimen)

    def volts(self) -> np.ndarray:
        """Play the excitation through the excitation computer's converter.

        Returns:
            Volts `(N, len(axes))` at the rate of the position loop, `N = round(rate * duration)`, before noise and
            bias; zero where an operator moves the stick.
        """
        return BOARD.convert(self.requested_volts(), rounds=self.chain.dac)

    def requested_volts(self) -> np.ndarray:
        """Voltages that the files request of the converter, before its range and rounding; otherwise as `volts`."""
        if not self.excitation:
            return np.zeros((round(self.sample_rate * self.duration), len(self.axes)))
        columns = [signal.requested_volts(self.duration, rate=self.sample_rate) for signal in self.excitation]
        if len(columns) == 1:
            columns = columns * len(self.axes)
        return np.hstack(columns)

    def played(self) -> dict[str, Excitation]:
        """Return what each axis plays; nothing where an operator moves the stick."""
        if len(self.excitation) == 1:
            return dict.fromkeys(self.axes, self.excitation[0])
        # Shorter than the axes only where there is none at all.
        return dict(zip(self.axes, self.excitation, strict=False))

    def with_excitation(self, excitation: Excitation, axis: str | None = None) -> "Scenario":
        """Return the same experiment with another excitation on one axis or on every axis.

        Its description and tags go: they name what was played before.

        Raises:
            ScenarioError: An operator moves the stick, there is no such axis, or the computer lacks outputs.
        """
        if axis is not None and axis not in self.axes:
            raise ScenarioError(unknown("axis", axis, self.axes))
        played = self.played()
        if axis is None or not played:
            changed: tuple[Excitation, ...] = (excitation,)
        else:
            changed = tuple({**played, axis: excitation}.values())
        return replace(self, excitation=changed, description="", tags=())

    @property
    def amplitude(self) -> float | None:
        """The amplitude that all excitations share, V; None where there is none."""
        amplitudes = {signal.parameters.get("amplitude") for signal in self.excitation}
        if len(amplitudes) != 1:
            return None
        (amplitude,) = amplitudes
        return float(amplitude) if isinstance(amplitude, int | float) else None

    def with_amplitude(self, volts: float) -> "Scenario":
        """Return the same experiment with another amplitude of all its excitations."""
        amplified = []
        for signal in self.excitation:
            amplified.append(replace(signal, parameters={**signal.parameters, "amplitude": volts}))
        return replace(self, excitation=tuple(amplified))

    def operator(self) -> Operator | None:
        """Return a new operator for the task, or None if the excitation computer moves the stick."""
        return task_operator(self.task, self.seed, self.hand_controller) if self.task else None

    @property
    def arm(self) -> ArmDescription:
        """Description of its arm."""
        return arm_named(self.variant)

    @property
    def sample_rate(self) -> int:
        """Rate of the position loop, Hz."""
        return self.arm.sample_rate

    @property
    def period(self) -> int:
        """Samples after which the command repeats but for noise: of all waveforms, as the hold samples them."""
        hold = self.hand_controller.hold if self.chain.hold else 1
        periods = [round(self.sample_rate * signal.waveform().period) for signal in self.excitation]
        return int(np.lcm.reduce([hold, *periods]))

    @property
    def has_own_operator(self) -> bool:
        """Whether a subclass has an operator of its own, which no TOML file describes."""
        return type(self).operator is not Scenario.operator

    def reseeded(self, seed: int) -> "Scenario":
        """Return the same experiment with other noise: its seed is drawn from `seed` and the name.

        The excitation keeps its own seed: the same file is played again.
        """
        check_seed(seed)
        # The name enters the seed: tests of one campaign must not share their noise.
        # A checksum, because Python's `hash` of a text differs from run to run.
        own_seed = np.random.SeedSequence([seed, crc32(self.name.encode())]).generate_state(1)[0]
        return replace(self, seed=int(own_seed))

    def to_toml(self) -> str:
        """Write every field as TOML, such that `from_toml` gives an equal scenario back."""
        table = codec.unstructure(self)
        for name, nominal in NOMINAL.items():
            table[name] = codec.changes(getattr(self, name), nominal)
        omitted = [name for name in (*NOMINAL, "excitation", "payload_changes") if not table[name]]
        return codec.to_toml({key: value for key, value in table.items() if key not in omitted})

    @classmethod
    def from_toml(cls, text: str, *, source: str = "TOML text", folder: Path = Path()) -> "Scenario":
        """Read a scenario, strictly; relative paths of waveform files start from `folder`.

        Raises:
            ScenarioError: The text is not TOML, or a key, a type or a name is wrong.
        """
        table = read_toml(text, source)
        try:
            return cls.from_table(table, folder=folder)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: {error}") from error

    @classmethod
    def from_table(cls, table: Mapping[str, Any], *, folder: Path = Path()) -> "Scenario":
        """Build a scenario from parsed TOML; see `from_toml`."""
        values = _with_arm(table)
        if "excitation" in values:
            tables = values["excitation"]
            if not isinstance(tables, list):
                tables = [tables]  # one excitation for all axes may be a plain table
            values["excitation"] = tuple(Excitation.from_table(excitation, folder) for excitation in tables)
        elif values.get("task"):
            # An operator needs no excitation; without a task its absence is an error.
            values["excitation"] = ()
        return codec.structure(cls, values)

    @classmethod
    def read(cls, path: str | Path) -> "Scenario":
        """Read a scenario from a TOML file; see `from_toml`."""
        if Path(path).exists() and not Path(path).is_file():  # reading a pipe may never end
            raise ScenarioError(f"cannot read scenario file {str(path)!r}: it is no ordinary file")
        try:
            toml = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f"cannot read scenario file {str(path)!r}: {error}") from error
        return cls.from_toml(toml, source=str(path), folder=Path(path).parent)


def known_arm(name: str) -> ArmDescription:
    """Return an arm by name or from its files.

    Raises:
        ScenarioError: There is no such arm, or its files are wrong.
    """
    try:
        return arm_named(name)
    except TwinError as error:
        # A name that resembles one of the test bed's gets a suggestion.
        if isinstance(name, str) and "/" not in name and str(error).startswith("unknown variant"):
            raise ScenarioError(f"{unknown('variant', name, VARIANTS)}; {str(error).partition('; ')[2]}") from error
        raise ScenarioError(str(error)) from error


def _with_arm(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table in which `arm` stands for the variant, and payload and pose of another arm are its own by default."""
    values = dict(table)
    if "arm" in values:
        if "variant" in values:
            raise ScenarioError("arm and variant given, expected one of them: both name the arm")
        values["variant"] = values.pop("arm")
    name = values.get("variant")
    if isinstance(name, str) and name not in VARIANTS:
        arm = known_arm(name)
        values.setdefault("payload", arm.tuned_payload)
        values.setdefault("pose", arm.operating_pose)
    payload = values.get("payload")
    if isinstance(payload, Mapping):
        values["payload"] = _own_payload(payload)
    return values


def _own_payload(table: Mapping[str, Any]) -> str:
    """Text of a payload that a table describes by mass, kg, centre, m, and inertia, kg m^2, in the frame of the tool.

    Raises:
        ScenarioError: Another key, no mass, or no numbers.
    """
    for key in table:
        if key not in ("mass", "centre", "inertia"):
            raise ScenarioError(unknown("key of payload", key, ("mass", "centre", "inertia")))
    values: dict[str, Sequence[float]] = {"centre": (0.0,) * 3, "inertia": (0.0,) * 6}
    for key, given in table.items():
        values[key] = codec.structure(tuple[float, ...], [given] if key == "mass" else given, f"payload: {key}")
    try:
        return load_from(values).text
    except TwinError as error:
        raise ScenarioError(str(error)) from error
