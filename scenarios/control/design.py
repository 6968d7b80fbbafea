"""Designs of control laws from an identified pair, by method, and their files."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import sysid
from hmtb_twin.files.atomic_write import write_whole
from scenarios.control.campaign import CONTROLLED, IdentifiedPair
from scenarios.control.joint_controller import Law
from scenarios.files.errors import ScenarioError, unknown
from sysid import Controller, SysidError
from sysid.control import AdaptiveFollowing
from sysid.exchange.json_text import decoded, encoded, parsed, text_of


def _adaptive(pair: IdentifiedPair) -> Law:
    fixed = sysid.model_following(pair.ground, pair.reference).controller
    return AdaptiveFollowing(fixed, pair.ground, pair.reference)


METHODS: Mapping[str, Callable[[IdentifiedPair], Law]] = {
    "following": lambda pair: sysid.model_following(pair.ground, pair.reference).controller,
    "adaptive": _adaptive,
    "vrft": lambda pair: sysid.vrft(pair.record, pair.reference).controller,
}
"""How each method designs its law."""

LAWS: Mapping[str, type] = {kind.__name__: kind for kind in (Controller, AdaptiveFollowing)}
"""Classes of laws that a file may hold."""

FORMAT = "hmtb-control 1"


def design(method: str, pair: IdentifiedPair) -> Law:
    """Design the law of a method, or read that of a file.

    Args:
        method: One of `METHODS`, or the path of a file of `write_law`, which ends in `.json`.
        pair: The identified models.

    Raises:
        ScenarioError: No such method, or a file without a law of the controlled joints.
        SysidError: The models allow no design.
    """
    check_method(method)
    return read_law(Path(method)) if method.endswith(".json") else METHODS[method](pair)


def check_method(method: str) -> None:
    """Raise `ScenarioError` unless a name is that of a method or of a file of a law."""
    if method.endswith(".json"):
        read_law(Path(method))
    elif method not in METHODS:
        raise ScenarioError(unknown("method", method, METHODS) + "; or a file of --out that ends in .json")


def write_law(law: Law, path: Path) -> Path:
    """Write a law as JSON, every bit of it; `read_law` reads it back."""
    content = {"format": FORMAT, "joints": list(CONTROLLED), "kind": type(law).__name__, "law": encoded(law)}
    write_whole(path, text_of(content) + "\n")
    return path


def read_law(path: Path) -> Law:
    """Read a law from a file of `write_law`.

    Raises:
        ScenarioError: No such file, or something else in it.
    """
    try:
        content = parsed(path)
        if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("kind") not in LAWS:
            raise ScenarioError(f"{path.name}: expected a law of hmtb control --out ({', '.join(LAWS)})")
        law: Law = decoded("law", content.get("law"), LAWS[content["kind"]])
    except (OSError, SysidError, json.JSONDecodeError) as error:
        raise ScenarioError(f"{path.name}: expected a law of hmtb control --out: {error}") from error
    if content.get("joints") != list(CONTROLLED):
        raise ScenarioError(f"{path.name}: joints {content.get('joints')} given, expected {', '.join(CONTROLLED)}")
    return law


@dataclass(frozen=True)
class WrongModel:
    """An error of the ground arm's model.

    Attributes:
        gain: Factor on its gain.
        delay: Further samples of delay.
    """

    gain: float = 1.0
    delay: int = 0

    def applied(self, pair: IdentifiedPair) -> IdentifiedPair:
        """Return the pair with the wrong model; its record is wrong in the same way."""
        model, zero = pair.ground, np.zeros_like
        B = self.gain * model.B
        for _ in range(self.delay):
            n, m = B.shape
            A = np.block([[model.A, B], [np.zeros((m, n + m))]])
            C = np.hstack([model.C, np.zeros((len(model.C), m))])
            K = np.vstack([model.gain, np.zeros((m, len(model.C)))])
            B = np.vstack([zero(B), np.eye(m)])
            model = replace(model, A=A, B=B, C=C, K=K)
        data = pair.record
        u = np.roll(data.u, -self.delay, axis=0) / self.gain
        record = replace(data, u=u)[: len(data) - self.delay]
        return replace(pair, ground=replace(model, B=B), record=record)
