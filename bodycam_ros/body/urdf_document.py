"""A URDF document: links and joints, checked, of any program. Bodies and results read the same documents."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.urdf_xml import xml_elements
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.tree import KinematicTree

BODY = "bodycam_body"
"""Tag of the element whose text is the body, as a body file has it."""

_MAX_JOINTS = 2000
_MAX_SHOWN = 60  # letters of an attribute in a message
_MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint.

    Attributes:
        name: of the joint.
        parent, child: links.
        parent_T_joint: (4, 4) pose of the joint, and at angle zero of the child link [m].
        axis: (3,) unit axis in the joint's axes; None for a fixed joint.
        slides: whether it moves along its axis, not about it.
    """

    name: str
    parent: str
    child: str
    parent_T_joint: Array
    axis: Array | None
    slides: bool = False

    @property
    def twist(self) -> Array:
        """(6,) its twist in the joint's axes, rotation first: it moves its child by ``exp_se3(position * twist)``."""
        axis = np.zeros(3) if self.axis is None else self.axis
        return np.concatenate([np.zeros(3), axis] if self.slides else [axis, np.zeros(3)])


@dataclass(frozen=True, eq=False)
class UrdfDocument:
    """A tree of links.

    Attributes:
        name: of the robot; may be empty.
        root: the link without a parent.
        links: names, in the order of the document.
        joints: parents first, else in the order of the document.
        body: the body that it was written of, in YAML; empty in documents of other programs.
    """

    name: str
    root: str
    links: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]
    body: str = ""

    @classmethod
    def parse(cls, text: str) -> "UrdfDocument":
        """Read a document.

        Raises:
            BodyError: not a URDF, not one tree, or with joints that no body has; the message names the joint or link.
        """
        robot = xml_elements(text)
        if robot.tag != "robot":
            raise BodyError(f"a URDF begins with <robot>, not <{robot.tag}>")
        joints = {}
        for number, element in enumerate(robot.iterfind("joint")):
            joints[element.get("name", "")] = _joint(element)
            if number >= _MAX_JOINTS or len(joints) <= number:
                raise BodyError(f"joint {element.get('name')} is listed twice, or is one of more than {_MAX_JOINTS}")
        links = tuple(element.get("name", "") for element in robot.iterfind("link"))
        if "" in links:
            raise BodyError("a link has no name")
        children = {joint.child for joint in joints.values()}
        roots = [name for name in links if name not in children]
        if len(roots) != 1:
            raise BodyError(f"a body has one root link, this has {', '.join(roots[:5]) or 'none'}")
        tree = _tree(roots[0], links, tuple(joints.values()))
        return cls(
            name=robot.get("name", ""),
            root=roots[0],
            links=links,
            joints=tuple(joints[joint.name] for joint in tree.tree_joints),
            body=robot.findtext(BODY, default=""),
        )


def _tree(root: str, links: tuple[str, ...], joints: Sequence[UrdfJoint]) -> KinematicTree:
    fixed = tuple(Joint(joint.name, joint.parent, joint.child, "weld", joint.parent_T_joint) for joint in joints)
    tree = KinematicTree("URDF", root, links, fixed)
    if tree.loop_joints:
        raise BodyError(f"link {tree.loop_joints[0].child} hangs on two joints; a URDF is a tree")
    return tree


def _joint(element: ET.Element) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if not name:
        raise BodyError("a joint has no name")
    if kind not in (*_MOVING, "fixed"):
        raise BodyError(f"joint {name} is {kind or 'of no type'}; a body has {', '.join(_MOVING)} and fixed joints")
    ends = [found.get("link", "") for role in ("parent", "child") if (found := element.find(role)) is not None]
    if len(ends) < 2 or "" in ends:
        raise BodyError(f"joint {name} lacks its parent or child link")
    try:
        axis = _axis(element.find("axis")) if kind in _MOVING else None
        return UrdfJoint(name, ends[0], ends[1], _origin(element.find("origin")), axis, kind == "prismatic")
    except ValueError as error:
        raise BodyError(f"joint {name}: {error}") from error


def _origin(element: ET.Element | None) -> Array:
    roll_pitch_yaw = _numbers(element, "rpy", "0 0 0")
    # URDF turns about fixed axes: x, then y, then z.
    about_x, about_y, about_z = exp_so3(np.diag(roll_pitch_yaw))
    return rigid(about_z @ about_y @ about_x, _numbers(element, "xyz", "0 0 0"))


def _axis(element: ET.Element | None) -> Array:
    axis = _numbers(element, "xyz", "1 0 0")
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ValueError("its axis has no direction")
    return axis / length


def _numbers(element: ET.Element | None, attribute: str, default: str) -> Array:
    text = default if element is None else element.get(attribute, default)
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f'{attribute}="{text[:_MAX_SHOWN]}" is not three numbers')
    return numbers
