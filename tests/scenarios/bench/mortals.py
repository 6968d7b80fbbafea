"""Processes that die: they stand in for `scenarios.bench.worker.work`, and import next to nothing."""

import os
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple


class Deed(NamedTuple):
    problem: str
    draw: int
    mark: str = ""


def work(pipe: Connection, bench: None) -> None:
    while (deed := pipe.recv()) is not None:
        if deed.problem == "error":
            pipe.send(ValueError("of the worker"))
            continue
        if deed.problem == "always" or (deed.problem == "once" and not Path(deed.mark).exists()):
            if deed.mark:
                Path(deed.mark).touch()
            os._exit(7)
        pipe.send(f"{deed.problem} {deed.draw}")
        pipe.send(None)
