"""One experiment: a frozen record that is a TOML file."""

import inspect
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_type_hints
from zlib import crc32

import numpy as np

from hmtb_twin import MODES, PAYLOADS, POSES, VARIANTS, Chain, HandController, Operator, axis_names
from hmtb_twin.parameters import HAND_CONTROLLER
from scenarios.errors import ScenarioError
from scenarios.excitation import KINDS
from scenarios.suggest import unknown
from scenarios.toml_values import record, typed, written
from scenarios.waveform import LONGEST, RATE, Waveform, check_seed

Value = float | int | bool | str

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,99}")
"""What a scenario may be called."""


@dataclass(frozen=True)
class Excitation:
    """What the excitation computer plays on an axis.

    Attributes:
        kind: Name of the excitation, one of `KINDS`.
        parameters: Its arguments by name; those left out keep their defaults.
    """

    kind: str
    parameters: Mapping[str, float | int | bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ScenarioError(unknown("excitation", self.kind, KINDS))
        object.__setattr__(self, "parameters", MappingProxyType(_checked(self.kind, self.parameters)))
        self.waveform()  # a bad value speaks here, not in the middle of a campaign

    def __hash__(self) -> int:
        return hash((self.kind, tuple(sorted(self.parameters.items()))))

    def __reduce__(self) -> tuple[type["Excitation"], tuple[str, dict[str, float | int | bool]]]:
        return (Excitation, (self.kind, dict(self.parameters)))

    def waveform(self) -> Waveform:
        """The 100-point file."""
        return KINDS[self.kind](**self.parameters)


@dataclass(frozen=True)
class Scenario:
    """Everything one experiment needs.

    Attributes:
        name: Unique name.
        axes: What the stick moves: joints, or directions of the tool in the Cartesian modes; all else is held.
        excitation: One entry, played on every axis, or one per axis.
        duration: Length of the record, s.
        seed: Draws the noise of the hand controller and of the sensors.
        variant: Which arm, e.g. ``"nominal"``.
        payload: What the end effector holds, e.g. ``"rpcm"``.
        pose: Keyframe of the operating point.
        mode: Control mode, e.g. ``"single_joint"``.
        worksite: At the worksite, with contact, instead of in free space.
        shutdown: Emergency shutdowns: times of power off and of power on again in turn, s.
        chain: Which links of the chain act; a TOML table of truth values.
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
    shutdown: tuple[float, ...] = ()
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
        for attribute, known in _choices().items():
            if getattr(self, attribute) not in known:
                raise ScenarioError(f"scenario {self.name!r}: {unknown(attribute, getattr(self, attribute), known)}")
        known = axis_names(self.mode)
        for name in self.axes:
            if name not in known:
                raise ScenarioError(f"scenario {self.name!r}, mode {self.mode}: {unknown('axis', name, known)}")
        if not self.axes or len(set(self.axes)) != len(self.axes):
            raise ScenarioError(
                f"scenario {self.name!r}: expected one or more different entries in axes, given {self.axes}"
            )
        if len(self.excitation) not in (1, len(self.axes)):
            raise ScenarioError(
                f"scenario {self.name!r}: {len(self.excitation)} excitations for {len(self.axes)} axes; "
                "expected one for all, or one per axis"
            )
        if not 1.0 / RATE <= self.duration <= LONGEST:
            raise ScenarioError(
                f"scenario {self.name!r}: expected a duration of {1 / RATE} to {LONGEST:g} s, given {self.duration}"
            )
        check_seed(self.seed)

    def volts(self) -> np.ndarray:
        """Play the excitation.

        Returns:
            Volts `(N, len(axes))` at 50 Hz, `N = round(50 * duration)`, before noise and bias.
        """
        columns = [entry.waveform().play(self.duration) for entry in self.excitation]
        return np.hstack(columns * len(self.axes) if len(columns) == 1 else columns)

    def operator(self) -> Operator | None:
        """No operator: the excitation computer moves the stick."""
        return None

    def reseeded(self, seed: int) -> "Scenario":
        """The same experiment with other noise: a seed of its own, drawn from `seed` and the name.

        The excitation keeps its own seed: one replays the same file.
        """
        if seed < 0:
            raise ScenarioError(f"expected a seed of 0 or more, given {seed}")
        drawn = np.random.SeedSequence([seed, crc32(self.name.encode())]).generate_state(1)
        return replace(self, seed=int(drawn[0]))

    def to_toml(self) -> str:
        """Write every field as TOML, such that `from_toml` gives an equal scenario back."""
        tables = {"chain": Chain(), "hand_controller": HAND_CONTROLLER}
        lines = [
            f"{entry.name} = {written(getattr(self, entry.name))}"
            for entry in fields(self)
            if entry.name not in ("excitation", *tables)
        ]
        for name, nominal in tables.items():
            changed = {key: value for key, value in vars(getattr(self, name)).items() if value != getattr(nominal, key)}
            if changed:
                lines += ["", f"[{name}]", *(f"{key} = {written(value)}" for key, value in changed.items())]
        for entry in self.excitation:
            lines += ["", "[[excitation]]", f"kind = {written(entry.kind)}"]
            lines += [f"{name} = {written(value)}" for name, value in entry.parameters.items()]
        return "\n".join(lines) + "\n"

    @classmethod
    def from_toml(cls, text: str, *, source: str = "TOML text") -> "Scenario":
        """Read a scenario, strictly.

        Args:
            text: The TOML text.
            source: Where it came from, for messages.

        Returns:
            The scenario.

        Raises:
            ScenarioError: The text is not TOML, or a key, a type or a name is wrong.
        """
        try:
            table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(f"{source}: not a TOML file ({error})") from error
        try:
            return cls.from_table(table)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: {error}") from error

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Scenario":
        """Build a scenario from parsed TOML; see `from_toml`."""
        hints = get_type_hints(cls)
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in hints:
                raise ScenarioError(unknown("key", key, hints))
            if key == "excitation":
                values[key] = _excitations(value)
            elif key in ("chain", "hand_controller"):
                values[key] = record(hints[key], key, value)
            else:
                values[key] = typed(key, value, hints[key])
        missing = [key for key in ("name", "axes", "excitation") if key not in values]
        if missing:
            raise ScenarioError(f"missing {', '.join(missing)}; a scenario needs name, axes and excitation")
        return cls(**values)

    @classmethod
    def read(cls, path: str | Path) -> "Scenario":
        """Read a scenario from a TOML file; see `from_toml`."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f"cannot read scenario file {str(path)!r}: {error}") from error
        return cls.from_toml(text, source=str(path))


def _choices() -> dict[str, tuple[str, ...]]:
    """What the laboratory offers, by field."""
    return {"variant": VARIANTS, "payload": tuple(PAYLOADS), "pose": tuple(POSES), "mode": MODES}


def _excitations(value: object) -> tuple[Excitation, ...]:
    tables = value if isinstance(value, list) else [value]
    entries = []
    for table in tables:
        if not isinstance(table, dict) or not isinstance(table.get("kind"), str):
            raise ScenarioError(f"excitation must be a table with a kind, given {table!r}; kinds: {', '.join(KINDS)}")
        entries.append(Excitation(table["kind"], {key: entry for key, entry in table.items() if key != "kind"}))
    return tuple(entries)


def _checked(kind: str, parameters: Mapping[str, object]) -> dict[str, float | int | bool]:
    """All arguments of an excitation, defaults filled in, of the right types."""
    signature: Mapping[str, inspect.Parameter] = inspect.signature(KINDS[kind]).parameters
    for key in parameters:
        if key not in signature:
            raise ScenarioError(f"excitation {kind!r}: {unknown('parameter', key, signature)}")
    hints = get_type_hints(KINDS[kind])
    values: dict[str, float | int | bool] = {}
    for key, parameter in signature.items():
        if key in parameters:
            values[key] = typed(f"{kind}.{key}", parameters[key], hints[key])
        elif parameter.default is not inspect.Parameter.empty:
            values[key] = parameter.default
        else:
            raise ScenarioError(f"excitation {kind!r} needs {key}; it takes {', '.join(signature)}")
    return values
