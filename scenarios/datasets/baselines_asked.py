"""Which models a data set is published with: the table `[baselines]` of a spec."""

from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.estimators import ESTIMATORS
from scenarios.suggest import unknown

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
