"""The server: for this machine only, on the port that was asked for, and for its own pages."""

import http.client
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from helpers.naming import naming
from websockets.exceptions import ConnectionClosed
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


def received(server: LocalServer, origin: str, token: str) -> bytes:
    """What a page is sent first."""
    address = f"ws://{HOST}:{server.get_port()}/{token}"
    with connect(address, origin=Origin(origin), subprotocols=protocol(server)) as page:
        first = page.recv(timeout=30)
        assert isinstance(first, bytes)
        return first


def test_only_pages_of_its_own_origin_with_its_token_connect(server: LocalServer) -> None:
    port, token = server.get_port(), server.address.rpartition("/")[2]
    own = f"http://{HOST}:{port}"
    for name in (HOST, "localhost"):
        assert received(server, f"http://{name}:{port}", token)
    others = (
        "https://example.org",
        f"http://example.org:{port}",
        f"http://{HOST}:{port - 1}",
        "http://localhost",
        "null",
    )
    for origin, word in [*((origin, token) for origin in others), (own, ""), (own, token[:-1] + "x")]:
        with naming(ConnectionClosed, 1008, "bodycam view"):
            received(server, origin, word)
    assert not server.get_clients()


def test_what_a_page_sends_before_it_is_refused_changes_nothing(server: LocalServer) -> None:
    from viser._messages import GuiUpdateMessage

    done: list[str] = []
    choice = server.gui.add_dropdown("choice", ("left", "right"))
    server.on_input(choice, done.append)
    update = GuiUpdateMessage(uuid=choice._impl.uuid, updates={"value": "right"})
    address = f"ws://{HOST}:{server.get_port()}/"
    with (
        pytest.raises(ConnectionClosed),
        connect(address, origin=Origin(f"http://{HOST}:1"), subprotocols=protocol(server)) as page,
    ):
        page.send(_sent(update))
        page.recv(timeout=30)
    assert choice.value == "left" and not done


def test_a_value_that_an_input_cannot_have_is_taken_back(server: LocalServer) -> None:
    from viser._messages import GuiUpdateMessage

    done: list[object] = []
    inputs: list[tuple[Any, object, object]] = [
        (server.gui.add_dropdown("choice", ("left", "right")), "nobody's name", "right"),
        (server.gui.add_slider("seconds", 0.0, 2.0, 0.1, 0.0), float("nan"), 1.0),
        (server.gui.add_vector3("place", (0.0, 0.0, 0.0)), (1.0, 2.0), (1.0, 2.0, 3.0)),
    ]
    for handle, _, _ in inputs:
        server.on_input(handle, done.append)
    origin, subprotocols = Origin(server.address.split("/?")[0]), protocol(server)
    with connect(server.address.partition("=")[2], origin=origin, subprotocols=subprotocols) as page:
        _connected(page)
        for handle, *values in inputs:
            for value in values:
                page.send(_sent(GuiUpdateMessage(uuid=handle._impl.uuid, updates={"value": value})))
        for _ in inputs:
            server.act(30.0)
    assert done == ["right", 1.0, (1.0, 2.0, 3.0)]


def _connected(page: Any) -> None:
    """What viser's page sends at first; before it, nothing else of it counts."""
    from viser._messages import ViewerCameraMessage

    rest: dict[str, Any] = {name: 1.0 for name in ("fov", "near", "far")} | {"image_height": 1, "image_width": 1}
    ones = dict.fromkeys(("position", "look_at", "up_direction"), (1.0, 1.0, 1.0))
    page.send(_sent(ViewerCameraMessage(wxyz=(1.0, 0.0, 0.0, 0.0), **ones, **rest)))


def _sent(message: Any) -> bytes:
    """A message as a page sends it."""
    return msgspec.msgpack.encode(message.as_serializable_dict([]))


def test_nothing_is_shared_through_others_servers(server: LocalServer) -> None:
    assert server.request_share_url() is None


def test_a_port_in_use_is_an_error_and_not_another_port() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        with naming(ViewError, f"port {port}", "--port"):
            LocalServer(port, "test")


@pytest.mark.parametrize("port", [-1, 70000])
def test_an_impossible_port_is_an_error(port: int) -> None:
    with naming(ViewError, f"port {port}", 65535):
        LocalServer(port, "test")


def test_the_command_line_does_without_the_server_until_it_is_needed() -> None:
    code = (
        "import sys; from bodycam_ros.cli.main import make_parser; make_parser(['view']); print('viser' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
