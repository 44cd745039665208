"""Absolute registration of a real camera in the real map of the sample."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from helpers.reprojection import reprojection_errors

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.track_frame import TrackFrame

CAMERA = "shin_left"


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    """The sample's map."""
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="module")
def seen(sample: Path) -> tuple[CameraModel, list[TrackFrame]]:
    """A shin's camera and its tracks over the first 25 frames, none of them pruned."""
    with open_recording(sample / "sample" / "bag") as recording:
        camera = recording.camera_model(CAMERA)
        tracker = FeatureTracker(camera)
        images = [image for image, _ in zip(recording.images([CAMERA]), range(25), strict=False)]
    return camera, [tracker.track(decode_grey(image), image.stamp_ns) for image in images]


def without_names(frame: TrackFrame) -> TrackFrame:
    """The frame with its descriptors lost."""
    nothing = np.zeros(0, np.uint32)
    return dataclasses.replace(
        frame, described=nothing, descriptors=np.zeros((0, 128), np.uint8), scales=np.zeros(0, np.float32)
    )


def test_registers_from_nothing_and_tracks_carry_their_landmarks(reference_map, seen) -> None:
    camera, frames = seen
    registrar = CameraFront(camera, reference_map, PipelineSettings())
    names: dict[int, int] = {}
    for frame in frames:
        matches = registrar.register(frame)
        assert matches.world_T_camera is not None
        errors = reprojection_errors(camera, matches.points_world, matches.pixels, matches.world_T_camera)
        assert np.median(errors) < 1.2
        for track, landmark in zip(matches.track_ids.tolist(), matches.landmark_ids.tolist(), strict=True):
            assert names.setdefault(track, landmark) == landmark
        assert len(set(matches.landmark_ids.tolist())) == len(matches.landmark_ids)
    assert np.sqrt(np.diag(matches.pose_covariance)[3:]).max() < 0.01


def test_a_lost_camera_comes_back_at_the_next_keyframe(reference_map, seen) -> None:
    camera, frames = seen
    registrar = CameraFront(camera, reference_map, PipelineSettings())
    registrar.register(frames[0])
    blind = without_names(frames[1])
    empty = dataclasses.replace(
        blind, track_ids=blind.track_ids[:0], pixels=blind.pixels[:0], stamp_ns=frames[1].stamp_ns, rotation_inliers=0
    )
    assert registrar.register(empty).world_T_camera is None
    keyframe = next(frame for frame in frames[2:] if frame.keyframe)
    assert registrar.register(keyframe).world_T_camera is not None


def test_a_map_of_noise_registers_nothing(reference_map, seen) -> None:
    camera, frames = seen
    rng = np.random.default_rng(0)
    noise = dataclasses.replace(
        reference_map, descriptors=rng.integers(0, 100, reference_map.descriptors.shape).astype(np.uint8)
    )
    registrar = CameraFront(camera, noise, PipelineSettings())
    assert [registrar.register(frame).world_T_camera for frame in frames] == [None] * len(frames)


def described(frame: TrackFrame, keyframe: TrackFrame) -> TrackFrame:
    """The frame with the descriptors that its tracks had on a keyframe."""
    began = keyframe.track_ids[keyframe.described]
    _, rows, of = np.intersect1d(frame.track_ids, began, assume_unique=True, return_indices=True)
    return dataclasses.replace(
        frame, described=rows.astype(np.uint32), descriptors=keyframe.descriptors[of], scales=keyframe.scales[of]
    )


def test_tracks_that_slid_along_do_not_keep_a_camera_where_it_was(sample, reference_map, seen) -> None:
    camera, frames = seen
    registrar = CameraFront(camera, reference_map, PipelineSettings())
    before = registrar.register(frames[0])
    with open_recording(sample / "sample" / "bag") as recording:
        image = [image for image, _ in zip(recording.images([CAMERA]), range(25), strict=False)][-1]
    later = FeatureTracker(camera).track(decode_grey(image), image.stamp_ns)
    # Thirty tracks stay where the first image had them, as on a smear of the lens, beside new features.
    slid = 30
    jumped = dataclasses.replace(
        later,
        stamp_ns=frames[1].stamp_ns,
        previous_stamp_ns=frames[0].stamp_ns,
        track_ids=np.concatenate([before.track_ids[:slid], before.track_ids.max() + 1 + later.track_ids]),
        pixels=np.concatenate([before.pixels[:slid], later.pixels]),
        described=later.described + np.uint32(slid),
    )
    there = CameraFront(camera, reference_map, PipelineSettings()).register(later).world_T_camera
    found = registrar.register(jumped).world_T_camera
    assert there is not None and found is not None and before.world_T_camera is not None
    assert np.linalg.norm(there[:3, 3] - before.world_T_camera[:3, 3]) > 0.2
    assert np.linalg.norm(there[:3, 3] - found[:3, 3]) < 0.02
