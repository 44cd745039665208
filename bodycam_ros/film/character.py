"""The person who is filmed: the skin of the body, in clothes, and lines of equipment as tubes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import Ball, limb_mesh
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body.skin import SkinnedSurface, skinned_body
from bodycam_ros.body.stick_figure import Bone
from bodycam_ros.body.surface import Faces, join_meshes
from bodycam_ros.geometry import Array
from bodycam_ros.results.picture_style import EQUIPMENT, rgb

_SKIN, _SHIRT, _TROUSERS, _SHOES = "#d8a98c", "#3f6f9e", "#3b414a", "#e4e2dd"
_CLOTHES = {
    "head": _SKIN, "hand": _SKIN, "forearm": _SKIN,
    "torso": _SHIRT, "upper_arm": _SHIRT,
    "pelvis": _TROUSERS, "thigh": _TROUSERS, "shin": _TROUSERS,
    "foot": _SHOES,
}  # fmt: skip
"""Kind of segment -> what is seen on it; others are as the shirt."""

_TUBE_M = 0.014
_SHORTEST_M = 1e-3


@dataclass(frozen=True, eq=False)
class PosedMesh:
    """Closed meshes of one time.

    Attributes:
        vertices: (V, 3) in the world [m].
        triangles: (T, 3) rows of them, counter-clockwise as seen from outside.
        colours: (V, 3) red, green and blue, linear in light, 0 to 1.
    """

    vertices: NDArray[np.float32]
    triangles: Faces
    colours: NDArray[np.float32]


class Character:
    """A body with clothes on.

    Raises:
        BodyError: no segment has a length to put a skin around.
    """

    def __init__(self, body: BodyModel) -> None:
        self._skin = skinned_body(body)
        segments = _segment_of_vertices(self._skin, len(body.segments))
        kinds = [SegmentName(name).kind for name in body.segments]
        palette = np.array([linear(_CLOTHES.get(kind, _SHIRT)) for kind in kinds], np.float32)
        self._colours = palette[segments]

    def posed(self, segment_poses: Array, equipment: Sequence[Bone] = ()) -> PosedMesh:
        """The person at poses world_T_segment (S, 4, 4) [m], with lines of equipment at the same one time."""
        meshes = [(self._skin.posed(segment_poses), self._skin.triangles.astype(np.int32))]
        meshes += [tube(bone.start[0], bone.end[0]) for bone in equipment if _length(bone) > _SHORTEST_M]
        vertices, triangles = join_meshes(meshes)
        colours = np.empty((len(vertices), 3), np.float32)
        colours[: len(self._colours)] = self._colours
        colours[len(self._colours) :] = linear(EQUIPMENT)
        return PosedMesh(vertices.astype(np.float32), triangles, colours)


def tube(start: Array, end: Array) -> tuple[Array, Faces]:
    """A closed mesh (V, 3), (T, 3) around a line between two points (3,) [m]."""
    return limb_mesh(start, end, [Ball(0.0, _TUBE_M), Ball(1.0, _TUBE_M)], np.array([0.0, 0.0, 1.0]))


def linear(colour: str) -> tuple[float, ...]:
    """Red, green and blue, linear in light, 0 to 1, of ``#rrggbb``."""
    return tuple((value / 255.0) ** GAMMA for value in rgb(colour))


GAMMA = 2.2
"""Exponent from values of a picture to light."""


def _segment_of_vertices(skin: SkinnedSurface, segments: int) -> NDArray[np.intp]:
    """(V,) the segment that moves each vertex most; half bones count for both that they are between."""
    shares = np.zeros((len(skin.vertices), segments))
    rows = np.arange(len(skin.vertices))
    for bone, weight in zip(skin.joints.T, skin.weights.T, strict=True):
        is_half = bone >= segments
        owner = np.where(is_half, 0, bone)
        np.add.at(shares, (rows, owner), np.where(is_half, 0.0, weight))
        if len(skin.halves):
            pair = skin.halves[np.where(is_half, bone - segments, 0)]
            for side in range(2):
                np.add.at(shares, (rows, pair[:, side]), np.where(is_half, 0.5 * weight, 0.0))
    return shares.argmax(axis=1)


def _length(bone: Bone) -> float:
    return float(np.linalg.norm(bone.end[0] - bone.start[0]))
