"""Journal of a run: finished work in an SQLite file, from which an interrupted run resumes."""

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, suppress
from pathlib import Path
from typing import Any

from scenarios.files.errors import LISTED, ScenarioError

LAST = "\U0010ffff"
"""Sorts behind everything that may follow a prefix."""

LONGEST_VALUE = 40
"""Characters of a value that a message shows."""

HASH_DIGITS = 64
"""Hexadecimal digits of a SHA-256 hash."""

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
            # No waiting for the lock: whoever holds it keeps it for a whole run. Python would begin transactions by
            # itself at the first insertion; here they begin by hand.
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
        # All of them are encoded before the transaction begins: one that JSON cannot hold leaves nothing behind.
        encoded = {key: _encoded(payload) for key, payload in payloads.items()}
        with self._database:  # rolls back where an error leaves the transaction open
            self._execute("BEGIN")
            for key, payload in encoded.items():
                row = (key, payload, _checksum(key, payload))
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
        changed = differences(before, fingerprint) if before else []
        if changed:
            unlisted = f"; {len(changed) - LISTED} more" if len(changed) > LISTED else ""
            raise ScenarioError(
                f"{self._path} was begun with other settings or software: {'; '.join(changed[:LISTED])}{unlisted}. "
                f"Resume with those, or remove {self._path} to start again"
            )

    def _entries(self, where: str, *values: str) -> Iterator[tuple[str, Any]]:
        """Entries in turn, each held against its checksum: SQLite itself does not notice a flipped bit."""
        try:
            for key, payload, crc in self._execute(f"SELECT key, payload, crc FROM entries {where}", values):
                if _checksum(key, payload) != crc:
                    raise self._damaged(f"the checksum of {key!r} is wrong")
                yield key, _decoded(payload)
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
    before: Mapping[str, str], after: Mapping[str, str], words: tuple[str, str] = ("then", "now")
) -> list[str]:
    """Describe in what two fingerprints differ, one line for each name whose values differ.

    Args:
        before: The first fingerprint.
        after: The second one.
        words: Behind the value of the first and that of the second.
    """
    lines = []
    for name in dict.fromkeys((*before, *after)):
        old, new = before.get(name, "none"), after.get(name, "none")
        if old != new:
            lines.append(_difference(name, _abridged(old), _abridged(new), words))
    return lines


def _difference(name: str, old: str, new: str, words: tuple[str, str]) -> str:
    # Two long values side by side hide what differs in them.
    if max(len(old), len(new)) > LONGEST_VALUE:
        return f"{name} differs"
    return f"{name} {old} {words[0]}, {new} {words[1]}"


def _abridged(value: str) -> str:
    """The first digits of a SHA-256 hash, which tell two apart; other values whole."""
    return value[:12] if len(value) == HASH_DIGITS else value


def _encoded(payload: Any) -> bytes | str:
    return payload if isinstance(payload, bytes) else json.dumps(payload)


def _decoded(payload: bytes | str) -> Any:
    return payload if isinstance(payload, bytes) else json.loads(payload)


def _checksum(key: str, payload: Any) -> int:
    """CRC-32 of key and payload: an entry under the key of another one is damaged too."""
    content = payload if isinstance(payload, bytes) else str(payload).encode()
    return zlib.crc32(content, zlib.crc32(key.encode()))
