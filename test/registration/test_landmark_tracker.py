"""Landmarks found directly in the images of the sample: they take over, hold, fail and come back."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.reprojection import reprojection_errors
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.geometry import inverse, log_se3, log_so3
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.direct_registration import DirectSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame

CAMERA = "shin_left"
IMAGES = 25

Images = list[tuple[NDArray[np.uint8], int]]
Said = list[tuple[TrackFrame, LandmarkMatches]]


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="module")
def seen(sample: Path) -> tuple[CameraModel, Images]:
    with open_recording(sample / "sample" / "bag") as recording:
        camera = recording.camera_model(CAMERA)
        images = [image for image, _ in zip(recording.images([CAMERA]), range(IMAGES), strict=False)]
    return camera, [(decode_grey(image), image.stamp_ns) for image in images]


@pytest.fixture(scope="module")
def said(reference_map: ReferenceMap, seen: tuple[CameraModel, Images]) -> Said:
    return run(reference_map, seen[0], seen[1])


def run(
    reference_map: ReferenceMap,
    camera: CameraModel,
    images: Iterable[tuple[NDArray[np.uint8], int]],
    settings: PipelineSettings | None = None,
    turn: CameraTurn | None = None,
) -> Said:
    settings = settings or PipelineSettings()
    front = CameraFront(camera, reference_map, settings, turn=turn)
    said: Said = []
    for image, stamp_ns in images:
        frame, matches, _ = front.process(image, stamp_ns)
        said.append((frame, matches))
    return said


def is_direct(frame: TrackFrame) -> bool:
    return frame.landmark_ids is not None and bool((frame.landmark_ids != NO_LANDMARK).all())


def apart(first: NDArray[np.float64], second: NDArray[np.float64]) -> tuple[float, float]:
    """Angle [deg] and distance [m] of two poses."""
    step = log_se3(inverse(first) @ second)
    return float(np.degrees(np.linalg.norm(step[:3]))), float(np.linalg.norm(step[3:]))


def test_landmarks_take_over_after_the_first_image_and_descriptors_are_left_alone(said: Said) -> None:
    frames = [frame for frame, _ in said]
    assert frames[0].keyframe and frames[0].landmark_ids is None
    assert sum(is_direct(frame) for frame in frames) >= IMAGES - 3
    assert sum(frame.keyframe for frame in frames) <= 2
    for frame, matches in said[1:]:
        if not is_direct(frame):
            continue
        assert len(frame.described) == 0 and frame.rotation_inliers == len(frame.track_ids) >= 24
        assert (np.diff(frame.track_ids.astype(np.int64)) > 0).all()
        assert matches.world_T_camera is not None
        assert set(matches.track_ids.tolist()) <= set(frame.track_ids.tolist())
    assert [frame.previous_stamp_ns for frame in frames[1:]] == [frame.stamp_ns for frame in frames[:-1]]


def test_poses_agree_with_descriptors_and_pixels_are_nearer(reference_map, seen, said) -> None:
    camera, images = seen
    features = PipelineSettings(direct=DirectSettings(enabled=False))
    of_features = run(reference_map, camera, images, features)
    ours, theirs = [], []
    for (frame, matches), (_, other) in zip(said, of_features, strict=True):
        degrees, metres = apart(other.world_T_camera, matches.world_T_camera)
        assert degrees < 0.4 and metres < 0.025
        if is_direct(frame):
            ours.append(reprojection_errors(camera, matches.points_world, matches.pixels, matches.world_T_camera))
            theirs.append(reprojection_errors(camera, other.points_world, other.pixels, other.world_T_camera))
    assert np.median(np.concatenate(ours)) < 0.8 * np.median(np.concatenate(theirs))


def test_an_image_that_shows_nothing_ends_it_and_the_next_ones_bring_it_back(reference_map, seen) -> None:
    camera, images = seen
    dark = [(np.zeros_like(image) if 8 <= n < 11 else image, stamp) for n, (image, stamp) in enumerate(images)]
    said = run(reference_map, camera, dark)
    assert is_direct(said[7][0])
    for frame, matches in said[8:11]:
        assert not is_direct(frame) and matches.world_T_camera is None
    back = [n for n, (frame, _) in enumerate(said) if n > 10 and is_direct(frame)]
    assert back and back[0] <= 16
    assert any(frame.keyframe for frame, _ in said[11 : back[0]])
    assert all(matches.world_T_camera is not None for _, matches in said[back[0] :])


def painted(reference_map: ReferenceMap, share: float) -> ReferenceMap:
    """A map with something else over the left ``share`` of every photograph."""
    photographs = reference_map.photographs
    random = np.random.default_rng(1)
    width, height = photographs.cameras[0].width, photographs.cameras[0].height
    cover = cv2.resize(random.integers(0, 256, (height // 6, width // 6)).astype(np.uint8), (width, height))
    jpegs = []
    for jpeg in photographs.jpegs:
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        picture[:, : round(share * width)] = cover[:, : round(share * width)]
        jpegs.append(bytes(cv2.imencode(".jpg", picture)[1].tobytes()))
    return replace(reference_map, photographs=replace(photographs, jpegs=tuple(jpegs)))


def test_a_camera_stays_registered_where_a_part_of_the_world_changed(reference_map, seen, said) -> None:
    camera, images = seen
    changed = painted(reference_map, 0.3)
    of_changed = run(changed, camera, images)
    assert all(matches.world_T_camera is not None for _, matches in of_changed)
    assert sum(is_direct(frame) for frame, _ in of_changed) > 0.6 * IMAGES
    for (_, matches), (_, other) in zip(said, of_changed, strict=True):
        degrees, metres = apart(matches.world_T_camera, other.world_T_camera)
        assert degrees < 0.4 and metres < 0.025


def gyroscope(said: Said, flow_of_time: float = 1.0) -> CameraTurn:
    """A sensor that turns as the registered images do, 200 times a second; backwards in time if -1."""
    stamps_ns = np.array([frame.stamp_ns for frame, _ in said])
    R = np.array([matches.world_T_camera[:3, :3] for _, matches in said])
    rates = log_so3(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / (1e-9 * np.diff(stamps_ns))[:, None]
    at = np.arange(stamps_ns[0], stamps_ns[-1] + 1, 5_000_000)
    of_step = np.minimum(np.searchsorted(stamps_ns, at, side="right") - 1, len(rates) - 1)
    return CameraTurn(ImuCalibration(), ImuSamples(at, flow_of_time * rates[of_step], np.zeros((len(at), 3))))


def test_few_images_a_second_are_found_with_a_gyroscope_and_one_that_lies_does_no_harm(
    reference_map, seen, said
) -> None:
    camera, images = seen
    few = images[::6]
    alone, turned, lied_to = (
        run(reference_map, camera, few, turn=turn) for turn in (None, gyroscope(said), gyroscope(said, -1.0))
    )
    # The first images confirm the sensor.
    assert all(is_direct(frame) for frame, _ in turned[-2:]) and not any(is_direct(frame) for frame, _ in alone)
    for each, most_deg, most_m in ((turned[-2:], 0.05, 0.005), (lied_to, 0.2, 0.025)):
        for (_, matches), (_, truth) in zip(each, said[::6][-len(each) :], strict=True):
            degrees, metres = apart(matches.world_T_camera, truth.world_T_camera)
            assert degrees < most_deg and metres < most_m


def test_a_small_share_of_many_landmarks_does_not_do_without_features(reference_map, seen) -> None:
    camera, images = seen
    covered = [(image.copy(), stamp_ns) for image, stamp_ns in images]
    for row, (image, _) in enumerate(covered):
        image[:, : round(0.035 * row * camera.width)] = 128
    many = replace(PipelineSettings(), direct=DirectSettings(per_cell=8))
    frames = [frame for frame, _ in run(reference_map, camera, covered, many)]
    known = [0 if frame.landmark_ids is None else int((frame.landmark_ids != NO_LANDMARK).sum()) for frame in frames]
    assert all(is_direct(frame) for frame in frames[2:8])
    assert any(count > 24 and not is_direct(frame) for count, frame in zip(known, frames, strict=True))
