"""Plain silhouette ICP of a convex object: contour points move along their normals to the nearest edge in the image.

What region tracking is compared with (RAPiD and its heirs): no colours, no appearance that is learned.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_se3, inverse, transform_points
from bodycam_ros.outside.surface import Surface

Array = NDArray[np.float64]

REACHES_PX = (24, 24, 24, 12, 12, 12, 6, 6, 6, 6)
"""How far along its normal a point looks for an edge, iteration by iteration."""

SPACING_PX = 4.0
LEAST_EDGE = 4.0  # grey levels per pixel, four times what grain makes
OUTLIER_PX = 4.0  # beyond it a point counts less (Huber)
DAMPING = 1.0  # of an information that is some millions


class SilhouetteIcp:
    """Follows a convex surface in the images of one camera."""

    def __init__(self, camera: CameraModel, surface: Surface) -> None:
        self._camera, self._surface = camera, surface
        self._K, self._distortion = np.array(camera.k).reshape(3, 3), np.array(camera.distortion)

    def look(self, image: NDArray[np.uint8], camera_T_segment: Array) -> Array:
        """Pose (4, 4) in an image (H, W, 3), from where the object was before."""
        grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), 1.0).astype(np.float32)
        pose = camera_T_segment
        for reach in REACHES_PX:
            points = self._contour(pose)
            pixels, by_pose = self._project(points)
            normals = self._outward(points, pixels, pose)
            found, there = nearest_edges(grey, pixels, normals, reach)
            if there.sum() < 6:
                return pose
            off, slope = found[there], np.einsum("ni,nij->nj", normals, by_pose)[there]
            weights = np.minimum(1.0, OUTLIER_PX / np.maximum(np.abs(off), 1e-9))
            information = (slope * weights[:, None]).T @ slope + DAMPING * np.eye(6)
            step = np.linalg.solve(information, (slope * weights[:, None]).T @ off)
            pose = exp_se3(step[None])[0] @ pose
        return pose

    def _contour(self, pose: Array) -> Array:
        """(N, 3) points along the contour, in the camera's frame."""
        rows = self._surface.contour(inverse(pose)[:3, 3])
        ends = transform_points(pose, self._surface.vertices)[self._surface.edges[rows]]
        pixels = self._project(ends.reshape(-1, 3))[0].reshape(-1, 2, 2)
        lengths = np.linalg.norm(pixels[:, 1] - pixels[:, 0], axis=1)
        counts = np.maximum(1, np.rint(lengths / SPACING_PX)).astype(int)
        return np.concatenate(
            [a + (np.arange(n)[:, None] + 0.5) / n * (b - a) for (a, b), n in zip(ends, counts, strict=True)]
        )

    def _project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (N, 2), and how they move with a change (6) of the pose from the left (N, 2, 6)."""
        zero = np.zeros(3)
        pixels, jacobian = cv2.projectPoints(points[:, None], zero, zero, self._K, self._distortion)
        return pixels.reshape(-1, 2), jacobian[:, :6].reshape(-1, 2, 6)

    def _outward(self, points: Array, pixels: Array, pose: Array) -> Array:
        """(N, 2) normals of the convex outline: away from the middle, across to its neighbours."""
        hull = cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2).astype(float)
        sides = np.roll(hull, -1, axis=0) - hull
        lengths = np.linalg.norm(sides, axis=1)
        hull, sides = hull[lengths > 1e-3], sides[lengths > 1e-3] / lengths[lengths > 1e-3, None]
        outward = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
        outward *= np.sign((outward * (hull - pixels.mean(axis=0))).sum(axis=1))[:, None]
        within = ((pixels[:, None] - hull) * outward).sum(axis=2)
        return outward[np.abs(within).argmin(axis=1)]


def nearest_edges(
    grey: NDArray[np.float32], pixels: Array, normals: Array, reach: int
) -> tuple[Array, NDArray[np.bool_]]:
    """How far outward (N,) [px] the nearest peak of the slope of grey is within reach, and whether there is one."""
    along = np.arange(-reach - 1, reach + 2)
    places = (pixels[:, None] + along[:, None] * normals[:, None]).astype(np.float32)
    profiles = cv2.remap(grey, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    slopes = 0.5 * np.abs(profiles[:, 2:] - profiles[:, :-2])
    beside = np.pad(slopes, ((0, 0), (1, 1)))
    peak = (slopes > LEAST_EDGE) & (slopes >= beside[:, :-2]) & (slopes >= beside[:, 2:])
    chosen = np.where(peak, np.abs(along[1:-1]), reach + 1).argmin(axis=1)
    return along[1:-1][chosen].astype(float), peak.any(axis=1)
