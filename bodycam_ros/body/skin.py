"""A skinned body: one closed surface around the skeleton, and bones that bend it without collapsing.

Vertices move with the weighted sum of their bones' motions (linear blend skinning), as every animation program does it.
Between two segments that are 120 deg apart the mean of both motions is half as thick as the limb. So each joint has a
further bone, its *half bone*, that turns by half of what the joint turns: no two bones that a vertex is shared by are
then more than half a joint's angle apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body import average_person as person
from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel
from bodycam_ros.body.limb_mesh import Limb, capsule_surfaces, hand_limb, limbs_by_segment
from bodycam_ros.body.posture import raised
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body.skin_mesh import joined_mesh, skin_mesh
from bodycam_ros.body.surface import Faces, Surface, vertex_neighbours
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, inverse, rigid, rotation_between, transform_points

MOST_BONES = 4
"""Bones of a vertex, as many as a glTF skin has in one attribute."""

_EDGE = 0.0135  # longest edge, in statures: 2.4 cm of a person of 1.75 m
_ARMS, _LEGS = np.radians(45.0), np.radians(12.0)  # away from the trunk and each other, so that they do not merge
_BEND_RADII = 2.3  # a limb's skin bends over so many of its radii to each side of a joint: a shorter bend folds
_SMOOTHINGS = 6  # of the weights over neighbours, where more than two segments meet
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True, eq=False)
class SkinnedSurface:
    """A closed surface and its bones: the S segments of the body in their order, then H half bones.

    Attributes:
        vertices: (V, 3) in the rest pose [m], in the frame of the root.
        triangles: (T, 3) rows of ``vertices``, counter-clockwise as seen from outside.
        joints: (V, 4) rows of the bones that move each vertex, the heaviest first.
        weights: (V, 4) of these bones; they sum to one.
        rest: (S, 4, 4) poses root_T_segment in the rest pose [m].
        neutral: (S, 4, 4) poses root_T_segment from which half bones turn by the half [m].
        halves: (H, 2) rows of the segments that each half bone is between, the parent first.
    """

    vertices: Array
    triangles: Faces
    joints: NDArray[np.intp]
    weights: Array
    rest: Array
    neutral: Array
    halves: NDArray[np.intp]

    def bone_poses(self, segment_poses: Array) -> Array:
        """Poses (..., S + H, 4, 4) of all bones by those of the segments (..., S, 4, 4), in the same frame [m].

        A half bone is where its child segment begins, and has no rotation in the neutral pose.
        """
        turned = segment_poses[..., :3, :3] @ np.swapaxes(self.neutral[:, :3, :3], -1, -2)
        above, below = turned[..., self.halves[:, 0], :, :], turned[..., self.halves[:, 1], :, :]
        halves = rigid(rotation_between(above, below, 0.5), segment_poses[..., :3, 3][..., self.halves[:, 1], :])
        poses: Array = np.concatenate([segment_poses, halves], axis=-3)
        return poses

    def posed(self, segment_poses: Array) -> Array:
        """Vertices (V, 3) of one pose of the segments (S, 4, 4), in the frame of these poses [m]."""
        moved = self.bone_poses(segment_poses) @ self._bind
        per_vertex = np.einsum("vb,vbij->vij", self.weights, moved[self.joints, :3])
        vertices: Array = np.einsum("vij,vj->vi", per_vertex[..., :3], self.vertices) + per_vertex[..., 3]
        return vertices

    def rebound(self, segment_poses: Array) -> "SkinnedSurface":
        """The same skin with another rest pose, by poses (S, 4, 4) of the segments."""
        return replace(self, vertices=self.posed(segment_poses), rest=segment_poses)

    @cached_property
    def _bind(self) -> Array:
        """(S + H, 4, 4) inverses of the bones' poses in the rest pose."""
        return inverse(self.bone_poses(self.rest))


def skinned_body(body: BodyModel, scanned: Mapping[str, Surface] | None = None) -> SkinnedSurface:
    """The skin of a body, as thick as its girths say, or as it was scanned, in a pose with arms and legs apart.

    Equipment has none. A person without hands has hands on the forearms.

    Args:
        body: of which some segments have a length.
        scanned: segment -> its closed surface, of some segments; they are joined as they are.

    Raises:
        BodyError: no segment has a length to put a skin around, or a scanned surface is not closed.
    """
    limbs = limbs_by_segment(body)
    if not limbs:
        raise BodyError(f"body {body.name}: no segment has a length, so there is nothing to put a skin around")
    limbs = {segment: [*parts, *_stiff_hand(body, segment)] for segment, parts in limbs.items()}
    stature_m = person.stature_of(body)
    rest = raised(body, raised(body, body.n_pose(np.eye(4)), "upper_arm", _ARMS), "thigh", _LEGS)
    pose = {segment: rest[body.segment_index[segment]] for segment in body.segments}
    if scanned:
        surfaces = capsule_surfaces(body) | {s: each for s, each in scanned.items() if s not in body.equipment_segments}
        placed = {s: (pose[s], surface) for s, surface in surfaces.items()}
        vertices, triangles = joined_mesh(placed, _EDGE * stature_m)
    else:
        around = [(pose[segment], limb) for segment, parts in limbs.items() for limb in parts]
        vertices, triangles = skin_mesh(around, _EDGE * stature_m, stature_m)
    distances = _bone_distances(vertices, body, limbs, rest)
    carried = [body.segment_index[segment] for segment in limbs]
    joints = [(body.segment_index[joint.parent], body.segment_index[joint.child]) for joint in body.tree_joints]
    halves = np.array([pair for pair in joints if set(pair) <= set(carried)], np.intp).reshape(-1, 2)
    weights = _bone_weights(vertices, triangles, distances, halves, rest)
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :MOST_BONES]
    heaviest = np.take_along_axis(weights, bones, axis=1)
    heaviest[heaviest < _LEAST_WEIGHT] = 0.0
    bones[heaviest == 0.0] = 0
    heaviest /= heaviest.sum(axis=1, keepdims=True)
    return SkinnedSurface(vertices, triangles, bones, heaviest, rest, rest, halves)


def _stiff_hand(body: BodyModel, segment: str) -> list[Limb]:
    """A hand on the forearm of a body without one: it moves with the forearm."""
    name = SegmentName(segment)
    if name.kind != "forearm" or f"hand{name.side}" in body.segments:
        return []
    stature = body.girths.get(segment, 1.0) * person.stature_of(body)
    (_, wrist, *_), *_ = limbs_by_segment(body)[segment]
    start, end, balls, across = hand_limb(stature)
    return [(wrist + start, wrist + end, balls, across)]


def _bone_distances(vertices: Array, body: BodyModel, limbs: Mapping[str, list[Limb]], rest: Array) -> Array:
    """(V, S) from vertices to the bones of each segment [m]; infinite to segments without a limb.

    Bones meet in the joints, so that as near to one as to the next is where the joint is.
    """
    distances = np.full((len(vertices), len(body.segments)), np.inf)
    for segment, parts in limbs.items():
        row = body.segment_index[segment]
        start = rest[row, :3, 3]
        for end in transform_points(rest[row], np.array(_bone_ends(body, segment, parts))):
            bone, offsets = end - start, vertices - start
            along = np.clip(offsets @ bone / max(float(bone @ bone), 1e-12), 0.0, 1.0)
            away = np.linalg.norm(offsets - along[:, None] * bone, axis=1)
            distances[:, row] = np.minimum(distances[:, row], away)
    return distances


def _bone_ends(body: BodyModel, segment: str, parts: list[Limb]) -> list[Array]:
    """(3,) in the segment's frame [m]: the joints on it, or else where its limbs begin and end."""
    joints = [joint for joint in body.tree_joints if joint.parent == segment and joint.type != "free"]
    ends = [joint.parent_T_joint[:3, 3] for joint in joints]
    if any(np.linalg.norm(end) > BONE_RADIUS_M for end in ends):
        return ends
    return [start + ball.along * (end - start) for start, end, balls, _ in parts for ball in (balls[0], balls[-1])]


def _bone_weights(vertices: Array, triangles: Faces, distances: Array, halves: NDArray[np.intp], rest: Array) -> Array:
    """Weights (V, S + H): each vertex moves with its nearest segment, and near a joint with the joint's half bone."""
    from scipy.sparse import diags_array  # a quarter of a second to load, with the trees of points
    from scipy.spatial import cKDTree

    owners = distances.argmin(axis=1)
    every = np.arange(len(vertices))
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    shares = np.zeros((len(vertices), len(halves)))
    for column, (above, below) in enumerate(halves):
        between = edges[(owners[edges[:, 0]] == above) & (owners[edges[:, 1]] == below)]
        if not len(between):
            continue
        # Where along these edges both segments are equally near: the skin's ring around the joint.
        nearer = distances[between, below] - distances[between, above]
        along = nearer[:, :1] / (nearer[:, :1] - nearer[:, 1:])
        ring = (1.0 - along) * vertices[between[:, 0]] + along * vertices[between[:, 1]]
        radius = float(np.linalg.norm(ring - rest[below, :3, 3], axis=1).mean())
        inside = np.flatnonzero((owners == above) | (owners == below))
        away = cKDTree(ring).query(vertices[inside])[0] / (_BEND_RADII * radius)
        shares[inside, column] = np.maximum(1.0 - away, 0.0)
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1.0)
    weights = np.zeros((len(vertices), len(rest) + len(halves)))
    weights[every, owners] = 1.0 - shares.sum(axis=1)
    weights[:, len(rest) :] = shares
    neighbours = vertex_neighbours(len(vertices), triangles)
    mean = diags_array(0.5 / neighbours.sum(axis=1)) @ neighbours
    for _ in range(_SMOOTHINGS):
        weights = 0.5 * weights + mean @ weights
    return weights
