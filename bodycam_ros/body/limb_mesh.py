"""Surfaces of capsules: each limb is the hull of balls along a line, as one closed mesh.

Segments of the default body (docs/joints.md) have the forms of people (``girths``); others are a capsule along each
bone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body import average_person as person
from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel, bone_ends, sole_points
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.body.surface import Faces, Surface, join_meshes
from bodycam_ros.geometry import Array

_AROUND = 24  # vertices of each ring
_RINGS = 20  # between the poles, denser towards them: 4 cm apart in the middle of a thigh
_BETWEEN = 40  # balls that stand for the cone between two
_PARALLEL = 1e-6
_CIRCUMSCRIBED = (np.pi / _AROUND) / np.sin(np.pi / _AROUND)
"""Factor of rings' radii: by Cauchy's formula a polygon of this size is, over all directions, as wide as the circle."""

_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True)
class Ball:
    """One of the balls that a limb is drawn around.

    Attributes:
        along: where on the line from the limb's start to its end; 0 to 1, the ends themselves.
        radius: along the line [m].
        breadth: along ``across``, in radii; 1 is round.
        depth: perpendicular to both, in radii.
    """

    along: float
    radius: float
    breadth: float = 1.0
    depth: float = 1.0


Limb = tuple[Array, Array, Sequence[Ball], Array]
"""Arguments of ``limb_mesh``."""


def limb_mesh(start: Array, end: Array, balls: Sequence[Ball], across: Array) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around balls along a line.

    Its mean width, over all directions around the line, is that of the limb. All limbs have as many vertices.

    Args:
        start, end: (3,) of the line [m]; they differ.
        balls: in their order along the line.
        across: (3,) direction in which limbs that are not round are broader; made perpendicular to the line.
    """
    axis, broad, deep = limb_axes(start, end, across)
    at, radii, breadth, depth = dense_balls(start, end, balls)
    low, high = (at - radii).min(), (at + radii).max()
    rings = low + 0.5 * (high - low) * (1.0 - np.cos(np.pi * np.arange(_RINGS + 2) / (_RINGS + 1)))
    radius = np.sqrt(np.maximum(radii**2 - (rings[1:-1, None] - at) ** 2, 0.0).max(axis=1)) * _CIRCUMSCRIBED
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    circle = (radius * np.interp(rings[1:-1], at, breadth))[:, None, None] * np.cos(angle)[:, None] * broad
    sides = (radius * np.interp(rings[1:-1], at, depth))[:, None, None] * np.sin(angle)[:, None]
    circle = circle + sides * deep
    centres = start + rings[:, None] * axis
    return np.concatenate([centres[:1], (centres[1:-1, None] + circle).reshape(-1, 3), centres[-1:]]), _FACES


def limb_axes(start: Array, end: Array, across: Array) -> Array:
    """Unit vectors (3, 3) along a limb, where it is broad, and perpendicular to both."""
    axis = (end - start) / np.linalg.norm(end - start)
    if np.linalg.norm(np.cross(across, axis)) < _PARALLEL:
        across = np.eye(3)[np.abs(axis).argmin()]
    broad = across - (across @ axis) * axis
    broad = broad / np.linalg.norm(broad)
    return np.stack([axis, broad, np.cross(axis, broad)])


def dense_balls(start: Array, end: Array, balls: Sequence[Ball]) -> Array:
    """(4, N) where balls are from a limb's start [m], their radii [m], breadths and depths in radii.

    Balls between two, with radii between theirs, have the cone that touches both as their hull.
    """
    length = float(np.linalg.norm(end - start))
    numbers = np.array([(ball.along * length, ball.radius, ball.breadth, ball.depth) for ball in balls])
    dense = np.linspace(0.0, len(balls) - 1.0, _BETWEEN * (len(balls) - 1) + 1)
    return np.stack([np.interp(dense, np.arange(len(balls)), column) for column in numbers.T])


def _ring_faces() -> Faces:
    """Two triangles between neighbours on neighbouring rings, a fan at each pole."""
    ring = np.arange(_AROUND)
    following = (ring + 1) % _AROUND
    first, last = 1, 1 + (_RINGS - 1) * _AROUND
    rows = 1 + np.arange(_RINGS - 1)[:, None] * _AROUND
    a, b = (rows + ring).ravel(), (rows + following).ravel()
    c, d = a + _AROUND, b + _AROUND
    fans = [
        np.stack([np.zeros_like(ring), first + following, first + ring], axis=1),
        np.stack([np.full_like(ring, last + _AROUND), last + ring, last + following], axis=1),
    ]
    return np.concatenate([*fans, np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]).astype(np.int32)


_FACES = _ring_faces()


def capsule_surfaces(body: BodyModel) -> dict[str, Surface]:
    """Segment -> its surface of capsules; a segment without any bone has none, and neither has equipment.

    The file of equipment has joints but no form: tubes that are not there would pull at the legs.
    """
    return {
        segment: Surface(*join_meshes([limb_mesh(*limb) for limb in limbs]))
        for segment, limbs in limbs_by_segment(body).items()
    }


def limbs_by_segment(body: BodyModel) -> dict[str, list[Limb]]:
    """Segment -> its limbs, in its frame; those of equipment, and without any bone, have none."""
    limbs = {
        segment: _apart(_person_limbs(body, segment)) or _apart(_bone_limbs(body, segment))
        for segment in body.segments
        if segment not in body.equipment_segments
    }
    return {segment: parts for segment, parts in limbs.items() if parts}


def _apart(limbs: list[Limb]) -> list[Limb]:
    """The limbs whose ends are a bone apart."""
    return [limb for limb in limbs if np.linalg.norm(limb[0] - limb[1]) >= BONE_RADIUS_M]


def _bone_limbs(body: BodyModel, segment: str) -> list[Limb]:
    """A capsule along each bone."""
    slenderness = body.girths.get(segment, 1.0) * person.SLENDERNESS
    ends = [(end, slenderness * float(np.linalg.norm(end))) for end in bone_ends(body, segment)]
    return [(np.zeros(3), end, [Ball(0.0, radius), Ball(1.0, radius)], _X) for end, radius in ends]


_LIMBS = {
    "upper_arm": ("forearm", [(0.0, person.BICEPS), (0.6, person.BICEPS), (1.0, person.FOREARM)]),
    "forearm": ("hand", [(0.0, person.FOREARM), (0.25, person.FOREARM), (1.0, person.WRIST)]),
    "thigh": ("shin", [(0.0, person.THIGH), (0.2, person.THIGH), (1.0, person.KNEE)]),
    "shin": ("foot", [(0.0, person.KNEE), (0.3, person.CALF), (1.0, person.ANKLE)]),
}
"""Kind of segment -> kind of the next one, and balls: where along it, and radius / stature."""


def _person_limbs(body: BodyModel, segment: str) -> list[Limb]:
    """Limbs of a segment of the default body, as thick as those of a person of some stature; none of others."""
    name = SegmentName(segment)
    tall = person.stature_of(body)
    stature = body.girths.get(segment, 1.0) * tall
    hanging = [joint for joint in body.tree_joints if joint.parent == segment and joint.type != "free"]
    joints = {joint.child: joint.parent_T_joint[:3, 3] for joint in hanging}
    if name.kind in _LIMBS:
        below, balls = _LIMBS[name.kind]
        end = joints.get(f"{below}{name.side}")
        if end is None or np.linalg.norm(end) < BONE_RADIUS_M:
            end = -person.BONES[name.kind] * tall * _Z
        return [(np.zeros(3), end, [Ball(along, radius * stature) for along, radius in balls], _Y)]
    if name.kind == "pelvis" and {"torso", "thigh_left", "thigh_right"} <= joints.keys():
        return _pelvis(joints["torso"], joints["thigh_left"], joints["thigh_right"], stature)
    if name.kind == "torso" and {"upper_arm_left", "upper_arm_right"} <= joints.keys():
        return _torso(joints["upper_arm_left"], joints["upper_arm_right"], joints.get("head"), stature)
    if name.kind == "head":
        return _head(stature)
    if name.kind == "foot":
        ankle = body.joint_to_parent(segment)
        has_shin = ankle is not None and SegmentName(ankle.parent).kind == "shin"
        shin = np.linalg.norm(ankle.parent_T_joint[:3, 3]) if ankle and has_shin else person.BONES["shin"] * tall
        return _foot(float(shin), stature)
    return [hand_limb(stature)] if name.kind == "hand" else []


def _pelvis(spine: Array, left: Array, right: Array, stature: float) -> list[Limb]:
    """As wide as the thighs at its hips are."""
    if np.linalg.norm(left - right) < BONE_RADIUS_M:
        return []
    width = float(np.linalg.norm(left - right)) + 2.0 * person.THIGH * stature
    buttocks = _flat(0.0, width, person.BUTTOCK_DEPTH * stature)
    waist = _flat(0.5, person.WAIST_BREADTH * stature, person.WAIST_DEPTH * stature)
    return [(0.5 * (left + right), spine, [buttocks, waist], left - right)]


def _torso(left: Array, right: Array, neck: Array | None, stature: float) -> list[Limb]:
    """A trunk, a bar as wide as from shoulder to shoulder, and a neck."""
    middle, apart = 0.5 * (left + right), left - right
    if np.linalg.norm(apart) < BONE_RADIUS_M or np.linalg.norm(middle) < BONE_RADIUS_M:
        return []
    chest = person.CHEST_BREADTH * stature, person.CHEST_DEPTH * stature
    waist = _flat(0.1, person.WAIST_BREADTH * stature, person.WAIST_DEPTH * stature)
    biceps, throat = person.BICEPS * stature, person.NECK * stature
    inward = apart * (biceps / float(np.linalg.norm(apart)))
    return [
        (np.zeros(3), middle, [waist, _flat(0.4, *chest), _flat(0.75, *chest)], apart),
        (right + inward, left - inward, [Ball(0.0, biceps), Ball(1.0, biceps)], _X),
        (middle, middle if neck is None else neck, [Ball(0.0, throat), Ball(1.0, throat)], _Y),
    ]


def _head(stature: float) -> list[Limb]:
    """An ellipsoid from chin to vertex, and the neck up to it.

    It is round from above: with hair a head is broader than these measures, and a flat ellipsoid in a broader contour
    turns its long side to the cameras.
    """
    half, throat = 0.5 * person.HEAD_HEIGHT * stature, person.NECK * stature
    centre = (person.NECK_TO_VERTEX * stature - half) * _Z
    breadth = 0.5 * (person.HEAD_BREADTH + person.HEAD_LENGTH) / person.HEAD_HEIGHT
    skull = Ball(0.0, half, breadth, breadth)
    return [
        (centre, centre + _Z, [skull], _Y),
        (np.zeros(3), centre, [Ball(0.0, throat), Ball(0.8, throat)], _Y),
    ]


def _foot(shin: float, stature: float) -> list[Limb]:
    """From heel to toe on the sole, of a foot below a shin of a length [m]."""
    back = sole_points(shin)[0]
    heel = -0.5 * back[2]
    toe = 0.5 * heel
    start = back + heel * (_X + _Z)
    end = back + (person.FOOT_LENGTH * stature - toe) * _X + toe * _Z
    breadths = 0.5 * person.HEEL_BREADTH * stature / heel, 0.5 * person.FOOT_BREADTH * stature / toe
    return [(start, end, [Ball(0.0, heel, breadths[0]), Ball(1.0, toe, breadths[1])], _Y)]


def hand_limb(stature: float) -> Limb:
    """A stretched hand of somebody of a stature [m], from the wrist on; its palm faces the body in the N-pose."""
    radius, broad = person.WRIST * stature, 0.5 * person.HAND_BREADTH / person.WRIST
    tip = (0.5 * radius - person.HAND_LENGTH * stature) * _Z
    return np.zeros(3), tip, [Ball(0.0, radius, broad), Ball(1.0, 0.5 * radius, broad)], _X


def _flat(along: float, breadth: float, depth: float) -> Ball:
    return Ball(along, 0.5 * depth, breadth / depth)
