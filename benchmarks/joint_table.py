"""The table of joints in docs/joints.md, made of the code: names, axes and limits are asked for, signs are tried.

What an angle does is seen on a standing body that it turns by a little, so the words cannot differ from the solver.
"""

from collections.abc import Sequence
from os.path import commonprefix
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import LEFT, RIGHT, SegmentName
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.static_cameras.limb_search import with_usual_limits

BEGIN, END = "<!-- made by python -m benchmarks.joint_table -->", "<!-- end of what is made -->"

_A_LITTLE_RAD = 0.2
_ALONG = {"torso": (0.0, 0.0, 1.0), "head": (0.0, 0.0, 1.0), "foot": (1.0, 0.0, 0.0)}
"""Where a segment goes from its joint in the N-pose; the others hang down."""

_BESIDE = {"foot": (0.0, 1.0, 0.0)}
"""A point off the segment's length, that shows it turn about itself: the left edge of a foot, else the front."""

_END_OF = {"torso": "top", "head": "top", "foot": "toes"}
_SIDE_OF = {"foot": "left edge"}
_WAYS = {(0, 1): "forward", (0, -1): "back", (1, 1): "left", (1, -1): "right", (2, 1): "up", (2, -1): "down"}

_TERMS = {
    ("torso", "forward"): ("flexion", "extension"),
    ("torso", "right"): ("bending to the right", "bending to the left"),
    ("torso", "turns left"): ("rotation to the left", "rotation to the right"),
    ("head", "forward"): ("flexion", "extension"),
    ("head", "right"): ("bending to the right", "bending to the left"),
    ("head", "turns left"): ("rotation to the left", "rotation to the right"),
    ("upper_arm", "back"): ("extension", "flexion"),
    ("upper_arm", "outward"): ("abduction", "adduction"),
    ("upper_arm", "turns outward"): ("external rotation", "internal rotation"),
    ("forearm", "back"): ("extension", "flexion"),
    ("forearm", "turns outward"): ("supination", "pronation"),
    ("hand", "back"): ("ulnar deviation", "radial deviation"),
    ("hand", "outward"): ("extension", "flexion"),
    ("thigh", "back"): ("extension", "flexion"),
    ("thigh", "outward"): ("abduction", "adduction"),
    ("thigh", "turns outward"): ("external rotation", "internal rotation"),
    ("shin", "back"): ("flexion", "extension"),
    ("shin", "outward"): ("abduction (valgus)", "adduction (varus)"),
    ("shin", "turns outward"): ("external rotation", "internal rotation"),
    ("foot", "down"): ("plantarflexion", "dorsiflexion"),
    ("foot", "outward"): ("toe-out", "toe-in"),
    ("foot", "turns up outside"): ("eversion", "inversion"),
}
"""What a clinician calls a motion of a kind of segment, and the opposite motion."""

_OPENSIM = {
    ("torso", "y"): ("lumbar_extension", "extension"),
    ("torso", "x"): ("lumbar_bending", "bending to the right"),
    ("torso", "z"): ("lumbar_rotation", "rotation to the left"),
    ("upper_arm", "y"): ("arm_flex_S", "flexion"),
    ("upper_arm", "x"): ("arm_add_S", "adduction"),
    ("upper_arm", "z"): ("arm_rot_S", "internal rotation"),
    ("forearm", "y"): ("elbow_flex_S", "flexion"),
    ("forearm", "z"): ("pro_sup_S", "pronation"),
    ("thigh", "y"): ("hip_flexion_S", "flexion"),
    ("thigh", "x"): ("hip_adduction_S", "adduction"),
    ("thigh", "z"): ("hip_rotation_S", "internal rotation"),
    ("shin", "y"): ("knee_angle_S", "flexion"),
    ("foot", "y"): ("ankle_angle_S", "dorsiflexion"),
    ("foot", "x"): ("subtalar_angle_S", "inversion"),
}
"""Coordinates of Rajagopal's full-body model, S for the side, and what they count as positive."""

_REP155 = {
    ("torso", "y"): ("waist", (0.0, 1.0, 0.0)),
    ("head", "x"): ("r_head", (1.0, 0.0, 0.0)),
    ("head", "y"): ("p_head", (0.0, -1.0, 0.0)),
    ("head", "z"): ("y_head", (0.0, 0.0, 1.0)),
    ("upper_arm", "x"): ("S_p_shoulder", (1.0, 0.0, 0.0)),
    ("upper_arm", "z"): ("S_r_shoulder", (0.0, 0.0, 1.0)),
    ("forearm", "y"): ("S_elbow", (0.0, -1.0, 0.0)),
    ("thigh", "x"): ("S_p_hip", (1.0, 0.0, 0.0)),
    ("thigh", "y"): ("S_r_hip", (0.0, -1.0, 0.0)),
    ("thigh", "z"): ("S_y_hip", (0.0, 0.0, -1.0)),
    ("shin", "y"): ("S_knee", (0.0, -1.0, 0.0)),
}
"""Joints of REP-155's human_description, and their axes on the left; x and the shoulder's z are mirrored."""

_MIRRORED = {("upper_arm", "x"), ("upper_arm", "z"), ("thigh", "x")}


def whole_body(repository: Path) -> BodyModel:
    """Every segment that the code knows by name, standing in the N-pose, without lengths."""
    parents = dict(Rig.from_yaml(repository / "bags/sample/rig.yaml").parents)
    parents |= {f"hand{side}": f"forearm{side}" for side in (LEFT, RIGHT)}
    root = next(segment for segment, parent in parents.items() if parent is None)
    joints = tuple(
        Joint(name.joint, parent, name.segment, "ball", np.eye(4), angle_axes=name.angle_axes)
        for name, parent in ((SegmentName(segment), parent) for segment, parent in parents.items())
        if parent is not None
    )
    return with_usual_limits(BodyModel("anybody", root, tuple(parents), joints, {}))


def joint_table(repository: Path) -> str:
    """Markdown: a row for each angle, left and right together."""
    body = whole_body(repository)
    rows = [
        "| angle | parent → segment | about | positive when its | that is | usual limits | REP-155 | OpenSim |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for joint in body.tree_joints:
        name = SegmentName(joint.child)
        if name.side == RIGHT:
            continue
        for angle, axis in zip(joint.angle_names, joint.angle_axes, strict=True):
            both = [_said(body, angle, joint, axis)]
            if name.side:
                other = next(j for j in body.tree_joints if j.child == f"{name.kind}{RIGHT}")
                both.append(_said(body, f"{other.name}_{axis}", other, axis))
            rows.append(_row(joint, angle, axis, both))
    return "\n".join(rows)


def _row(joint: Joint, angle: str, axis: str, both: Sequence[tuple[str, ...]]) -> str:
    parent, child = (SegmentName(segment).kind for segment in (joint.parent, joint.child))
    turn = ("first", "second", "third")[joint.angle_axes.index(axis)]
    columns = (_left_and_right(column) for column in zip(*both, strict=True))
    return f"| `{angle.replace(LEFT, '_S')}` | {parent} → {child} | {axis},\u00a0{turn} | {' | '.join(columns)} |"


def _left_and_right(said: tuple[str, ...]) -> str:
    """What is said of one side or of both, what they share only once."""
    if len(set(said)) == 1:
        return said[0]
    left, right = said
    if left[1:] == right[1:]:
        return f"{'±' if left[0] == '+' else '∓'}{left[1:]}"
    shared = len(commonprefix([left.split(), right.split()]))
    return f"{left} / {' '.join(right.split()[shared:])}"


def _said(body: BodyModel, angle: str, joint: Joint, axis: str) -> tuple[str, str, str, str, str]:
    """Motion, its term, limits, REP-155's name and OpenSim's, with signs, of one angle of one side."""
    name = SegmentName(joint.child)
    motion, way = _motion(body, angle, joint, axis)
    term = _term(name.kind, way)
    limits = "–"
    if joint.limits:
        low, high = np.degrees(joint.limits[joint.angle_axes.index(axis)])
        limits = f"{low:.0f}°\u00a0to\u00a0{high:.0f}°".replace("-", "−")
    return motion, term, limits, _rep155(name, axis), _opensim(name, axis, term)


def _motion(body: BodyModel, angle: str, joint: Joint, axis: str) -> tuple[str, str]:
    """What moves where when the angle grows, and the way in the words of ``_TERMS``."""
    name = SegmentName(joint.child)
    along, beside = np.array(_ALONG.get(name.kind, (0.0, 0.0, -1.0))), np.array(_BESIDE.get(name.kind, (1.0, 0.0, 0.0)))
    about_itself = bool(np.abs(along["xyz".index(axis)]) > 0.5)
    point = beside if about_itself else along
    angles = JointAngles(body)
    turned = angles.rotations(np.array([_A_LITTLE_RAD * (known == angle) for known in angles.names]))
    row = next(row for row, known in enumerate(body.tree_joints) if known is joint)
    shift = turned[row] @ point - point
    shift[np.abs(point) > 0.5] = 0.0  # what it loses of its own length
    component = int(np.argmax(np.abs(shift)))
    way = _WAYS[component, int(np.sign(shift[component]))]
    if name.kind == "foot" and about_itself:
        outside = (name.side == LEFT) == (way == "up")
        return f"left edge goes {way}", f"turns {'up outside' if outside else 'up inside'}"
    sided = way
    if name.side and component == 1:
        sided = "outward" if name.side == f"_{way}" else "inward"
    if about_itself:
        return f"front turns {sided}", f"turns {sided}"
    end = _END_OF.get(name.kind, "lower end")
    return f"{end} {'go' if end.endswith('s') else 'goes'} {sided}", sided


_OPPOSITE = {
    "inward": "outward", "turns inward": "turns outward", "turns up inside": "turns up outside",
}  # fmt: skip


def _term(kind: str, way: str) -> str:
    if (kind, way) in _TERMS:
        return _TERMS[kind, way][0]
    opposite = (kind, _OPPOSITE.get(way, ""))
    return _TERMS[opposite][1] if opposite in _TERMS else "–"


def _opensim(name: SegmentName, axis: str, term: str) -> str:
    if (name.kind, axis) not in _OPENSIM:
        return "–"
    coordinate, positive = _OPENSIM[name.kind, axis]
    sign = "+" if term == positive else "−"
    return f"{sign}`{coordinate}`"


def _rep155(name: SegmentName, axis: str) -> str:
    if (name.kind, axis) not in _REP155:
        return "–"
    joint, direction = _REP155[name.kind, axis]
    mirrored = name.side == RIGHT and (name.kind, axis) in _MIRRORED
    sign = "+" if (sum(direction) > 0.0) != mirrored else "−"
    return f"{sign}`{joint}`"


if __name__ == "__main__":
    _REPOSITORY = Path(__file__).parents[1]
    _PAGE = _REPOSITORY / "docs/joints.md"
    _before, _rest = _PAGE.read_text().split(BEGIN)
    _after = _rest.split(END)[1]
    _PAGE.write_text(f"{_before}{BEGIN}\n\n{joint_table(_REPOSITORY).strip()}\n\n{END}{_after}")
