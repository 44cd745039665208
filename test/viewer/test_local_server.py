"""The server: for this machine only, on the port that was asked for, and for its own pages."""

import http.client
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from bodycam_ros.errors import ViewError
from bodycam_ros.viewer.server import HOST, LocalServer


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test")
    yield server
    server.stop()


def protocol(server: LocalServer) -> list[Subprotocol]:
    """What viser's page asks for."""
    import viser

    return [Subprotocol(f"viser-v{viser.__version__}")]


def test_it_listens_on_loopback_only(server: LocalServer) -> None:
    listening = Path("/proc/net/tcp").read_text() + Path("/proc/net/tcp6").read_text()
    bound = [line.split()[1] for line in listening.splitlines() if line.split()[3] == "0A"]
    assert [address for address in bound if address.endswith(f":{server.get_port():04X}")] == [
        f"0100007F:{server.get_port():04X}"
    ]
    connection = http.client.HTTPConnection(HOST, server.get_port(), timeout=30)
    connection.request("GET", "/")
    assert connection.getresponse().status == 200


_HALF_A_PAGE = """
import socket, time
from bodycam_ros.viewer.server import HOST, LocalServer
server = LocalServer(0, "test")
with socket.create_connection((HOST, server.get_port())) as page:
    page.sendall(b"GET / HTTP/1.1\\r\\nHost: half of a hea")
time.sleep(1.0)
server.stop()
"""


def test_a_page_that_is_closed_while_it_connects_is_no_news() -> None:
    ended = subprocess.run([sys.executable, "-c", _HALF_A_PAGE], capture_output=True, text=True, check=True)
    assert (ended.stdout, ended.stderr) == ("", "")


def test_pages_from_elsewhere_cannot_connect(server: LocalServer) -> None:
    address = server.address.replace("http", "ws")
    with pytest.raises(InvalidStatus, match="403"):
        connect(address, origin=Origin("https://example.org"), subprotocols=protocol(server))
    with pytest.raises(InvalidStatus, match="403"):  # a name that its owner lets point to this machine
        connect(address, origin=Origin(f"http://example.org:{server.get_port()}"), subprotocols=protocol(server))
    with connect(address, origin=Origin(server.address), subprotocols=protocol(server)) as page:
        assert page.recv(timeout=30)


def test_nothing_is_shared_through_others_servers(server: LocalServer) -> None:
    assert server.request_share_url() is None


def test_a_port_in_use_is_an_error_and_not_another_port() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ViewError, match=f"port {port} of this machine is in use.*--port"):
            LocalServer(port, "test")


@pytest.mark.parametrize("port", [-1, 70000])
def test_an_impossible_port_is_an_error(port: int) -> None:
    with pytest.raises(ViewError, match=f"port {port}: expected 0 .* to 65535"):
        LocalServer(port, "test")


def test_the_command_line_does_without_the_server_until_it_is_needed() -> None:
    code = (
        "import sys; from bodycam_ros.cli.main import make_parser; make_parser(['view']); print('viser' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
