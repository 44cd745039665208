"""A URDF document as it stands: links, joints, and nothing believed before it is checked.

Bodies and solved bags read the same documents, and both through here.

There are no entities, which could stand for any file or any length, and what is read is bounded. A launch file reads
it too: nothing but the standard library is imported.
"""

import heapq
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.urdf_xml import xml_elements
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_so3, rigid

LOOPS = "bodycam_loops"
"""Tag of the element whose text is the joints that close loops."""

STANDING = "bodycam_standing"
"""Tag of an element for each link that does not move in the world; its attribute ``link`` names it."""

_MOST_NAMED = 5  # in a message
_MOST_SHOWN = 60  # letters of what came
_MOVING = ("revolute", "continuous", "prismatic")
_LIMITED = ("revolute", "prismatic")
_SOFT = ("soft_lower_limit", "soft_upper_limit")


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint.

    Attributes:
        name: of the joint.
        parent, child: links.
        parent_T_joint: (4, 4) pose of the joint, and at angle zero of the child link [m].
        axis: (3,) unit axis in the joint's axes; None for a fixed joint.
        limits: (low, high) [rad], of a prismatic joint [m]: its soft limits, the range of motion of a person, or else
            its limits; None for a fixed joint, and for a continuous one without soft limits.
        slides: whether it moves along its axis, not about it.
    """

    name: str
    parent: str
    child: str
    parent_T_joint: Array
    axis: Array | None
    limits: tuple[float, float] | None
    slides: bool = False

    @property
    def twist(self) -> Array:
        """(6,) its twist in the joint's axes, rotation first: it moves its child by ``exp_se3(position * twist)``."""
        axis = np.zeros(3) if self.axis is None else self.axis
        return np.concatenate([np.zeros(3), axis] if self.slides else [axis, np.zeros(3)])

    @classmethod
    def read(cls, element: ET.Element) -> "UrdfJoint":
        """The joint of an element.

        Raises:
            ValueError: it lacks something, or is of a type that no body has.
        """
        name, kind = element.attrib.get("name", ""), element.attrib.get("type", "")
        if not name:
            raise ValueError("a joint has no name")
        if kind not in (*_MOVING, "fixed"):
            raise ValueError(
                f"joint {name} is {kind or 'of no type'}; a body has {', '.join(_MOVING)} and fixed joints"
            )
        parent, child = (_link(element, role) for role in ("parent", "child"))
        if not parent or not child:
            raise ValueError(f"joint {name} lacks its parent or child link")
        try:
            origin = _origin(element.find("origin"))
            axis = _axis(element.find("axis")) if kind in _MOVING else None
            limits = _limits(element, kind) if kind in _MOVING else None
        except ValueError as error:
            raise ValueError(f"joint {name}: {error}") from error
        return cls(name, parent, child, origin, axis, limits, kind == "prismatic")


@dataclass(frozen=True, eq=False)
class UrdfDocument:
    """A tree of links.

    Attributes:
        name: of the robot; may be empty.
        root: the link without a parent.
        links: names, in the order of the document.
        drawn: those that have a shape.
        joints: parents first, else in the order of the document.
        loops: what it says, in YAML, of the joints that close loops, which it cannot show; mostly nothing.
        standing: links that it says do not move in the world.
    """

    name: str
    root: str
    links: tuple[str, ...]
    drawn: frozenset[str]
    joints: tuple[UrdfJoint, ...]
    loops: str = ""
    standing: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> "UrdfDocument":
        """Read a document.

        Raises:
            BodyError: not a URDF, not one tree, or with joints that no body has; the message names the joint or link.
        """
        robot = xml_elements(text)
        if robot.tag != "robot":
            raise BodyError(f"a URDF begins with <robot>, not <{robot.tag}>")
        try:
            joints = [UrdfJoint.read(element) for element in robot.iterfind("joint")]
        except ValueError as error:
            raise BodyError(str(error)) from error
        links = {element: element.attrib.get("name", "") for element in robot.iterfind("link")}
        names = list(links.values())
        _check_names(names, joints)
        hung = {joint.child for joint in joints}
        roots = [name for name in names if name not in hung]
        if len(roots) != 1:
            raise BodyError(f"a body has one root link, this has {_some(roots) or 'none'}")
        drawn = frozenset(name for element, name in links.items() if element.find("visual") is not None)
        ordered = _parents_first(joints, roots[0])
        loops = robot.findtext(LOOPS, default="")
        standing = tuple(element.attrib.get("link", "") for element in robot.iterfind(STANDING))
        return cls(robot.attrib.get("name", ""), roots[0], tuple(names), drawn, ordered, loops, standing)


def said_loops(text: str) -> str:
    """What a document says of the joints that close loops, whatever else is in it; empty if nothing.

    Raises:
        BodyError: it is not XML.
    """
    return xml_elements(text).findtext(LOOPS, default="").strip()


def _check_names(links: Sequence[str], joints: Sequence[UrdfJoint]) -> None:
    if "" in links:
        raise BodyError("a link has no name")
    for kind, names in (("link", links), ("joint", [joint.name for joint in joints])):
        if twice := sorted(name for name, count in Counter(names).items() if count > 1):
            raise BodyError(f"{kind} {_some(twice)} is listed twice; names must differ")
    known = set(links)
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in known:
                raise BodyError(f"joint {joint.name}: link {link} is missing")
    if twice := sorted(name for name, count in Counter(joint.child for joint in joints).items() if count > 1):
        raise BodyError(f"link {_some(twice)} hangs on two joints; a URDF is a tree")


def _parents_first(joints: Sequence[UrdfJoint], root: str) -> tuple[UrdfJoint, ...]:
    below: dict[str, list[int]] = defaultdict(list)
    for place, joint in enumerate(joints):
        below[joint.parent].append(place)
    ordered, ready = [], list(below[root])
    while ready:
        ordered.append(joints[heapq.heappop(ready)])
        for place in below[ordered[-1].child]:
            heapq.heappush(ready, place)
    if lost := {joint.name for joint in joints} - {joint.name for joint in ordered}:
        raise BodyError(f"joint {_some(sorted(lost))} does not hang on root link {root}")
    return tuple(ordered)


def _some(names: Sequence[str]) -> str:
    """The first of many names, and how many there are beside them."""
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more


def _link(element: ET.Element, role: str) -> str:
    found = element.find(role)
    return "" if found is None else found.attrib.get("link", "")


def _origin(element: ET.Element | None) -> Array:
    roll_pitch_yaw = _numbers(element, "rpy", "0 0 0", 3)
    # URDF turns about fixed axes: x, then y, then z.
    about_x, about_y, about_z = exp_so3(np.diag(roll_pitch_yaw))
    R = about_z @ about_y @ about_x
    return rigid(R, _numbers(element, "xyz", "0 0 0", 3))


def _axis(element: ET.Element | None) -> Array:
    axis = _numbers(element, "xyz", "1 0 0", 3)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ValueError("its axis has no direction")
    return axis / length


def _limits(joint: ET.Element, kind: str) -> tuple[float, float] | None:
    element, names = joint.find("safety_controller"), _SOFT
    if element is None or not element.attrib.keys() >= {*_SOFT}:
        if kind not in _LIMITED:
            return None
        element, names = joint.find("limit"), ("lower", "upper")
    low, high = (float(_numbers(element, name, "0", 1)[0]) for name in names)
    return low, high


def _numbers(element: ET.Element | None, attribute: str, default: str, count: int) -> Array:
    text = default if element is None else element.attrib.get(attribute, default)
    numbers = np.array([_number(word) for word in text.split()])
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        wanted = "three numbers" if count == 3 else "a number"
        raise ValueError(f'{attribute}="{text[:_MOST_SHOWN]}" is not {wanted}')
    return numbers


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan
