"""A reference map with the landmarks that have grown, and the images that they grew from among its photographs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.growing_map import GREY, GrownPoint
from bodycam_ros.mapping.small_photographs import SmallPhotographSettings, plane_normals
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap


@dataclass(frozen=True)
class KeptImage:
    """An image of a worn camera that the map keeps.

    Attributes:
        camera: its name.
        stamp_ns: [ns].
        world_T_camera: (4, 4).
        jpeg: the grey picture, encoded.
    """

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    jpeg: bytes


def extended_map(
    reference_map: ReferenceMap,
    points: Sequence[GrownPoint],
    images: Sequence[KeptImage],
    cameras: Mapping[str, CameraModel],
    looks: int,
    surfaces: SmallPhotographSettings,
) -> ReferenceMap:
    """The map with more landmarks.

    Args:
        reference_map: what has grown; all of it stays where it is.
        points: its new landmarks.
        images: that they were seen in.
        cameras: models of the worn cameras by name.
        looks: descriptors that each landmark keeps.
        surfaces: how planes through landmarks are found.
    """
    count, known = len(points), len(reference_map.landmark_ids)
    seen_in = {(s.camera, s.stamp_ns) for point in points for s in point.sightings}
    images = [image for image in images if (image.camera, image.stamp_ns) in seen_in]
    described = [point.looks(min(looks, len(point.sightings))) for point in points]
    rows = np.repeat(np.arange(known, known + count), [len(sizes) for _, _, sizes in described])
    ids = int(reference_map.landmark_ids.max()) + 1 + np.arange(count)
    positions = np.array([point.position for point in points]).reshape(-1, 3)
    grown = replace(
        reference_map,
        landmark_ids=np.concatenate([reference_map.landmark_ids, ids.astype(np.uint32)]),
        points_world=np.concatenate([reference_map.points_world, positions]),
        colours=np.concatenate([reference_map.colours, np.full((count, 3), GREY, np.uint8)]),
        descriptor_landmark=np.concatenate([reference_map.descriptor_landmark, rows.astype(np.uint32)]),
        descriptors=np.concatenate([reference_map.descriptors, *[look[0] for look in described]]),
        descriptor_view=np.concatenate([reference_map.descriptor_view, *[look[1] for look in described]]),
        descriptor_size=np.concatenate([reference_map.descriptor_size, *[look[2] for look in described]]),
        world_T_camera=np.concatenate(
            [reference_map.world_T_camera, np.array([image.world_T_camera for image in images]).reshape(-1, 4, 4)]
        ),
        image_names=(*reference_map.image_names, *[f"{image.camera}/{image.stamp_ns}" for image in images]),
        grown=reference_map.grown + count,
    )
    photographs = reference_map.photographs
    return (
        grown
        if photographs is None
        else replace(grown, photographs=_with_images(photographs, grown, points, images, cameras, surfaces))
    )


def _with_images(
    photographs: MapPhotographs,
    grown: ReferenceMap,
    points: Sequence[GrownPoint],
    images: Sequence[KeptImage],
    cameras: Mapping[str, CameraModel],
    surfaces: SmallPhotographSettings,
) -> MapPhotographs:
    """The photographs and the worn cameras' images, with the landmarks that those show."""
    names = sorted({image.camera for image in images})
    views_before, landmarks_before = len(photographs.jpegs), len(photographs.normals)
    view_of = {(image.camera, image.stamp_ns): views_before + row for row, image in enumerate(images)}
    seen = [
        (landmarks_before + row, view)
        for row, point in enumerate(points)
        for view in sorted({view_of[s.camera, s.stamp_ns] for s in point.sightings})
    ]
    landmarks, views = np.array(seen, np.int64).reshape(-1, 2).T
    towards = grown.world_T_camera[views, :3, 3] - grown.points_world[landmarks]
    facing = np.zeros((len(points), 3))
    np.add.at(facing, landmarks - landmarks_before, towards / np.linalg.norm(towards, axis=1, keepdims=True))
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    normals = plane_normals(grown.points_world, np.arange(landmarks_before, len(grown.points_world)), facing, surfaces)
    return MapPhotographs(
        jpegs=(*photographs.jpegs, *[image.jpeg for image in images]),
        cameras=(*photographs.cameras, *[cameras[name] for name in names]),
        camera_of_view=np.concatenate(
            [
                photographs.camera_of_view,
                np.array([len(photographs.cameras) + names.index(image.camera) for image in images], np.uint16),
            ]
        ),
        world_T_camera=grown.world_T_camera,
        observation_landmark=np.concatenate([photographs.observation_landmark, landmarks.astype(np.uint32)]),
        observation_view=np.concatenate([photographs.observation_view, views.astype(np.uint16)]),
        normals=np.concatenate([photographs.normals, normals.astype(np.float32)]),
    )
