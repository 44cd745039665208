"""What of a body's shape static cameras tell: where joints are on their segments, and how thick segments are.

Unknown are shares of what the body that is begun with has: of each coordinate of a joint in its parent, and of the
girth of each segment.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BONE_RADIUS_M, THICKEST, THINNEST, BodyModel
from bodycam_ros.calibration.anthropometry import mirrored
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.settings import SettingsGroups, setting
from bodycam_ros.static_cameras import person_model
from bodycam_ros.static_cameras.contour_kernels import NOBODY
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.surface import OPEN, Surface

Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BodySurface:
    """Vertices, faces and edges of a body, each with the row of its segment.

    Attributes:
        segment_count: of the body, with and without a surface.
        vertices, segment_of_vertex: (V, 3) in their segments' frames [m], (V,).
        faces, face_normals, face_offsets, segment_of_face: (F, 3), (F, 3), (F,) [m], (F,).
        edges, edge_faces: (E, 2), (E, 2); -1 where there is no second face.
    """

    segment_count: int
    vertices: Array
    segment_of_vertex: Whole
    faces: Whole
    face_normals: Array
    face_offsets: Array
    segment_of_face: Whole
    edges: Whole
    edge_faces: Whole

    @classmethod
    def of(cls, body: BodyModel, surfaces: Mapping[str, Surface]) -> "BodySurface":
        """Of surfaces by segment.

        Raises:
            BodyError: the body has more segments than labels, or none with a surface.
        """
        there = [(row, surfaces[segment]) for row, segment in enumerate(body.segments) if segment in surfaces]
        if not there or len(body.segments) >= NOBODY:
            raise BodyError(
                f"body {body.name}: {len(there)} of its {len(body.segments)} segments have a surface; static cameras "
                f"need one at least, and follow at most {NOBODY - 1} segments"
            )
        vertices_before = np.cumsum([0, *(len(surface.vertices) for _, surface in there)])
        faces_before = np.cumsum([0, *(len(surface.faces) for _, surface in there)])

        def rows(counts: list[int]) -> Whole:
            return np.repeat([row for row, _ in there], counts).astype(np.int64)

        edge_faces = [
            np.where(surface.edge_faces == OPEN, OPEN, surface.edge_faces + before)
            for (_, surface), before in zip(there, faces_before, strict=False)
        ]
        return cls(
            len(body.segments),
            np.concatenate([surface.vertices for _, surface in there]),
            rows([len(surface.vertices) for _, surface in there]),
            _whole([s.faces + before for (_, s), before in zip(there, vertices_before, strict=False)]),
            np.concatenate([surface.face_normals for _, surface in there]),
            np.concatenate([surface.face_offsets for _, surface in there]),
            rows([len(surface.faces) for _, surface in there]),
            _whole([s.edges + before for (_, s), before in zip(there, vertices_before, strict=False)]),
            _whole(edge_faces),
        )


def _whole(values: list[NDArray[np.integer]]) -> Whole:
    return np.ascontiguousarray(np.concatenate(values), np.int64)


@dataclass(frozen=True)
class ShapeSettings:
    """What is expected of a body that static cameras measure."""

    length_sigma: float = setting(
        0.06,
        limits=(0.001, 1.0),
        reason="relative error of a length beforehand; raise it for bodies of unusual proportions",
    )


_GIRTH_SIGMA = 0.08  # relative; people's girths differ by some 8 %
_ASYMMETRY_SIGMA = 0.01  # share of a length by which left and right differ: 4 mm of a thigh
_GIRTH_ASYMMETRY_SIGMA = 0.03  # the same of girths


@dataclass(frozen=True)
class MeasureSettings(SettingsGroups):
    """Settings of measuring a body by static cameras, beside those of following it."""

    shape: ShapeSettings = ShapeSettings()


_SHORTEST = -0.9  # share: a length or girth keeps its sign


class BodyShape:
    """The unknown shares of a body's lengths, then of its girths; 0 as they were.

    Args:
        body: that is begun with; alone, without equipment.
        settings: how far it may be off.

    Attributes:
        lengths: (joint, axis) of each unknown length, a coordinate of the joint in its parent.
        thick: segment of each unknown girth.
        size: K, of both.
    """

    def __init__(self, body: BodyModel, settings: ShapeSettings) -> None:
        self._body, self._settings = body, settings
        self._stature = person_model.stature_of(body)
        self.lengths = [
            (joint, axis)
            for joint in body.tree_joints
            for axis in range(3)
            if abs(joint.parent_T_joint[axis, 3]) > BONE_RADIUS_M
        ]
        self.thick = list(capsule_surfaces(body))
        self.size = len(self.lengths) + len(self.thick)

    def shaped(self, shares: Array) -> BodyModel:
        """The body with other lengths and girths, by shares (K,) of those that it had."""
        places = {joint.name: joint.parent_T_joint.copy() for joint, _ in self.lengths}
        for (joint, axis), share in zip(self.lengths, shares, strict=False):
            places[joint.name][axis, 3] *= 1.0 + max(float(share), _SHORTEST)
        joints = [
            replace(joint, parent_T_joint=places.get(joint.name, joint.parent_T_joint)) for joint in self._body.joints
        ]
        body = replace(self._body, joints=tuple(joints))
        # Girths are said in those of people of the body's size, and its size may have changed.
        size = self._stature / person_model.stature_of(body)
        thick = {
            segment: float(np.clip(size * self._girth(segment) * (1.0 + share), THINNEST, THICKEST))
            for segment, share in zip(self.thick, shares[len(self.lengths) :], strict=True)
        }
        return replace(body, girths=thick)

    def prior(self, shares: Array) -> tuple[Array, Array]:
        """What is expected beforehand, as normal equations (K, K), (K,) about shares (K,); left is as right."""
        count = len(self.lengths)
        sigmas = np.repeat([self._settings.length_sigma, _GIRTH_SIGMA], [count, len(self.thick)])
        sizes = np.array(
            [abs(joint.parent_T_joint[axis, 3]) for joint, axis in self.lengths] + [*map(self._girth, self.thick)]
        )
        J, residuals = [np.diag(1.0 / sigmas)], [shares / sigmas]
        for pair in self._pairs:
            sigma = _ASYMMETRY_SIGMA if pair[0] < count else _GIRTH_ASYMMETRY_SIGMA
            row = np.zeros((1, self.size))
            row[0, pair] = sizes[pair] * [1.0, -1.0] / (sizes[pair].mean() * sigma)
            J.append(row)
            residuals.append(row @ (1.0 + shares))
        rows, off = np.concatenate(J), np.concatenate(residuals)
        return rows.T @ rows, -rows.T @ off

    @cached_property
    def _pairs(self) -> list[list[int]]:
        """Rows of what is on one side, and of the same on the other."""
        names = [(joint.name, axis) for joint, axis in self.lengths] + [(segment, -1) for segment in self.thick]
        row = {name: number for number, name in enumerate(names)}
        opposite = [row.get((mirrored(name) or "", axis), -1) for name, axis in names]
        return [[own, other] for own, other in enumerate(opposite) if other > own]

    def _girth(self, segment: str) -> float:
        return self._body.girths.get(segment, 1.0)
