"""Choice and alignment of patches in NumPy, landmark by landmark: what the compiled ones are held to."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import local_scales
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.registration.patch_kernels import PATCH
from helpers.numpy_lens import project_in_numpy, project_with_jacobian_in_numpy
from helpers.numpy_pose_fit import seen_later

Array = NDArray[np.float64]
Levels = list[NDArray[np.uint8]]

BORDER_PX = 6.0
LEAST_COSINE = 0.2
MOST_STEPS = 8
STILL_PX = 0.02
FARTHEST_PX = 4.0
LEAST_SLOPE = 300.0
MOST_ABOVE = 4
CELLS = 8
LEAST_SIGMA_PX = 0.8
LEAST_AXIS_COSINE = np.cos(np.radians(84.0))


def project_moving_in_numpy(
    camera: CameraModel, world_T_camera: Array, points_world: Array, twist: Array, readout_time: float, rounds: int = 2
) -> tuple[Array, NDArray[np.bool_]]:
    """Pixels (N, 2), each of the row that shows it, as a number of rounds find it."""
    points = transform_points(inverse(world_T_camera), points_world)
    pixels, valid = project_in_numpy(camera, points)
    for _ in range(rounds if readout_time else 0):
        times_s = readout_time * (pixels[:, 1] / (camera.height - 1) - 0.5)
        moved = points - times_s[:, None] * (np.cross(twist[:3], points) + twist[3:])
        pixels, still = project_in_numpy(camera, moved)
        valid &= still
    return pixels, valid


def exact_pixels(
    camera: CameraModel, world_T_camera: Array, points_world: Array, twist: Array, readout_time: float
) -> Array:
    """Pixels (N, 2) at a constant twist, without linearisation."""
    points = transform_points(inverse(world_T_camera), points_world)
    pixels = project_in_numpy(camera, points)[0]
    for _ in range(8 if readout_time else 0):
        times_s = readout_time * (pixels[:, 1] / (camera.height - 1) - 0.5)
        pixels = project_in_numpy(camera, seen_later(points, twist, times_s))[0]
    return pixels


def choose_in_numpy(
    camera: CameraModel,
    world_T_camera: Array,
    twist: Array,
    readout_time: float,
    points_world: Array,
    normals: Array,
    sizes: Array,
    trust: Array,
    per_cell: int,
) -> NDArray[np.int64]:
    offsets = points_world - world_T_camera[:3, 3]
    distances = np.linalg.norm(offsets, axis=1)
    sigmas_px = camera.fx * sizes.astype(float) / distances
    pixels, valid = project_moving_in_numpy(camera, world_T_camera, points_world, twist, readout_time, rounds=1)
    u, v = np.nan_to_num(pixels, nan=-1.0).T
    seen = (
        valid
        & (offsets @ world_T_camera[:3, 2] >= LEAST_AXIS_COSINE * distances)
        & (sigmas_px >= LEAST_SIGMA_PX)
        & (-np.einsum("ni,ni->n", normals.astype(float), offsets) >= LEAST_COSINE * distances)
        & (np.minimum(u, v) > BORDER_PX)
        & (u < camera.width - 1 - BORDER_PX)
        & (v < camera.height - 1 - BORDER_PX)
    )
    merits = trust - 0.05 * np.abs(np.log2(sigmas_px / 2.0))
    cell = (v * CELLS / camera.height).astype(int) * CELLS + (u * CELLS / camera.width).astype(int)
    rows = [
        row
        for number in range(CELLS * CELLS)
        for row in sorted(np.flatnonzero(seen & (cell == number)), key=lambda row: -merits[row])[:per_cell]
    ]
    return np.array(rows, np.int64)


def best_views_in_numpy(
    camera: CameraModel,
    world_T_camera: Array,
    points_world: Array,
    rows: NDArray[np.int64],
    reference_cameras: list[CameraModel],
    world_T_reference: Array,
    observers: list[list[int]],
) -> NDArray[np.int64]:
    """``reference_cameras``: of each photograph; ``observers``: for each landmark the photographs that see it."""
    views = np.full(len(rows), -1)
    for n, row in enumerate(rows):
        point = points_world[row]
        ours, scale = shown_in_numpy(camera, world_T_camera, point)
        best = -np.inf
        for k in observers[row]:
            theirs, shown = shown_in_numpy(reference_cameras[k], world_T_reference[k], point)
            merit = theirs @ ours - 0.15 * max(np.log2(scale / shown), 0.0)
            if merit > best:
                best, views[n] = merit, k
    return views


def shown_in_numpy(camera: CameraModel, world_T_camera: Array, point: Array) -> tuple[Array, float]:
    """Unit direction to a point, and how finely it is shown [px/m], by the table of the lens."""
    offset = point - world_T_camera[:3, 3]
    distance = float(np.linalg.norm(offset))
    scales = local_scales(camera)
    at = np.rint((offset @ world_T_camera[:3, 2] / distance + 1.0) / 2.0 * (len(scales) - 1))
    return offset / distance, float(scales[int(at)]) / distance


def align_in_numpy(
    camera: CameraModel,
    world_T_camera: Array,
    twist: Array,
    readout_time: float,
    image: Levels,
    reference_cameras: list[CameraModel],
    world_T_reference: Array,
    references: list[Levels],
    views: NDArray[np.int64],
    reference_pixels: Array,
    points_world: Array,
    normals: Array,
    first_level: int,
    last_level: int,
    least_likeness: float,
) -> tuple[Array, Array]:
    """As ``align_patches``; ``reference_cameras``: of each picture; pyramids are lists of images."""
    pixels, valid = project_moving_in_numpy(camera, world_T_camera, points_world, twist, readout_time)
    likeness = np.full(len(points_world), np.nan)
    for n in np.flatnonzero(valid & (views >= 0)):
        k = views[n]
        along = plane_axes(normals[n])
        _, here = derivative(camera, world_T_camera, points_world[n], along)
        shown, there = derivative(reference_cameras[k], world_T_reference[k], points_world[n], along)
        if not (np.isfinite(here).all() and np.isfinite(there).all()) or abs(np.linalg.det(here)) <= 1e-9:
            continue
        if len(reference_pixels):
            shown = reference_pixels[n]
        reference_by_image = there @ np.linalg.inv(here)
        scale = np.sqrt(abs(np.linalg.det(reference_by_image)))
        if not 0.05 < scale < 40.0:
            continue
        for level in range(first_level, last_level - 1, -1):
            size = 2.0**level
            above = int(np.clip(round(np.log2(scale * size)), 0, min(MOST_ABOVE, len(references[k]) - 1)))
            patch = warp_in_numpy(references[k][above], shown / 2**above, reference_by_image * size / 2**above)
            likeness[n] = np.nan
            if patch is None:
                continue
            found, likeness[n] = align_one_in_numpy(image[level], pixels[n] / size, patch)
            if likeness[n] >= (least_likeness if level == last_level else 0.5 * least_likeness):
                pixels[n] = found * size
            elif level == last_level:
                likeness[n] = np.nan
        if not camera.in_image(pixels[n : n + 1])[0]:
            likeness[n] = np.nan
    return pixels, likeness


def plane_axes(normal: Array) -> Array:
    """(3, 2) two directions along a plane; which ones makes no difference."""
    return np.asarray(np.linalg.svd(normal[None])[2][1:].T)


def derivative(camera: CameraModel, world_T_camera: Array, point_world: Array, along: Array) -> tuple[Array, Array]:
    """Pixel (2,) of a point, and how it moves with the point along two directions (2, 2)."""
    point = transform_points(inverse(world_T_camera), point_world[None])
    pixels, jacobian, _ = project_with_jacobian_in_numpy(camera, point)
    return pixels[0], jacobian[0] @ world_T_camera[:3, :3].T @ along


def warp_in_numpy(picture: NDArray[np.uint8], at: Array, picture_by_image: Array) -> Array | None:
    """A patch with a ring of one pixel around it; None where the picture ends."""
    steps = np.arange(PATCH + 2) - 0.5 * (PATCH + 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1)  # (rows, columns, 2) x, y
    places = at + grid @ picture_by_image.T
    height, width = picture.shape
    if places.min() < 0 or places[..., 0].max() >= width - 1 or places[..., 1].max() >= height - 1:
        return None
    return sampled(picture, places)


def align_one_in_numpy(image: NDArray[np.uint8], at: Array, ring: Array) -> tuple[Array, float]:
    """Where in an image a patch (with its ring) is found, and the correlation there; NaN if it is not."""
    patch = ring[1:-1, 1:-1].ravel()
    slopes = [0.5 * (ring[1:-1, 2:] - ring[1:-1, :-2]).ravel(), 0.5 * (ring[2:, 1:-1] - ring[:-2, 1:-1]).ravel()]
    # By what the patch and a constant do not explain of its slopes it is held.
    explained = np.column_stack([patch, np.ones_like(patch)])
    rest = np.column_stack(slopes) - explained @ np.linalg.lstsq(explained, np.column_stack(slopes), rcond=None)[0]
    if np.var(patch) * patch.size < 1.0 or np.linalg.eigvalsh(rest.T @ rest)[0] < LEAST_SLOPE:
        return at, np.nan
    steps = np.arange(PATCH) - 0.5 * (PATCH - 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1)
    height, width = image.shape
    now, likeness = at.copy(), np.nan
    for _ in range(MOST_STEPS):
        left, top = now - 0.5 * (PATCH - 1)
        if not (left >= 0 and top >= 0 and left + PATCH < width and top + PATCH < height):
            return at, np.nan
        values = sampled(image, now + grid).ravel()
        if np.var(values) * values.size < 1.0:
            return at, np.nan
        likeness = float(np.corrcoef(patch, values)[0, 1])
        columns = np.column_stack([patch, *slopes, np.ones_like(patch)])
        gain, by_x, by_y, _ = np.linalg.lstsq(columns, values, rcond=None)[0]
        if not 0.1 < gain < 10.0:
            return at, np.nan
        step = -np.array([by_x, by_y]) / gain
        now = now + step
        if not np.linalg.norm(now - at) < FARTHEST_PX:
            return at, np.nan
        if np.linalg.norm(step) < STILL_PX:
            break
    return now, likeness


def sampled(picture: NDArray[np.uint8], places: Array) -> Array:
    """Bilinear grey levels (...) at places (..., 2)."""
    down, across = places[..., 1], places[..., 0]
    return np.asarray(map_coordinates(picture.astype(float), [down, across], order=1), np.float64)
