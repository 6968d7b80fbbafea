"""Designs of control laws from an identified pair, by method, and their files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np

import sysid
from hmtb_twin.files.atomic_write import write_whole
from scenarios.control.campaign import CONTROLLED, IdentifiedPair
from scenarios.control.runs import Law
from scenarios.files.errors import ScenarioError, unknown
from sysid import AdaptiveFollowing, SysidError
from sysid.exchange.json_text import decoded, encoded, parsed, text_of
from sysid.models import add_delay

CORRECTION = 0.85
"""Largest corrections of a feedback, in standard deviations of the record's commands: 31 to 41 mrad.

The elbow needs 35 mrad for three units. In contact errors are the same from 0.5 to 0.8, larger with 0.4 and 1."""


def _following(pair: IdentifiedPair) -> sysid.Controller:
    """Feedforward to the reference and feedback from the error, designed from both models."""
    correction = CORRECTION * pair.record.u.std(axis=0)
    return sysid.model_following(pair.ground, pair.reference, correction=correction).controller


def _adaptive(pair: IdentifiedPair) -> AdaptiveFollowing:
    """The same law, with a feedforward that learns friction and stiffness from its errors."""
    return AdaptiveFollowing(_following(pair), pair.ground, pair.reference)


def _virtual_reference(pair: IdentifiedPair) -> sysid.Controller:
    """Virtual reference feedback tuning: from the record alone, without a model of the arm."""
    return sysid.vrft(pair.record, pair.reference, correction=CORRECTION).controller


METHODS: Mapping[str, Callable[[IdentifiedPair], Law]] = {
    "following": _following,
    "adaptive": _adaptive,
    "vrft": _virtual_reference,
}
"""How each method designs its law."""

LAWS: Mapping[str, type[Law]] = {law_class.__name__: law_class for law_class in get_args(Law)}
"""Classes of laws that a file may hold."""

FORMAT = "hmtb-control 1"


def designer(method: str, joints: Sequence[str] = CONTROLLED) -> Callable[[IdentifiedPair], Law]:
    """Return the function that designs the law of a method, or that returns the law of a file.

    Args:
        method: One of `METHODS`, or the path of a file of `write_law`, which ends in `.json`.
        joints: The controlled joints.

    Raises:
        ScenarioError: No such method, or a file without a law of the controlled joints.
    """
    if method.endswith(".json"):
        law = read_law(Path(method), joints)
        return lambda _: law
    if method not in METHODS:
        raise ScenarioError(unknown("method", method, METHODS) + "; or a file of --out that ends in .json")
    return METHODS[method]


def write_law(law: Law, path: Path, joints: Sequence[str] = CONTROLLED) -> Path:
    """Write a law as JSON, every bit of it; `read_law` reads it back."""
    content = {"format": FORMAT, "joints": list(joints), "kind": type(law).__name__, "law": encoded(law)}
    write_whole(path, text_of(content) + "\n")
    return path


def read_law(path: Path, joints: Sequence[str] = CONTROLLED) -> Law:
    """Read a law of these joints from a file of `write_law`.

    Raises:
        ScenarioError: No such file, or something else in it.
    """
    try:
        content = parsed(path)
        # As text: JSON may hold a list there, which is no key of a mapping.
        is_law = isinstance(content, dict) and content.get("format") == FORMAT and str(content.get("kind")) in LAWS
        if not is_law:
            raise ScenarioError(f"{path.name}: expected a law of hmtb control --out ({', '.join(LAWS)})")
        law: Law = decoded("law", content.get("law"), LAWS[content["kind"]])
    except SysidError as error:
        raise ScenarioError(f"{path.name}: expected a law of hmtb control --out: {error}") from error
    loops = law.fixed.loops if isinstance(law, AdaptiveFollowing) else law.loops
    if content.get("joints") != list(joints) or loops != len(joints):
        raise ScenarioError(f"{path.name}: {loops} loops, {content.get('joints')} given, expected {list(joints)}")
    return law


def wrong_model(pair: IdentifiedPair, gain: float = 1.0, delay: int = 0) -> IdentifiedPair:
    """Return a pair whose model of the ground arm is wrong, and its record in the same way.

    Args:
        pair: The right pair.
        gain: Factor on the model's gain.
        delay: Further samples of delay.
    """
    model = add_delay(replace(pair.ground, B=gain * pair.ground.B), delay)
    # Commands that come earlier and are smaller make the arm look slower and its gain larger; the samples that wrap
    # round are cut off.
    record = replace(pair.record, u=np.roll(pair.record.u, -delay, axis=0) / gain)
    return replace(pair, ground=model, record=record[: len(record) - delay])
