"""Tables of a data set's spec: baselines, truth, randomised twins, scoring."""

from collections.abc import Mapping
from dataclasses import dataclass

from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.specimen_draw import TwinDistributions
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_values import typed, written
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
class BaselinesAsked:
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
class TruthAsked:
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
        """Build it from parsed TOML, strictly: count, and a table of kind, spread and centre per quantity.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping):
            raise ScenarioError(f"twins must be a table, given {table!r}")
        if "count" not in table:
            raise ScenarioError("twins needs count")
        quantities = {key: value for key, value in table.items() if key != "count"}
        try:
            distributions = TwinDistributions.from_table(quantities)
        except TwinError as error:
            raise ScenarioError(f"twins: {error}") from error
        return cls(typed("twins.count", table["count"], int), distributions)

    def to_toml(self) -> str:
        """Write it as a TOML table."""
        return f"[twins]\ncount = {written(self.count)}\n{self.distributions.to_toml()}"


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
