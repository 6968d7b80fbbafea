"""A block of records in a spec: what is played, on which arms, how often."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from hmtb_twin import MODES, PAYLOADS, POSES, VARIANTS, Chain, HandController
from hmtb_twin.parameters.plant import ACTUATOR_FORMS, FRICTIONS
from hmtb_twin.parameters.values import HAND_CONTROLLER, JOINTS, OPERATING_POSE
from scenarios.datasets.layout import PARTS
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.experiments.scenario import NAME
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_values import record, typed, written

PAYLOAD = "rpcm"
"""What the end effector holds unless the block says otherwise."""

MOST_REPEATS = 10_000
"""More repeats of one record than that are a slip of the keyboard."""

CHOICES: Mapping[str, tuple[str, ...]] = {
    "variants": tuple(VARIANTS),
    "payloads": tuple(PAYLOADS),
    "poses": tuple(POSES),
    "actuators": ACTUATOR_FORMS,
    "frictions": FRICTIONS,
    "joints": JOINTS,
}
"""What may stand in the lists of a block."""


@dataclass(frozen=True)
class Records:
    """A block of records: every combination of its lists is one experiment.

    What is played is one of three: registered `scenarios`; an `excitation` on `axes`; `multisines` on `axes`.

    Attributes:
        name: Experiments are named after it.
        part: What the records are for, one of `PARTS`.
        scenarios: Registered scenarios, or tags of them.
        axes: What is excited.
        each_axis: Each of the axes in a record of its own, instead of all at once.
        excitation: One entry, played on every axis, or one per axis.
        multisines: Random-phase multisines: every realisation and record of the measurement is an experiment.
        draw_waveforms: Waveforms that chance makes are drawn anew, instead of those written: for every experiment, or
            of multisines for every measurement, whose realisations and records belong together.
        amplitudes: Of the excitation, V; root mean square of multisines, rad; as written where there are none.
        joints: Whose commands are the inputs and whose angles the outputs; the excited joints by default, in Cartesian
            modes the three that the thesis studied.
        variants: Arm variants.
        payloads: What the end effector holds.
        poses: Keyframes of the operating point.
        actuators: Forms of the actuators.
        frictions: What the joints rub with.
        process_noises: Standard deviations of the drives' noise, part of the rated torque.
        mode: Control mode.
        repeats: How often each combination is run, with other noise.
        duration: Length, s; of scenarios their own by default.
        chain: Which links of the chain act.
        hand_controller: The hand-controller interface.
    """

    name: str
    part: str
    scenarios: tuple[str, ...] = ()
    axes: tuple[str, ...] = ()
    each_axis: bool = False
    excitation: tuple[Excitation, ...] = ()
    multisines: Multisines | None = None
    draw_waveforms: bool = False
    amplitudes: tuple[float, ...] = ()
    joints: tuple[str, ...] = ()
    variants: tuple[str, ...] = ("nominal",)
    payloads: tuple[str, ...] = (PAYLOAD,)
    poses: tuple[str, ...] = (OPERATING_POSE,)
    actuators: tuple[str, ...] = ("linear",)
    frictions: tuple[str, ...] = ("lugre",)
    process_noises: tuple[float, ...] = (0.0,)
    mode: str = "single_joint"
    repeats: int = 1
    duration: float | None = None
    chain: Chain = Chain()  # noqa: RUF009
    hand_controller: HandController = HAND_CONTROLLER

    def __post_init__(self) -> None:
        where = f"records {self.name!r}"
        if not NAME.fullmatch(self.name):
            raise ScenarioError(f"{where}: expected 1 to 100 letters, digits, '.', '_', '-' or '+' as a name")
        if self.part not in PARTS:
            raise ScenarioError(f"{where}: {unknown('part', self.part, PARTS)}")
        if self.mode not in MODES:
            raise ScenarioError(f"{where}: {unknown('mode', self.mode, MODES)}")
        for key, known in CHOICES.items():
            for value in getattr(self, key):
                if value not in known:
                    raise ScenarioError(f"{where}: {unknown(key, value, known)}")
        for entry in fields(self):
            values = getattr(self, entry.name)
            if (
                entry.name not in ("excitation", "axes")
                and isinstance(values, tuple)
                and len(set(values)) < len(values)
            ):
                raise ScenarioError(f"{where}: {entry.name} = {values} given, expected each once")
        empty = [key for key in CHOICES if key != "joints" and not getattr(self, key)]
        if empty or not self.process_noises:
            raise ScenarioError(f"{where}: an empty list given for {', '.join(empty) or 'process_noises'}")
        played = [bool(self.scenarios), bool(self.excitation), self.multisines is not None]
        if sum(played) != 1:
            raise ScenarioError(f"{where}: expected one of scenarios, excitation and multisines, given {sum(played)}")
        if self.scenarios and (self.axes or self.each_axis):
            raise ScenarioError(f"{where}: axes given beside scenarios, which have their own")
        if not self.scenarios and not self.axes:
            raise ScenarioError(f"{where}: expected axes to excite, given none")
        if self.multisines is not None and self.duration is not None:
            raise ScenarioError(f"{where}: a duration given for multisines; it follows from period and periods")
        if self.excitation and self.duration is None:
            raise ScenarioError(f"{where}: expected a duration in s, given none")
        if not 1 <= self.repeats <= MOST_REPEATS:
            raise ScenarioError(f"{where}: repeats = {self.repeats} given, expected 1 to {MOST_REPEATS}")

    @classmethod
    def from_table(cls, table: object) -> "Records":
        """Build a block from parsed TOML, strictly.

        Raises:
            ScenarioError: No table, an unknown key, a value of a wrong type or out of range, or a missing one.
        """
        if not isinstance(table, Mapping):
            raise ScenarioError(f"records must be a table, given {table!r}")
        hints = get_type_hints(cls)
        where = f"records {table.get('name', '')!r}"
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in hints:
                raise ScenarioError(f"{where}: {unknown('key', key, hints)}")
            if key == "excitation":
                values[key] = tuple(
                    Excitation.from_table(entry) for entry in (value if isinstance(value, list) else [value])
                )
            elif key in ("chain", "hand_controller", "multisines"):
                kind = {"chain": Chain, "hand_controller": HandController, "multisines": Multisines}[key]
                values[key] = record(kind, f"{where}: {key}", value)
            else:
                values[key] = typed(f"{where}: {key}", value, float if key == "duration" else hints[key])
        missing = [key for key in ("name", "part") if key not in values]
        if missing:
            raise ScenarioError(f"{where}: missing {', '.join(missing)}")
        return cls(**values)

    def to_toml(self) -> str:
        """Write the block as a table of an array, such that `from_table` gives an equal one back."""
        lines = ["[[records]]"]
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name not in ("excitation", "chain", "hand_controller", "multisines") and value is not None:
                lines.append(f"{entry.name} = {written(value)}")
        for name, usual in (("chain", Chain()), ("hand_controller", HAND_CONTROLLER), ("multisines", None)):
            value = getattr(self, name)
            if value is None:
                continue
            changed = {k: v for k, v in vars(value).items() if usual is None or v != getattr(usual, k)}
            if changed:
                lines += ["", f"[records.{name}]", *(f"{k} = {written(v)}" for k, v in changed.items())]
        for one in self.excitation:
            lines += ["", "[[records.excitation]]", one.to_toml()]
        return "\n".join(lines) + "\n"
