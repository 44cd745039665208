"""A body from URDF: what ``urdf`` wrote, read back.

URDF carries segments, tree joints with their limits, and camera mounts. It cannot carry joints that close loops, own
sigmas of joints, and the report; a body that must keep these is kept as YAML. Joints come in the order of the tree.
Links and joints are told apart by the names and the structure that ``urdf`` gives them, so a document that another
program wrote out again, with other visuals or without, reads as the same body.
"""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.joint import Joint
from bodycam_ros.body.urdf import CAMERA_SUFFIX, UNKNOWN_LIMITS
from bodycam_ros.body.urdf_joint import UrdfJoint
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, inverse

_EXACT = 1e-9  # rounding of the document
_INNER_LINK, _CHILD_FRAME = "_link", "_joint_frame"


def body_from_urdf(text: str) -> BodyModel:
    """The body that a URDF document describes.

    Raises:
        BodyError: not a URDF, or one of something else than a body of ours; the message names the joint or link.
    """
    try:
        robot = ET.fromstring(text)
        if robot.tag != "robot":
            raise BodyError(f"a URDF begins with <robot>, not <{robot.tag}>")
        joints = [UrdfJoint.read(element) for element in robot.iterfind("joint")]
    except ET.ParseError as error:
        raise BodyError(f"this is not XML: {error}") from error
    except ValueError as error:
        raise BodyError(str(error)) from error
    links = [element.attrib.get("name", "") for element in robot.iterfind("link")]
    drawn = {element.attrib.get("name", "") for element in robot.iterfind("link") if element.find("visual") is not None}
    _check_names(links, joints)
    return _Document(robot.attrib.get("name", ""), links, joints, _inner_links(joints) - drawn).body()


def _inner_links(joints: Sequence[UrdfJoint]) -> set[str]:
    """Links inside a joint: between the angles of a ball, or between a joint and a child frame that is turned."""
    after_angle = {
        joint.child for joint in joints if joint.axis is not None and joint.child == f"{joint.name}{_INNER_LINK}"
    }
    return after_angle | {joint.child for joint in joints if joint.child.endswith(_CHILD_FRAME)}


def _check_names(links: Sequence[str], joints: Sequence[UrdfJoint]) -> None:
    if "" in links:
        raise BodyError("a link has no name")
    for kind, names in (("link", links), ("joint", [joint.name for joint in joints])):
        if twice := sorted(name for name, count in Counter(names).items() if count > 1):
            raise BodyError(f"{kind} {', '.join(twice)} is listed twice; names must differ")
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise BodyError(f"joint {joint.name}: link {link} is missing")
    if twice := sorted(name for name, count in Counter(joint.child for joint in joints).items() if count > 1):
        raise BodyError(f"link {', '.join(twice)} hangs on two joints; a URDF is a tree")


@dataclass(frozen=True)
class _Document:
    """Names, links and joints of a URDF, and which links are inside a joint."""

    name: str
    links: Sequence[str]
    joints: Sequence[UrdfJoint]
    inner: set[str]

    def body(self) -> BodyModel:
        if not self.name:
            raise BodyError("the robot has no name")
        segments = [link for link in self.links if link not in self.inner and not link.endswith(CAMERA_SUFFIX)]
        hung = {joint.child for joint in self.joints}
        roots = [segment for segment in segments if segment not in hung]
        if len(roots) != 1:
            raise BodyError(f"a body has one root link, this has {', '.join(roots) or 'none'}")
        chains = [self._chain(joint) for joint in self.joints if joint.parent in segments]
        mounts = {
            chain[0].child.removesuffix(CAMERA_SUFFIX): CameraMount(chain[0].parent, chain[0].parent_T_joint)
            for chain in chains
            if _is_camera(chain)
        }
        return BodyModel(
            name=self.name,
            root=roots[0],
            segments=tuple(segments),
            joints=tuple(_joint(chain) for chain in chains if not _is_camera(chain)),
            mounts=mounts,
        )

    def _chain(self, first: UrdfJoint) -> list[UrdfJoint]:
        """The joints from one segment to the next, or to a camera."""
        chain = [first]
        while (link := chain[-1].child) in self.inner:
            following = [joint for joint in self.joints if joint.parent == link]
            if len(following) != 1:
                raise BodyError(
                    f"joint {first.name}: {len(following)} joints hang on link {link}, which is inside a joint of a "
                    "body; expected one, which leads on to the joint's child"
                )
            chain += following
            if len(chain) > len(self.joints):
                raise BodyError(f"joint {first.name}: the links after it form a circle")
        return chain


def _is_camera(chain: Sequence[UrdfJoint]) -> bool:
    if not chain[-1].child.endswith(CAMERA_SUFFIX):
        return False
    if len(chain) > 1 or chain[0].axis is not None:
        raise BodyError(f"link {chain[-1].child}: a camera is fixed to its segment, by one joint")
    return True


def _joint(chain: Sequence[UrdfJoint]) -> Joint:
    """The joint that a chain stands for: angles, and then perhaps a child frame that is not the joint's."""
    moving = [joint for joint in chain if joint.axis is not None]
    fixed = [joint for joint in chain[len(moving) :] if joint.axis is None]
    ends = 1 if moving else 2
    if len(moving) + len(fixed) != len(chain) or len(moving) not in (0, 1, 3) or len(fixed) > ends:
        kinds = ", ".join(f"{joint.name} {'fixed' if joint.axis is None else 'turning'}" for joint in chain)
        raise BodyError(
            f"between segments {chain[0].parent} and {chain[-1].child} there are joints {kinds}; a body has balls "
            "(three turning), hinges (one turning) and welds (one fixed), and after any a fixed one at most"
        )
    at_child = fixed[len(fixed) - 1] if len(fixed) == ends else None
    place: dict[str, Any] = {
        "parent": chain[0].parent,
        "child": chain[-1].child,
        "parent_T_joint": chain[0].parent_T_joint,
        "child_T_joint": np.eye(4) if at_child is None else inverse(at_child.parent_T_joint),
    }
    if len(moving) == 3:
        return _ball(moving, place)
    if moving:
        limits = None if moving[0].limits is None else (moving[0].limits,)
        return Joint(name=moving[0].name, type="hinge", **place, axis=_axis(moving[0]), limits=limits)
    return Joint(name=chain[0].name, type="weld", **place)


def _ball(angles: Sequence[UrdfJoint], place: dict[str, Any]) -> Joint:
    names = [joint.name for joint in angles]
    axes = "".join(_letter(joint) for joint in angles)
    name = names[0].removesuffix(f"_{axes[0]}")
    if names != [f"{name}_{axis}" for axis in axes]:
        raise BodyError(
            f"joints {', '.join(names)}: a ball's angles about {', '.join(axes)} are named BALL_{axes[0]} ..."
        )
    if any(not _is_identity(joint.parent_T_joint) for joint in angles[1:]):
        raise BodyError(f"joints {', '.join(names)}: the three axes of a ball meet in one point, unturned")
    bounds = [joint.limits or UNKNOWN_LIMITS for joint in angles]
    unknown = all(np.allclose(pair, UNKNOWN_LIMITS, rtol=0.0, atol=_EXACT) for pair in bounds)
    return Joint(name=name, type="ball", angle_axes=axes, limits=None if unknown else tuple(bounds), **place)


def _letter(joint: UrdfJoint) -> str:
    """The axis x, y or z that an angle of a ball turns about."""
    axis = _axis(joint)
    found = [letter for letter, unit in zip("xyz", np.eye(3), strict=True) if np.allclose(axis, unit, atol=_EXACT)]
    if not found:
        raise BodyError(f"joint {joint.name}: an angle of a ball turns about x, y or z, not about {axis.tolist()}")
    return found[0]


def _axis(joint: UrdfJoint) -> Array:
    assert joint.axis is not None  # of a joint that turns
    return joint.axis


def _is_identity(pose: Array) -> bool:
    return bool(np.allclose(pose, np.eye(4), rtol=0.0, atol=_EXACT))
