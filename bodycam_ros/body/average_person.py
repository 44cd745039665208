"""An average person: bone lengths, girths, masses, and a body of a given height.

Girths are fractions of the stature, the mean of the women's and the men's. Girths of limbs and the chest: means of 247
men, 177.7 cm tall, and 260 women, 164.9 cm tall, of Heinz, Peterson, Johnson and Kerk 2003, "Exploring relationships in
body dimensions", Journal of Statistics Education 11(2); people who exercise, of normal weight, with the biceps tensed
and the thigh measured below the gluteal fold. Waist, buttocks, neck, head and the breadths of heel and hand, which are
not in it: means of 4082 men, 175.6 cm tall, and 1986 women, 162.9 cm tall, of Gordon et al. 2014, *2012 anthropometric
survey of U.S. Army personnel*. The height of the head, hand and foot: Drillis and Contini 1966 (in Winter,
*Biomechanics and Motor Control of Human Movement*, figure 4.1); from the neck up: de Leva 1996, table 4.

Limbs are those of de Leva 1996, table 4, and shoulders are as high
above the hips as the middle of the shoulders there: 515.5 mm of men, 497.9 mm of women. All that is used of that table
was compared with another transcription of it. The spine bends and the neck begins where Dumas, Cheze and Verriest 2007,
"Adjustments to McConville et al. and Young et al. body segment inertial parameters", put the joints between pelvis,
torso and head, of men 1.77 m and women 1.61 m tall. No second transcription of these four lengths was at hand; by them
the neck's joint is 0.023 of the stature below de Leva's cervicale, which is on the skin behind it. Distances between
the centres of the hips, and of the shoulders, which tables have from skin to skin only, are round values.

Shares of the mass, centres of mass and radii of gyration are those of de Leva 1996, "Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters", table 4, the mean of women's and men's, compared with two
transcriptions of it. They scale with a segment's bone, or with the stature where a segment has no bone between two
joints. The trunk's parts hang from the cervicale: the lower one is the pelvis, the other two are the torso, which meet
where the omphalion is and not at the joint of the spine. A segment that a body lacks, such as a hand, is rigidly part
of the next one towards the root.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from bodycam_ros.body.body_model import BONE_RADIUS_M, BodyModel, Mass, combined, sole_points
from bodycam_ros.body.segment_name import LEFT, RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint import Joint

_STATURES_M = np.array([1.741, 1.735])  # of the men and women of the table

# Men, then women: length [m]; share of the mass; centre's distance from the upper end in lengths; radii of gyration in
# lengths about the sagittal (forward), transverse (to the side) and longitudinal axis.
_TABLE = {
    "head": ((0.2429, 0.0694, 0.5002, 0.303, 0.315, 0.261), (0.2437, 0.0668, 0.4841, 0.271, 0.295, 0.261)),
    "upper trunk": ((0.2421, 0.1596, 0.5066, 0.505, 0.320, 0.465), (0.2280, 0.1545, 0.5050, 0.466, 0.314, 0.449)),
    "middle trunk": ((0.2155, 0.1633, 0.4502, 0.482, 0.383, 0.468), (0.2053, 0.1465, 0.4512, 0.433, 0.354, 0.415)),
    "lower trunk": ((0.1457, 0.1117, 0.6115, 0.615, 0.551, 0.587), (0.1815, 0.1247, 0.4920, 0.433, 0.402, 0.444)),
    "upper_arm": ((0.2817, 0.0271, 0.5772, 0.285, 0.269, 0.158), (0.2751, 0.0255, 0.5754, 0.278, 0.260, 0.148)),
    "forearm": ((0.2689, 0.0162, 0.4574, 0.276, 0.265, 0.121), (0.2643, 0.0138, 0.4559, 0.261, 0.257, 0.094)),
    "hand": ((0.1879, 0.0061, 0.3624, 0.288, 0.235, 0.184), (0.1701, 0.0056, 0.3427, 0.244, 0.208, 0.154)),
    "thigh": ((0.4222, 0.1416, 0.4095, 0.329, 0.329, 0.149), (0.3685, 0.1478, 0.3612, 0.369, 0.364, 0.162)),
    "shin": ((0.4403, 0.0433, 0.4395, 0.251, 0.246, 0.102), (0.4386, 0.0481, 0.4352, 0.267, 0.263, 0.092)),
    "foot": ((0.2581, 0.0137, 0.4415, 0.257, 0.245, 0.124), (0.2283, 0.0129, 0.4014, 0.299, 0.279, 0.139)),
}
"""Head from the vertex to the cervicale, upper trunk from there to the xiphion, middle trunk to the omphalion, lower
trunk to the middle of the hips; hand from the wrist to the tip of the middle finger, foot from heel to toe."""

BONE_ENDS = {"torso": "head", "upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
"""Kind of segment -> kind of the segment at the far end of its bone."""

THIGH, KNEE, CALF, ANKLE = (girth / (2.0 * np.pi) for girth in (0.332, 0.212, 0.211, 0.130))
BICEPS, FOREARM, WRIST, NECK = (girth / (2.0 * np.pi) for girth in (0.182, 0.152, 0.094, 0.215))
"""Radii of round sections with the girths that were measured."""

CHEST_BREADTH, CHEST_DEPTH = 0.163, 0.112
WAIST_BREADTH, WAIST_DEPTH = 0.183, 0.133
BUTTOCK_DEPTH = 0.145
HEAD_BREADTH, HEAD_LENGTH = 0.089, 0.114  # of which the length is from the forehead to its back
HEAD_HEIGHT = 0.130  # from the chin
NECK_TO_VERTEX = 0.140 + 0.023  # from the joint of the neck, below the cervicale, to the top of the head
FOOT_LENGTH = 0.152
FOOT_BREADTH = 0.055
HEEL_BREADTH = 0.041
HAND_LENGTH, HAND_BREADTH = 0.108, 0.049


def _by_stature(row: Sequence[float], stature_m: float) -> Array:
    """A line of the table, with lengths and radii of gyration in statures."""
    length, share, along, *radii = row
    return np.array([length / stature_m, share, along, *(length / stature_m * np.array(radii))])


_BY_STATURE = {
    kind: np.array([_by_stature(*pair) for pair in zip(of_both, _STATURES_M, strict=True)])
    for kind, of_both in _TABLE.items()
}
BONE_RANGES = {
    kind: (float(_BY_STATURE[kind][:, 0].min()), float(_BY_STATURE[kind][:, 0].max()))
    for kind in ("upper_arm", "forearm", "thigh", "shin")
}
"""Kind of segment -> length of its bone in statures, of men and of women, the shorter first."""

BONES = {kind: 0.5 * (shorter + longer) for kind, (shorter, longer) in BONE_RANGES.items()}
"""Kind of segment -> length of its bone: the body's sex is not known."""

SLENDERNESS = 0.15
"""Mean radius over length of a bone that is not measured; those of the four limbs are 0.12 to 0.20."""

USUAL_STATURE_M = 1.738


def stature_of(body: BodyModel) -> float:
    """Stature [m] that the bones of a body let expect: the median over the bones; a usual one if none is known."""
    statures = []
    for joint in body.tree_joints:
        known, above = BONES.get(SegmentName(joint.parent).kind), body.joint_to_parent(joint.parent)
        if known is not None and above is not None and joint.type != "free":
            length = float(np.linalg.norm(joint.parent_T_joint[:3, 3] - above.child_T_joint[:3, 3]))
            statures += [length / known] if length > BONE_RADIUS_M else []
    return median(statures) if statures else USUAL_STATURE_M


SHORTEST_M, TALLEST_M = 0.6, 2.75
"""No grown person is shorter, and none was taller."""

SPINE_ABOVE_HIPS = 0.5 * (0.094 / 1.77 + 0.107 / 1.61)
NECK_ABOVE_SPINE = 0.5 * (0.477 / 1.77 + 0.429 / 1.61)
"""Height of the joint of the spine above the hips, and of the neck above that, in statures."""

_SHOULDERS = 0.5 * (0.5155 / 1.741 + 0.4979 / 1.735) - SPINE_ABOVE_HIPS
_HALF_HIPS, _HALF_SHOULDERS = 0.05, 0.105


def body_of_height(height_m: float, name: str) -> BodyModel:
    """A body of average people of a height [m], with hands; all joints are balls.

    Raises:
        BodyError: no person is so tall.
    """
    if not SHORTEST_M <= height_m <= TALLEST_M:
        raise BodyError(
            f"{height_m:g} m is no person's height; expected {SHORTEST_M:g} to {TALLEST_M:g} m, such as 1.78"
        )
    offsets = {"torso": ("pelvis", (0.0, 0.0, SPINE_ABOVE_HIPS)), "head": ("torso", (0.0, 0.0, NECK_ABOVE_SPINE))}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        offsets |= {
            f"upper_arm{side}": ("torso", (0.0, sign * _HALF_SHOULDERS, _SHOULDERS)),
            f"forearm{side}": (f"upper_arm{side}", (0.0, 0.0, -BONES["upper_arm"])),
            f"thigh{side}": ("pelvis", (0.0, sign * _HALF_HIPS, 0.0)),
            f"shin{side}": (f"thigh{side}", (0.0, 0.0, -BONES["thigh"])),
            f"foot{side}": (f"shin{side}", (0.0, 0.0, -BONES["shin"])),
        }
    joints = []
    for child, (parent, offset) in offsets.items():
        called = SegmentName(child)
        place = rigid(np.eye(3), height_m * np.array(offset))
        joints.append(Joint(called.joint, parent, child, "ball", place, angle_axes=called.angle_axes))
    return with_hands(BodyModel(name, "pelvis", ("pelvis", *offsets), tuple(joints), {}))


_X, _Z = np.eye(3)[[0, 2]]
_OF_BOTH_SIDES = ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")

_AXES = {"forearm": (1, 0, 2), "hand": (1, 0, 2), "foot": (2, 1, 0)}
"""Radii of gyration about x, y and z of a segment's frame: palms face the thighs in the N-pose, a foot lies along x."""


def person_masses(body: BodyModel, mass_kg: float) -> dict[str, Mass]:
    """Segment -> its mass, for the segments that people have; equipment and segments of other names have none.

    Args:
        body: with segments named as those of the default body, which stands straight in its N-pose.
        mass_kg: of the whole person [kg]; the sum of all masses.

    Raises:
        BodyError: the body has no pelvis, or bones that no person has.
    """
    if "pelvis" not in body.segments:
        raise BodyError(
            f"body {body.name} has no segment pelvis; a person's mass is shared among segments named as in the default "
            "body: rename them, or leave out the mass"
        )
    stature_m = stature_of(body)
    usual = body_of_height(stature_m, body.name)
    usual_origins = dict(zip(usual.segments, usual.n_pose(np.eye(4))[:, :3, 3], strict=True))
    parts = _usual_parts(stature_m, mass_kg)
    held: dict[str, list[Mass]] = defaultdict(list)
    for segment in usual.segments:
        holder = segment
        while holder not in body.segments and (joint := usual.joint_to_parent(holder)) is not None:
            holder = joint.parent
        bone, usual_bone = _bone(body, segment), _bone(usual, segment)
        for part in parts[SegmentName(segment).kind]:
            if bone is not None and usual_bone is not None:
                held[holder].append(_scaled(part, bone, usual_bone))
            else:
                offset = usual_origins[segment] - usual_origins[holder]
                held[holder].append(Mass(part.kilograms, part.centre + offset, part.inertia))
    return {segment: combined(held[segment]) for segment in body.segments if segment in held}


def _usual_parts(stature_m: float, mass_kg: float) -> dict[str, list[Mass]]:
    """Kind of segment -> its parts in its frame, of a person of usual proportions."""
    rows = {kind: of_both.mean(axis=0) for kind, of_both in _BY_STATURE.items()}
    total = sum(row[1] * (2.0 if kind in _OF_BOTH_SIDES else 1.0) for kind, row in rows.items())

    def part(name: str, upper_end: Array, down: Array = -_Z) -> Mass:
        """Mass by a line of the table, in a frame in which its upper end and the direction from there are given."""
        length, share, along, *radii = rows[name]
        radii_m = stature_m * np.array(radii)[list(_AXES.get(name, (0, 1, 2)))]
        kilograms = mass_kg * share / total
        return Mass(kilograms, stature_m * (upper_end + along * length * down), kilograms * np.diag(radii_m**2))

    lengths = {name: row[0] for name, row in rows.items()}
    cervicale = (lengths["upper trunk"] + lengths["middle trunk"] + lengths["lower trunk"]) * _Z  # above the hips
    spine, neck = SPINE_ABOVE_HIPS * _Z, NECK_ABOVE_SPINE * _Z
    heel = sole_points(lengths["shin"])[0] * [1.0, 1.0, 0.5]
    return {
        "pelvis": [part("lower trunk", lengths["lower trunk"] * _Z)],
        "torso": [
            part("upper trunk", cervicale - spine),
            part("middle trunk", cervicale - spine - lengths["upper trunk"] * _Z),
        ],
        "head": [part("head", cervicale - spine - neck + lengths["head"] * _Z)],
        "foot": [part("foot", heel, _X)],
        **{kind: [part(kind, np.zeros(3))] for kind in ("upper_arm", "forearm", "hand", "thigh", "shin")},
    }


def _bone(body: BodyModel, segment: str) -> Array | None:
    """(3,) from a segment's origin to the joint at the end of its bone [m]; None if it has none."""
    name = SegmentName(segment)
    end = f"{BONE_ENDS.get(name.kind)}{name.side}"
    ends = [joint.parent_T_joint[:3, 3] for joint in body.tree_joints if (joint.parent, joint.child) == (segment, end)]
    return ends[0] if ends and np.linalg.norm(ends[0]) > BONE_RADIUS_M else None


def _scaled(part: Mass, bone: Array, usual_bone: Array) -> Mass:
    """A part of a segment whose bone (3,) is another than the usual one (3,)."""
    along = float(part.centre @ usual_bone / (usual_bone @ usual_bone))
    scale = float(np.linalg.norm(bone) / np.linalg.norm(usual_bone))
    centre = along * bone + scale * (part.centre - along * usual_bone)
    return Mass(part.kilograms, centre, scale**2 * part.inertia)


_WRIST_LIMITS = ((-1.3, 1.3), (-0.3, 0.3), (-0.7, 0.7))
"""[rad] of its angles in the order y, z, x: to the sides, about the forearm, and towards the palm."""


def with_hands(body: BodyModel) -> BodyModel:
    """The body with a hand on each forearm that has none, at a wrist as far from the elbow as the upper arm is long."""
    segments, joints = list(body.segments), list(body.joints)
    for segment in body.segments:
        name = SegmentName(segment)
        hand = f"hand{name.side}"
        if name.kind == "forearm" and hand not in segments:
            segments.append(hand)
            place = rigid(np.eye(3), -_forearm_length(body, segment) * _Z)
            joints.append(Joint(f"wrist{name.side}", segment, hand, "ball", place, limits=_WRIST_LIMITS))
    return replace(body, segments=tuple(segments), joints=tuple(joints))


def _forearm_length(body: BodyModel, forearm: str) -> float:
    """From elbow to wrist [m], by the length of the upper arm; by the body's stature where there is none."""
    elbow = body.joint_to_parent(forearm)
    upper_arm: Array = np.zeros(3) if elbow is None else elbow.parent_T_joint[:3, 3]
    length = float(np.linalg.norm(upper_arm))
    if elbow is None or SegmentName(elbow.parent).kind != "upper_arm" or length < 0.05:
        return BONES["forearm"] * stature_of(body)
    return length * BONES["forearm"] / BONES["upper_arm"]
