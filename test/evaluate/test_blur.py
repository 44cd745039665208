"""Blur by the tracks, registered share by blur, and brightness over time."""

from pathlib import Path

import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS, Walk, write_images, write_solved
from numpy.typing import NDArray

from bodycam_ros.evaluate import brightness as brightness_module
from bodycam_ros.evaluate.blur import blur_classes, image_motion
from bodycam_ros.evaluate.brightness import brightness
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.registration.camera_sight import CameraSight
from bodycam_ros.solved.camera_record import CameraRecord
from bodycam_ros.solved.image_motion import ImageMotion
from bodycam_ros.solved.solved_recording import read_solved


def record(motion: list[float], lost: tuple[int, ...] = ()) -> CameraRecord:
    """A camera whose picture moved so, and which was lost at some images."""
    poses = np.tile(np.eye(4), (len(motion), 1, 1))
    poses[list(lost)] = np.nan
    return CameraRecord(
        camera="waist",
        stamps_ns=START_NS + FRAME_NS * np.arange(len(motion)),
        tracks=np.full(len(motion), 50),
        landmarks=np.where(np.isnan(poses[:, 0, 0]), 0, 40),
        world_T_camera=poses,
        image_motion=np.array(motion),
        sights=np.where(np.isnan(poses[:, 0, 0]), CameraSight.BLIND, CameraSight.REGISTERED).astype(np.int8),
    )


def ids(*values: int) -> NDArray[np.uint32]:
    return np.array(values, np.uint32)


def test_motion_is_the_median_over_tracks_that_are_in_both_images() -> None:
    motion = ImageMotion()
    pixels = np.random.default_rng(0).uniform(0, 400, (8, 2)).astype(np.float32)
    assert np.isnan(motion.add(ids(1, 2, 3, 4, 5, 6, 7, 8), pixels))
    moved = pixels[1:] + np.array([3.0, 4.0], np.float32)
    moved[0] += 100.0  # one that slipped
    assert motion.add(ids(2, 3, 4, 5, 6, 7, 8), moved) == pytest.approx(5.0, abs=1e-3)
    assert np.isnan(motion.add(ids(20, 21, 22, 23, 24, 25), pixels[:6]))


def test_shares_are_by_class_and_images_without_tracks_count_with_their_neighbours() -> None:
    slow, fast = record([0.5] * 6 + [3.0, 3.0]), record([20.0, np.nan, 20.0, 20.0], lost=(1,))
    classes = {c.low_px: c for c in blur_classes((slow, fast))}
    assert sorted(classes) == [0.0, 2.0, 16.0]
    assert (classes[0.0].images, classes[0.0].registered) == (6, 1.0)
    assert (classes[16.0].images, classes[16.0].registered) == (4, 0.75)
    assert classes[16.0].landmarks == 40.0


def test_a_bag_without_tracks_has_no_classes() -> None:
    unknown = record([np.nan] * 3)
    assert np.isnan(image_motion(unknown)).all()
    assert blur_classes((unknown,)) == ()


def test_figures_say_how_pictures_moved(solved: Path) -> None:
    figures = summary(evaluate(solved))
    assert sum(blur["images"] for blur in figures["blur"]) == sum(c["images"] for c in figures["cameras"].values())


def test_light_that_halves_is_measured(walk: Walk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = read_solved(write_solved(walk, tmp_path / "out"))
    recording = write_images(tmp_path / "recording", ("waist", "shin"))
    middle_ns = (solved.start_ns + solved.end_ns) // 2

    def decoded(image: object) -> NDArray[np.uint8]:
        late = image.stamp_ns > middle_ns and image.camera == "shin"  # type: ignore[attr-defined]
        grey = np.full((48, 64), 60 if late else 120, np.uint8)
        grey[:6] = 255
        return grey

    monkeypatch.setattr(brightness_module, "decode_grey", decoded)
    light = brightness(solved, recording)
    assert light["waist"].range == pytest.approx(1.0)
    assert light["shin"].range == pytest.approx(2.0)
    assert light["shin"].saturated == pytest.approx(6 / 48)
    assert np.ptp(light["shin"].seconds) > 1.5
