"""Tables of a data set's spec: record blocks, scoring, truth, baselines, randomised twins."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from hmtb_twin import MODES, PAYLOADS, POSES, VARIANTS, Chain, HandController
from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.plant import ACTUATOR_FORMS, FRICTIONS
from hmtb_twin.parameters.specimen_draw import TwinDistributions
from hmtb_twin.parameters.values import HAND_CONTROLLER, JOINTS, OPERATING_POSE
from scenarios.datasets.layout import PARTS
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.experiments.scenario import NAME
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.methods import ESTIMATORS

TRIVIAL = ("hold", "gain", "truth")
"""Predictors without orders: the last output of the window for ever, a static gain, and the small-signal truth."""

USUAL = ("hold", "gain", "arx:4/4", "armax:3/3/3", "iv4:2/2", "oe:2/2", "oe:3/3", "okid:2/5", "n4sid:3", "truth")
"""The models where a spec names none."""


@dataclass(frozen=True)
class Method:
    """One kind of model, with its orders.

    Attributes:
        name: One of `TRIVIAL`, or an estimator of the command line.
        orders: Its orders, those with defaults filled in.
    """

    name: str
    orders: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.name in TRIVIAL:
            if self.orders:
                raise ScenarioError(f"method {self.name} given orders {self.orders}, expected none")
            return
        if self.name not in ESTIMATORS:
            raise ScenarioError(unknown("method", self.name, (*TRIVIAL, *ESTIMATORS)))
        complete = ESTIMATORS[self.name].complete(self.name, self.orders)
        object.__setattr__(self, "orders", tuple(complete.values()))

    @classmethod
    def parsed(cls, text: str) -> "Method":
        """Understand a method as it is written, ``"oe:2/2/1"``.

        Raises:
            ScenarioError: It names none, or has other orders than the method takes.
        """
        name, colon, rest = text.partition(":")
        words = rest.split("/") if colon else []
        if not all(word.isascii() and word.isdigit() and len(word) < 5 for word in words):
            raise ScenarioError(f"baseline {text!r}: expected a method with its orders, as in oe:2/2/1")
        return cls(name, tuple(int(word) for word in words))

    def __str__(self) -> str:
        """As it is written in a spec."""
        return self.name + (":" + "/".join(map(str, self.orders)) if self.orders else "")


@dataclass(frozen=True)
class BaselineSpec:
    """The models, and what they are identified from.

    Attributes:
        models: Methods with their orders, each a row of the table.
        twins: How many of the randomised twins, evenly over them all, the models are made for; 0: all.
        records: Records of each block of the training part, by arm and joints, that are used; 0: all.
    """

    models: tuple[str, ...] = USUAL
    twins: int = 10
    records: int = 0

    def __post_init__(self) -> None:
        if len(set(self.methods)) < len(self.models):
            raise ScenarioError(f"baselines: models = {self.models} given, expected each once")
        for name in ("twins", "records"):
            if not 0 <= getattr(self, name) <= 10**7:
                raise ScenarioError(f"baselines: {name} = {getattr(self, name)} given, expected 0 (all) or more")

    @property
    def methods(self) -> tuple[Method, ...]:
        """The models, understood."""
        return tuple(Method.parsed(text) for text in self.models)


LARGEST = 1.0
"""No trial amplitude of a small signal is larger, rad."""


@dataclass(frozen=True)
class TruthSpec:
    """What is told beyond matrices and noise floors, which every data set has.

    Attributes:
        amplitudes: At which the linear model of every arm is tried against simulation, rad; most of a second per arm.
        best_linear: Blocks of records for whose arm, joints and amplitude the best linear approximation is measured.
        floors: Records of each block of the test part, by arm and joints, all twins together, for which the floors of
            linear systems are searched. What no model at all can foretell is told for every one.
        search_steps: At most, of each search for the linear system of the truth's order behind such a floor; 0: to the
            end, which takes ten times as long and finds a few percent more at most.
        realisations: Of the multisine that each best linear approximation is measured with. Those that the data set's
            own records of its class have count; what is missing is simulated.
    """

    amplitudes: tuple[float, ...] = ()
    best_linear: tuple[str, ...] = ()
    floors: int = 1
    search_steps: int = 10
    realisations: int = 8

    def __post_init__(self) -> None:
        if not all(0.0 < amplitude <= LARGEST for amplitude in self.amplitudes):
            raise ScenarioError(
                f"truth: amplitudes = {self.amplitudes} given, expected above 0 and up to {LARGEST:g} rad"
            )
        for name in ("amplitudes", "best_linear"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ScenarioError(f"truth: {name} = {values} given, expected each once")
        for name, least, most in (("floors", 0, 10**6), ("search_steps", 0, 10**4), ("realisations", 2, 10**4)):
            if not least <= getattr(self, name) <= most:
                raise ScenarioError(
                    f"truth: {name} = {getattr(self, name)} given, expected {least} or more, up to {most}"
                )


MOST = 10**7
"""More twins than that are a slip of the keyboard."""


@dataclass(frozen=True)
class Twins:
    """Arms drawn at random, on each of which every experiment is run.

    Attributes:
        count: How many.
        distributions: How they differ from the variant, and their surroundings from what the block says.
    """

    count: int
    distributions: TwinDistributions = TwinDistributions()  # noqa: RUF009

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST:
            raise ScenarioError(f"twins: count = {self.count} given, expected 1 to {MOST}")

    @classmethod
    def from_table(cls, table: object) -> "Twins":
        """Build it from parsed TOML: count, and a table of kind, spread and centre for each quantity.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping) or "count" not in table:
            raise ScenarioError(f"twins must be a table with a count, given {table!r}")
        quantities = {key: value for key, value in table.items() if key != "count"}
        try:
            distributions = TwinDistributions.from_table(quantities)
        except TwinError as error:
            raise ScenarioError(f"twins: {error}") from error
        return cls(codec.structure(int, table["count"], "twins.count"), distributions)

    def to_table(self) -> dict[str, Any]:
        """Write it as plain values."""
        return {"count": self.count, **codec.unstructure(self.distributions)}


codec.register(Twins, Twins.from_table, Twins.to_table)

METRICS = ("rmse", "nrmse", "fit")
"""Root mean square error; that over the spread of the output in percent; 100 (1 - |error| / |y - mean y|) percent."""

UNITS = {"rad": 1.0, "mrad": 1e3, "deg": 57.29577951308232}
"""Units of a root mean square error, per rad."""

PERCENT = "%"
"""Unit of the other metrics."""


@dataclass(frozen=True)
class Scoring:
    """The primary score of a data set.

    Attributes:
        metric: One of `METRICS`.
        unit: Of the root mean square error, one of `UNITS`, mrad where none is given; of the others %.
        steps: Samples ahead that outputs are known for; 0: simulation, from inputs and the window alone.
    """

    metric: str = "rmse"
    unit: str = ""
    steps: int = 0

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise ScenarioError(f"scoring: {unknown('metric', self.metric, METRICS)}")
        object.__setattr__(self, "unit", self.unit or ("mrad" if self.metric == "rmse" else PERCENT))
        if self.metric != "rmse" and self.unit != PERCENT:
            raise ScenarioError(f"scoring: unit = {self.unit!r} given for {self.metric}, which is in {PERCENT}")
        if self.metric == "rmse" and self.unit not in UNITS:
            raise ScenarioError(f"scoring: {unknown('unit', self.unit, UNITS)}")
        if not 0 <= self.steps <= 10**6:
            raise ScenarioError(f"scoring: steps = {self.steps} given, expected 0 (simulation) or more")


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

NOMINAL: Mapping[str, object] = {"chain": Chain(), "hand_controller": HAND_CONTROLLER}
"""Tables of a block, of which specs hold only what differs from these."""


@dataclass(frozen=True)
class RecordBlock:
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

    def to_table(self) -> dict[str, Any]:
        """Write the block as plain values; of chain and hand controller only what differs from the nominal ones."""
        table = codec.unstructure(replace(self, chain=Chain(), hand_controller=HAND_CONTROLLER))
        excitation = table.pop("excitation")
        table |= {name: codec.changes(getattr(self, name), usual) for name, usual in NOMINAL.items()}
        return {key: value for key, value in table.items() if value != {}} | (
            {"excitation": excitation} if excitation else {}
        )
