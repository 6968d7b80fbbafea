"""The methods of identification by name, those of `methods.toml`: what each takes, returns and is called by.

The command line, the baselines of data sets and the test bench take from this table what they offer.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import read_toml

# NumPy and the toolbox are loaded when a method is used: the help of the command line reads the table too.
if TYPE_CHECKING:
    from sysid import Estimate, IOData, Polynomials
    from sysid.validation.predictors import Predictor
    from sysid.validation.structure_scan import Order

DIGITS = 9  # of an order that is read: more are a slip of the keyboard

MOST_ORDER = 100
"""Largest order of a predictor that is tried at all: a slip of the keyboard would fill the memory."""


class Knowledge(NamedTuple):
    """What a method may know besides the records.

    Attributes:
        seed: Of its random draws; that of the data set's spec.
        dead_zones: Half width of the dead zone of each training record's arm, rad, from the truth.
        dead_zone: That of the arm to predict, rad.
    """

    seed: int = 0
    dead_zones: tuple[float, ...] = ()
    dead_zone: float = 0.0


@dataclass(frozen=True)
class BenchEntry:
    """How the test bench knows a method.

    Attributes:
        structure: Structure of its models, one of `sysid.polynomial.structures.STRUCTURES`.
        method: Kind of method, of which theory says what to expect: one of `scenarios.estimators.estimator.METHODS`.
        settings: Its settings on the bench, in words.
        options: Options that it is called with there.
        search: Further options while orders are chosen.
        noise_model: Whether its model of the noise is one; if not, it claims none, and simulation errors choose orders.
    """

    structure: str
    method: str
    settings: str
    options: Mapping[str, Any] = field(default_factory=dict)
    search: Mapping[str, Any] = field(default_factory=dict)
    noise_model: bool = True


@dataclass(frozen=True)
class IdentificationMethod:
    """A method of identification.

    Attributes:
        name: Its name on the command line and in specs of data sets; on the test bench our-NAME.
        title: What it is, in words.
        call: The function, `module:function`: it takes a record, or several, and the orders by their names.
        returns: `estimate`, `predictor` or `model`.
        orders: Names of the required orders.
        optional: Names of the optional orders that follow, with their defaults.
        words: Orders that may be words, such as the kind of a process model; the command line alone has room for them.
        least: Least value of each order of a predictor.
        outputs: Whether it takes several outputs.
        knows: Keyword arguments that are filled from `Knowledge`, with the names of its fields.
        bench: How the test bench knows it; None: it does not.
    """

    name: str
    title: str
    call: str
    returns: str = "estimate"
    orders: tuple[str, ...] = ()
    optional: Mapping[str, int | str] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    least: Mapping[str, int] = field(default_factory=dict)
    outputs: bool = False
    knows: Mapping[str, str] = field(default_factory=dict)
    bench: BenchEntry | None = None

    @property
    def function(self) -> Callable[..., Any]:
        """The function behind the method."""
        module, _, name = self.call.partition(":")
        return cast("Callable[..., Any]", attrgetter(name)(import_module(module)))

    @property
    def usage(self) -> str:
        """The orders in their sequence, optional ones in brackets."""
        return " ".join([*self.orders, *(f"[{name}]" for name in self.optional)])

    @property
    def needs_truth(self) -> bool:
        """Whether it needs the dead zones of the truth."""
        return "dead_zones" in self.knows.values()

    def complete(self, values: "Sequence[Order | str]") -> "dict[str, Any]":
        """Return all orders by name, defaults filled in.

        Raises:
            ScenarioError: Too few, too many, negative, below the least, or a word for a number.
        """
        import numpy as np

        names = (*self.orders, *self.optional)
        if not len(self.orders) <= len(values) <= len(names):
            shown = " ".join(map(str, values)) or "nothing"
            raise ScenarioError(f"{self.name} takes the orders {self.usage}; given {shown}")
        self._check_words(dict(zip(names, values, strict=False)))
        if any(np.min(value) < 0 for value in values if not isinstance(value, str)):
            raise ScenarioError(
                f"orders must be 0 or more, given {' '.join(map(str, values))}; {self.name} takes {self.usage}"
            )
        defaults = list(self.optional.values())[len(values) - len(self.orders) :]
        orders = dict(zip(names, (*values, *defaults), strict=True))
        for name, lowest in self.least.items():
            self._check_range(name, int(np.max(orders[name])), lowest)
        return orders

    def _check_words(self, orders: "Mapping[str, Order | str]") -> None:
        for name, value in orders.items():
            if isinstance(value, str) and name not in self.words:
                raise ScenarioError(f"{self.name}: {name} is a whole number, given {value}; it takes {self.usage}")

    def _check_range(self, order: str, value: int, lowest: int) -> None:
        if value < lowest:
            raise ScenarioError(
                f"{self.name}: {order} = {value} given, expected {lowest} or more; it takes {self.usage}"
            )
        if value > MOST_ORDER:
            from sysid.records.arguments import shortened

            shown = shortened(str(value), 20)
            raise ScenarioError(f"{self.name}: {order} = {shown} given, expected {MOST_ORDER} or less")

    def predictor(self, records: "Sequence[IOData]", orders: Sequence[int], knowledge: Knowledge) -> "Predictor":
        """Make the predictor of a method that returns one, from records and all its orders."""
        arguments: dict[str, Any] = dict(zip((*self.orders, *self.optional), orders, strict=True))
        for argument, fact in self.knows.items():
            arguments[argument] = getattr(knowledge, fact)
        return cast("Predictor", self.function(records, **arguments))


def typed_orders(words: Sequence[str], method: str | None) -> "tuple[Order | str, ...] | None":
    """Orders as typed; None if one of them is none.

    They are whole numbers, with commas where inputs have their own (`1,2`), and words where an estimator has them.
    """
    estimator = ESTIMATORS.get(method or "")
    takes_words = estimator is not None and bool(estimator.words)
    orders: list[Order | str] = []
    for word in words:
        # [0-9] alone: other alphabets have digits too, which int() would take
        if re.fullmatch(rf"[+-]?[0-9]{{1,{DIGITS}}}", word):
            orders.append(int(word))
        elif re.fullmatch(rf"[0-9]{{1,{DIGITS}}}(,[0-9]{{1,{DIGITS}}})+", word):
            orders.append(tuple(map(int, word.split(","))))
        elif takes_words and re.fullmatch(r"[A-Za-z][A-Za-z0-9]{0,15}", word):
            orders.append(word)
        else:
            return None
    return tuple(orders)


def _read() -> dict[str, IdentificationMethod]:
    methods = {}
    path = Path(__file__).with_suffix(".toml")
    for name, table in read_toml(path.read_text(encoding="utf-8"), path.name).items():
        bench = table.pop("bench", None)
        entry = BenchEntry(**bench) if bench else None
        orders, words = tuple(table.pop("orders", ())), tuple(table.pop("words", ()))
        methods[name] = IdentificationMethod(name, **table, orders=orders, words=words, bench=entry)
    return methods


METHODS: Mapping[str, IdentificationMethod] = MappingProxyType(_read())
"""Every method by name."""

ESTIMATORS: Mapping[str, IdentificationMethod] = MappingProxyType(
    {name: method for name, method in METHODS.items() if method.returns == "estimate"}
)
"""Every estimator of the command line."""

COUNTED: Mapping[str, IdentificationMethod] = MappingProxyType(
    {name: method for name, method in METHODS.items() if not method.words}
)
"""Every method whose orders are numbers."""

BENCH_ENTRIES: Mapping[str, BenchEntry] = MappingProxyType(
    {name: method.bench for name, method in METHODS.items() if method.bench is not None}
)
"""Entries of the test bench by the names of their methods."""


def estimate(
    data: "IOData | Sequence[IOData]", method: str, orders: "Sequence[Order | str]", **options: "bool | Polynomials"
) -> "Estimate":
    """Run an estimator by name.

    Args:
        data: Input and output, of one experiment or several.
        method: One of `ESTIMATORS`.
        orders: Its orders in their usual sequence; optional ones may be left out.
        options: Options of the estimator, such as `coloured` of oe.

    Raises:
        ScenarioError: Unknown method, or orders that do not fit it.
    """
    from sysid import IOData

    if method not in ESTIMATORS:
        raise ScenarioError(unknown("method", method, ESTIMATORS))
    records = data if isinstance(data, IOData) or len(data) != 1 else data[0]
    entry = ESTIMATORS[method]
    return cast("Estimate", entry.function(records, **entry.complete(orders), **options))
