"""Evidence of a frame's contours about a body's lengths and girths, whatever its pose is.

The shift of a line across the contour depends on the pose of the body, on the lengths between it and the root, on its
segment's girth, and on the forms of people that capsules do not have: smooth bulges, always in the same places. The
pose is eliminated frame by frame, bulges at last.
"""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.body.body_shape import BodyShape
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import BodySurface, Surface
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.region_settings import LEAST_SIGMA_PX, LINES_ALIKE, MIN_LINES, RegionSettings
from bodycam_ros.static_cameras.static_camera import Image, RegionModel

BULGES = 9
"""Bulges of each segment: three to lean, a taper, three to bend, flat rather than round, and thick in the middle."""

_SHARE = 1e-6  # by which a length is changed to measure how the surface moves
_LOOSE_ROOT, _LOOSE_JOINT = np.repeat([0.1, 0.05], 3), 0.15
"""[rad], [m]; [rad] of a pose that was found with a body that is about right."""


class ShapeEvidence:
    """Evidence of images about the shape of a body.

    Args:
        shape: what is unknown of it.
        lasting: (K + S BULGES,) shares and bulges [m], as far as they are known.
        settings: how lines are trusted.

    Attributes:
        body: of these shares, with the limits of people.
        surface: its capsules, with these bulges.
    """

    def __init__(self, shape: BodyShape, lasting: Array, settings: RegionSettings) -> None:
        self._shape = shape
        self._settings = settings
        self._size = len(lasting)
        shares, bulges = lasting[: shape.size], lasting[shape.size :].reshape(-1, BULGES)
        self.body = with_usual_limits(shape.shaped(shares))
        self._capsules = capsule_surfaces(self.body)
        row_of = self.body.segment_index
        surfaces = {name: _bulged(surface, bulges[row_of[name]]) for name, surface in self._capsules.items()}
        self.surface = BodySurface.of(self.body, surfaces)
        self._step = ArticulatedStep(self.body)
        changed = [self._vertices(shares + _SHARE * unit) for unit in np.eye(shape.size)]
        self._growth = (np.stack(changed, axis=1) - self._vertices(shares)[:, None]) / _SHARE
        self._parents = [row_of[joint.parent] for joint, _ in shape.lengths]
        self._axes = [axis for _, axis in shape.lengths]
        self._moves = self.body.moves[:, [self.body.joint_row[joint.name] for joint, _ in shape.lengths]]

    def _vertices(self, shares: Array) -> Array:
        """(V, 3) vertices of the capsules of a body with shares (K,), in their segments' frames."""
        return np.concatenate([each.vertices for each in capsule_surfaces(self._shape.shaped(shares)).values()])

    def measure(
        self, views: Mapping[str, RegionModel], images: Mapping[str, Image], poses: Array
    ) -> tuple[Array, Array]:
        """Normal equations (size, size), (size,) of what lasts, the body's pose near poses (S, 4, 4) eliminated."""
        turns = self._step.jacobians(poses)
        lengths = self._shape.initial[: len(self._parents)]
        # A length moves all that hangs on its joint, along an axis of the parent.
        shifts = poses[self._parents, :3, self._axes].T * lengths
        moves = self._moves[:, None] * (np.swapaxes(poses[:, :3, :3], 1, 2) @ shifts)
        pose_size, shape_size = turns.shape[2], self._shape.size
        total = pose_size + self._size
        A, b = np.zeros((total, total)), np.zeros(total)
        for name, image in images.items():
            contour = views[name].find_contour(poses)
            measured = views[name].measure(image, contour, 1)
            weights = 1.0 / (measured.variances + LEAST_SIGMA_PX**2) / LINES_ALIKE
            for row in np.unique(contour.segments):
                if measured.lines[row] < max(MIN_LINES, self._settings.least_confidence * measured.asked[row]):
                    continue
                lines = np.flatnonzero((contour.segments == row) & np.isfinite(measured.shifts))
                points = contour.points[lines]
                p, slope = points[:, 4:7], points[:, 7:10]
                growth = self._growth_at(points)
                growth[:, : len(lengths)] += moves[row].T
                by_pose = np.concatenate([np.cross(p, slope), slope], axis=1) @ turns[row]
                J = np.concatenate([by_pose, (growth @ slope[:, :, None])[..., 0], self._bulges(row, p, slope)], axis=1)
                first = pose_size + shape_size + BULGES * row
                columns = np.concatenate([np.arange(pose_size + shape_size), np.arange(first, first + BULGES)])
                weighted = J * weights[lines, None]
                A[np.ix_(columns, columns)] += weighted.T @ J
                b[columns] += weighted.T @ measured.shifts[lines]
        return self._without_pose(A, b, pose_size, poses)

    def _without_pose(self, A: Array, b: Array, size: int, poses: Array) -> tuple[Array, Array]:
        """The Schur complement of the pose's unknowns, which come first."""
        of_pose, pull = A[:size, :size].copy(), b[:size].copy()
        self._step.add_prediction(of_pose, pull, poses, PredictedBody(poses, _LOOSE_ROOT, _LOOSE_JOINT))
        solved = np.linalg.solve(of_pose, np.column_stack([A[:size, size:], pull]))
        information: Array = A[size:, size:] - A[size:, :size] @ solved[:, :-1]
        vector: Array = b[size:] - A[size:, :size] @ solved[:, -1]
        return information, vector

    def _growth_at(self, points: Array) -> Array:
        """(N, K, 3) how points of a contour move in their segments with the shares."""
        first, second = self.surface.edges[points[:, 12].astype(np.int64)].T
        start, end = self.surface.vertices[first], self.surface.vertices[second]
        along = np.linalg.norm(points[:, 4:7] - start, axis=1) / np.linalg.norm(end - start, axis=1)
        growth: Array = self._growth[first] + along[:, None, None] * (self._growth[second] - self._growth[first])
        return growth

    def _bulges(self, row: int, p: Array, slope: Array) -> Array:
        """(N, BULGES) how far the contour moves [px/m] with the bulges of its segment."""
        steep = np.linalg.norm(slope, axis=1)[:, None]
        forms: Array = _bulge_forms(slope / steep, p[:, 2], self._capsules[self.body.segments[row]]) * steep
        return forms


def _bulge_forms(normals: Array, z: Array, surface: Surface) -> Array:
    """(N, BULGES) how far outward a surface is moved by a unit of each bulge, by outward normals (N, 3) at z (N,)."""
    x, y, across = normals.T
    low, high = surface.vertices[:, 2].min(), surface.vertices[:, 2].max()
    t = 2.0 * (z - low) / (high - low) - 1.0
    forms: Array = np.column_stack([x, y, across, t, t * x, t * y, t * across, x * x - y * y, t * t - 1.0 / 3.0])
    return forms


def _bulged(surface: Surface, bulges: Array) -> Surface:
    """A surface with bulges (BULGES,) [m] on it; vertices and faces keep their order."""
    normals = np.zeros_like(surface.vertices)
    np.add.at(normals, surface.faces, surface.scaled_normals[:, None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outward = _bulge_forms(normals, surface.vertices[:, 2], surface) @ bulges
    return Surface(surface.vertices + outward[:, None] * normals, surface.faces)
