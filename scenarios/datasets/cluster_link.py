"""The way to a Dask scheduler: made, looked after, and made again when it has gone."""

import logging
import socket
import struct
from asyncio import CancelledError as AsyncCancelledError
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic, sleep
from types import TracebackType
from typing import TYPE_CHECKING, Any

from scenarios.files.errors import ScenarioError
from scenarios.jobs.bitwise_compatibility import kinship, strangeness

if TYPE_CHECKING:
    from distributed import Client, Future

FIRST = 5.0
"""How long a scheduler has to answer for the first time, s."""

HANDSHAKE = 20.0
"""How long a scheduler that listens may take to answer, s."""

PAUSE = 1.0
"""Between attempts to reach a scheduler that has gone, s."""

GATHER = 600.0
"""How long the answer of a task may be on its way, s."""

GREETING = struct.Struct("<Q")
"""Beginning of every message between Dask's processes: its length, in bytes."""

MOST_GREETING = 2**20
"""The first one is shorter, in bytes."""

INSTALL = "pip install 'hmtb-twin[cluster]'"

RESUME = "what is done is kept: the same command goes on from there"


class LostError(Exception):
    """The answer to a task will not come: scheduler or worker have gone."""


class Link:
    """The way to a scheduler.

    Args:
        address: Of the scheduler.
        patience: How long it and its workers are waited for once they have gone, s.
        said: Told in words what is waited for.
    """

    def __init__(self, address: str, patience: float, said: Callable[[str], None]) -> None:
        self.said = said
        self._address, self._patience = address, patience
        self._client: Client | None = None
        self._known: frozenset[str] = frozenset()
        self._stack = ExitStack()

    def __enter__(self) -> "Link":
        self._stack.enter_context(_quiet())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()
        self._stack.close()

    def connect(self) -> "Client":
        """Reach the scheduler for the first time.

        Raises:
            ScenarioError: The extra is not installed, or nobody answers within seconds.
        """
        require_dask()
        timeout = min(FIRST, self._patience)
        try:
            begun = monotonic()
            while True:
                try:
                    return self._reach()
                except OSError:
                    if monotonic() - begun >= timeout:
                        raise
                    sleep(PAUSE / 4)
        except (OSError, ValueError) as error:
            raise ScenarioError(
                f"no Dask scheduler answers at {self._address!r} within {timeout:g} s ({_short(error)}); expected an "
                "address as 'dask scheduler' says it, such as tcp://127.0.0.1:8786"
            ) from error

    def workers(self, client: "Client") -> tuple["Client", int]:
        """Count the workers, and look at those that are new; wait where there is none, or no scheduler.

        Args:
            client: The client that was used so far.

        Returns:
            The client to go on with, and how many workers there are, at least one.

        Raises:
            ScenarioError: Waited for longer than the patience lasts, or a worker's bits would differ.
        """
        begun, told = monotonic(), ""
        while True:
            here: frozenset[str] | None = None
            try:
                if client.status != "running":
                    client = self._reach()
                here = frozenset(client.nthreads())
                self._look_at(client, here - self._known)
                self._known = here
            except (OSError, TimeoutError, CancelledError, AsyncCancelledError):
                here = None
            if here:
                if told:
                    self.said(f"{len(here)} workers at {self._address}: it goes on")
                return client, len(here)
            missing = "has gone" if here is None else "has no workers"
            waited = monotonic() - begun
            if waited >= self._patience:
                raise ScenarioError(
                    f"the scheduler at {self._address} {missing}; waited for {self._patience:g} s; {RESUME}"
                )
            if missing != told:
                self.said(f"the scheduler at {self._address} {missing}; waiting up to {self._patience - waited:.0f} s")
                told = missing
            sleep(min(PAUSE, self._patience))

    def answer(self, future: "Future") -> Any:
        """What a task gave back; None where every worker that ran it died.

        Raises:
            LostError: It has to be sent anew.
            ScenarioError: The worker does not have this software.
        """
        from distributed import KilledWorker

        if future.status not in ("finished", "error"):
            raise LostError
        try:
            return future.result(timeout=GATHER)
        except KilledWorker:
            return None
        except ImportError as error:
            raise ScenarioError(self.strange("of the scheduler", (f"it cannot import {error.name}",))) from error
        except (OSError, TimeoutError, CancelledError, AsyncCancelledError) as error:
            raise LostError from error

    def strange(self, worker: str, differences: Sequence[str]) -> str:
        """The line about a worker whose bits would differ.

        Args:
            worker: Which one.
            differences: In what.
        """
        return (
            f"worker {worker} would make other bits than this process: "
            f"{'; '.join(differences)}. Start workers with the same software, on processors of one kind; {RESUME}"
        )

    def _look_at(self, client: "Client", new: frozenset[str]) -> None:
        if not new:
            return
        answers: Mapping[str, Any] = client.run(_kinship, workers=sorted(new), on_error="return")
        for worker, answer in sorted(answers.items()):
            if isinstance(answer, ImportError):
                raise ScenarioError(self.strange(worker, (f"it cannot import {answer.name}",)))
            # Of one that has died since there is nothing to say.
            if isinstance(answer, Mapping) and (differences := strangeness(kinship(), answer)):
                raise ScenarioError(self.strange(worker, differences))

    def _reach(self) -> "Client":
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port, parse_address

        self._close()
        self._known = frozenset()
        host, port = get_address_host_port(self._address, strict=True)
        # Dask takes its time to say that nobody listens, and far longer where something else does.
        with socket.create_connection((host, port), timeout=FIRST) as connection:
            if parse_address(self._address)[0] == "tcp":
                _check_greeting(connection)
        self._client = Client(self._address, timeout=HANDSHAKE, set_as_default=False)
        return self._client

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            # Where the scheduler has gone, there is nobody to say farewell to.
            with suppress(OSError, TimeoutError, CancelledError, AsyncCancelledError):
                client.close(timeout=PAUSE)


def require_dask() -> None:
    """Refuse to go on where the extra is not installed.

    Raises:
        ScenarioError: It is not.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise ScenarioError(f"--cluster needs Dask distributed: {INSTALL}") from error


def _kinship() -> dict[str, str]:
    return dict(kinship())


def _check_greeting(connection: socket.socket) -> None:
    """Refuse what is no scheduler: one says, unasked, how it talks, in a message that begins with its own length.

    Raises:
        OSError: Nothing comes, or something else.
    """
    head = b""
    while len(head) < GREETING.size:
        part = connection.recv(GREETING.size - len(head))
        if not part:
            raise ConnectionError("what listens there hangs up")
        head += part
    if not 0 < GREETING.unpack(head)[0] < MOST_GREETING:
        raise ConnectionError("what listens there is no Dask scheduler")


def _short(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask's own lines about what is told here in ours."""
    names = [name for name in ("distributed", *logging.root.manager.loggerDict) if name.split(".")[0] == "distributed"]
    before = {name: logging.getLogger(name).level for name in names}
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
