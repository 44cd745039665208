"""A limb as one closed mesh: balls along a line, and the cones that touch neighbouring ones around it.

Segments of the default body (DESIGN 3) have the forms of people (``girths``); others are a capsule along each bone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel, bone_ends, sole_points
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras import person_model
from bodycam_ros.static_cameras.surface import Faces, Surface

_AROUND = 24  # vertices of each ring
_OVER_CAP = 6  # rings from the pole of a ball to its girth
_LONGEST_M = 0.05  # between two rings
_SHORTEST = 1e-3  # of the limb's length between two rings
_PARALLEL = 1e-6
_CIRCUMSCRIBED = (np.pi / _AROUND) / np.sin(np.pi / _AROUND)
"""Of the rings' radii: by Cauchy's formula a polygon of this size is, over all directions, as wide as the circle."""


@dataclass(frozen=True)
class Ball:
    """One of the balls that a limb is drawn around.

    Attributes:
        along: where on the line from the limb's start to its end; 0 to 1, the ends themselves.
        radius: [m]
        breadth: across the line and ``across``, in radii; 1 is round.
    """

    along: float
    radius: float
    breadth: float = 1.0


def limb_mesh(start: Array, end: Array, balls: Sequence[Ball], across: Array) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around balls along a line.

    Its mean width, over all directions around the line, is that of the limb.

    Args:
        start, end: (3,) of the line [m]; they differ.
        balls: in their order along the line.
        across: (3,) direction in which limbs that are not round are broader; made perpendicular to the line.
    """
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    if np.linalg.norm(np.cross(across, axis)) < _PARALLEL:
        across = np.eye(3)[np.abs(axis).argmin()]
    broad = across - (across @ axis) * axis
    broad = broad / np.linalg.norm(broad)
    rest = np.cross(axis, broad)

    at = np.array([ball.along * length for ball in balls])
    radii = np.array([ball.radius for ball in balls])
    rings = _rings(at, radii)
    radius = _profile(rings, at, radii) * _CIRCUMSCRIBED
    breadth = np.interp(rings, at, [ball.breadth for ball in balls])
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    circle = (radius * breadth)[1:-1, None, None] * np.cos(angle)[:, None] * broad
    circle = circle + radius[1:-1, None, None] * np.sin(angle)[:, None] * rest
    centres = start + rings[:, None] * axis
    vertices = np.concatenate([centres[:1], (centres[1:-1, None] + circle).reshape(-1, 3), centres[-1:]])
    return vertices, _faces(len(rings) - 2)


def _rings(at: Array, radii: Array) -> Array:
    """(R) places of the rings along the line, from pole to pole."""
    first, last = int(np.argmin(at - radii)), int(np.argmax(at + radii))
    low, high = at[first] - radii[first], at[last] + radii[last]
    cap = 1.0 - np.cos(0.5 * np.pi * np.arange(_OVER_CAP + 1) / _OVER_CAP)
    places = np.concatenate([low + radii[first] * cap, high - radii[last] * cap, *_touching(at, radii)])
    places = np.unique(places[(places >= low) & (places <= high)])
    kept = [low]
    for place in places[1:]:
        if place - kept[-1] > _SHORTEST * (high - low):
            steps = int(np.ceil((place - kept[-1]) / _LONGEST_M))
            kept += list(np.linspace(kept[-1], place, steps + 1)[1:])
    kept[-1] = high
    return np.array(kept)


def _touching(at: Array, radii: Array) -> list[Array]:
    """(2,) of each two neighbouring balls: where along the line the cone around them touches them."""
    touching = []
    for (x, y), (p, q) in zip(pairwise(at), pairwise(radii), strict=True):
        if abs(p - q) < y - x:  # else one is within the other
            sine = (p - q) / (y - x)
            touching.append(np.array([x + p * sine, y + q * sine]))
    return touching


def _profile(places: Array, at: Array, radii: Array) -> Array:
    """Radii of the limb at places along the line: the largest of its balls and cones."""
    square = radii**2 - (places[:, None] - at) ** 2
    radius: Array = np.sqrt(np.maximum(square, 0.0).max(axis=1))
    for touching in _touching(at, radii):
        ends = np.sqrt(np.maximum(radii**2 - (touching[:, None] - at) ** 2, 0.0).max(axis=1))
        within = (places >= touching[0]) & (places <= touching[1])
        radius = np.where(within, np.maximum(radius, np.interp(places, touching, ends)), radius)
    return radius


def _faces(rings: int) -> Faces:
    """Two triangles between neighbours on neighbouring rings, a fan at each pole."""
    ring = np.arange(_AROUND)
    following = (ring + 1) % _AROUND
    first, last = 1, 1 + (rings - 1) * _AROUND
    rows = 1 + np.arange(rings - 1)[:, None] * _AROUND
    a, b = (rows + ring).ravel(), (rows + following).ravel()
    c, d = a + _AROUND, b + _AROUND
    return np.concatenate(
        [
            np.stack([np.zeros_like(ring), first + following, first + ring], axis=1),
            np.stack([a, b, d], axis=1),
            np.stack([a, d, c], axis=1),
            np.stack([np.full_like(ring, last + _AROUND), last + ring, last + following], axis=1),
        ]
    ).astype(np.int32)


_X, _Y, _Z = np.eye(3)
_Mesh = tuple[Array, Faces]


def capsule_surfaces(body: BodyModel) -> dict[str, Surface]:
    """Segment -> its surface of capsules; a segment without any bone has none, and neither has equipment.

    Nobody knows how a machine looks whose file has but joints: tubes that are not there would pull at the legs.
    """
    stature = person_model.stature_of(body)
    surfaces = {}
    for segment in body.segments:
        thick = body.girths.get(segment, 1.0)
        parts = [] if segment in body.equipment_segments else _parts(body, segment, thick * stature)
        if parts:
            surfaces[segment] = Surface(segment, *_joined(parts))
    return surfaces


def _parts(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """Of a segment that is as thick as that of a person of some stature."""
    form = _FORMS.get(SegmentName(segment).kind)
    if form is not None and (parts := form(body, segment, stature)):
        return parts
    return _along_bones(body, segment)


def _along_bones(body: BodyModel, segment: str) -> list[_Mesh]:
    parts = []
    for end in bone_ends(body, segment):
        ball = body.girths.get(segment, 1.0) * person_model.SLENDERNESS * float(np.linalg.norm(end))
        parts.append(limb_mesh(np.zeros(3), end, [Ball(0.0, ball), Ball(1.0, ball)], _X))
    return parts


def _limb(balls: list[tuple[float, float]], body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """A limb to the joint on it, or as long as people's are; balls are where along it, and radius / stature."""
    name = SegmentName(segment)
    end = _joints_on(body, segment).get(f"{_BELOW[name.kind]}{name.side}")
    if end is None or _too_near(end, np.zeros(3)):
        end = -person_model.BONES[name.kind] * person_model.stature_of(body) * _Z
    return [limb_mesh(np.zeros(3), end, [Ball(along, radius * stature) for along, radius in balls], _Y)]


def _pelvis(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """As wide as the thighs at its hips are."""
    joints = _joints_on(body, segment)
    spine, hips = joints.get("torso"), _pair(joints, "thigh")
    if spine is None or hips is None or _too_near(*hips) or _too_near(spine, hips.mean(axis=0)):
        return []
    half_hips = 0.5 * float(np.linalg.norm(hips[0] - hips[1])) + person_model.THIGH * stature
    buttocks = _flat(0.0, 2.0 * half_hips, person_model.BUTTOCK_DEPTH * stature)
    waist = _flat(0.5, person_model.WAIST_BREADTH * stature, person_model.WAIST_DEPTH * stature)
    return [limb_mesh(hips.mean(axis=0), spine, [buttocks, waist], hips[0] - hips[1])]


def _torso(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """A trunk, a bar as wide as from shoulder to shoulder, and a neck."""
    joints = _joints_on(body, segment)
    neck, shoulders = joints.get("head"), _pair(joints, "upper_arm")
    if shoulders is None or _too_near(*shoulders) or _too_near(shoulders.mean(axis=0), np.zeros(3)):
        return []
    middle, apart = shoulders.mean(axis=0), shoulders[0] - shoulders[1]
    chest = person_model.CHEST_BREADTH * stature, person_model.CHEST_DEPTH * stature
    waist = _flat(0.1, person_model.WAIST_BREADTH * stature, person_model.WAIST_DEPTH * stature)
    parts = [limb_mesh(np.zeros(3), middle, [waist, _flat(0.4, *chest), _flat(0.75, *chest)], apart)]
    radius = person_model.BICEPS * stature
    inward = apart * (radius / float(np.linalg.norm(apart)))
    ends = shoulders[1] + inward, shoulders[0] - inward
    parts.append(limb_mesh(*ends, [Ball(0.0, radius), Ball(1.0, radius)], _X))
    if neck is not None and not _too_near(neck, middle):
        radius = person_model.NECK * stature
        parts.append(limb_mesh(middle, neck, [Ball(0.0, radius), Ball(1.0, radius)], _Y))
    return parts


def _head(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """An ellipsoid from chin to vertex, and the neck up to it."""
    half_height = 0.5 * person_model.HEAD_HEIGHT * stature
    centre = person_model.NECK_TO_VERTEX * stature * _Z - half_height * _Z
    ball, faces = limb_mesh(np.zeros(3), centre, [Ball(0.0, half_height)], _Y)
    sides = np.array([person_model.HEAD_LENGTH, person_model.HEAD_BREADTH, person_model.HEAD_HEIGHT])
    flat = sides / person_model.HEAD_HEIGHT
    neck = person_model.NECK * stature
    return [(centre + flat * ball, faces), limb_mesh(np.zeros(3), centre, [Ball(0.0, neck), Ball(0.8, neck)], _Y)]


def _foot(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """From heel to toe on the sole."""
    ankle = body.joint_to_parent(segment)
    shin = person_model.BONES["shin"] * person_model.stature_of(body)
    if ankle is not None and SegmentName(ankle.parent).kind == "shin":
        shin = float(np.linalg.norm(ankle.parent_T_joint[:3, 3]))
    back = sole_points(shin)[0]
    heel = -0.5 * back[2]
    toe = 0.5 * heel
    start = back + heel * (_X + _Z)
    end = back + (person_model.FOOT_LENGTH * stature - toe) * _X + toe * _Z
    balls = [
        Ball(0.0, heel, 0.5 * person_model.HEEL_BREADTH * stature / heel),
        Ball(1.0, toe, 0.5 * person_model.FOOT_BREADTH * stature / toe),
    ]
    return [limb_mesh(start, end, balls, _Y)]


def _hand(body: BodyModel, segment: str, stature: float) -> list[_Mesh]:
    """Stretched; its palm faces the body in the N-pose."""
    radius = person_model.WRIST * stature
    palm = Ball(0.0, radius, 0.5 * person_model.HAND_BREADTH / person_model.WRIST)
    fingers = Ball(1.0, 0.5 * radius, palm.breadth)
    return [limb_mesh(np.zeros(3), (0.5 * radius - person_model.HAND_LENGTH * stature) * _Z, [palm, fingers], _X)]


_FORMS: dict[str, Callable[[BodyModel, str, float], list[_Mesh]]] = {
    "pelvis": _pelvis,
    "torso": _torso,
    "head": _head,
    "upper_arm": partial(_limb, [(0.0, person_model.BICEPS), (0.6, person_model.BICEPS), (1.0, person_model.FOREARM)]),
    "forearm": partial(_limb, [(0.0, person_model.FOREARM), (0.25, person_model.FOREARM), (1.0, person_model.WRIST)]),
    "hand": _hand,
    "thigh": partial(_limb, [(0.0, person_model.THIGH), (0.2, person_model.THIGH), (1.0, person_model.KNEE)]),
    "shin": partial(_limb, [(0.0, person_model.KNEE), (0.3, person_model.CALF), (1.0, person_model.ANKLE)]),
    "foot": _foot,
}

_BELOW = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}


def _flat(along: float, breadth: float, depth: float) -> Ball:
    return Ball(along, 0.5 * depth, breadth / depth)


def _joints_on(body: BodyModel, segment: str) -> dict[str, Array]:
    """Child -> (3,) the joint that it hangs on the segment by [m]."""
    hanging = [joint for joint in body.tree_joints if joint.parent == segment and joint.type != "free"]
    return {joint.child: joint.parent_T_joint[:3, 3] for joint in hanging}


def _pair(joints: dict[str, Array], kind: str) -> Array | None:
    """(2, 3) joints of the left and the right one, if the body has both."""
    left, right = joints.get(f"{kind}_left"), joints.get(f"{kind}_right")
    return None if left is None or right is None else np.stack([left, right])


def _too_near(point: Array, other: Array) -> bool:
    """Whether two points are no bone apart."""
    return float(np.linalg.norm(point - other)) < BONE_RADIUS_M


def _joined(parts: list[_Mesh]) -> _Mesh:
    """Several closed meshes as one."""
    before = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = np.concatenate([faces + row for (_, faces), row in zip(parts, before, strict=False)])
    return np.concatenate([vertices for vertices, _ in parts]), faces.astype(np.int32)
