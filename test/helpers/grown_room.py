"""A room of points on walls, and body cameras that walk in it: what they see of it is known exactly."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.geometry import exp_so3, inverse, rigid, transform_points
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.registration.matching import RADIUS_PX, match_near_prediction
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import DESCRIPTOR_LENGTH, NO_LANDMARK
from helpers.rolling_camera import map_of, wide_camera

Array = NDArray[np.float64]

CAMERA = wide_camera()
FOCAL_PX = float(np.sqrt(CAMERA.fx * CAMERA.fy))
CAMERAS = ("chest", "hip", "shin")
FRAME_NS = 400_000_000
_HALF_M = 3.0
_SIZE_M = 0.03  # of features
_LEAST_DEPTH_M = 0.3


def cameras() -> dict[str, CameraModel]:
    return dict.fromkeys(CAMERAS, CAMERA)


def unlike(count: int, random: np.random.Generator) -> NDArray[np.uint8]:
    """Descriptors (N, 128) of length 512 that are as unlike each other as those of different things."""
    values = random.exponential(size=(count, DESCRIPTOR_LENGTH)) ** 2
    values *= 512.0 / np.linalg.norm(values, axis=1, keepdims=True)
    return np.minimum(values, 255.0).astype(np.uint8)


def walls(count: int, random: np.random.Generator) -> Array:
    """Points (N, 3) on the four walls of a room around the origin [m]."""
    along, height = random.uniform(-_HALF_M, _HALF_M, count), random.uniform(-1.3, 1.3, count)
    side = random.integers(0, 4, count)
    x = np.where(side < 2, np.where(side == 0, _HALF_M, -_HALF_M), along)
    y = np.where(side < 2, along, np.where(side == 2, _HALF_M, -_HALF_M))
    return np.column_stack([x, y, height])


def elsewhere(random: np.random.Generator) -> ReferenceMap:
    """A map of what no camera of the room sees."""
    return map_of(random.normal(size=(20, 3)) + np.array([500.0, 0.0, 0.0]), random)


def walked(camera: int, number: int) -> Array:
    """world_T_camera (4, 4) on the way: all walk around the middle, and look outwards, each to another side."""
    phase = 0.1 * number
    heading = 0.35 * number + 0.5 * camera
    # z of the camera looks into the heading, y down.
    c, s = np.cos(heading), np.sin(heading)
    looking = np.array([[s, 0.0, c], [-c, 0.0, s], [0.0, -1.0, 0.0]])
    place = np.array([np.cos(phase), np.sin(phase), 0.1 * np.sin(3.0 * phase) + 0.15 * camera])
    return rigid(looking @ exp_so3(0.1 * np.sin(phase * np.array([1.0, 2.0, 3.0]))), place)


def keyframe(
    camera: str,
    stamp_ns: int,
    world_T_camera: Array,
    points_world: Array,
    descriptors: NDArray[np.uint8],
    random: np.random.Generator,
    noise_px: float = 0.3,
) -> BodyKeyframe:
    """What a camera makes keyframes of: the points before it, where it sees them, and what they look like."""
    points_camera = transform_points(inverse(world_T_camera), points_world)
    pixels, valid = CAMERA.project(points_camera)
    seen = np.flatnonzero(
        valid & CAMERA.in_image(np.nan_to_num(pixels, nan=-1.0)) & (points_camera[:, 2] > _LEAST_DEPTH_M)
    )
    bearings, in_view = CAMERA.unproject(pixels[seen] + noise_px * random.normal(size=(len(seen), 2)))
    seen, bearings = seen[in_view], bearings[in_view]
    looks = descriptors[seen].astype(np.int64) + random.integers(-3, 4, (len(seen), DESCRIPTOR_LENGTH))
    return BodyKeyframe(
        camera=camera,
        stamp_ns=stamp_ns,
        world_T_camera=world_T_camera,
        position_sigma=0.001,
        focal_length=FOCAL_PX,
        rays_world=bearings @ world_T_camera[:3, :3].T,
        descriptors=np.clip(looks, 0, 255).astype(np.uint8),
        sizes=_SIZE_M / np.linalg.norm(points_camera[seen], axis=1),
        landmark_ids=np.full(len(seen), NO_LANDMARK, np.uint32),
    )


def walk(
    points_world: Array, descriptors: NDArray[np.uint8], frames: int, random: np.random.Generator, noise_px: float = 0.3
) -> Iterator[BodyKeyframe]:
    """The keyframes of all cameras, in order of time; those of an instant have one stamp."""
    for number in range(frames):
        for row, camera in enumerate(CAMERAS):
            stamp_ns = 1_000_000_000 + number * FRAME_NS
            yield keyframe(camera, stamp_ns, walked(row, number), points_world, descriptors, random, noise_px)


def named(one: BodyKeyframe, grown_map: ReferenceMap) -> BodyKeyframe:
    """The keyframe with the landmarks that its features show, as a registrar names them."""
    bearings = one.rays_world @ one.world_T_camera[:3, :3]
    pixels, _ = CAMERA.project(bearings)
    scales = one.sizes * scales_at(CAMERA, bearings[:, 2])
    features, landmarks = match_near_prediction(
        grown_map, CAMERA, one.world_T_camera, pixels, one.descriptors, scales, RADIUS_PX
    )
    ids = one.landmark_ids.copy()
    ids[features] = grown_map.landmark_ids[landmarks]
    return replace(one, landmark_ids=ids)
