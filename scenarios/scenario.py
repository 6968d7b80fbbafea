"""One experiment: a frozen record that is a TOML file."""

import inspect
import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_type_hints
from zlib import crc32

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.excitation import KINDS
from scenarios.suggest import unknown
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
        axes: Excited joints; all others hold their pose and servo.
        excitation: One entry, played on every axis, or one per axis.
        duration: Length of the record, s.
        seed: Draws the noise of the hand controller and of the sensors.
        variant: Which arm, e.g. ``"nominal"``.
        payload: What the end effector holds, e.g. ``"rpcm"``.
        pose: Keyframe of the operating point.
        mode: Control mode, e.g. ``"single_joint"``.
        friction: Seal friction on.
        noise: Hand-controller and resolver noise on.
        quantisation: Converters and resolvers quantise.
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
    friction: bool = True
    noise: bool = True
    quantisation: bool = True
    description: str = ""
    tags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        from hmtb_twin import JOINTS

        if not NAME.fullmatch(self.name):
            raise ScenarioError(
                f"scenario name {self.name!r}: expected 1 to 100 letters, digits, '.', '_', '-' or '+', the first a "
                "letter or digit, because files are named after it"
            )
        for name in self.axes:
            if name not in JOINTS:
                raise ScenarioError(f"scenario {self.name!r}: {unknown('joint', name, JOINTS)}")
        if not self.axes or len(set(self.axes)) != len(self.axes):
            raise ScenarioError(
                f"scenario {self.name!r}: expected one or more different joints in axes, given {self.axes}"
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
        for attribute, known in _choices().items():
            if getattr(self, attribute) not in known:
                raise ScenarioError(f"scenario {self.name!r}: {unknown(attribute, getattr(self, attribute), known)}")

    def volts(self) -> np.ndarray:
        """Play the excitation.

        Returns:
            Volts `(N, len(axes))` at 50 Hz, `N = round(50 * duration)`, before noise and bias.
        """
        columns = [entry.waveform().play(self.duration) for entry in self.excitation]
        return np.hstack(columns * len(self.axes) if len(columns) == 1 else columns)

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
        lines = [
            f"{entry.name} = {_toml(getattr(self, entry.name))}" for entry in fields(self) if entry.name != "excitation"
        ]
        for entry in self.excitation:
            lines += ["", "[[excitation]]", f"kind = {_toml(entry.kind)}"]
            lines += [f"{name} = {_toml(value)}" for name, value in entry.parameters.items()]
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
            values[key] = _excitations(value) if key == "excitation" else _typed(key, value, hints[key])
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
    import hmtb_twin

    return {
        "variant": hmtb_twin.VARIANTS,
        "payload": tuple(hmtb_twin.PAYLOADS),
        "pose": tuple(hmtb_twin.POSES),
        "mode": hmtb_twin.MODES,
    }


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
            values[key] = _typed(f"{kind}.{key}", parameters[key], hints[key])
        elif parameter.default is not inspect.Parameter.empty:
            values[key] = parameter.default
        else:
            raise ScenarioError(f"excitation {kind!r} needs {key}; it takes {', '.join(signature)}")
    return values


def _typed(key: str, value: object, expected: object) -> Any:
    """Check a TOML value against a type; only whole numbers pass for float."""
    checks: Mapping[object, tuple[Callable[[object], bool], Callable[[Any], object], str]] = {
        bool: (lambda v: isinstance(v, bool), bool, "true or false"),
        int: (lambda v: isinstance(v, int) and not isinstance(v, bool), int, "a whole number"),
        float: (
            lambda v: isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < sys.float_info.max,
            float,
            "a finite number",
        ),
        str: (lambda v: isinstance(v, str), str, "a text"),
        tuple[str, ...]: (
            lambda v: isinstance(v, list | tuple) and all(isinstance(entry, str) for entry in v),
            tuple,
            "a list of texts",
        ),
    }
    passes, convert, wanted = checks[expected]
    if not passes(value):
        raise ScenarioError(f"{key} must be {wanted}, given {value!r}")
    return convert(value)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    return '"' + "".join(_escape(character) for character in str(value)) + '"'


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    # TOML basic strings hold no control characters; everything else may stand as it is.
    return character if ord(character) >= 0x20 and ord(character) != 0x7F else f"\\u{ord(character):04X}"
