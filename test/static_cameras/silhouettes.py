"""Where geometry has the contours of balls, through OpenCV's lenses; and what our kernel is asked of them."""

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface import BodySurface, Surface
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.static_cameras.contour_kernels import find_contour

Array = NDArray[np.float64]

SPACING_PX = 3.0
SHRINK = 2
MOST = 4000
LENSES = {
    "plumb_bob": camera_from_info(
        "near", 640, 480, "plumb_bob", [-0.06, 0.025, 0.0004, -0.0003, 0.0], [470, 0, 318.3, 0, 471, 240.7, 0, 0, 1]
    ),
    "equidistant": camera_from_info(
        "wide", 640, 480, "equidistant", [0.01, -0.004, 0.002, -0.0005], [300, 0, 322.1, 0, 300, 236.4, 0, 0, 1]
    ),
}
TURNED = exp_so3(np.array([0.4, -0.7, 0.3]))


def ball(radius: float) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32))


def surface_of(**surfaces: Surface) -> BodySurface:
    """A surface of a body whose segments all hang on the first."""
    names = tuple(surfaces)
    joints = tuple(Joint(name, names[0], name, "ball", np.eye(4)) for name in names[1:])
    return BodySurface.of(BodyModel("things", names[0], names, joints, {}), surfaces)


def contour(
    camera: CameraModel,
    surface: BodySurface,
    camera_T_segment: Array,
    before: tuple[tuple[int, int], ...] = (),
    most: int = MOST,
) -> tuple[Array, NDArray[np.int64], NDArray[np.uint8]]:
    """``before``: which segment's contour counts before which other's."""
    stands_out = np.zeros((surface.segment_count,) * 2, np.uint8)
    for front, behind in before:
        stands_out[front, behind] = 1
    return find_contour(
        camera.parameters, camera_T_segment, surface.vertices, surface.segment_of_vertex, surface.faces,
        surface.face_normals, surface.face_offsets, surface.segment_of_face, surface.edges, surface.edge_faces,
        stands_out, camera.width, camera.height, SHRINK, SPACING_PX, most,
    )  # fmt: skip


def at(*places: tuple[float, float, float]) -> Array:
    return np.array([rigid(TURNED, np.array(place)) for place in places])


def rim_of_ball(centre: Array, radius: float) -> Array:
    """(N, 3) closed line of the points where rays from the camera touch a ball."""
    distance = np.linalg.norm(centre)
    axis = centre / distance
    across = np.linalg.svd(axis[None])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:, None]
    circle = np.cos(angle) * across[0] + np.sin(angle) * across[1]
    sine = radius / distance
    return np.asarray(distance * (1.0 - sine**2) * axis + radius * np.sqrt(1.0 - sine**2) * circle)


def beside(line: Array, pixels: Array) -> tuple[Array, Array]:
    """Distances (N,) of pixels from a dense line (M, 2), outward, and its outward normals there (N, 2)."""
    along = np.roll(line[:-1], -1, axis=0) - np.roll(line[:-1], 1, axis=0)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    normals *= np.sign(((line[:-1] - line[:-1].mean(axis=0)) * normals).sum(axis=1).sum())
    nearest = np.linalg.norm(pixels[:, None] - line[None, :-1], axis=2).argmin(axis=1)
    return ((pixels - line[nearest]) * normals[nearest]).sum(axis=1), normals[nearest]


def largest_gap(line: Array, pixels: Array) -> float:
    """Greatest distance of a point of a dense closed line (M, 2) from all pixels."""
    return float(np.linalg.norm(pixels[:, None] - line[None], axis=2).min(axis=0).max())


def inside(line: Array, pixels: Array) -> NDArray[np.bool_]:
    """(N,) which pixels a closed line goes around, by a pixel at least."""
    return depth_within(line, pixels) > 1.0


def depth_within(line: Array, pixels: Array) -> Array:
    """(N,) how deep within a closed line pixels are, negative outside [px]."""
    polygon = line.astype(np.float32)[:, None]
    return np.array([cv2.pointPolygonTest(polygon, (float(x), float(y)), True) for x, y in pixels])
