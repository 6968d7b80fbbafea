"""Journals: what a kill leaves is taken up, what is out of date is not."""

import json
from pathlib import Path

import numpy as np
import pytest

from scenarios.bench.journal import Journal, file_name
from scenarios.bench.measurement import Measurement
from scenarios.problems.trial import Trial

KEY = {"contestant": {"name": "mine"}, "source": "1", "software": "2", "seed": 0}


def opened(folder: Path, said: list[str] | None = None, **changes: object) -> Journal:
    told = [] if said is None else said
    return Journal(folder, "mine", {**KEY, **changes}, run="a", said=told.append)


def trials(count: int) -> list[Measurement]:
    response = np.array([[[1.0 + 2.0j]]])
    return [Measurement(Trial("p1", k), "model", response=response, whiteness_p=0.1 * k) for k in range(count)]


def lines(journal: Journal) -> list[str]:
    return [one.to_json() for one in journal.measured().values()]


def test_what_was_added_is_there_again(tmp_path: Path):
    given = trials(3)
    with opened(tmp_path) as journal:
        for one in (*given, given[0]):
            journal.add(one)
    with opened(tmp_path) as journal:
        assert journal.done == {one.trial.key for one in given}
        assert lines(journal) == [one.to_json() for one in given]


TRIAL = b'{"trial": {"problem": "p1", "draw": 7, "ask": "fit"}, '


@pytest.mark.parametrize(
    "torn",
    [
        *(b'{"trial": {"pro', b"\0\0\0\n", b"\xff\n", b'{"kind": "model"}\n', b"[]\n", b"[" * 100_000 + b"\n"),
        *(TRIAL + b'"kind": "zork"}\n', TRIAL + b'"kind": 5}\n', TRIAL + b'"kind": "model", "response": 1.0}\n'),
        b'{"trial": {"problem": ["p1"], "draw": 7, "ask": "fit"}, "kind": "model"}\n',
        b'{"trial": {"problem": "p1", "draw": "7", "ask": "fit"}, "kind": "model"}\n',
    ],
)
def test_what_is_torn_is_cut_off(tmp_path: Path, torn: bytes):
    given = trials(3)
    with opened(tmp_path) as journal:
        for one in given[:2]:
            journal.add(one)
    with journal.path.open("ab") as stream:
        stream.write(torn)
    with opened(tmp_path) as journal:
        assert len(journal.done) == 2
        journal.add(given[2])
        assert lines(journal) == [one.to_json() for one in given]


def test_how_much_was_lost_to_damage_is_said(tmp_path: Path):
    with opened(tmp_path) as journal:
        for one in trials(5):
            journal.add(one)
    first, *others = journal.path.read_bytes().splitlines(keepends=True)
    journal.path.write_bytes(b"".join([first, others[0], b"{}\n", *others[1:], b'{"torn']))
    said: list[str] = []
    with opened(tmp_path, said) as journal:
        assert len(journal.done) == 1
    assert len(said) == 1 and said[0].endswith("is damaged after 1 trials; 5 lines behind them are done again")


@pytest.mark.parametrize("left", [b"", b'{"run": "b', b"\n", b'{"key": {}}\n'])
def test_one_without_a_first_line_begins_anew(tmp_path: Path, left: bytes):
    with opened(tmp_path) as journal:
        journal.add(trials(1)[0])
    journal.path.write_bytes(left)
    with opened(tmp_path) as journal:
        assert (journal.run, journal.done) == ("a", set())
        journal.add(trials(1)[0])
    assert json.loads(journal.path.read_text().splitlines()[0]) == {"run": "a", "key": KEY}


def test_what_no_command_brings_back_is_forgotten_and_said(tmp_path: Path):
    for change, words in (
        ({"source": "changed"}, "mine: its file changed since the last run: it starts anew"),
        ({"software": "changed"}, "mine: this software, or a package that it uses, changed since the last run: it"),
    ):
        with opened(tmp_path) as journal:
            journal.add(trials(1)[0])
        said: list[str] = []
        with opened(tmp_path, said, **change) as other:
            other.add(trials(1)[0])
            assert not journal.path.exists()
        assert len(said) == 1 and said[0].startswith(words)
        other.path.unlink()


def test_that_of_another_seed_and_of_another_estimator_stay(tmp_path: Path):
    said: list[str] = []
    with opened(tmp_path) as journal:
        journal.add(trials(1)[0])
    with opened(tmp_path, said, seed=1):
        pass
    with Journal(tmp_path, "mine-2", {**KEY, "source": "3"}, run="a", said=said.append):
        pass
    assert said == []
    assert list(tmp_path.iterdir()) == [journal.path]  # those in which nothing was done are gone


def test_one_that_is_being_written_is_left_alone(tmp_path: Path):
    said: list[str] = []
    with opened(tmp_path) as journal:
        journal.add(trials(1)[0])
        with opened(tmp_path, said, source="changed"):
            assert journal.path.exists()
        assert len(lines(journal)) == 1
    assert said == []


def test_names_become_names_of_files():
    assert file_name("our-oe_2.1+x") == "our-oe_2.1+x"
    names = ["our oe/2 (n=3)", "our-oe/2 (n=3)", "../..", "\u03b1", "\u03b2"]
    files = [file_name(name) for name in names]
    assert len(set(files)) == 5 and files[0].startswith("our-oe-2-n-3-") and files[3].startswith("estimator-")
