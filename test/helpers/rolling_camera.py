"""A camera whose rows are read out one after the other while it moves as is known, before known landmarks."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, rigid, transform_points
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame

Array = NDArray[np.float64]

START_NS = 1_000_000_000
_KEYFRAMES = 10
_ROUNDS = 6
_SIGMA_PX = 6.0
_MEDIAN_DEPTH_M = 4.0


def wide_camera() -> CameraModel:
    """The lens of the recordings: 153 degrees across."""
    k = [239.0, 0, 320.0, 0, 239.0, 240.0, 0, 0, 1]
    return camera_from_info("wide", 640, 480, "equidistant", [-0.0137, 0.0037, -0.0015, 0.0004], k)


def swinging(seconds: Array) -> Array:
    """world_T_camera (..., 4, 4) on a limb, at times (...) [s]: it turns by up to 3 rad/s and goes at up to 1 m/s."""
    phase = 2 * np.pi * np.asarray(seconds)[..., None]
    turn = np.array([0.35, 0.5, 0.3]) * np.sin(phase * np.array([0.8, 0.95, 1.1]))
    place = np.array([0.15, 0.1, 0.12]) * np.sin(phase * np.array([0.9, 0.7, 1.0]) + 1.0)
    return rigid(exp_so3(turn), place)


def landmarks_ahead(count: int, random: np.random.Generator) -> Array:
    """World points (N, 3) all around the axis, 2.5 to 6 m away."""
    directions = random.normal(size=(count, 3)) + np.array([0.0, 0.0, 1.0])
    return directions / np.linalg.norm(directions, axis=1)[:, None] * random.uniform(2.5, 6.0, (count, 1))


def rolling_pixels(
    camera: CameraModel, points_world: Array, pose_at: Callable[[Array], Array], seconds: float, readout_time: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Where an image shows points (N, 3), each when its own row is exposed, and which of them are in it.

    The row and its time depend on each other; they settle to nothing within some rounds.
    """
    pixels, visible = camera.project(transform_points(inverse(pose_at(np.array(seconds))), points_world))
    for _ in range(_ROUNDS if readout_time else 0):
        shares = np.nan_to_num(pixels[:, 1]) / (camera.height - 1) - 0.5
        at = inverse(pose_at(seconds + shares * readout_time))
        points_camera = (at[:, :3, :3] @ points_world[:, :, None])[:, :, 0] + at[:, :3, 3]
        pixels, visible = camera.project(points_camera)
    return pixels, visible & camera.in_image(np.nan_to_num(pixels, nan=-1.0))


def constant_twist(world_T_camera: Array, twist: Array) -> Callable[[Array], Array]:
    """A motion through a pose at time 0."""
    return lambda seconds: world_T_camera @ exp_se3(seconds[..., None] * twist)


def map_of(points_world: Array, random: np.random.Generator) -> ReferenceMap:
    """A map of points (L, 3) that look as unlike each other as noise."""
    count = len(points_world)
    ids = np.arange(count, dtype=np.uint32)
    toward = -points_world / np.linalg.norm(points_world, axis=1)[:, None]
    return ReferenceMap(
        landmark_ids=ids,
        points_world=points_world,
        colours=np.zeros((count, 3), np.uint8),
        descriptor_landmark=ids,
        descriptors=random.integers(0, 100, (count, 128)).astype(np.uint8),
        descriptor_view=toward.astype(np.float32),
        descriptor_size=np.full(count, _SIGMA_PX * _MEDIAN_DEPTH_M / 239.0, np.float32),
        world_T_camera=np.eye(4)[None],
        image_names=("here",),
        metric=True,
        gravity_aligned=True,
    )


def track_frames(
    camera: CameraModel,
    reference_map: ReferenceMap,
    random: np.random.Generator,
    readout_time: float,
    count: int,
    rate_hz: float = 30.0,
    pixel_noise: float = 0.3,
) -> Iterator[TrackFrame]:
    """Track frames of ``count`` images of the ``swinging`` camera; a track per landmark in sight."""
    names = np.zeros(len(reference_map.points_world), np.int64)
    following = np.zeros(0, np.int64)
    previous_ns = 0
    for number in range(count):
        seconds = number / rate_hz
        now, before = swinging(np.array([seconds, seconds - 1 / rate_hz]))
        stamp_ns = START_NS + round(1e9 * seconds)
        pixels, visible = rolling_pixels(camera, reference_map.points_world, swinging, seconds, readout_time)
        keyframe = number % _KEYFRAMES == 0
        if keyframe:
            # Tracks are found anew, each with another error; here one that is new with every image.
            following = np.flatnonzero(visible)
            names[following] = names.max() + 1 + np.arange(len(following))
        following = following[visible[following]]
        ordered = following[np.argsort(names[following])]
        depths = np.linalg.norm(reference_map.points_world[ordered] - now[:3, 3], axis=1)
        described = np.arange(len(ordered) if keyframe else 0)
        yield TrackFrame(
            camera=camera.name,
            stamp_ns=stamp_ns,
            previous_stamp_ns=previous_ns,
            track_ids=names[ordered].astype(np.uint32),
            pixels=(pixels[ordered] + pixel_noise * random.normal(size=(len(ordered), 2))).astype(np.float32),
            described=described.astype(np.uint32),
            descriptors=reference_map.descriptors[ordered[described]],
            scales=(_SIGMA_PX * _MEDIAN_DEPTH_M / depths[described]).astype(np.float32),
            keyframe=keyframe,
            current_R_previous=now[:3, :3].T @ before[:3, :3],
            rotation_inliers=50 if previous_ns else 0,
        )
        previous_ns = stamp_ns
