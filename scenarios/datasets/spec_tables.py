"""Tables of a data set's spec: record blocks, scoring, truth, baselines, randomised twins."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from hmtb_twin import MODES, PAYLOADS, POSES, VARIANTS, Chain, HandController
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.plant import ACTUATOR_FORMS, FRICTIONS
from hmtb_twin.parameters.specimen_draw import TwinDistributions
from hmtb_twin.parameters.values import HAND_CONTROLLER, JOINTS, OPERATING_POSE
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.experiments.scenario import NAME
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.nonlinear_methods import NONLINEAR

PARTS = ("train", "validation", "test")
"""Purposes of records: to identify from, to choose a model by, and to score it on."""

TRIVIAL = ("hold", "gain", "truth")
"""Methods without orders: hold the last output of the window, a static gain, the small-signal truth."""

USUAL = ("hold", "gain", "arx:4/4", "armax:3/3/3", "iv4:2/2", "oe:2/2", "oe:3/3", "okid:2/5", "n4sid:3", "truth")
"""The models of a spec that names none."""


def check_ranges(table: str, record: object, ranges: Mapping[str, tuple[int, int]]) -> None:
    """Refuse numbers of a table of a spec that are out of range; above it they are slips of the keyboard.

    Raises:
        ScenarioError: A number below its least or above its largest value.
    """
    for name, (lower, upper) in ranges.items():
        value = getattr(record, name)
        if not lower <= value <= upper:
            # Cut, because a slip may have thousands of digits.
            raise ScenarioError(f"{table}: {name} = {str(value)[:20]} given, expected {lower} to {upper}")


@dataclass(frozen=True)
class Method:
    """A method of identification with its orders.

    Attributes:
        name: One of `TRIVIAL`, an estimator of the command line, or one of `NONLINEAR`.
        orders: Its orders, completed by their defaults.
    """

    name: str
    orders: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.name in TRIVIAL:
            if self.orders:
                raise ScenarioError(f"method {self.name} given orders {self.orders}, expected none")
            return
        if self.name in NONLINEAR:
            orders = NONLINEAR[self.name].checked(self.name, self.orders)
        elif self.name in ESTIMATORS:
            orders = ESTIMATORS[self.name].complete(self.name, self.orders)
        else:
            raise ScenarioError(unknown("method", self.name, (*TRIVIAL, *ESTIMATORS, *NONLINEAR)))
        # The dataclass is frozen; the same method with its defaults written out must be equal to it.
        object.__setattr__(self, "orders", tuple(orders.values()))

    @classmethod
    def parsed(cls, method: str) -> "Method":
        """Read a method as specs write it, ``"oe:2/2/1"``.

        Raises:
            ScenarioError: Unknown method, or other orders than it takes.
        """
        name, colon, orders = method.partition(":")
        words = orders.split("/") if colon else []
        # `isdigit` alone lets other scripts' digits pass, and no order has five.
        if not all(word.isascii() and word.isdigit() and len(word) < 5 for word in words):
            raise ScenarioError(f"baseline {method!r}: expected a method with its orders, as in oe:2/2/1")
        return cls(name, tuple(int(word) for word in words))

    def __str__(self) -> str:
        """The method as specs write it."""
        if not self.orders:
            return self.name
        return f"{self.name}:{'/'.join(map(str, self.orders))}"


@dataclass(frozen=True)
class BaselineSpec:
    """The baselines that a data set is published with.

    Attributes:
        models: Methods with their orders, each a row of the table.
        twins: Number of randomised twins, evenly over them all, that models are identified for; 0: all.
        records: Records of each block of the training part, by arm and joints, that are used; 0: all.
    """

    models: tuple[str, ...] = USUAL
    twins: int = 10
    records: int = 0

    def __post_init__(self) -> None:
        if len(set(self.methods)) < len(self.models):
            raise ScenarioError(f"baselines: models = {self.models} given, expected each once")
        check_ranges("baselines", self, {"twins": (0, 10**7), "records": (0, 10**7)})

    @property
    def methods(self) -> tuple[Method, ...]:
        """The models as methods."""
        return tuple(Method.parsed(model) for model in self.models)


@dataclass(frozen=True)
class TruthSpec:
    """The truth that is published beyond matrices and noise floors, which every data set has.

    Attributes:
        amplitudes: Amplitudes at which the linear model of every arm is tried against simulation, rad; this takes most
            of a second per arm.
        best_linear: Blocks of records for whose arm, joints and amplitude the best linear approximation is measured.
        floors: Number of records of each block of the test part, by arm and joints, all twins together, for which the
            floors of linear systems are searched. The noise of the recorder is stated for every record.
        search_steps: Steps at most of each search for the linear system of the truth's order behind such a floor; 0: to
            the end, which takes ten times as long and improves the floor by a few percent at most.
        realisations: Number of realisations of the multisine that measures a best linear approximation. The data set's
            own records of its class count; the rest is simulated.
    """

    amplitudes: tuple[float, ...] = ()
    best_linear: tuple[str, ...] = ()
    floors: int = 1
    search_steps: int = 10
    realisations: int = 8

    def __post_init__(self) -> None:
        if not all(0.0 < amplitude <= 1.0 for amplitude in self.amplitudes):
            raise ScenarioError(f"truth: amplitudes = {self.amplitudes} given, expected above 0 and up to 1 rad")
        for name in ("amplitudes", "best_linear"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ScenarioError(f"truth: {name} = {values} given, expected each once")
        # Two realisations at least: the nonlinear distortion is estimated from the spread between them.
        check_ranges("truth", self, {"floors": (0, 10**6), "search_steps": (0, 10**4), "realisations": (2, 10**4)})


@dataclass(frozen=True)
class Twins:
    """Arms drawn at random; every experiment runs on each of them.

    Attributes:
        count: Number of arms.
        distributions: Distributions of their parameters about those of the variant, and of their surroundings.
    """

    count: int
    distributions: TwinDistributions = TwinDistributions()  # noqa: RUF009

    def __post_init__(self) -> None:
        check_ranges("twins", self, {"count": (1, 10**7)})

    @classmethod
    def from_table(cls, table: object) -> "Twins":
        """Build it from parsed TOML: count, and a table of kind, spread and centre for each quantity.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping) or "count" not in table:
            raise ScenarioError(f"twins must be a table with a count, given {table!r}")
        try:
            distributions = TwinDistributions.from_table({key: table[key] for key in table if key != "count"})
        except TwinError as error:
            raise ScenarioError(f"twins: {error}") from error
        return cls(codec.structure(int, table["count"], "twins.count"), distributions)


codec.register(Twins, Twins.from_table, lambda twins: {"count": twins.count, **codec.unstructure(twins.distributions)})

METRICS = ("rmse", "nrmse", "fit")
"""Root mean square error; that over the spread of the output in percent; 100 (1 - |error| / |y - mean y|) percent."""

UNITS = {"rad": 1.0, "mrad": 1e3, "deg": 57.29577951308232}
"""Units of a root mean square error, per rad."""


@dataclass(frozen=True)
class Scoring:
    """The primary score of a data set.

    Attributes:
        metric: One of `METRICS`.
        unit: Of the root mean square error, one of `UNITS`, mrad where none is given; of the others %.
        steps: Prediction horizon, samples; 0: simulation, from inputs and the window alone.
    """

    metric: str = "rmse"
    unit: str = ""
    steps: int = 0

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise ScenarioError(f"scoring: {unknown('metric', self.metric, METRICS)}")
        usual_unit = "mrad" if self.metric == "rmse" else "%"
        object.__setattr__(self, "unit", self.unit or usual_unit)
        if self.metric != "rmse" and self.unit != "%":
            raise ScenarioError(f"scoring: unit = {self.unit!r} given for {self.metric}, which is in %")
        if self.metric == "rmse" and self.unit not in UNITS:
            raise ScenarioError(f"scoring: {unknown('unit', self.unit, UNITS)}")
        check_ranges("scoring", self, {"steps": (0, 10**6)})


PAYLOAD = "rpcm"
"""Default payload of the end effector."""

CHOICES: Mapping[str, tuple[str, ...]] = {
    "variants": tuple(VARIANTS),
    "payloads": tuple(PAYLOADS),
    "poses": tuple(POSES),
    "actuators": ACTUATOR_FORMS,
    "frictions": FRICTIONS,
    "joints": JOINTS,
}
"""Choices for the lists of a block."""


@dataclass(frozen=True)
class RecordBlock:
    """A block of records: every combination of its lists is one experiment.

    A block plays one of three: registered `scenarios`; an `excitation` on `axes`; `multisines` on `axes`.

    Attributes:
        name: Experiments are named after it.
        part: What the records are for, one of `PARTS`.
        scenarios: Registered scenarios, or tags of them.
        axes: Axes to excite.
        each_axis: Whether each axis has a record of its own, instead of all at once.
        excitation: One entry, played on every axis, or one per axis.
        multisines: Random-phase multisines: every realisation and record of the measurement is an experiment.
        draw_waveforms: Whether random waveforms are drawn anew for every experiment, instead of from the seeds in the
            spec; multisines for every measurement, whose realisations and records belong together.
        amplitudes: Of the excitation, V; root mean square of multisines, rad; as written where there are none.
        joints: Joints whose commands are the inputs and whose angles the outputs; the excited joints by default, in
            Cartesian modes the three that the thesis studied.
        variants: Arm variants.
        payloads: Payloads of the end effector.
        poses: Keyframes of the operating point.
        actuators: Forms of the actuators.
        frictions: Friction models of the joints.
        process_noises: Standard deviations of the drives' noise, part of the rated torque.
        mode: Control mode.
        repeats: Number of runs of each combination, with different noise.
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
        for problem in self._problems():
            raise ScenarioError(f"records {self.name!r}: {problem}")
        check_ranges(f"records {self.name!r}", self, {"repeats": (1, 10_000)})

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong in single settings, then what contradicts what."""
        yield from self._name_problems()
        yield from self._list_problems()
        yield from self._waveform_problems()

    def _name_problems(self) -> Iterator[str]:
        if not NAME.fullmatch(self.name):
            yield "expected 1 to 100 letters, digits, '.', '_', '-' or '+' as a name"
        if self.part not in PARTS:
            yield unknown("part", self.part, PARTS)
        if self.mode not in MODES:
            yield unknown("mode", self.mode, MODES)
        for key, choices in CHOICES.items():
            yield from (unknown(key, value, choices) for value in getattr(self, key) if value not in choices)

    def _list_problems(self) -> Iterator[str]:
        """Yield the lists that name a value twice, which would make two experiments of one name, and empty ones."""
        for attribute in fields(self):
            values = getattr(self, attribute.name)
            # Two axes may be excited alike; the scenario refuses axes given twice.
            is_list_of_choices = isinstance(values, tuple) and attribute.name not in ("excitation", "axes")
            if is_list_of_choices and len(set(values)) < len(values):
                yield f"{attribute.name} = {values} given, expected each once"
        empty = [key for key in (*CHOICES, "process_noises") if key != "joints" and not getattr(self, key)]
        if empty:
            yield f"an empty list given for {', '.join(empty)}"

    def _waveform_problems(self) -> Iterator[str]:
        ways_to_excite = [bool(self.scenarios), bool(self.excitation), self.multisines is not None]
        if sum(ways_to_excite) != 1:
            yield f"expected one of scenarios, excitation and multisines, given {sum(ways_to_excite)}"
        if self.scenarios and (self.axes or self.each_axis):
            yield "axes given beside scenarios, which have their own"
        if not self.scenarios and not self.axes:
            yield "expected axes to excite, given none"
        if self.multisines is not None and self.duration is not None:
            yield "a duration given for multisines; it follows from period and periods"
        if self.excitation and self.duration is None:
            yield "expected a duration in s, given none"

    def to_table(self) -> dict[str, Any]:
        """Write the block as plain values; of chain and hand controller only what differs from the nominal ones."""
        table = codec.unstructure(replace(self, chain=Chain(), hand_controller=HAND_CONTROLLER))
        table["chain"] = codec.changes(self.chain, Chain())
        table["hand_controller"] = codec.changes(self.hand_controller, HAND_CONTROLLER)
        excitation = table.pop("excitation")
        if excitation:
            table["excitation"] = excitation  # last, because tables stand behind values in TOML
        return {key: value for key, value in table.items() if value != {}}
