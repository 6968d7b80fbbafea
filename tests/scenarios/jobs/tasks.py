"""Tasks for worker processes: they import next to nothing."""

import os
import time
from pathlib import Path

from scenarios.jobs.executor import at_worker_exit

OPENED: list[int] = []


def double(shared, batch):
    return [shared * item for item in batch]


def mortal(marks, batch):
    """Kills its worker at "always", and at "once" the first time."""
    for item in batch:
        mark = Path(marks, item)
        if item.startswith("always") or (item.startswith("once") and not mark.exists()):
            mark.touch()
            os._exit(7)
    return list(batch)


def wrong(shared, batch):
    raise ValueError(f"of the worker, {batch[0]}")


def opened(mark, batch):
    """Opens something once for all batches; with "hang" it never ends."""
    if not OPENED:
        OPENED.append(os.getpid())
        at_worker_exit(lambda: Path(mark, f"closed-{os.getpid()}").touch())
    Path(mark, f"opened-{os.getpid()}").touch()
    if "hang" in batch:
        time.sleep(600)
    return [os.getpid() for _ in batch]


def slow(seconds, batch):
    time.sleep(seconds)
    return list(batch)
