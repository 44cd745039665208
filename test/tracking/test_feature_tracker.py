"""The tracker on images of a world that only turns, where the truth is known to a fraction of a pixel."""

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.tracking.feature_tracker import FeatureTracker

STEP_NS = 33_000_000


@pytest.fixture(scope="module")
def camera() -> CameraModel:
    """A fisheye of 150 degrees."""
    k = [120.0, 0, 160, 0, 120.0, 120, 0, 0, 1]
    return camera_from_info("fisheye", 320, 240, "equidistant", [-0.014, 0.004, -0.0015, 0.0004], k)


@pytest.fixture(scope="module")
def panorama() -> np.ndarray:
    """A world at infinity: blurred noise on a sphere, by longitude and latitude."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.random((1000, 2000)).astype(np.float32), (0, 0), 5)
    return cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def look(panorama: np.ndarray, camera: CameraModel, world_R_camera: np.ndarray) -> np.ndarray:
    """The image that the camera sees of the panorama."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    bearings, valid = camera.unproject(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
    world = np.where(valid[:, None], bearings, [0, 0, 1]) @ world_R_camera.T
    height, width = panorama.shape
    longitude = (np.arctan2(world[:, 0], world[:, 2]) / (2 * np.pi) + 0.5) * width
    latitude = (np.arcsin(np.clip(world[:, 1], -1, 1)) / np.pi + 0.5) * height
    shape = (camera.height, camera.width)
    x, y = longitude.astype(np.float32).reshape(shape), latitude.astype(np.float32).reshape(shape)
    return cv2.remap(panorama, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)


def turn(frame: int) -> np.ndarray:
    """world_R_camera of a frame: a few degrees a frame about a changing axis."""
    return exp_so3(np.array([0.02 * frame, 0.3 * np.sin(0.15 * frame), 0.03 * frame]))


def test_tracks_and_rotation_follow_the_world(camera: CameraModel, panorama: np.ndarray) -> None:
    tracker = FeatureTracker(camera)
    born: dict[int, np.ndarray] = {}
    errors_px = []
    for index in range(15):
        frame = tracker.track(look(panorama, camera, turn(index)), (index + 1) * STEP_NS)
        if index:
            truth = turn(index).T @ turn(index - 1)
            assert frame.rotation_inliers > 0.8 * len(frame.track_ids) - frame.keyframe * len(frame.described)
            assert np.degrees(np.linalg.norm(log_so3(truth.T @ frame.current_R_previous))) < 0.05
            assert frame.previous_stamp_ns == index * STEP_NS
        bearings, _ = camera.unproject(frame.pixels.astype(float))
        for track, pixel, bearing in zip(frame.track_ids.tolist(), frame.pixels, bearings, strict=True):
            world = born.setdefault(track, turn(index) @ bearing)
            expected, valid = camera.project((turn(index).T @ world)[None])
            if valid[0]:
                errors_px.append(np.linalg.norm(expected[0] - pixel))
    assert np.median(errors_px) < 0.3
    assert np.percentile(errors_px, 99) < 1.5


def test_a_grey_image_loses_the_tracks_and_a_new_one_finds_others(camera: CameraModel, panorama: np.ndarray) -> None:
    tracker = FeatureTracker(camera)
    image = look(panorama, camera, turn(0))
    before = tracker.track(image, STEP_NS)
    grey = tracker.track(np.full_like(image, 128), 2 * STEP_NS)
    assert len(before.track_ids) > 50
    assert len(grey.track_ids) == 0
    assert grey.rotation_inliers == 0
    frames = [tracker.track(image, (3 + k) * STEP_NS) for k in range(4)]
    assert len(frames[-1].track_ids) > 50
    assert not set(frames[-1].track_ids.tolist()) & set(before.track_ids.tolist())


def test_wrong_size_and_stamps_that_do_not_advance_are_named(camera: CameraModel, panorama: np.ndarray) -> None:
    tracker = FeatureTracker(camera)
    image = look(panorama, camera, turn(0))
    with naming(RecordingError, "fisheye", "200 x 100", "320 x 240"):
        tracker.track(np.zeros((100, 200), np.uint8), STEP_NS)
    tracker.track(image, 5 * STEP_NS)
    with naming(RecordingError, "fisheye"):
        tracker.track(image, 4 * STEP_NS)
    assert len(tracker.track(image, 6 * STEP_NS).track_ids) > 50


def test_tracks_survive_images_that_are_missing_while_the_camera_turns(
    camera: CameraModel, panorama: np.ndarray
) -> None:
    tracker = FeatureTracker(camera)
    for index in (0, 1, 2, 7):
        frame = tracker.track(look(panorama, camera, exp_so3(np.array([0.0, 0.1 * index, 0.0]))), (index + 1) * STEP_NS)
    truth = exp_so3(np.array([0.0, -0.5, 0.0]))
    assert frame.rotation_inliers > 50
    assert np.degrees(np.linalg.norm(log_so3(truth.T @ frame.current_R_previous))) < 0.05
