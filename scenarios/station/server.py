"""The page's server: on this machine alone, for the address that it printed and no other."""

import contextlib
import functools
import http
import io
import logging
import types
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    import viser

LOOPBACK = "127.0.0.1"
"""The only address that the station listens on."""

NOT_INSTALLED = (
    'the station needs viser: pip install "hmtb-twin[station]", or pip install -e ".[station]" in a checkout'
)
"""Advice where the extra is missing."""


def load_viser() -> types.ModuleType:
    """Import viser.

    Raises:
        ScenarioError: It is not installed.
    """
    try:
        import viser
        import viser.infra
    except ImportError as error:
        raise ScenarioError(NOT_INSTALLED) from error
    return viser


def is_own_page(headers: Any, port: int) -> bool:
    """Whether a request is for this station and comes from its own page or from no page at all.

    A page of another site that the same browser shows can reach the loopback address, by its number or by a name that
    it points there; its `Host` or its `Origin` tells.
    """
    own_hosts = [f"{name}:{port}" for name in (LOOPBACK, "localhost")]
    own_origins = [f"http://{host}" for host in own_hosts]
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    # Two hosts are a forgery: servers and proxies differ in which of them they take.
    return len(hosts) == 1 and hosts[0] in own_hosts and all(origin in own_origins for origin in origins)


@contextlib.contextmanager
def _guarded() -> Iterator[None]:
    """Let viser start a server that answers no foreign page; viser itself has no option for it."""
    import websockets.asyncio.server as websockets_server

    class OwnPages(websockets_server.ServerConnection):
        async def handshake(
            self,
            process_request: Callable[..., Any] | None = None,
            process_response: Callable[..., Any] | None = None,
            server_header: str | None = None,
        ) -> None:
            def process(connection: Any, request: Any) -> Any:
                if not is_own_page(request.headers, self.local_address[1]):
                    return self.respond(http.HTTPStatus.FORBIDDEN, "this station answers its own page only\n")
                return None if process_request is None else process_request(connection, request)

            await super().handshake(process, process_response, server_header)

    serve = websockets_server.serve
    websockets_server.serve = functools.partial(serve, create_connection=OwnPages)  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]


def open_server(port: int = 0) -> "viser.ViserServer":
    """Start a viser server on the loopback address.

    Args:
        port: The port; 0 takes a free one.

    Raises:
        ScenarioError: viser is not installed, or the port is taken or none.
    """
    if not 0 <= port <= 65535:
        raise ScenarioError(f"port {port} given, expected 1 to 65535, or 0 for a free one")
    # What a broken or foreign client sends ends its connection; its traceback is no news for the terminal.
    logging.getLogger("websockets.server").addHandler(logging.NullHandler())
    with _guarded(), contextlib.redirect_stdout(io.StringIO()):
        server: viser.ViserServer = load_viser().ViserServer(
            host=LOOPBACK, port=port, label="HMTB station", verbose=False
        )
    # viser takes the next free port where this one is taken: the printed address would be another than the user's.
    if port and server.get_port() != port:
        close_server(server)
        raise ScenarioError(f"port {port} is taken; expected a free one, or 0 to have one chosen")
    # viser's tunnel would show the page to the internet: any browser may ask for it, nobody gets it.
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
    return server


def close_server(server: "viser.ViserServer") -> None:
    """Stop the server without a word of its own on the terminal."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
