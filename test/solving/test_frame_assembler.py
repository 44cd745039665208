"""Streams of single cameras become frames of the body, whatever the order of arrival."""

import numpy as np

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.frame_assembler import AssemblerSettings, FrameAssembler

MS = 1_000_000


def heard(camera: str, stamp_ms: int) -> LandmarkMatches:
    """A registration of which only camera and stamp matter."""
    return LandmarkMatches(
        camera, stamp_ms * MS, 0, np.zeros(0, np.uint32), np.zeros(0, np.uint32), np.zeros((0, 2), np.float32),
        np.zeros((0, 3), np.float32), None, np.zeros((6, 6)), np.eye(3), 0,
    )  # fmt: skip


def frames_of(messages: list[LandmarkMatches], cameras: str, **settings: float) -> list[tuple[int, str]]:
    """(stamp [ms], cameras) of all frames, those of the flush included."""
    assembler = FrameAssembler(cameras, AssemblerSettings(**settings))
    frames = [frame for message in messages for frame in assembler.add(message)] + assembler.flush()
    return [(frame.stamp_ns // MS, "".join(sorted(frame.matches))) for frame in frames]


def test_frames_do_not_depend_on_the_order_of_arrival() -> None:
    by_time = [heard(camera, stamp) for stamp in (0, 33, 66) for camera in "abc"]
    by_camera = [heard(camera, stamp) for camera in "abc" for stamp in (0, 33, 66)]
    assert frames_of(by_time, "abc") == frames_of(by_camera, "abc") == [(0, "abc"), (33, "abc"), (66, "abc")]


def test_stamps_within_the_tolerance_are_one_instant() -> None:
    messages = [heard("a", 0), heard("b", 5), heard("a", 33), heard("b", 50)]
    assert frames_of(messages, "ab") == [(0, "ab"), (33, "a"), (50, "b")]


def test_a_missing_image_does_not_hold_the_others_up() -> None:
    assembler = FrameAssembler("ab")
    assert assembler.add(heard("a", 0)) == []
    assert [f.stamp_ns for f in assembler.add(heard("b", 33))] == [0]


def test_a_silent_camera_is_waited_for_and_then_left_behind() -> None:
    assembler = FrameAssembler("ab", AssemblerSettings(max_wait=0.1))
    frames = [frame for stamp in range(0, 400, 33) for frame in assembler.add(heard("a", stamp))]
    assert [frame.stamp_ns // MS for frame in frames] == list(range(0, 270, 33))
    assert assembler.add(heard("b", 0)) == []
    assert assembler.late == 1


def test_cameras_that_nobody_waits_for_are_ignored() -> None:
    assert FrameAssembler("ab").add(heard("x", 0)) == []
