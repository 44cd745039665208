"""The photographs as the map keeps them: small, grey, and with the surfaces that its landmarks lie on."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.features import read_photograph
from bodycam_ros.mapping.progress import Progress, in_parallel
from bodycam_ros.mapping.structure import Structure
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class SmallPhotographSettings:
    """What the map keeps of the photographs."""

    keep: bool = setting(True, reason="without photographs landmarks are known by their descriptors alone")
    width: int = setting(
        640,
        unit="px",
        limits=(160, 4000),
        reason="of the kept pictures; body cameras see the world at a fraction of a photograph's scale",
    )
    quality: int = setting(75, unit="%", limits=(30, 100), reason="of their JPEG coding")
    neighbours: int = setting(
        12, limits=(4, 100), reason="nearest landmarks that tell the plane of the surface that a landmark lies on"
    )
    max_thickness: float = setting(
        0.3, limits=(0.01, 1.0), reason="of that plane over its breadth; thicker is no surface, and is taken to face us"
    )


def small_photographs(
    folder: Path,
    structure: Structure,
    settings: SmallPhotographSettings,
    workers: int,
    progress: Progress,
) -> MapPhotographs:
    """Encode the photographs of a structure, and find the surfaces.

    Args:
        folder: with the photographs.
        structure: in the frame of the map.
        settings: sizes.
        workers: threads.
        progress: shows the step.

    Raises:
        MapError: a photograph cannot be read any more.
    """
    cameras = tuple(_smaller(camera, min(1.0, settings.width / camera.width)) for camera in structure.cameras)

    def encode(view: int) -> bytes:
        camera = cameras[structure.camera_of_view[view]]
        return _encoded(folder / structure.names[view], (camera.width, camera.height), settings.quality)

    jpegs = []
    with progress.step("keeping photographs", len(structure.names)) as advance:
        for jpeg in in_parallel(encode, range(len(structure.names)), workers):
            jpegs.append(jpeg)
            advance()
    order = np.lexsort((structure.observation_views, structure.observation_points))
    return MapPhotographs(
        jpegs=tuple(jpegs),
        cameras=cameras,
        camera_of_view=structure.camera_of_view.astype(np.uint16),
        world_T_camera=structure.world_T_camera,
        observation_landmark=structure.observation_points[order].astype(np.uint32),
        observation_view=structure.observation_views[order].astype(np.uint16),
        normals=surface_normals(structure, settings).astype(np.float32),
    )


def surface_normals(structure: Structure, settings: SmallPhotographSettings) -> NDArray[np.float64]:
    """(L, 3) unit normals of the planes that each landmark and its neighbours span, towards those who saw it."""
    points = structure.points_world
    towards = structure.world_T_camera[structure.observation_views, :3, 3] - points[structure.observation_points]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    facing = np.zeros_like(points)
    np.add.at(facing, structure.observation_points, towards)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    return plane_normals(points, np.arange(len(points)), facing, settings)


def plane_normals(
    points: NDArray[np.float64],
    rows: NDArray[np.int64],
    facing: NDArray[np.float64],
    settings: SmallPhotographSettings,
) -> NDArray[np.float64]:
    """(M, 3) unit normals of the planes that some points span with their neighbours.

    Args:
        points: (L, 3) all points.
        rows: (M,) of those that are asked.
        facing: (M, 3) unit directions to where they were seen from: the side of the normals, and what stands in for one
            where the neighbours are in no plane.
        settings: of the planes.
    """
    from scipy.spatial import cKDTree

    count = min(settings.neighbours + 1, len(points))
    if count < 4 or not len(rows):
        return facing
    _, near = cKDTree(points).query(points[rows], k=count)
    offsets = points[near] - np.median(points[near], axis=1, keepdims=True)
    spreads, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
    normals = axes[:, :, 0]
    normals *= np.where(np.einsum("ni,ni->n", normals, facing) < 0.0, -1.0, 1.0)[:, None]
    thin = np.sqrt(np.maximum(spreads[:, 0], 0.0)) < settings.max_thickness * np.sqrt(np.maximum(spreads[:, 1], 1e-12))
    return np.where(thin[:, None], normals, facing)


def _smaller(camera: CameraModel, scale: float) -> CameraModel:
    width, height = round(scale * camera.width), round(scale * camera.height)
    across, down = width / camera.width, height / camera.height
    # Pixel centres at integers: the borders, half a pixel outside, are what scales.
    k = (
        *(across * camera.fx, 0.0, across * (camera.cx + 0.5) - 0.5),
        *(0.0, down * camera.fy, down * (camera.cy + 0.5) - 0.5),
        *(0.0, 0.0, 1.0),
    )
    return camera_from_info(camera.name, width, height, camera.distortion_model, camera.distortion, k)


def _encoded(path: Path, size: tuple[int, int], quality: int) -> bytes:
    grey = cv2.cvtColor(read_photograph(path), cv2.COLOR_BGR2GRAY)
    smaller = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    done, jpeg = cv2.imencode(".jpg", smaller, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise MapError(f"{path}: cannot be kept in the map as a picture of {size[0]}x{size[1]} pixels")
    return bytes(jpeg.tobytes())
