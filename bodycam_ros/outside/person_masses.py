"""Masses of a person's segments, by the mass of the whole person.

Shares of the mass, centres of mass and radii of gyration are those of de Leva 1996, "Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters", table 4, the mean of women's and men's, compared with two
transcriptions of it. They scale with a segment's bone, or with the stature where a segment has no bone between two
joints. The trunk's parts hang from the cervicale: the lower one is the pelvis, the other two are the torso, which meet
where the omphalion is and not at the joint of the spine. A segment that a body lacks, such as a hand, is rigidly part
of the next one towards the root.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.mass import Mass, combined
from bodycam_ros.body.segment_shape import BONE_RADIUS_M
from bodycam_ros.body.sole import sole_points
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.outside.body_of_height import NECK_ABOVE_SPINE, SPINE_ABOVE_HIPS, body_of_height
from bodycam_ros.outside.girths import stature_of

_X, _Z = np.eye(3)[[0, 2]]
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

_BONE_ENDS = {"torso": "head", "upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}
"""Kind of segment -> kind of the segment at the far end of its bone."""

_OF_BOTH_SIDES = ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")

_AXES = {"forearm": (1, 0, 2), "hand": (1, 0, 2), "foot": (2, 1, 0)}
"""Radii of gyration about x, y and z of a segment's frame: palms face the thighs in the N-pose, a foot lies along x."""


def person_masses(body: BodyModel, mass_kg: float) -> dict[str, Mass]:
    """Segment -> its mass, for the segments that people have; equipment and segments of other names have none.

    Args:
        body: with segments named as those of the default body, which stands straight in its N-pose.
        mass_kg: of the whole person [kg]; the sum of all masses.

    Raises:
        BodyError: the body has no pelvis, or bones that nobody has.
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
    rows = {kind: 0.5 * np.sum([_by_stature(*pair) for pair in zip(of_both, _STATURES_M, strict=True)], axis=0)
            for kind, of_both in _TABLE.items()}  # fmt: skip
    total = sum(row[1] * (2.0 if kind in _OF_BOTH_SIDES else 1.0) for kind, row in rows.items())

    def part(name: str, upper_end: Array, down: Array = -_Z) -> Mass:
        """Of a line of the table, in a frame in which its upper end and the direction from there are given."""
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


def _by_stature(row: Sequence[float], stature_m: float) -> Array:
    """A line of the table, with lengths and radii of gyration in statures."""
    length, share, along, *radii = row
    return np.array([length / stature_m, share, along, *(length / stature_m * np.array(radii))])


def _bone(body: BodyModel, segment: str) -> Array | None:
    """(3,) from a segment's origin to the joint at the end of its bone [m]; None if it has none."""
    name = SegmentName(segment)
    end = f"{_BONE_ENDS.get(name.kind)}{name.side}"
    ends = [joint.parent_T_joint[:3, 3] for joint in body.tree_joints if (joint.parent, joint.child) == (segment, end)]
    return ends[0] if ends and np.linalg.norm(ends[0]) > BONE_RADIUS_M else None


def _scaled(part: Mass, bone: Array, usual_bone: Array) -> Mass:
    """A part of a segment whose bone (3,) is another than the usual one (3,)."""
    along = float(part.centre @ usual_bone / (usual_bone @ usual_bone))
    scale = float(np.linalg.norm(bone) / np.linalg.norm(usual_bone))
    centre = along * bone + scale * (part.centre - along * usual_bone)
    return Mass(part.kilograms, centre, scale**2 * part.inertia)
