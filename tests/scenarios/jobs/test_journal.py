"""Journals: whole entries survive a kill, and no second run writes into one."""

import signal
import subprocess
import sys

import numpy as np
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.jobs.journal import Journal, differences, read_fingerprint
from tests.refusals import refused

FINGERPRINT = {"numpy": "2.0", "source": "a" * 64}

KILLED = """
import os, signal, sys
from pathlib import Path
from scenarios.jobs.journal import Journal

journal = Journal(Path(sys.argv[1]), {"numpy": "2.0", "source": "a" * 64})
for number in range(100):
    journal.add_all({f"trial {number}": [number, 0.1], f"bytes {number}": bytes([number])})
print("ready", flush=True)
journal._execute("BEGIN")
journal._execute("INSERT INTO entries (key, payload, crc) VALUES ('half', '1', 0)")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_entries_are_there_when_the_journal_is_opened_again(tmp_path):
    path = tmp_path / "new" / "journal.sqlite"
    with Journal(path, FINGERPRINT) as journal:
        journal.add("b 2", {"x": [1.5, None]})
        journal.add_all({"a 1": b"\x00\xff", "b 1": "text"})
        assert ("a 1" in journal, "a 2" in journal, journal.get("a 2")) == (True, False, None)
    with Journal(path, dict(reversed(FINGERPRINT.items()))) as journal:
        assert list(journal.items()) == [("b 2", {"x": [1.5, None]}), ("a 1", b"\x00\xff"), ("b 1", "text")]
        assert list(journal.items("b ")) == [("b 1", "text"), ("b 2", {"x": [1.5, None]})]
        assert journal.keys("a") == {"a 1"}
        journal.remove("a 1")
        journal.add("b 1", 7)
        assert dict(journal.items()) == {"b 2": {"x": [1.5, None]}, "b 1": 7}
    assert [entry.name for entry in path.parent.iterdir()] == ["journal.sqlite"]
    assert read_fingerprint(path) == FINGERPRINT
    assert read_fingerprint(tmp_path / "nothing") is None


def test_a_killed_process_leaves_whole_entries_and_no_lock(tmp_path):
    path = tmp_path / "journal.sqlite"
    ended = subprocess.run([sys.executable, "-c", KILLED, str(path)], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (-signal.SIGKILL, "ready\n"), ended.stderr
    with Journal(path, FINGERPRINT) as journal:
        assert len(journal.keys()) == 200
        assert (journal.get("trial 99"), journal.get("bytes 99"), journal.get("half")) == ([99, 0.1], b"c", None)


def test_a_second_run_and_other_settings_are_refused(tmp_path):
    path = tmp_path / "journal.sqlite"
    with Journal(path, FINGERPRINT) as journal:
        journal.add("a", 1)
        refused("another process is at work here; wait for it", Journal, path, FINGERPRINT)
    message = r"other settings or software: numpy 2\.0 then, 2\.1 now; source a{12} then"
    refused(message, Journal, path, {"numpy": "2.1", "source": "b" * 64})
    with Journal(path, FINGERPRINT) as journal:
        assert dict(journal.items()) == {"a": 1}
    lines = differences({"a": "1", "b": "x" * 50}, {"c": "2"}, ("there", "here"))
    assert lines == ["a 1 there, none here", "b differs", "c none there, 2 here"]


@pytest.mark.parametrize("content", [b"no database" * 100, b"SQLite format 3\x00" + bytes(range(1, 256)) * 16, None])
def test_a_damaged_journal_and_a_folder_in_its_place_are_refused(tmp_path, content):
    path = tmp_path / "journal.sqlite"
    path.write_bytes(content) if content else path.mkdir()
    refused(r"journal\.sqlite" if content else r"cannot read or write .*journal\.sqlite", Journal, path, FINGERPRINT)


def test_a_flipped_bit_is_an_error_and_no_other_result(tmp_path):
    path, rng = tmp_path / "journal.sqlite", np.random.default_rng(2)
    entries = {f"trial {number}": {"error": number / 7, "files": {"a": "x" * 20}} for number in range(40)}
    with Journal(path, FINGERPRINT) as journal:
        journal.add_all(entries)
    whole, refusals = path.read_bytes(), 0
    for place in rng.integers(0, len(whole), 150):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << int(rng.integers(8))]) + whole[place + 1 :])
        try:
            with Journal(path, FINGERPRINT) as journal:
                assert all(journal.get(key) == entries[key] for key in entries if key in journal)
                read = dict(journal.items()), journal.keys()
        except ScenarioError as error:
            refusals += 1
            assert "journal.sqlite" in str(error)
        else:
            assert read == (entries, entries.keys())
    assert refusals > 20
