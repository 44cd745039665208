"""The body as URDF: for robot_state_publisher, RViz and every tool that reads robots.

Links are named as the segments and start at the joint to their parent; the zero pose is the N-pose. A ball joint is
three revolute joints through two links without mass or shape; a free joint, on which a machine stands beside
the body, three prismatic ones and then three continuous ones, so that the robot has one root. Cameras are fixed links
``<cam>_optical_frame``, so their TF comes for free.

The whole body, with joints that close loops, is in an element of our own, ``<bodycam_body>``, as in a body file; other
readers pass over it.
"""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement, pairwise, repeat

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BONE_RADIUS_M, JOINT_RADIUS_M, BodyModel, Mass, bone_ends
from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.body.urdf_xml import xml_elements
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_se3, rigid, rotation_to_z
from bodycam_ros.kinematics.joint import FULL_TURN, Joint

BODY = "bodycam_body"
"""Tag of the element whose text is the body, as a body file has it."""

_FARTHEST_M = 100_000.0  # of what stands beside the body, along an axis: no map is so large
_AXES = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}
_NO_LIMIT = "1000"  # of effort [N m, N] and velocity [rad/s, m/s], which URDF wants too: beyond any person
_NO_CONTROLLER = {"k_position": "0", "k_velocity": _NO_LIMIT}  # URDF wants the latter; nothing drives a person
_PAIRS_OF_AXES = tuple(combinations_with_replacement(enumerate("xyz"), 2))
_DECIMALS = 12  # below any reader's rounding
_CAMERA_SIZE_M = np.array([0.06, 0.04, 0.02])  # an action camera: wide, high, deep
_COLOURS = {
    "bone": (0.85, 0.82, 0.75, 1.0),
    "joint": (0.25, 0.45, 0.7, 1.0),
    "camera": (0.15, 0.15, 0.15, 1.0),
    "equipment": (0.56, 0.29, 0.54, 1.0),
}


def xml_numbers(values: NDArray[np.floating]) -> str:
    """Numbers as an attribute has them, with more decimals than any reader keeps."""
    # Adding zero turns -0.0 into 0.0.
    return " ".join(repr(round(float(value), _DECIMALS) + 0.0) for value in values)


def urdf_text(body: BodyModel, masses: Mapping[str, Mass] | None = None) -> str:
    """The body as a URDF document; its movable joints are named and ordered as ``JointAngles.names``.

    Args:
        body: to describe.
        masses: segment -> its mass; segments that are not in it have no ``<inertial>``.

    Raises:
        BodyError: the body's names clash with each other in URDF.
    """
    robot = ET.Element("robot", name=body.name)
    for name, rgba in _COLOURS.items():
        ET.SubElement(ET.SubElement(robot, "material", name=name), "color", rgba=xml_numbers(np.array(rgba)))
    for segment in body.segments:
        _add_segment(robot, body, segment, (masses or {}).get(segment))
    for joint in body.tree_joints:
        for name, ends, origin, motion in _connections(joint):
            _add_joint(robot, name, ends, origin, motion)
            if ends[1] != joint.child:
                ET.SubElement(robot, "link", name=ends[1])
    for camera, mount in body.mounts.items():
        link = ET.SubElement(robot, "link", name=optical_frame(camera))
        _add_visual(link, "box", "camera", np.eye(4), size=xml_numbers(_CAMERA_SIZE_M))
        _add_joint(robot, f"{camera}_mount", (mount.segment, optical_frame(camera)), mount.segment_T_camera, None)
    check_names(robot, {"links": ["link"], "joints": ["joint"]}, "URDF")
    ET.SubElement(robot, BODY).text = f"\n{yaml_text(replace(body, report={}))}"
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def body_from_urdf(text: str) -> BodyModel:
    """The body that a URDF document carries; its joints come in the order of the tree, those that close loops last.

    Raises:
        BodyError: not a URDF, or not of a body; the message names the place in it.
    """
    robot = xml_elements(text)
    if robot.tag != "robot":
        raise BodyError(f"a URDF begins with <robot>, not <{robot.tag}>")
    written = robot.findtext(BODY, default="")
    if not written.strip():
        raise BodyError(f"this URDF has no <{BODY}>: it is of a robot, or of an earlier version; give the body as YAML")
    try:
        body = body_from_yaml(written)
    except BodyError as error:
        raise BodyError(f"<{BODY}>: {error}") from error
    if missing := set(body.segments) - {link.get("name", "") for link in robot.iterfind("link")}:
        raise BodyError(f"<{BODY}>: the URDF has no links {', '.join(sorted(missing))}; write it anew from the body")
    return replace(body, joints=(*body.tree_joints, *body.loop_joints))


_Range = tuple[float, float] | None
_Motion = tuple[str, Array, _Range, _Range]
"""Type, axis, limits and range of motion of a URDF joint that moves."""


def _motions(joint: Joint) -> list[_Motion]:
    """How each of ``Joint.angle_names`` moves."""
    if joint.type == "weld":
        return []
    # No published angle leaves the limits of a revolute joint (``JointAngleTracker``).
    kind, limits = ("continuous", None) if joint.counts_turns else ("revolute", (-FULL_TURN, FULL_TURN))
    axes = [joint.axis] if joint.type == "hinge" else [_AXES[axis] for axis in joint.angle_axes]
    turning = [(kind, *each) for each in zip(axes, repeat(limits), joint.limits or repeat(None))]
    if joint.type != "free":
        return turning
    return [*(("prismatic", axis, (-_FARTHEST_M, _FARTHEST_M), None) for axis in _AXES.values()), *turning]


_Connection = tuple[str, tuple[str, str], Array, _Motion | None]
"""Name, parent and child link, parent_T_child (4, 4) at zero [m], and how it moves; None: it is fixed."""


def _connections(joint: Joint) -> Iterator[_Connection]:
    """The joint's chain from parent to child: three revolute joints or one, a fixed one, or six of a free joint."""
    aligned = np.array_equal(joint.child_T_joint, np.eye(4))
    last_link = joint.child if aligned else f"{joint.name}_joint_frame"
    links = [joint.parent, *(f"{name}_link" for name in joint.angle_names[:-1]), last_link]
    origin = joint.parent_T_joint
    for name, motion, ends in zip(joint.angle_names, _motions(joint), pairwise(links), strict=False):
        yield name, ends, origin, motion
        origin = np.eye(4)
    if joint.type == "weld":
        yield joint.name, (joint.parent, last_link), origin, None
    if not aligned:
        yield f"{joint.name}_to_{joint.child}", (last_link, joint.child), joint.joint_T_child, None


def _add_joint(robot: ET.Element, name: str, ends: tuple[str, str], origin: Array, motion: _Motion | None) -> None:
    """A joint between two links; one that does not move is fixed."""
    kind, axis, limits, range_of_motion = ("fixed", None, None, None) if motion is None else motion
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    _add_origin(element, origin)
    for role, link in zip(("parent", "child"), ends, strict=True):
        ET.SubElement(element, role, link=link)
    if axis is None:
        return
    ET.SubElement(element, "axis", xyz=xml_numbers(axis))
    ET.SubElement(element, "limit", {**_bounds("{}", limits), "effort": _NO_LIMIT, "velocity": _NO_LIMIT})
    if range_of_motion is not None:
        # URDF wants soft limits within the others.
        soft = range_of_motion if limits is None else np.clip(range_of_motion, *limits)
        ET.SubElement(element, "safety_controller", {**_bounds("soft_{}_limit", soft), **_NO_CONTROLLER})


def _bounds(name: str, limits: Sequence[float] | NDArray[np.floating] | None) -> dict[str, str]:
    """Attributes of limits, whose name has ``lower`` or ``upper`` in it."""
    pairs = () if limits is None else zip(("lower", "upper"), limits, strict=True)
    return {name.format(end): xml_numbers(np.array([limit])) for end, limit in pairs}


def _add_segment(robot: ET.Element, body: BodyModel, segment: str, mass: Mass | None) -> None:
    """A ball at the segment's origin, and bones from there."""
    link = ET.SubElement(robot, "link", name=segment)
    if mass is not None:
        inertial = ET.SubElement(link, "inertial")
        _add_origin(inertial, rigid(np.eye(3), mass.centre))
        ET.SubElement(inertial, "mass", value=xml_numbers(np.array([mass.kilograms])))
        moments = {f"i{a}{b}": xml_numbers(mass.inertia[i, [j]]) for (i, a), (j, b) in _PAIRS_OF_AXES}
        ET.SubElement(inertial, "inertia", moments)
    bone, ball = ("equipment",) * 2 if segment in body.equipment_segments else ("bone", "joint")
    _add_visual(link, "sphere", ball, np.eye(4), radius=str(JOINT_RADIUS_M))
    for end in bone_ends(body, segment):
        length = float(np.linalg.norm(end))
        size = {"radius": str(BONE_RADIUS_M), "length": xml_numbers(np.array([length]))}
        _add_visual(link, "cylinder", bone, rigid(rotation_to_z(end / length).T, end / 2.0), **size)


def _add_visual(link: ET.Element, shape: str, colour: str, link_T_shape: Array, **size: str) -> None:
    visual = ET.SubElement(link, "visual")
    _add_origin(visual, link_T_shape)
    ET.SubElement(ET.SubElement(visual, "geometry"), shape, size)
    ET.SubElement(visual, "material", name=colour)


def _add_origin(element: ET.Element, pose: Array) -> None:
    ET.SubElement(element, "origin", xyz=xml_numbers(pose[:3, 3]), rpy=xml_numbers(_roll_pitch_yaw(pose[:3, :3])))


def _roll_pitch_yaw(R: Array) -> Array:
    """(3,) angles [rad] of R = R_z(yaw) R_y(pitch) R_x(roll), exact at the singularity too: roll follows from yaw."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def check_names(document: ET.Element, kinds: Mapping[str, Sequence[str]], what: str) -> None:
    """Refuse a document in which two elements of a kind (its name, in the plural -> its tags) have the same name.

    Raises:
        BodyError: so it is.
    """
    for kind, tags in kinds.items():
        names = Counter(
            element.attrib["name"] for tag in tags for element in document.iter(tag) if "name" in element.attrib
        )
        if twice := sorted(name for name, count in names.items() if count > 1):
            raise BodyError(
                f"two {kind} of the {what} would be named {', '.join(twice)}; rename the segment, joint or camera"
            )


LinkTransform = tuple[str, str, Array]
"""Parent link, child link, parent_T_child (4, 4) [m]."""


class LinkTransforms:
    """The links of a body's URDF, apart from its root.

    Args:
        body: that it is of.

    Attributes:
        fixed: those that never move in their parent: cameras, and what is welded.
    """

    def __init__(self, body: BodyModel) -> None:
        connections = [each for joint in body.tree_joints for each in _connections(joint)]
        self.fixed: tuple[LinkTransform, ...] = (
            *((*ends, origin) for _, ends, origin, motion in connections if motion is None),
            *((m.segment, optical_frame(camera), m.segment_T_camera) for camera, m in body.mounts.items()),
        )
        moving = [(name, ends, origin, motion) for name, ends, origin, motion in connections if motion is not None]
        self._names, self._ends = [each[0] for each in moving], [each[1] for each in moving]
        self._parent_T_joint = np.array([each[2] for each in moving]).reshape(-1, 4, 4)
        twists = [
            np.concatenate([np.zeros(3), axis] if kind == "prismatic" else [axis, np.zeros(3)])
            for *_, (kind, axis, _, _) in moving
        ]
        self._twists = np.array(twists).reshape(-1, 6)

    def moving(self, names: Sequence[str], positions: NDArray[np.float64]) -> list[LinkTransform]:
        """Joints that move.

        Args:
            names: J joints, all that move among them.
            positions: (J,) angles [rad], or places [m] of joints that slide.

        Raises:
            KeyError: a joint that moves is not among them.
        """
        row = {name: number for number, name in enumerate(names)}
        rows = np.array([row[joint] for joint in self._names], dtype=int)
        parent_T_child = self._parent_T_joint @ exp_se3(positions[rows, None] * self._twists)
        return [(*ends, pose) for ends, pose in zip(self._ends, parent_T_child, strict=True)]
