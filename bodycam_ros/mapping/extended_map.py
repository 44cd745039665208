"""A reference map with added landmarks, and with the images that show them among its photographs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.extendable_map import GREY
from bodycam_ros.mapping.map_point import MapPoint
from bodycam_ros.mapping.small_photographs import normals_towards
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap

_MAX_DESCRIPTORS = 4  # of an added landmark, from directions far from each other


@dataclass(frozen=True)
class KeptImage:
    """An image of a body camera that the map keeps; ``jpeg`` is the grey picture, ``world_T_camera`` (4, 4)."""

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    jpeg: bytes


def make_extended_map(
    reference_map: ReferenceMap,
    points: Sequence[MapPoint],
    images: Sequence[KeptImage],
    cameras: Mapping[str, CameraModel],
) -> ReferenceMap:
    """The map with more landmarks, all others unchanged.

    Args:
        reference_map: the map.
        points: new landmarks.
        images: of body cameras; those that show none of the points are left out.
        cameras: models of the body cameras by name.
    """
    known = len(reference_map.landmark_ids)
    observed = {(s.camera, s.stamp_ns) for point in points for s in point.sightings}
    images = [image for image in images if (image.camera, image.stamp_ns) in observed]
    described = [point.descriptors(min(_MAX_DESCRIPTORS, len(point.sightings))) for point in points]
    rows = np.repeat(known + np.arange(len(points)), [len(sizes) for _, _, sizes in described])
    poses = np.array([image.world_T_camera for image in images]).reshape(-1, 4, 4)
    more: dict[str, NDArray[Any]] = {
        "landmark_ids": int(reference_map.landmark_ids.max()) + 1 + np.arange(len(points), dtype=np.uint32),
        "points_world": np.array([point.position for point in points]).reshape(-1, 3),
        "colours": np.full((len(points), 3), GREY, np.uint8),
        "descriptor_landmark": rows.astype(np.uint32),
        "world_T_camera": poses,
    }
    if points:
        arrays = (np.concatenate(parts) for parts in zip(*described, strict=True))
        more |= dict(zip(("descriptors", "descriptor_view", "descriptor_size"), arrays, strict=True))
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(reference_map, name), array]) for name, array in more.items()
    }
    extended = replace(
        reference_map,
        **joined,
        image_names=(*reference_map.image_names, *[f"{image.camera}/{image.stamp_ns}" for image in images]),
        grown=reference_map.grown + len(points),
    )
    if reference_map.photographs is None:
        return extended
    return replace(extended, photographs=_with_images(reference_map.photographs, extended, points, images, cameras))


def _with_images(
    photographs: MapPhotographs,
    extended: ReferenceMap,
    points: Sequence[MapPoint],
    images: Sequence[KeptImage],
    cameras: Mapping[str, CameraModel],
) -> MapPhotographs:
    """The photographs and the body cameras' images, with the landmarks that these show."""
    names = sorted({image.camera for image in images})
    first_view, first_landmark = len(photographs.jpegs), len(photographs.normals)
    view_of = {(image.camera, image.stamp_ns): first_view + row for row, image in enumerate(images)}
    observations = [
        (first_landmark + row, view)
        for row, point in enumerate(points)
        for view in sorted({view_of[s.camera, s.stamp_ns] for s in point.sightings})
    ]
    landmarks, views = np.array(observations, np.int64).reshape(-1, 2).T
    towards = extended.world_T_camera[views, :3, 3] - extended.points_world[landmarks]
    normals = normals_towards(extended.points_world, first_landmark, landmarks, towards)
    camera_of_image = np.array([len(photographs.cameras) + names.index(image.camera) for image in images], np.uint16)
    return MapPhotographs(
        jpegs=(*photographs.jpegs, *[image.jpeg for image in images]),
        cameras=(*photographs.cameras, *[cameras[name] for name in names]),
        camera_of_view=np.concatenate([photographs.camera_of_view, camera_of_image]),
        world_T_camera=extended.world_T_camera,
        observation_landmark=np.concatenate([photographs.observation_landmark, landmarks.astype(np.uint32)]),
        observation_view=np.concatenate([photographs.observation_view, views.astype(np.uint16)]),
        normals=np.concatenate([photographs.normals, normals.astype(np.float32)]),
    )
