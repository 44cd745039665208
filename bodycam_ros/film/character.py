"""The person who is filmed: the skin of the body, in clothes, and the equipment."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body.skin import SkinnedSurface, skinned_body
from bodycam_ros.body.surface import Faces, Surface, join_meshes, vertex_neighbours
from bodycam_ros.environment.machines import COLOURS, machine_parts
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.results.colours import linear

_SKIN, _SHIRT, _TROUSERS, _SHOES, _HAIR, _SOLES, _EQUIPMENT = range(7)
_CLOTHING = "#d8a98c", "#3f6f9e", "#3b414a", "#e4e2dd", "#4a3426", "#55595e"
PALETTE = np.array([linear(each) for each in (*_CLOTHING, *COLOURS)], np.float32)
"""(C, 3) colours, linear in light: skin, shirt, trousers, shoes, hair, soles; of equipment paint, rubber and metal."""

_CLOTHES = {
    "head": _SKIN, "hand": _SKIN, "forearm": _SKIN,
    "torso": _SHIRT, "upper_arm": _SHIRT,
    "pelvis": _TROUSERS, "thigh": _TROUSERS, "shin": _TROUSERS,
    "foot": _SHOES,
}  # fmt: skip
"""Kind of segment -> what is seen on it; others are as the shirt."""

_HAIRLINE = (0.62, 0.62)  # height in the middle of the head, and how it rises to the front, in heights of the head
_SOLE_M = 0.02
_BORDER_M = 0.03  # over which shares change
_SMOOTHINGS = 12  # of the borders of garments over neighbouring vertices


@dataclass(frozen=True, eq=False)
class PosedMesh:
    """Closed meshes of one time.

    Attributes:
        vertices: (V, 3) in the world [m].
        triangles: (T, 3) rows of them, counter-clockwise as seen from outside.
        shares: (V, C) how much of each vertex each colour of ``PALETTE`` has; the largest is seen.
    """

    vertices: NDArray[np.float32]
    triangles: Faces
    shares: NDArray[np.float32]


class Character:
    """A body with clothes on.

    Args:
        body: with its equipment.
        lengths: of the equipment, as they were estimated [m]; see ``machine_parts``.
        scanned: segment -> its surface, of some segments; others are as thick as their girths.

    Raises:
        BodyError: no segment has a length to put a skin around, or a scanned surface is not closed.
    """

    def __init__(
        self,
        body: BodyModel,
        lengths: Mapping[str, float] = MappingProxyType({}),
        scanned: Mapping[str, Surface] | None = None,
    ) -> None:
        self._body = body
        self._skin = skinned_body(body, scanned)
        self._parts = machine_parts(body, lengths)
        clothes = np.array([_CLOTHES.get(SegmentName(name).kind, _SHIRT) for name in body.segments])
        self._shares = _segment_shares(self._skin, len(body.segments)) @ np.eye(len(PALETTE), dtype=np.float32)[clothes]
        neighbours = _neighbours(self._skin)
        for _ in range(_SMOOTHINGS):
            self._shares = neighbours @ self._shares
        self._add_hair_and_soles()

    def _add_hair_and_soles(self) -> None:
        """By them one sees where a person faces, and what touches the ground."""
        nearest = self._skin.joints[:, 0]
        for row, name in enumerate(self._body.segments):
            kind = SegmentName(name).kind
            rows = np.flatnonzero(nearest == row)
            if kind not in ("head", "foot") or not len(rows):
                continue
            x, _, z = transform_points(inverse(self._skin.rest[row]), self._skin.vertices[rows]).T
            if kind == "head":
                added, inside_m = _HAIR, z - _HAIRLINE[0] * z.max() - _HAIRLINE[1] * x
            else:
                added, inside_m = _SOLES, z.min() + _SOLE_M - z
            share = np.clip(0.5 + inside_m / _BORDER_M, 0.0, 1.0).astype(np.float32)
            self._shares[rows] *= 1.0 - share[:, None]
            self._shares[rows, added] += share

    def posed(self, segment_poses: Array, *, with_equipment: bool = True, rolled_m: float = 0.0) -> PosedMesh:
        """The person, and the equipment, at poses world_T_segment (S, 4, 4) [m]; wheels have rolled so far [m]."""
        meshes = [(self._skin.posed(segment_poses), self._skin.triangles.astype(np.int32))]
        colours = []
        if with_equipment:
            for part in self._parts:
                pose = segment_poses[self._body.segment_index[part.segment]]
                meshes.append((part.placed(pose, rolled_m), part.triangles))
                colours.append(_EQUIPMENT + part.colour)
        shares = [self._shares]
        for (vertices, _), colour in zip(meshes[1:], colours, strict=True):
            one = np.zeros((len(vertices), len(PALETTE)), np.float32)
            one[:, colour] = 1.0
            shares.append(one)
        vertices, triangles = join_meshes(meshes)
        return PosedMesh(vertices.astype(np.float32), triangles, np.concatenate(shares))


def _segment_shares(skin: SkinnedSurface, segments: int) -> NDArray[np.float32]:
    """(V, S) how much each segment moves each vertex; half bones count for both that they are between."""
    by_bone = np.zeros((len(skin.vertices), segments + len(skin.halves)), np.float32)
    np.add.at(by_bone, (np.arange(len(by_bone))[:, None], skin.joints), skin.weights)
    shares = by_bone[:, :segments].copy()
    for pair, half in zip(skin.halves, by_bone[:, segments:].T, strict=True):
        shares[:, pair] += 0.5 * half[:, None]
    return shares


def _neighbours(skin: SkinnedSurface) -> csr_array:
    """(V, V) that means each vertex with those beside it."""
    count = len(skin.vertices)
    beside = vertex_neighbours(count, skin.triangles).astype(np.float32) + eye_array(count, dtype=np.float32)
    return csr_array(diags_array(1.0 / beside.sum(axis=1)) @ beside)
