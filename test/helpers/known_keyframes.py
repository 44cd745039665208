"""A small map with photographs, and what a body camera sees of it and of points that the map does not know."""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import inverse, rigid, transform_points
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame

LANDMARKS = 60
K = [240.0, 0, 319.5, 0, 240.0, 239.5, 0, 0, 1]
FRAME_NS = 400_000_000
SIZE_M = 0.02


def body_camera(name: str = "hand") -> CameraModel:
    return camera_from_info(name, 640, 480, "equidistant", [0.0] * 4, K)


def descriptors_of(count: int, seed: int) -> NDArray[np.uint8]:
    """(count, 128) of the length of RootSIFT, none like another."""
    random = np.random.default_rng(seed).gamma(0.4, size=(count, 128))
    return np.rint(512.0 * random / np.linalg.norm(random, axis=1, keepdims=True)).clip(0, 255).astype(np.uint8)


def small_map(seed: int = 1, twins: bool = False) -> ReferenceMap:
    """Landmarks up to z = 3, and two photographs of them; twins: each has another one that looks the same."""
    random = np.random.default_rng(seed)
    facing = np.tile(np.array([0.0, 0.0, -1.0], np.float32), (LANDMARKS, 1))
    poses = np.stack([rigid(np.eye(3), np.array([x, 0.0, 0.0])) for x in (-0.5, 0.5)])
    grey = bytes(cv2.imencode(".jpg", np.full((48, 64), 90, np.uint8))[1].tobytes())
    lens = camera_from_info("photograph", 64, 48, "plumb_bob", [0.0] * 5, [50.0, 0, 31.5, 0, 50.0, 23.5, 0, 0, 1])
    rows = np.repeat(np.arange(LANDMARKS), 2)
    descriptors = descriptors_of(LANDMARKS, seed)
    if twins:
        descriptors[LANDMARKS // 2 :] = descriptors[: LANDMARKS // 2]
    return ReferenceMap(
        landmark_ids=np.arange(1, LANDMARKS + 1, dtype=np.uint32),
        points_world=random.uniform([-1.5, -1.0, 1.0], [1.5, 1.0, 3.0], (LANDMARKS, 3)),
        colours=random.integers(0, 256, (LANDMARKS, 3), dtype=np.uint8),
        descriptor_landmark=np.arange(LANDMARKS, dtype=np.uint32),
        descriptors=descriptors,
        descriptor_view=facing,
        descriptor_size=np.full(LANDMARKS, SIZE_M, np.float32),
        world_T_camera=poses,
        image_names=("one.jpg", "two.jpg"),
        metric=True,
        gravity_aligned=True,
        photographs=MapPhotographs(
            jpegs=(grey, grey),
            cameras=(lens,),
            camera_of_view=np.zeros(2, np.uint16),
            world_T_camera=poses,
            observation_landmark=rows.astype(np.uint32),
            observation_view=np.tile(np.arange(2), LANDMARKS).astype(np.uint16),
            normals=facing,
        ),
    )


def unknown_points(count: int = 60, seed: int = 7) -> NDArray[np.float64]:
    """(count, 3) behind the map's landmarks."""
    return np.random.default_rng(seed).uniform([-1.5, -1.0, 3.5], [1.5, 1.0, 5.0], (count, 3))


def place(number: int) -> NDArray[np.float64]:
    """World_T_camera (4, 4) of a camera that goes sideways, by 0.2 m from one image to the next, and back again."""
    turn = number % 8
    return rigid(np.eye(3), np.array([0.2 * min(turn, 8 - turn) - 0.3, 0.0, 0.0]))


def tracks(
    camera: CameraModel,
    number: int,
    points: NDArray[np.float64],
    descriptors: NDArray[np.uint8],
    first: int = 0,
    first_track: int = 0,
) -> TrackFrame:
    """Image so-and-so of that camera, every feature of it new and described.

    Args:
        camera: its model.
        number: of the image.
        points, descriptors: (N, 3), (N, 128) what is there to be seen, with feature sizes as ``small_map`` has them.
        first: number of the first image.
        first_track: id of the first track.
    """
    seen = transform_points(inverse(place(number)), points)
    pixels, _ = camera.project(seen)
    count = len(points)
    return TrackFrame(
        camera=camera.name,
        stamp_ns=number * FRAME_NS + FRAME_NS,
        previous_stamp_ns=number * FRAME_NS if number > first else 0,
        track_ids=np.arange(first_track + number * count, first_track + (number + 1) * count, dtype=np.uint32),
        pixels=pixels.astype(np.float32),
        described=np.arange(count, dtype=np.uint32),
        descriptors=descriptors,
        scales=(SIZE_M * camera.fx / np.linalg.norm(seen, axis=1)).astype(np.float32),
        keyframe=True,
        current_R_previous=np.eye(3),
        rotation_inliers=count if number > first else 0,
    )


def keyframes(
    camera: CameraModel, points: NDArray[np.float64], count: int = 4, start: int = 0, seed: int = 7
) -> list[BodyKeyframe]:
    """Keyframes of that camera, whose features carry no landmark."""
    made = []
    for number in range(start, start + count):
        world_T_camera = place(number)
        seen = transform_points(inverse(world_T_camera), points)
        made.append(
            BodyKeyframe(
                camera=camera.name,
                stamp_ns=number * FRAME_NS + FRAME_NS,
                world_T_camera=world_T_camera,
                position_sigma=0.002,
                focal_length=camera.fx,
                rays_world=seen / np.linalg.norm(seen, axis=1, keepdims=True) @ world_T_camera[:3, :3].T,
                descriptors=descriptors_of(len(points), seed),
                sizes=np.full(len(points), 2.0 / camera.fx),
                landmark_ids=np.full(len(points), NO_LANDMARK, np.uint32),
            )
        )
    return made
