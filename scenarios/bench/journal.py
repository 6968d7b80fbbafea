"""The journal of a contestant: a line for each trial that is done, so that a run that was stopped is gone on with."""

import fcntl
import json
import re
from collections.abc import Callable, Iterator, Mapping
from hashlib import sha256
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from scenarios.bench.measurement import Measurement
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

ENDING = ".jsonl"

HANG = "hang"

GIVEN_UP = "given up"
"""By which the reason of a trial begins that was not asked any more."""

PASSING = {"source": "its file", "software": "this software, or a package that it uses,"}
"""Entries of a key that no command line brings back, in words: a journal under another one is of no more use."""

IDENTITY = ("target", "home", "program")
"""What an estimator is, whatever is said of it: journals of another one of the same name are left alone."""


class Journal:
    """Trials of one contestant that are done, in a file that is only ever added to.

    The first line holds the key: all that outcomes depend on. What a kill left half written is cut off and done again.

    Args:
        folder: For journals.
        name: Of the contestant.
        key: What outcomes depend on, as JSON holds it: contestant, source, limits, seed, software.
        run: Mark of this run, for a journal that is new.
        said: Told in words why an earlier journal is of no use.

    Attributes:
        path: The file.
        run: Mark of the run that began it.
        done: Keys of the trials that it holds.
        hangs: How many trials hung at its end, one after the other; those that were not asked count as none.

    Raises:
        ScenarioError: Another run is at work with it.
        OSError: It cannot be read or written.
    """

    def __init__(
        self, folder: Path, name: str, key: Mapping[str, Any], *, run: str, said: Callable[[str], None]
    ) -> None:
        text, stem = json.dumps(key, sort_keys=True), file_name(name)
        self.path = folder / f"{stem}-{sha256(text.encode()).hexdigest()[:12]}{ENDING}"
        folder.mkdir(parents=True, exist_ok=True)
        _forget_others(folder, stem, self.path, key, lambda why: said(f"{name}: {why}"))
        self.run, self.done, self._mine = run, set[str](), False
        self.hangs = 0
        # Unbuffered: a line is with the system as soon as it is written.
        self._stream = FileIO(self.path, "a+")
        try:
            self._lock()
            if not self._take_up(lambda why: said(f"{name}: {why}")):
                self._stream.truncate(0)
                self._write(json.dumps({"run": run, "key": key}))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let others at it; one in which nothing is done is removed."""
        if self._mine and not self.done:
            self.path.unlink(missing_ok=True)
        self._stream.close()

    def add(self, measured: Measurement) -> None:
        """Add a trial; one that it holds already is left as it is."""
        if measured.trial.key not in self.done:
            self._write(measured.to_json())
            self._count(measured)

    def measured(self) -> dict[Trial, Measurement]:
        """All that it holds, by trial."""
        with self.path.open("rb") as stream:
            next(stream)
            return {one.trial: one for one in (Measurement.from_json(line.decode()) for line in stream)}

    def _write(self, line: str) -> None:
        left = memoryview(f"{line}\n".encode())
        while left:
            try:
                left = left[self._stream.write(left) :]
            except OSError as error:  # a full disk: writing to a stream gives the error no name
                error.filename = str(self.path)
                raise

    def _count(self, measured: Measurement) -> None:
        self.done.add(measured.trial.key)
        hung = measured.kind == HANG and not measured.why.startswith(GIVEN_UP)
        self.hangs = self.hangs + 1 if hung else 0

    def _lock(self) -> None:
        self._mine = _locked(self._stream)
        if not self._mine:
            raise ScenarioError(
                f"{self.path}: another hmtb verify is at work in this folder, and asks the same estimator, which "
                "may be the second implementation, with which others are compared; wait for it, stop it, or give "
                "another --out"
            )

    def _take_up(self, said: Callable[[str], None]) -> bool:
        """Take over what an earlier run left; False where there is not even a whole first line."""
        good = lost = 0
        with self.path.open("rb") as stream:
            for line in stream:
                if lost or not line.endswith(b"\n"):
                    lost += line.endswith(b"\n")
                    continue
                try:
                    if good:
                        self._count(Measurement.from_json(line.decode()))
                    else:
                        self.run = str(json.loads(line)["run"])
                except (ValueError, TypeError, KeyError, RecursionError):
                    lost += 1
                    continue
                good += len(line)
        if lost:
            said(f"{self.path} is damaged after {len(self.done)} trials; {lost} lines behind them are done again")
        self._stream.truncate(good)
        return good > 0


def _locked(stream: IO[bytes]) -> bool:
    """Lock a file as long as it is open; False where another process has it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def file_name(name: str) -> str:
    """A contestant's name as that of a file, without an ending; with a mark where the two are not the same."""
    plain = re.sub(r"[^A-Za-z0-9_.+-]+", "-", name).strip(".-")
    return plain if plain == name else f"{plain or 'estimator'}-{sha256(name.encode()).hexdigest()[:6]}"


def _forget_others(folder: Path, stem: str, path: Path, key: Mapping[str, Any], said: Callable[[str], None]) -> None:
    """Remove journals of the same contestant that no command can take up again, and say why it starts anew."""
    for other, theirs in _keys(folder, stem):
        passed = [words for entry, words in PASSING.items() if theirs.get(entry) != key[entry]]
        if other == path or not passed or _identity(theirs) != _identity(key):
            continue
        with other.open("ab") as stream:
            if _locked(stream):  # another run may still be at work with it
                other.unlink(missing_ok=True)
                said(f"{' and '.join(passed)} changed since the last run: it starts anew")


def _identity(key: Mapping[str, Any]) -> tuple[object, ...]:
    contestant = key.get("contestant")
    return tuple(contestant.get(name) for name in IDENTITY) if isinstance(contestant, Mapping) else ()


def _keys(folder: Path, stem: str) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    for path in sorted(folder.glob(f"{stem}-{'[0-9a-f]' * 12}{ENDING}")):
        try:
            with path.open("rb") as stream:
                key = json.loads(stream.readline())["key"]
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            continue
        if isinstance(key, Mapping):
            yield path, key
