"""The discovery server is found where it is, and started so that it finds its libraries."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bodycam_ros.cli.main import main
from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.discovery_server import discovery_server, servers_named

_WAIT_S = 20.0


def test_the_wheels_server_runs_and_ends(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "discovery", "127.0.0.1", "--port", str(port)]
    bare = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    with (tmp_path / "said").open("w+") as said:
        server = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT, env=bare)
        try:
            deadline_s = time.monotonic() + _WAIT_S
            while f"[127.0.0.1]:{port}" not in (text := (tmp_path / "said").read_text()):
                assert server.poll() is None, text
                assert time.monotonic() < deadline_s, text
                time.sleep(0.05)
            server.send_signal(signal.SIGINT)
            assert server.wait(_WAIT_S) == 0
        finally:
            server.kill()
    assert f"export ROS_DISCOVERY_SERVER='127.0.0.1:{port}'" in text
    assert "Server ID:          0" in text


def test_a_ros_installation_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "fast-discovery-server"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("LD_LIBRARY_PATH", "/sourced")
    server = discovery_server("10.0.0.1", 11812, 2, prefix=tmp_path / "without_wheels")
    wanted = ("--server-id", "2", "--udp-address", "10.0.0.1", "--udp-port", "11812")
    assert server.command == (str(program), *wanted)
    assert server.environment()["LD_LIBRARY_PATH"] == "/sourced"


def test_where_there_is_none_it_is_said_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BodycamError, match=r"no fast-discovery-server here: 'make latency' installs"):
        discovery_server("10.0.0.1", prefix=tmp_path)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("192.0.2.1", "on 192.0.2.1:{port}: it is not an address of this computer"),
        ("no.such.name.invalid", "'no.such.name.invalid' is no IPv4 address, nor a name"),
        ("::1", "'::1' is no IPv4 address"),
        ("127.0.0.1", "on 127.0.0.1:{port}: the port is taken; a server may be running already"),
    ],
)
def test_where_nobody_could_reach_it_none_is_started(
    address: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert main(["discovery", address, "--port", str(port)]) == 1
    assert said.format(port=port) in capsys.readouterr().err


@pytest.mark.parametrize(("number", "named"), [(0, "a:11811"), (2, ";;a:11811")])
def test_a_server_has_its_place_in_the_list(number: int, named: str) -> None:
    assert servers_named("a", number=number) == named


@pytest.mark.parametrize("wrong", [["--port", "0"], ["--port", "65536"], ["--id", "255"], []])
def test_wrong_usage_is_refused(wrong: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["discovery", *(["127.0.0.1"] if wrong else []), *wrong])
    assert ended.value.code == 2
    assert "must be" in capsys.readouterr().err or not wrong
