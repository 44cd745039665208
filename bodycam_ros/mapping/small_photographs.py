"""The photographs as the map keeps them: small, grey, and with normals of the surfaces that its landmarks lie on."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.camera.camera_info import scaled_camera
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.structure import Structure
from bodycam_ros.progress import Progress, in_parallel
from bodycam_ros.registration.map_photographs import MapPhotographs

_WIDTH_PX = 640  # of kept pictures: body cameras see the world at a fraction of a photograph's scale
_JPEG_QUALITY = 75
_NEIGHBOURS = 12  # landmarks that define the plane of the surface that a landmark lies on
_MAX_THICKNESS = 0.3  # of these over their breadth; thicker is no surface, and is assumed to face the cameras


def small_photographs(folder: Path, structure: Structure, workers: int, progress: Progress) -> MapPhotographs:
    """Encode the photographs of a structure, and find the surfaces.

    Args:
        folder: with the photographs.
        structure: in the frame of the map.
        workers: threads.
        progress: shows the step.

    Raises:
        MapError: a photograph cannot be read any more.
    """
    cameras = tuple(scaled_camera(camera, min(1.0, _WIDTH_PX / camera.width)) for camera in structure.cameras)

    def encode(view: int) -> bytes:
        camera = cameras[structure.camera_of_view[view]]
        return _encoded(folder / structure.names[view], (camera.width, camera.height))

    with progress.step("keeping photographs", len(structure.names)) as advance:
        jpegs = tuple(in_parallel(encode, range(len(structure.names)), workers, advance))
    order = np.lexsort((structure.observation_views, structure.observation_points))
    return MapPhotographs(
        jpegs=jpegs,
        cameras=cameras,
        camera_of_view=structure.camera_of_view.astype(np.uint16),
        world_T_camera=structure.world_T_camera,
        observation_landmark=structure.observation_points[order].astype(np.uint32),
        observation_view=structure.observation_views[order].astype(np.uint16),
        normals=surface_normals(structure).astype(np.float32),
    )


def surface_normals(structure: Structure) -> NDArray[np.float64]:
    """(L, 3) unit normals of the surfaces around the points, to the side of the cameras that saw them."""
    towards = structure.world_T_camera[structure.observation_views, :3, 3]
    towards = towards - structure.points_world[structure.observation_points]
    return normals_towards(structure.points_world, 0, structure.observation_points, towards)


def normals_towards(
    points: NDArray[np.float64], first: int, observed: NDArray[np.int64], towards: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(M, 3) unit normals of the planes that the last points span with their neighbours.

    Where the neighbours are in no plane the mean direction to the cameras stands in for the normal.

    Args:
        points: (L, 3) all points.
        first: row of the first of the M points that are asked for, up to the last.
        observed: (O,) row of the point of each of their observations.
        towards: (O, 3) from the point to the camera.
    """
    from scipy.spatial import cKDTree

    facing = np.zeros((len(points) - first, 3))
    np.add.at(facing, observed - first, towards / np.linalg.norm(towards, axis=1, keepdims=True))
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    count = min(_NEIGHBOURS + 1, len(points))
    if count < 4 or not len(facing):
        return facing
    _, near = cKDTree(points).query(points[first:], k=count)
    offsets = points[near] - np.median(points[near], axis=1, keepdims=True)
    spreads, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
    normals = axes[:, :, 0]
    normals *= np.where(np.einsum("ni,ni->n", normals, facing) < 0.0, -1.0, 1.0)[:, None]
    thin = np.sqrt(np.maximum(spreads[:, 0], 0.0)) < _MAX_THICKNESS * np.sqrt(np.maximum(spreads[:, 1], 1e-12))
    return np.where(thin[:, None], normals, facing)


def _encoded(path: Path, size: tuple[int, int]) -> bytes:
    grey = cv2.cvtColor(read_image_file(path, cv2.IMREAD_COLOR, MapError), cv2.COLOR_BGR2GRAY)
    smaller = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    done, jpeg = cv2.imencode(".jpg", smaller, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise MapError(f"{path}: cannot be kept in the map as a picture of {size[0]}x{size[1]} pixels")
    return bytes(jpeg.tobytes())
