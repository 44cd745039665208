"""Forward kinematics of a URDF, over all instants at once.

A solved bag is read as every other tool reads it, by its ``/robot_description``: what is measured is what was published
and not what the solver had in mind.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_yaml import body_from_yaml
from bodycam_ros.body.stick_figure import Bone, bones, equipment_lines
from bodycam_ros.body.urdf import CAMERA_SUFFIX
from bodycam_ros.body.urdf_document import UrdfDocument, UrdfJoint
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.kinematics.joint import Joint


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of a URDF.

    Attributes:
        root: the link without a parent.
        segments: links that stand for parts of the body: drawn ones, so neither cameras nor the links inside a
            joint; in the order of the document.
        cameras: cameras that have a link ``<camera>_optical_frame``, in the order of the document.
        joints: parents first.
        equipment: segment of what stands beside the body, on three joints that slide -> where the lines end that it is
            drawn with (3,), in its own axes [m]: at joints on it, and where the body holds it.
    """

    root: str
    segments: tuple[str, ...]
    cameras: tuple[str, ...]
    joints: tuple[UrdfJoint, ...]
    equipment: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)

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
            document = UrdfDocument.parse(text)
            loops = body_from_yaml(document.body).loop_joints if document.body.strip() else ()
        except BodyError as error:
            raise RecordingError(f"{source}: not a URDF that can be read: {error}") from error
        body = tuple(link for link in document.links if not link.endswith(CAMERA_SUFFIX))
        drawn = tuple(link for link in body if link in document.drawn)
        cameras = tuple(link.removesuffix(CAMERA_SUFFIX) for link in document.links if link.endswith(CAMERA_SUFFIX))
        segments = drawn or body
        beside = _beside(document.joints)
        joints: list[UrdfJoint | Joint] = [*document.joints, *loops]
        held = [(j.parent, j.parent_T_joint) for j in joints if not j.child.endswith(CAMERA_SUFFIX)]
        equipment = {
            segment: tuple(at[:3, 3] for parent, at in held if parent == segment and at[:3, 3].any())
            for segment in segments
            if segment in beside
        }
        return cls(document.root, segments, cameras, document.joints, equipment)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that have an angle."""
        return tuple(joint.name for joint in self.joints if joint.axis is not None)

    @property
    def moving_beside(self) -> tuple[str, ...]:
        """Those of ``moving`` that are of equipment, and say where it is beside the body."""
        on_the_way = set(self.equipment)
        for joint in reversed(self.joints):
            if joint.child in on_the_way and joint.parent not in self.segments:
                on_the_way.add(joint.parent)
        return tuple(joint.name for joint in self.joints if joint.axis is not None and joint.child in on_the_way)

    @property
    def body_segments(self) -> tuple[str, ...]:
        """Segments of the body alone."""
        return tuple(segment for segment in self.segments if segment not in self.equipment)

    def bones(self, world_T_link: Mapping[str, Array]) -> list[Bone]:
        """Lines of the body and of its equipment, whose links are at poses (T, 4, 4) [m]."""
        body = {segment: world_T_link[segment] for segment in self.body_segments}
        return [*bones(body, self.parent_segments()), *equipment_lines(world_T_link, self.equipment)]

    def parent_segments(self) -> dict[str, str]:
        """Segment -> the segment that it hangs on; the topmost has none."""
        parent_of = {joint.child: joint.parent for joint in self.joints}
        segments = set(self.segments)
        parents = {}
        for segment in self.segments:
            above = parent_of.get(segment)
            while above is not None and above not in segments:
                above = parent_of.get(above)
            if above is not None:
                parents[segment] = above
        return parents

    def forward_kinematics(self, world_T_root: Array, angles: Mapping[str, NDArray[np.floating]]) -> dict[str, Array]:
        """Link -> poses world_T_link (T, 4, 4) [m].

        Args:
            world_T_root: (T, 4, 4) poses of the root link.
            angles: joint -> (T,) angles [rad], or places [m] of joints that slide, of all that move.
        """
        world_T_link = {self.root: world_T_root}
        for joint in self.joints:
            parent_T_child = joint.parent_T_joint
            if joint.axis is not None:
                parent_T_child = joint.parent_T_joint @ exp_se3(angles[joint.name][:, None] * joint.twist)
            world_T_link[joint.child] = world_T_link[joint.parent] @ parent_T_child
        return world_T_link


def _beside(joints: Sequence[UrdfJoint]) -> set[str]:
    """Links that three joints in a row slide, and all that hang on them."""
    slid = {joint.child: 0 for joint in joints}
    beside: set[str] = set()
    for joint in joints:
        slid[joint.child] = slid.get(joint.parent, 0) + 1 if joint.slides else 0
        if slid[joint.child] == 3 or joint.parent in beside:
            beside.add(joint.child)
    return beside
