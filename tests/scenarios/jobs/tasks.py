"""Tasks for worker processes: they import next to nothing."""

import os
import time
from pathlib import Path
from typing import Any

from scenarios.jobs.executor import at_worker_exit

OPENED: list[int] = []


def double(shared: Any, batch: tuple[int, ...]) -> list[int]:
    return [shared * item for item in batch]


def mortal(marks: str, batch: tuple[str, ...]) -> list[str]:
    """Kills its worker at "always", and at "once" the first time."""
    for item in batch:
        mark = Path(marks, item)
        if item.startswith("always") or (item.startswith("once") and not mark.exists()):
            mark.touch()
            os._exit(7)
    return list(batch)


def wrong(shared: Any, batch: tuple[str, ...]) -> list[str]:
    raise ValueError(f"of the worker, {batch[0]}")


def opened(mark: str, batch: tuple[str, ...]) -> list[int]:
    """Opens something once for all batches; with "hang" it never ends."""
    if not OPENED:
        OPENED.append(os.getpid())
        at_worker_exit(lambda: Path(mark, f"closed-{os.getpid()}").touch())
    Path(mark, f"opened-{os.getpid()}").touch()
    if "hang" in batch:
        time.sleep(600)
    return [os.getpid() for _ in batch]


def slow(seconds: float, batch: tuple[int, ...]) -> list[int]:
    time.sleep(seconds)
    return list(batch)
