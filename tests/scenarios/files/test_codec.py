"""Records read back equal from TOML and JSON, and errors name the place."""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from scenarios.files import codec
from scenarios.files.errors import ScenarioError
from scenarios.files.toml_file import read_toml
from tests.refusals import refused


@dataclass(frozen=True)
class Inner:
    gain: float = 1.0
    switch: bool = False

    def __post_init__(self) -> None:
        if self.gain < 0:
            raise ValueError(f"inner: gain = {self.gain} given, expected 0 or more")


@dataclass(frozen=True)
class Outer:
    name: str
    count: int
    points: tuple[float, ...] = ()
    words: tuple[str, ...] = ()
    inner: Inner = Inner()
    parts: tuple[Inner, ...] = ()
    seed: int | None = None
    shares: Mapping[str, float] = field(default_factory=dict)


RECORD = Outer('a "b" \\ \n µ \x7f', 3, (1.0, 1e-300, -0.1), ("x", ""), Inner(2.5), (Inner(), Inner(1.5, True)), 7)


def test_records_read_back_equal():
    text = codec.to_toml(codec.unstructure(RECORD))
    assert codec.structure(Outer, tomllib.loads(text)) == RECORD
    assert codec.from_json(Outer, json.dumps(codec.unstructure(RECORD)), "a.json") == RECORD
    assert "[[parts]]\ngain = 1.5\nswitch = true\n" in text and "\npoints = [1.0, 1e-300, -0.1]\n" in text
    assert codec.changes(Inner(2.0), Inner()) == {"gain": 2.0}
    assert codec.to_toml({"a": {"b": {"c": 1}, "d": []}}) == "[a]\nd = []\n\n[a.b]\nc = 1\n"


def test_numbers_of_numpy_are_written_as_those_of_python():
    record = Outer(np.str_("a"), np.int64(3), (np.float64(0.1),), inner=Inner(np.float32(0.5), np.bool_(True)))
    table = codec.unstructure(record)
    assert json.dumps(table["inner"]) == '{"gain": 0.5, "switch": true}'
    assert codec.structure(Outer, table) == Outer("a", 3, (0.1,), inner=Inner(0.5, True))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cuont": 1}, "unknown key 'cuont': did you mean 'count'?"),
        ({"inner": {"gian": 1.0}}, "inner: unknown key 'gian': did you mean 'gain'?"),
        ({"parts": [{}, {"gain": "1"}]}, "parts[1].gain must be a finite number, given '1'"),
        ({"parts": {"gain": 1.0}}, "parts must be a list of tables, given"),
        ({"inner": {"gain": -1}}, "inner: gain = -1.0 given, expected 0 or more"),
        ({"inner": 3}, "inner must be a table, given 3"),
        ({"count": 1.0}, "count must be a whole number, given 1.0"),
        ({"count": True}, "count must be a whole number, given True"),
        ({"inner": {"switch": 1}}, "inner.switch must be true or false, given 1"),
        ({"points": "12"}, "points must be a list of finite numbers, given '12'"),
        ({"points": [1, float("nan")]}, "points[1] must be a finite number, given nan"),
        ({"words": [1]}, "words[0] must be a text, given 1"),
        ({"shares": {"a": "b"}}, "shares.a must be a finite number, given 'b'"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place(change, says):
    with pytest.raises(ScenarioError) as refusal:
        codec.structure(Outer, {"name": "a", "count": 1, **change})
    assert str(refusal.value).startswith(says)


def test_missing_keys_and_damaged_texts_are_refused():
    refused(r"^tables: missing name, count; it takes name, count, points, words", codec.structure, Outer, {}, "tables")
    for text in ("{", "[" * 100_000, '{"name": 1}'):
        refused(r"^a\.json: ", codec.from_json, Outer, text, "a.json")
    for text in ("a = ", "a = " + "[" * 100_000, "a = " + "1" * 10_000):
        refused(r"^a\.toml: ", read_toml, text, "a.toml")
