"""Cameras and trackers on one computer, registration and solver on another, in namespaces of the network."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from two_computers import Computer, two_computers, why_not

from bodycam_ros.recording.bag_file import BagFile

if TYPE_CHECKING:
    from graph_apart import RunApart

REPOSITORY = Path(__file__).parents[2]
BAGS = REPOSITORY / "bags"
SAMPLE = (BAGS / "sample/bag", BAGS / "map", BAGS / "body.yaml")
INSTANTS = 60
JPEG = bytes.fromhex("ffd8ffe0")
"""What every image of the sample begins with."""


@pytest.fixture
def computers() -> Iterator[tuple[Computer, Computer]]:
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    if reason := why_not():
        pytest.skip(reason)
    with two_computers() as both:
        yield both


@contextmanager
def no_images_on_the_wire(computer: Computer) -> Iterator[None]:
    counting = computer.start_counting(JPEG)
    try:
        yield
        counting.terminate()
        assert int(counting.communicate(timeout=10.0)[0]) == 0, "images went over the wire"
    finally:
        counting.kill()
        counting.wait()


def check(run: "RunApart", cameras: Sequence[str]) -> None:
    """Tracks have travelled whole, images have stayed, and it is told where everything is."""
    assert set(run.exit_codes.values()) == {0}, run.said
    assert "Traceback" not in run.said
    assert (run.tracks.sent, run.tracks.heard) == 2 * (INSTANTS * len(cameras),), run.said
    for camera in cameras:
        way = run.diagnostics[f"registration: way of {camera}"]
        assert (way["hardware_id"], way["computer"], way["times lost"]) == ("desk", "worn", "0")
        # Both have the clock of this machine.
        assert abs(float(way["clock ahead by [ms]"])) <= float(way["clock ahead known to [ms]"])
        assert float(way["delay, median [ms]"]) > 0.0
        of_tracker = run.diagnostics[f"tracker_{camera}: camera {camera}"]
        assert (of_tracker["hardware_id"], of_tracker["computer"]) == ("worn", "worn")


def test_a_discovery_server_and_the_whole_graph(computers: tuple[Computer, Computer], tmp_path: Path) -> None:
    from graph_apart import run_apart

    cameras = ("waist_front", "thigh_left")
    with no_images_on_the_wire(computers[0]):
        run = run_apart(*computers, tmp_path, "server", *SAMPLE, cameras, rate=0.5)
    check(run, cameras)
    assert (run.landmarks.sent, run.landmarks.heard, run.instants) == (2 * INSTANTS, 2 * INSTANTS, INSTANTS), run.said


def test_unicast_peers(computers: tuple[Computer, Computer], tmp_path: Path) -> None:
    from graph_apart import run_apart

    with no_images_on_the_wire(computers[0]):
        run = run_apart(*computers, tmp_path, "peers", *SAMPLE, ("head",), rate=0.5, solves=False)
    check(run, ("head",))


def test_images_on_the_wire_would_be_seen(computers: tuple[Computer, Computer]) -> None:
    """What the other tests rely on: a JPEG of the sample, sent as Fast DDS sends messages."""
    worn, desk = computers
    with BagFile(SAMPLE[0]) as bag:
        topics = {topic: kind for topic, kind in bag.topics.items() if topic == "/head/image_raw/compressed"}
        (image, *_) = (bytes(message.data) for _, _, message in bag.messages(topics))
    counting = desk.start_counting(JPEG)
    send = f"import socket; socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto({image!r}, ({desk.address!r}, 9))"
    worn.run(sys.executable, "-c", send)
    time.sleep(0.2)
    counting.terminate()
    assert int(counting.communicate(timeout=10.0)[0]) >= 1
