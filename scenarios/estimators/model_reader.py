"""Reads files of models in a process of its own: a damaged one can make the library that reads it hang or crash."""

import os
import sys
import tempfile
from pathlib import Path
from types import TracebackType

from scenarios.estimators.model_file import read_model_numbers
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.outcome import KINDS
from scenarios.estimators.reading_child import MEMORY
from scenarios.estimators.started import start
from scenarios.estimators.supervised import Supervised
from scenarios.estimators.wire import WireError, complete, pack, unpack
from sysid.records.arrays import FloatArray

PATIENCE = 10.0
"""How long reading a model may take, s; it takes thousandths of one."""

STARTING = 60.0
"""How long the process may take to start, s."""


class ModelReader:
    """A process that reads files of models; it is started when it is first needed.

    Args:
        patience: How long reading a file may take, s.
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._process: Supervised | None = None

    def __enter__(self) -> "ModelReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def read(self, path: Path) -> dict[str, FloatArray]:
        """The numbers of a model.

        Args:
            path: The file.

        Raises:
            NoModelError: It cannot be read, or reading it does not end.
        """
        if path.suffix == ".json":
            # Nothing but Python reads it.
            return read_model_numbers(path)
        process = self._process or self._started()
        got = process.exchange(pack({"path": str(path)}), complete, seconds=self._patience, memory_bytes=2 * MEMORY)
        if got.end == "answered":
            try:
                fields, numbers = unpack(got.reply)
                kind, why = str(fields["kind"]), str(fields["why"])
            except (WireError, KeyError):
                kind, why = "malformed", f"{path.name} is damaged"
            if kind == "read":
                return numbers
            raise NoModelError(kind if kind in KINDS else "malformed", why)
        self._end()
        what = {"hang": f"does not end within {self._patience:g} s", "memory": "takes too much memory"}
        raise NoModelError("malformed", f"reading {path.name} {what.get(got.end, 'crashes')}: it is damaged")

    def _started(self) -> Supervised:
        process = start(
            [sys.executable, "-P", "-m", "scenarios.estimators.reading_child", "{request}", "{reply}"],
            folder=Path(tempfile.gettempdir()),
            environment={"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
        self._process = process
        got = process.exchange(b"", complete, seconds=STARTING, memory_bytes=2 * MEMORY)
        if got.end != "answered":
            printed = process.tail()
            self._end()
            raise NoModelError("malformed", f"the process that reads files does not start: {printed}")
        return process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end()
