"""Run batches on the workers of a Dask scheduler, wherever they are."""

import logging
import re
import socket
from asyncio import CancelledError as AsyncCancelledError
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from threading import Event
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

from scenarios.files.errors import ScenarioError
from scenarios.jobs.bitwise_compatibility import bit_differences, bit_fingerprint
from scenarios.jobs.executor import RESUME, DeadWorkerError, Executor, LostError

if TYPE_CHECKING:
    from distributed import Client, Future

ADDRESS = re.compile(r"(?:tcp|tls)://(?:\[[0-9A-Fa-f:.%\w]+\]|[\w.-]+):([0-9]{1,5})", re.ASCII)
"""Address of a scheduler."""

CONNECT = 5.0
"""Time for a scheduler to answer for the first time, s."""

PAUSE = 1.0
"""Time between attempts to reach a scheduler that has gone, s."""

LOOK = 2.0
"""Time between looks at scheduler and workers, s."""

GONE = (OSError, TimeoutError, CancelledError, AsyncCancelledError)
"""Errors that Dask raises when the scheduler or a worker is lost."""


class Cluster(Executor["Future"]):
    """Runs batches on the workers of a Dask scheduler.

    Batches and results travel; no folder is shared. Workers must run the same software, on processors that round alike,
    so that results have the same bits wherever they were computed.

    Args:
        address: Of the scheduler, ``"tcp://host:8786"``.
        patience: How long a scheduler that has gone, or missing workers, are waited for, s.
        report: Called with a line on what is waited for.

    Raises:
        ScenarioError: No address, Dask is not installed, no certificates for TLS, or a negative time.
    """

    local = False

    def __init__(self, address: str, patience: float = 300.0, report: Callable[[str], None] = lambda _: None) -> None:
        match = ADDRESS.fullmatch(address)
        if match is None or not 1 <= int(match[1]) < 2**16:
            raise ScenarioError(
                f"cluster {address[:100]!r} given, expected the address of a Dask scheduler as 'dask scheduler' "
                "prints it, such as tcp://127.0.0.1:8786"
            )
        try:
            from distributed.security import Security
        except ImportError as error:
            raise ScenarioError("--cluster needs Dask distributed: pip install 'hmtb-twin[cluster]'") from error
        try:
            secured = not address.startswith("tls:") or Security().get_connection_args("client")["ssl_context"]
        except OSError as error:
            raise ScenarioError(f"the certificates in Dask's configuration cannot be read: {error}") from error
        if not secured:
            raise ScenarioError(
                f"{address} without certificates; expected distributed.comm.tls.ca-file, .client.cert and .client.key "
                "in Dask's configuration, or in DASK_DISTRIBUTED__COMM__TLS__CA_FILE and so on"
            )
        if not patience >= 0.0:
            raise ScenarioError(f"patience = {patience} given, expected 0 s or more")
        super().__init__(report)
        self._address, self._patience = address, patience
        self._client: Client | None = None
        # The first look is due at once.
        self._looked = -LOOK
        self._news = Event()

    def _room(self) -> int:
        if self._client is None:
            # Dask logs every lost connection, which `report` tells in one line.
            for name in ("distributed", *logging.root.manager.loggerDict):
                if name.split(".")[0] == "distributed":
                    logging.getLogger(name).setLevel(logging.CRITICAL)
            timeout = min(CONNECT, self._patience)
            try:
                self._connect(timeout)
            except (OSError, ValueError) as error:
                why = (str(error).splitlines() or [type(error).__name__])[0]
                raise ScenarioError(
                    f"no Dask scheduler answers at {self._address!r} within {timeout:g} s ({why}); expected "
                    "an address as 'dask scheduler' prints it, such as tcp://127.0.0.1:8786"
                ) from error
        if monotonic() - self._looked >= LOOK:
            self.workers = self._count_workers()
            self._looked = monotonic()
        return 2 * self.workers  # one batch runs, and one waits beside it

    def _submit(self, task: Callable[..., Any], shared: Any, batch: tuple[Any, ...]) -> "Future":
        assert self._client is not None  # noqa: S101 - _room has connected it
        # Results of equal batches differ in what clocks say: Dask must not reuse them.
        future = self._client.submit(_run_task, task, shared, batch, dict(bit_fingerprint()), pure=False)
        future.add_done_callback(lambda _: self._news.set())
        return future

    def _finished(self, running: Collection["Future"]) -> Collection["Future"]:
        self._news.wait(LOOK)
        self._news.clear()
        return [future for future in running if future.status != "pending"]

    def _results(self, handle: "Future") -> list[Any]:
        from distributed import KilledWorker

        try:
            if handle.status not in ("finished", "error"):
                raise LostError
            answer: list[Any] | Mapping[str, Any] = handle.result(timeout=600.0)
        except KilledWorker as error:
            raise DeadWorkerError from error
        except ImportError as error:
            answer = {"worker": "of the scheduler", "differences": [f"it cannot import {error.name}"]}
        except GONE as error:
            raise LostError from error
        finally:
            handle.release()
        if isinstance(answer, Mapping):
            raise ScenarioError(
                f"worker {answer['worker']} would compute other bits than this process: "
                f"{'; '.join(answer['differences'])}. Start workers with the same software, on processors of one kind; "
                f"{RESUME}"
            )
        return answer

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with suppress(*GONE):  # a scheduler that has gone answers no farewell
                client.close(timeout=PAUSE)

    def _connect(self, timeout: float) -> None:
        from distributed import Client

        self._close()
        end = monotonic() + timeout
        while True:
            try:
                _check_scheduler(self._address, timeout)
                break
            except OSError:  # one that has just been started does not listen yet
                if monotonic() >= end:
                    raise
                sleep(PAUSE / 4)
        # A client of the user's own stays Dask's default.
        self._client = Client(self._address, timeout=20.0, set_as_default=False)

    def _count_workers(self) -> int:
        """Number of workers, at least one; waits where there are none, or no scheduler."""
        begun, reported = monotonic(), ""
        while True:
            try:
                if self._client is None or self._client.status != "running":
                    self._connect(CONNECT)
                workers = len(self._client.nthreads()) if self._client is not None else 0
                missing = "has no workers"
            except GONE:
                workers, missing = 0, "has gone"
            if workers:
                if reported:
                    self._report(f"{workers} workers at {self._address}: work continues")
                return workers
            waited = monotonic() - begun
            if waited >= self._patience:
                raise ScenarioError(
                    f"the scheduler at {self._address} {missing}; waited for {self._patience:g} s; {RESUME}"
                )
            if missing != reported:
                self._report(
                    f"the scheduler at {self._address} {missing}; waiting up to {self._patience - waited:.0f} s"
                )
                reported = missing
            sleep(min(PAUSE, self._patience))


def worker_threads() -> int | None:
    """Threads of the Dask worker that runs this task; None in any other process."""
    try:
        from distributed import get_worker

        return int(get_worker().state.nthreads)
    except (ImportError, ValueError):
        return None


def _run_task(
    task: Callable[..., Any], shared: Any, batch: tuple[Any, ...], expected: Mapping[str, str]
) -> list[Any] | dict[str, Any]:
    """Run a batch on a Dask worker, unless its bits would differ."""
    if differences := bit_differences(expected):
        from distributed import get_worker

        return {"differences": differences, "worker": get_worker().address}
    return list(task(shared, batch))


def _check_scheduler(address: str, timeout: float) -> None:
    """Raise `OSError` for what is no scheduler: Dask's client waits without end for one that says nothing."""
    from distributed.comm.addressing import get_address_host_port, parse_address

    with socket.create_connection(get_address_host_port(address, strict=True), timeout=timeout) as connection:
        # Under TLS nobody speaks before the handshake, which is left to Dask's client.
        if parse_address(address)[0] != "tcp":
            return
        with connection.makefile("rb") as stream:
            greeting = stream.read(8)
    # Dask's messages begin with their length in bytes; a scheduler's first one is short.
    if len(greeting) < 8 or not 0 < int.from_bytes(greeting, "little") < 2**20:
        raise ConnectionError("it is no Dask scheduler")
