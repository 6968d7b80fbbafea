"""Journal of a run: finished work in an SQLite file, from which an interrupted run resumes."""

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, suppress
from pathlib import Path
from typing import Any

from scenarios.files.errors import ScenarioError

LAST = "\U0010ffff"
"""Sorts behind everything that may follow a prefix."""

SCHEMA = """
CREATE TABLE IF NOT EXISTS fingerprint (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS entries (number INTEGER PRIMARY KEY, key TEXT UNIQUE, payload NOT NULL, crc NOT NULL);
"""


class Journal(AbstractContextManager["Journal"]):
    """Payloads by key, each on file as soon as it is added; one process at a time has the journal open.

    A process that is killed leaves whole entries only, and its lock goes with it. A power cut may take the last entries
    along: their work is done again.

    Args:
        path: The file; it and its folder are made if missing.
        fingerprint: What the entries depend on, such as versions of software and settings, by name.

    Raises:
        ScenarioError: Another process has the journal open; it was begun with another fingerprint; it is damaged; or
            it cannot be written.
    """

    def __init__(self, path: Path, fingerprint: Mapping[str, str]) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._database = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        except sqlite3.Error as error:
            raise self._error(error) from error
        try:
            self._open(fingerprint)
        except BaseException:
            self._database.close()
            raise

    def __exit__(self, *_: object) -> None:
        self.close()

    def __contains__(self, key: str) -> bool:
        """Whether there is an entry; a damaged one counts as none, so that its work is done again."""
        try:
            row = self._execute("SELECT payload, crc FROM entries WHERE key = ?", (key,)).fetchone()
        except sqlite3.Error:
            return False
        return row is not None and _checksum(key, row[0]) == row[1]

    def close(self) -> None:
        """Release the lock; other processes may open the journal."""
        self._database.close()

    def items(self, prefix: str = "") -> Iterator[tuple[str, Any]]:
        """Keys with this prefix and their payloads, sorted by key; without a prefix all, in the order of adding."""
        order = "key" if prefix else "number"
        return self._entries(f"WHERE key BETWEEN ? AND ? ORDER BY {order}", prefix, prefix + LAST)

    def keys(self, prefix: str = "") -> set[str]:
        """Keys that begin with a prefix."""
        return {key for key, _ in self.items(prefix)}

    def get(self, key: str) -> Any:
        """The payload of a key; None where there is none."""
        return next((payload for _, payload in self._entries("WHERE key = ?", key)), None)

    def add(self, key: str, payload: Any) -> None:
        """Add an entry, bytes or anything that JSON holds, or replace that of the same key."""
        self.add_all({key: payload})

    def add_all(self, payloads: Mapping[str, Any]) -> None:
        """Add several entries at once: after a kill all of them are there, or none."""
        texts = {key: value if isinstance(value, bytes) else json.dumps(value) for key, value in payloads.items()}
        with self._database:  # rolls back where an error leaves the transaction open
            self._execute("BEGIN")
            for key, text in texts.items():
                row = (key, text, _checksum(key, text))
                self._execute("INSERT OR REPLACE INTO entries (key, payload, crc) VALUES (?, ?, ?)", row)
            self._execute("COMMIT")

    def remove(self, key: str) -> None:
        """Remove an entry: its work is to be done again."""
        self._execute("DELETE FROM entries WHERE key = ?", (key,))

    def _open(self, fingerprint: Mapping[str, str]) -> None:
        # Exclusive locks last until the file is closed, and need no shared memory beside it. In WAL mode a commit is a
        # write without a flush: enough against kills, and quick enough for an entry per trial.
        for pragma in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL"):
            self._execute(f"PRAGMA {pragma}")
        self._execute("BEGIN EXCLUSIVE")
        for statement in SCHEMA.strip().splitlines():
            self._execute(statement)
        before = dict(self._execute("SELECT name, value FROM fingerprint").fetchall())
        if not before:
            for row in fingerprint.items():
                self._execute("INSERT INTO fingerprint VALUES (?, ?)", row)
        self._execute("COMMIT")
        if before and (changed := differences(before, fingerprint)):
            more = f"; {len(changed) - 3} more" if len(changed) > 3 else ""
            raise ScenarioError(
                f"{self._path} was begun with other settings or software: {'; '.join(changed[:3])}{more}. Resume "
                f"with those, or remove {self._path} to start again"
            )

    def _entries(self, where: str, *values: str) -> Iterator[tuple[str, Any]]:
        """Entries in turn, each held against its checksum: SQLite itself does not notice a flipped bit."""
        try:
            for key, value, crc in self._execute(f"SELECT key, payload, crc FROM entries {where}", values):
                if _checksum(key, value) != crc:
                    raise self._damaged(f"the checksum of {key!r} is wrong")
                yield key, value if isinstance(value, bytes) else json.loads(value)
        except sqlite3.Error as error:
            raise self._damaged(error) from error

    def _execute(self, statement: str, values: tuple[Any, ...] = ()) -> sqlite3.Cursor:
        try:
            return self._database.execute(statement, values)
        except sqlite3.Error as error:
            raise self._error(error) from error

    def _error(self, error: sqlite3.Error) -> ScenarioError:
        if "locked" in str(error):
            return ScenarioError(f"{self._path}: another process is at work here; wait for it, or stop it")
        if isinstance(error, sqlite3.OperationalError):
            return ScenarioError(f"cannot read or write {self._path}: {error}")
        return self._damaged(error)

    def _damaged(self, reason: object) -> ScenarioError:
        return ScenarioError(f"{self._path} is damaged ({reason}); remove it to start again")


def read_fingerprint(path: Path) -> dict[str, str] | None:
    """The fingerprint of a journal; None where the file is none, or another process has it open."""
    if not path.is_file():
        return None
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{path}?mode=rw", uri=True, timeout=0.0)) as database:
        return dict(database.execute("SELECT name, value FROM fingerprint").fetchall())
    return None


def differences(
    before: Mapping[str, str], now: Mapping[str, str], words: tuple[str, str] = ("then", "now")
) -> list[str]:
    """Describe in what two fingerprints differ, one text for each entry."""
    texts = []
    for name in dict.fromkeys((*before, *now)):
        values = [table.get(name, "none") for table in (before, now)]
        if values[0] != values[1]:
            shown = [value[:12] if len(value) == 64 else value for value in values]  # the beginning of a hash tells
            short = all(len(value) <= 40 for value in shown)
            texts.append(f"{name} {shown[0]} {words[0]}, {shown[1]} {words[1]}" if short else f"{name} differs")
    return texts


def _checksum(key: str, payload: Any) -> int:
    return zlib.crc32(payload if isinstance(payload, bytes) else str(payload).encode(), zlib.crc32(key.encode()))
