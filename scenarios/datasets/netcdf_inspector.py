"""Looks at files that may be damaged, and outlives what they do to their reader."""

import json
import os
import select
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

from scenarios.files.errors import ScenarioError

PATIENCE = 60.0
"""How long the reader may take for a file, s; a record takes hundredths of one."""


class Inspector:
    """Asks a process what is in files, and starts another one where a file was too much for it.

    Args:
        patience: How long to wait for an answer, s.
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "Inspector":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def look(self, path: Path) -> dict[str, Any]:
        """What is in a file; see `glance`.

        Args:
            path: The file.

        Raises:
            ScenarioError: It cannot be read, or reading it does not end.
        """
        process = self._process or self._started()
        if process.stdin is None or process.stdout is None:
            raise ScenarioError("the process that reads files has no pipes")
        try:
            process.stdin.write(json.dumps(str(path)) + "\n")
            process.stdin.flush()
            there = select.select([process.stdout], [], [], self._patience)[0]
            line = process.stdout.readline() if there else None
        except OSError:
            line = ""
        if not line:
            self._end()
            what = "crashed" if line == "" else f"did not end within {self._patience:g} s"
            raise ScenarioError(f"{path}: reading it {what}: it is damaged")
        found: dict[str, Any] = json.loads(line)
        if "error" in found:
            raise ScenarioError(found["error"])
        return found

    def _started(self) -> subprocess.Popen[str]:
        self._process = subprocess.Popen(
            # Without the working folder, which may be the one under check, among the places of modules.
            [sys.executable, "-P", "-m", "scenarios.datasets.netcdf_probe"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue  # what was left to write has nobody to read it
