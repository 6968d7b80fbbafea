"""Names of models in a comparison: the truth, printed models, estimators with orders, and model files."""

import re
from typing import NamedTuple

from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.methods import ESTIMATORS
from scenarios.truth.published import BY_NAME, published_model

FORMS = "truth, published, published:NAME (4.7 ... 5.10, sysid, okid, hybrid), METHOD:ORDERS (oe:2/2/1), FILE.json"
"""Forms of a model's name, for messages."""

DIGITS = 4  # of an order at most: more are a slip of the keyboard


class ModelName(NamedTuple):
    """A model by name.

    Attributes:
        text: The name as typed.
        kind: `truth`, `published`, `file` or the method of an estimator.
        name: Name of a printed model; empty for all of the joint, and for others.
        orders: Orders of an estimator.
    """

    text: str
    kind: str
    name: str = ""
    orders: tuple[int, ...] = ()

    @property
    def is_estimated(self) -> bool:
        """Whether the model is identified from records; others are known beforehand."""
        return self.kind in ESTIMATORS


def parse_model_name(text: str) -> ModelName:
    """Parse the name of a model.

    Args:
        text: `truth`, `published`, `published:4.7`, a method with its orders, `oe:2/2/1`, or a model file, `my.json`.

    Raises:
        ScenarioError: It names no model.
    """
    kind, colon, rest = text.partition(":")
    if text.endswith(".json"):
        return ModelName(text, "file")
    if text in ("truth", "published"):
        return ModelName(text, kind)
    if kind == "published":
        published_model(rest)  # refuses a name that the thesis does not have
        return ModelName(text, kind, name=rest)
    if kind == "truth":
        raise ScenarioError(f"model {text!r}: the truth has no name or orders; expected truth alone")
    if kind not in ESTIMATORS:
        if text in BY_NAME:
            raise ScenarioError(f"unknown model {text!r}: did you mean 'published:{text}'? There are: {FORMS}")
        raise ScenarioError(unknown("model", kind, ("truth", "published", *ESTIMATORS)) + f"; written {FORMS}")
    words = rest.replace(",", "/").split("/") if colon else []
    # [0-9] alone: other alphabets have digits too, which int() would take.
    if not all(re.fullmatch(rf"[0-9]{{1,{DIGITS}}}", word.strip()) for word in words):
        raise ScenarioError(
            f"model {text!r}: expected whole orders apart by slashes, of {DIGITS} digits at most, as in oe:2/2/1"
        )
    orders = tuple(int(word) for word in words)
    ESTIMATORS[kind].complete(kind, orders)
    return ModelName(text, kind, orders=orders)
