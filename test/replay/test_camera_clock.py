"""What the stamps of cameras say: the remarks that follow a replay's table."""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.replay.camera_clock import CameraClocks

FRAME_NS = 33_333_333
CAMERAS = ("head", "hip", "knee", "toe")
FRAMES = np.arange(300) * FRAME_NS + 1_700_000_000_000_000_000


def remarks(stamps: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    clocks = CameraClocks(CAMERAS)
    for camera in CAMERAS:
        for stamp_ns in stamps.get(camera, FRAMES):
            clocks.add(camera, int(stamp_ns))
    return clocks.remarks()


def test_cameras_of_one_trigger_are_not_spoken_of() -> None:
    jitter = np.random.default_rng(4).normal(0, 300_000, len(FRAMES))
    assert remarks({}) == ()
    assert remarks({"knee": FRAMES + jitter.astype(np.int64)}) == ()
    assert remarks({"knee": FRAMES[::3], "hip": np.delete(FRAMES, slice(100, 200))}) == ()


def test_a_camera_that_is_silent_is_named() -> None:
    assert remarks({"toe": FRAMES[:0]}) == ("camera toe: no image of it could be used",)


def test_a_camera_that_is_there_for_a_part_is_named() -> None:
    assert remarks({"hip": FRAMES[:200], "knee": FRAMES[60:]}) == (
        "camera hip: ends 3.3 s before the others",
        "camera knee: begins 2.0 s after the others",
    )


def test_a_clock_of_another_time_is_named_with_its_size() -> None:
    (line,) = remarks({"toe": FRAMES + 3_600_000_000_000})
    assert line.startswith("camera toe: its stamps are 3600.0 s ahead of the others'")
    (line,) = remarks({"toe": FRAMES - 3_600_000_000_000})
    assert line.startswith("camera toe: its stamps are 3600.0 s behind the others'")


def test_cameras_that_run_free_are_not_spoken_of() -> None:
    assert remarks({"hip": FRAMES + 10_000_000, "knee": FRAMES - 12_000_000}) == ()
    free = FRAMES[0] + (np.arange(280) * 1.07 * FRAME_NS).astype(np.int64)
    assert remarks({"head": free}) == ()


def test_one_camera_has_nobody_to_be_compared_with() -> None:
    clocks = CameraClocks(["head"])
    clocks.add("head", 5)
    assert clocks.remarks() == ()
