"""The manifest: lines on the disk, of which only whole ones count."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.datasets.manifest import Manifest, entry_of, line_of


def entry(number: int, text: str = "") -> dict[str, Any]:
    return {"number": number, "files": {}, "about": {"name": f"experiment {number}{text}"}}


def piece(name: str) -> dict[str, Any]:
    return {"stage": "words", "piece": name, "files": {}}


def test_what_is_noted_is_there_when_it_is_opened_again(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    with Manifest(path, 5) as manifest:
        assert (manifest.done, list(manifest.left)) == (0, [0, 1, 2, 3, 4])
        manifest.append([entry(3), entry(1)])
        manifest.append([piece("b"), entry(4), piece("a")])
        first = list(manifest.noted())
    with Manifest(path, 5) as manifest:
        assert list(manifest.noted()) == first == [entry(1), entry(3), entry(4)]
        assert list(manifest.left) == [0, 2]
        assert manifest.experiment(2) is None
        assert manifest.experiment(3) == entry(3)
        assert (manifest.piece("words", "a"), manifest.piece("words", "c")) == (piece("a"), None)
        manifest.forget(entry(3))
        manifest.forget(piece("b"))
        assert list(manifest.left) == [0, 2, 3]
        manifest.append([entry(3, ", anew"), piece("b")])
    with Manifest(path, 5) as manifest:
        assert manifest.experiment(3) == entry(3, ", anew")
        manifest.append([entry(0), entry(2)])
        manifest.put_in_order([("words", "a"), ("words", "b")])
        assert [line["number"] for line in manifest.noted()] == [0, 1, 2, 3, 4]
    lines = [entry(0), entry(1), entry(2), entry(3, ", anew"), entry(4), piece("a"), piece("b")]
    assert path.read_bytes() == b"".join(map(line_of, lines))


@pytest.mark.parametrize("cut", [1, 5, 40])
def test_half_a_line_is_cut_off_and_written_over(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "manifest.jsonl"
    with Manifest(path, 3) as manifest:
        manifest.append([entry(0), entry(1)])
    path.write_bytes(path.read_bytes()[:-cut])
    with Manifest(path, 3) as manifest:
        assert list(manifest.left) == [1, 2]
        manifest.append([entry(2), entry(1)])
        assert list(manifest.noted()) == [entry(0), entry(1), entry(2)]
    assert path.read_bytes() == b"".join(map(line_of, (entry(0), entry(2), entry(1))))


def test_a_line_of_which_any_byte_has_changed_is_none() -> None:
    line = line_of({**entry(3), "seed": 12, "value": 0.1})
    assert entry_of(line) == {**entry(3), "seed": 12, "value": 0.1}
    rng = np.random.default_rng(1)
    for place in range(len(line)):
        spoilt = bytearray(line)
        spoilt[place] ^= 1 << rng.integers(0, 7)
        found = entry_of(bytes(spoilt))
        assert found is None or found == entry_of(line)  # white space between words says nothing


@pytest.mark.parametrize("text", [b"\n", b"{}\n", b"[]\n", b"7\n", b'{"sum": 1}\n', bytes(9), b"\xff\n"])
def test_what_is_no_line_is_none(text: bytes) -> None:
    assert entry_of(text) is None
