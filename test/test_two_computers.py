"""The computers of the tests: apart, connected, and with a wire that loses and delays what it is told to."""

import re
import sys
import time
from pathlib import Path

import pytest
from two_computers import two_computers, why_not

ECHO = """
import socket, sys
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
    back.bind((sys.argv[1], 5000))
    print('up', flush=True)
    while True:
        back.sendto(*back.recvfrom(70000))
"""
ASK = """
import socket, sys, time
came, shortest_s = 0, 9.0
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ask:
    ask.settimeout(0.15)
    for number in range(60):
        begun_s = time.monotonic()
        ask.sendto(bytes(int(sys.argv[2])), (sys.argv[1], 5000))
        try:
            ask.recv(70000)
        except TimeoutError:
            continue
        came, shortest_s = came + 1, min(shortest_s, time.monotonic() - begun_s)
print(came, shortest_s)
"""


@pytest.mark.skipif(bool(why_not()), reason=why_not())
@pytest.mark.parametrize(("loss", "delay_s", "bytes_sent"), [(0.0, 0.0, 8000), (0.0, 0.02, 8000), (0.2, 0.01, 100)])
def test_the_wire_does_as_it_is_told(loss: float, delay_s: float, bytes_sent: int, tmp_path: Path) -> None:
    with two_computers(loss=loss, delay_s=delay_s) as (worn, desk):
        assert (worn.run("hostname").strip(), desk.run("hostname").strip()) == ("worn", "desk")
        assert re.search(rf"{worn.address}/24.* wire", worn.run("ip", "-o", "address"))
        assert worn.run("ls", "/dev/shm") == ""
        back = desk.start([sys.executable, "-c", ECHO, desk.address], tmp_path / "echo", {})
        while (tmp_path / "echo").read_text() != "up\n":
            assert back.poll() is None
            time.sleep(0.02)
        came, shortest_s = map(float, worn.run(sys.executable, "-c", ASK, desk.address, str(bytes_sent)).split())
        back.kill()
        back.wait()
    # Two of three frames come back where a fifth is lost each way: four standard deviations of sixty are 15.
    assert came >= 55 if loss == 0.0 else 23 <= came <= 53
    assert shortest_s >= 2 * delay_s
