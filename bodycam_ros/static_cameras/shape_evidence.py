"""What the contours of an instant say of a body's lengths and girths, whatever its pose is.

A line across the contour says by how many pixels the contour is off. It moves with the pose of the body, with the
lengths between it and the root, with its segment's girth, and with what people have on them that capsules have not:
smooth bulges, always in the same places. The pose is eliminated at once, bulges at last.
"""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.errors import StationError
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.body_shape import BodyShape, BodySurface
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.region_settings import LEAST_SIGMA_PX, LINES_ALIKE, RegionSettings
from bodycam_ros.static_cameras.station import Image, RegionModel
from bodycam_ros.static_cameras.surface import BULGES, along_of, bulge_forms, bulged

_PROBES = (1e-6, -1e-6, 1e-8, -1e-8, 1e-10, -1e-10)
"""Shares by which a length is changed to see how the surface moves; the first that gives no limb another ring."""

_MIN_LINES = 4
"""That measure something of a segment."""

_LOOSE_ROOT, _LOOSE_JOINT = np.repeat([0.1, 0.05], 3), 0.15
"""[rad], [m]; [rad] of a pose that was found with a body that is about right."""


class ShapeEvidence:
    """Asks lines about the shape of a body.

    Args:
        shape: what is unknown of it.
        lasting: (K + S BULGES,) shares and bulges [m], as far as they are known.
        settings: how lines are trusted.

    Attributes:
        body: of these shares, with the limits of people.
        surface: its capsules, with these bulges.
    """

    def __init__(self, shape: BodyShape, lasting: Array, settings: RegionSettings) -> None:
        self._shape, self._settings = shape, settings
        shares, bulges = lasting[: shape.size], lasting[shape.size :].reshape(-1, BULGES)
        self.body = with_usual_limits(shape.shaped(shares))
        self._capsules = capsule_surfaces(self.body)
        self._vertices = BodySurface.of(self.body, self._capsules).vertices
        self.surface = BodySurface.of(self.body, bulged(self.body, self._capsules, bulges))
        self._size = len(lasting)
        self._step = ArticulatedStep(self.body)
        self._growth = np.stack([self._grown(shares, row) for row in range(shape.size)], axis=1)
        row_of = self.body.segment_index
        self._parents = [row_of[joint.parent] for joint, _ in shape.lengths]
        self._axes = [axis for _, axis in shape.lengths]
        self._initial = np.array([joint.parent_T_joint[axis, 3] for joint, axis in shape.lengths])
        self._moves = self.body.moves[:, [self.body.joint_row[joint.name] for joint, _ in shape.lengths]]

    def of_instant(
        self, views: Mapping[str, RegionModel], images: Mapping[str, Image], poses: Array
    ) -> tuple[Array, Array]:
        """Normal equations (size, size), (size,) of what lasts, the body's pose near poses (S, 4, 4) eliminated."""
        turns = self._step.jacobians(poses)
        # A length moves all that hangs on its joint, along an axis of the parent.
        shifts = poses[self._parents, :3, self._axes].T * self._initial
        moves = self._moves[:, None] * (np.swapaxes(poses[:, :3, :3], 1, 2) @ shifts)
        pose_size, shape_size = turns.shape[2], self._shape.size
        total = pose_size + self._size
        A, b = np.zeros((total, total)), np.zeros(total)
        for name, image in images.items():
            contour = views[name].find_contour(poses)
            off_px, variance = views[name].line_shifts(image, contour)
            weights = 1.0 / (variance + LEAST_SIGMA_PX**2) / LINES_ALIKE
            for row in np.unique(contour.segments):
                lines = np.flatnonzero((contour.segments == row) & np.isfinite(off_px))
                asked = np.count_nonzero(contour.segments == row)
                if len(lines) < max(_MIN_LINES, self._settings.least_confidence * asked):
                    continue
                points = contour.points[lines]
                p, slope = points[:, 4:7], points[:, 7:10]
                grown = self._growth_at(points)
                grown[:, : len(self._initial)] += moves[row].T
                J = np.concatenate(
                    [
                        np.concatenate([np.cross(p, slope), slope], axis=1) @ turns[row],
                        (grown @ slope[:, :, None])[..., 0],
                        self._bulges(row, p, slope),
                    ],
                    axis=1,
                )
                first = pose_size + shape_size + BULGES * row
                columns = np.concatenate([np.arange(pose_size + shape_size), np.arange(first, first + BULGES)])
                weighted = J * weights[lines, None]
                A[np.ix_(columns, columns)] += weighted.T @ J
                b[columns] += weighted.T @ off_px[lines]
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
        growth = self._growth
        moved: Array = growth[first] + along[:, None, None] * (growth[second] - growth[first])
        return moved

    def _bulges(self, row: int, p: Array, slope: Array) -> Array:
        """(N, BULGES) how far the contour moves [px/m] with the bulges of its segment."""
        steep = np.linalg.norm(slope, axis=1)[:, None]
        along = along_of(p[:, 2], self._capsules[self.body.segments[row]])
        moved: Array = bulge_forms(slope / steep, along) * steep
        return moved

    def _grown(self, shares: Array, row: int) -> Array:
        """(V, 3) how vertices move in their segments with a share."""
        for tiny in _PROBES:
            more = shares.copy()
            more[row] += tiny
            body = self._shape.shaped(more)
            vertices = BodySurface.of(body, capsule_surfaces(body)).vertices
            if len(vertices) == len(self._vertices):
                break
        else:
            raise StationError(f"the surface of {self.body.name} changes its rings with every change of a length")
        grown: Array = (vertices - self._vertices) / tiny
        return grown
