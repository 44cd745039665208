"""Forward kinematics of a URDF, over all instants at once.

The evaluation reads a robot as every other tool does, from ``/robot_description``, and so measures what was published
and not what the solver had in mind.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array, exp_so3, rigid

CAMERA_SUFFIX = "_optical_frame"
"""End of the name of a camera's link."""

_TURNING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint.

    Attributes:
        name: of the joint.
        parent, child: links.
        parent_T_joint: (4, 4) pose of the joint, and at angle zero of the child link [m].
        axis: (3,) unit axis in the joint's axes; None for a fixed joint.
    """

    name: str
    parent: str
    child: str
    parent_T_joint: Array
    axis: Array | None


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of a URDF.

    Attributes:
        root: the link without a parent.
        segments: links that stand for parts of the body: drawn ones, so neither cameras nor the links inside a ball
            joint; in the order of the document.
        cameras: cameras that have a link ``<camera>_optical_frame``, in the order of the document.
        joints: parents first.
    """

    root: str
    segments: tuple[str, ...]
    cameras: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]

    @classmethod
    def parse(cls, text: str, source: str) -> "UrdfTree":
        """Read a URDF document.

        Args:
            text: the document.
            source: where it comes from, for messages.

        Raises:
            RecordingError: not a URDF, not a tree, or with joints that a body does not have.
        """
        try:
            document = ET.fromstring(text)
            joints = [_joint(element) for element in document.iterfind("joint")]
        except (ET.ParseError, ValueError, KeyError, AttributeError) as error:
            raise RecordingError(f"{source}: not a URDF that can be read: {error!r}") from error
        links = {link.attrib.get("name", ""): link for link in document.iterfind("link")}
        roots = sorted(set(links) - {joint.child for joint in joints})
        if len(roots) != 1:
            raise RecordingError(f"{source}: a URDF has one root link, this one has {', '.join(roots) or 'none'}")
        body = [name for name in links if not name.endswith(CAMERA_SUFFIX)]
        drawn = [name for name in body if links[name].find("visual") is not None]
        cameras = [name.removesuffix(CAMERA_SUFFIX) for name in links if name.endswith(CAMERA_SUFFIX)]
        return cls(roots[0], tuple(drawn or body), tuple(cameras), _parents_first(joints, roots[0], source))

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that have an angle."""
        return tuple(joint.name for joint in self.joints if joint.axis is not None)

    def parent_segments(self) -> dict[str, str]:
        """Segment -> the segment that it hangs on; the topmost has none."""
        parent_of = {joint.child: joint.parent for joint in self.joints}
        parents = {}
        for segment in self.segments:
            above = parent_of.get(segment)
            while above is not None and above not in self.segments:
                above = parent_of.get(above)
            if above is not None:
                parents[segment] = above
        return parents

    def forward_kinematics(self, world_T_root: Array, angles: Mapping[str, NDArray[np.floating]]) -> dict[str, Array]:
        """Link -> poses world_T_link (T, 4, 4) [m].

        Args:
            world_T_root: (T, 4, 4) poses of the root link.
            angles: joint -> (T,) angles [rad], of all that move.
        """
        world_T_link = {self.root: world_T_root}
        for joint in self.joints:
            parent_T_child = joint.parent_T_joint
            if joint.axis is not None:
                turn = exp_so3(angles[joint.name][:, None] * joint.axis)
                parent_T_child = joint.parent_T_joint @ rigid(turn, np.zeros(3))
            world_T_link[joint.child] = world_T_link[joint.parent] @ parent_T_child
        return world_T_link


def _joint(element: ET.Element) -> UrdfJoint:
    name, kind = element.attrib["name"], element.attrib["type"]
    if kind not in (*_TURNING, "fixed"):
        raise ValueError(f"joint {name} is {kind}; a body has {', '.join(_TURNING)} and fixed joints")
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise ValueError(f"joint {name} lacks its parent or child link")
    axis = None
    if kind in _TURNING:
        axis = _three_numbers(element.find("axis"), "xyz", "1 0 0")
        axis = axis / np.linalg.norm(axis)
    return UrdfJoint(name, parent.attrib["link"], child.attrib["link"], _origin(element.find("origin")), axis)


def _origin(element: ET.Element | None) -> Array:
    roll_pitch_yaw = _three_numbers(element, "rpy", "0 0 0")
    # URDF turns about fixed axes: x, then y, then z.
    R = np.asarray(Rotation.from_euler("xyz", roll_pitch_yaw).as_matrix(), dtype=np.float64)
    return rigid(R, _three_numbers(element, "xyz", "0 0 0"))


def _three_numbers(element: ET.Element | None, attribute: str, default: str) -> Array:
    text = default if element is None else element.attrib.get(attribute, default)
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f'{attribute}="{text}" is not three numbers')
    return numbers


def _parents_first(joints: list[UrdfJoint], root: str, source: str) -> tuple[UrdfJoint, ...]:
    """In the order of the document as far as that goes."""
    reached, ordered, pending = {root}, [], list(joints)
    while pending:
        ready = next((joint for joint in pending if joint.parent in reached), None)
        if ready is None:
            raise RecordingError(f"{source}: joint {pending[0].name} does not hang on root link {root}")
        ordered.append(ready)
        reached.add(ready.child)
        pending.remove(ready)
    return tuple(ordered)
