"""What the body of one pass tells the registrars of the next, and when."""

from dataclasses import replace

import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS

from bodycam_ros.replay.body_feedback import BodyHints
from bodycam_ros.solving.expected_cameras import ExpectedCamera


class Heard:
    """Notes what a camera's pipeline is told, in the order of its images."""

    def __init__(self) -> None:
        self.events: list[tuple[str, int]] = []

    def expect(self, expected: ExpectedCamera) -> None:
        self.events.append(("expect", expected.stamp_ns))

    def doubt(self, stamp_ns: int) -> None:
        self.events.append(("doubt", stamp_ns))


def stamp(number: int) -> int:
    return START_NS + number * FRAME_NS


def expected(number: int) -> ExpectedCamera:
    return ExpectedCamera("shin", stamp(number), np.eye(4), np.eye(6))


@pytest.mark.parametrize("ahead_ns", [0, 4_000_000, -4_000_000])
def test_hints_come_with_their_images(ahead_ns: int) -> None:
    """Where a camera is expected is said before its image; what is doubted is what it said of the image before."""
    hints = BodyHints(
        {"shin": tuple(replace(expected(n), stamp_ns=stamp(n) + ahead_ns) for n in (3, 4))},
        {"shin": ((stamp(6) + ahead_ns, stamp(8)),)},
    )
    told, heard = hints.of("shin"), Heard()
    for number in range(10):
        told.tell(heard, stamp(number))
        heard.events.append(("image", number))
    events = [(what, value) for what, value in heard.events if what == "image"]
    assert events == [("image", number) for number in range(10)]
    order = [what if what != "image" else value for what, value in heard.events]
    assert order == [0, 1, 2, "expect", 3, "expect", 4, 5, 6, "doubt", 7, 8, 9]


def test_a_camera_that_nobody_speaks_of_hears_nothing() -> None:
    heard = Heard()
    BodyHints({"shin": (expected(1),)}, {"shin": ((stamp(1), stamp(2)),)}).of("waist").tell(heard, stamp(9))
    assert heard.events == []
