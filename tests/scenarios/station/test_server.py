import http.client
import socket

import psutil

from scenarios.station.server import LOOPBACK, close_server, open_server
from tests.refusals import refused


def status(port, **headers):
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=10)
    connection.putrequest("GET", "/", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    try:
        return connection.getresponse().status
    finally:
        connection.close()


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
}


def test_only_its_own_page_is_answered(served):
    port = served.server.get_port()
    own = f"{LOOPBACK}:{port}"
    assert status(port) == status(port, Host=f"localhost:{port}") == status(port, Origin=f"http://{own}") == 200
    for foreign in ("evil.example", f"evil.example:{port}", LOOPBACK, f"{LOOPBACK}:1", ""):
        assert status(port, Host=foreign) == 403, foreign
    for foreign in ("http://evil.example", f"https://{own}", "null", f"http://{LOOPBACK}"):
        assert status(port, Origin=foreign) == 403, foreign
        assert status(port, Origin=foreign, **UPGRADE) == 403, foreign


def test_nothing_listens_beyond_the_loopback_address(served):
    listening = [one.laddr for one in psutil.Process().net_connections("tcp") if one.status == psutil.CONN_LISTEN]
    assert [address.ip for address in listening if address.port == served.server.get_port()] == [LOOPBACK]


def test_nobody_gets_a_tunnel_to_the_internet(served):
    assert served.server.request_share_url() is None


def test_a_port_that_is_taken_or_none_is_refused():
    with socket.socket() as other:
        other.bind((LOOPBACK, 0))
        other.listen()
        refused("is taken", lambda: open_server(other.getsockname()[1]))
    refused("expected 1 to 65535", lambda: open_server(70000))


def test_a_free_port_is_chosen_without_a_word(capsys):
    server = open_server()
    assert server.get_port() > 0
    close_server(server)
    assert capsys.readouterr().out == ""
