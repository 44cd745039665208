"""Forward kinematics of a URDF, over all instants at once.

A solved bag is read as every other tool reads it, by its ``/robot_description``: what is measured is what was published
and not what the solver had in mind.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf import CAMERA_SUFFIX
from bodycam_ros.body.urdf_document import UrdfDocument, UrdfJoint
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.geometry import Array, exp_so3, rigid


@dataclass(frozen=True, eq=False)
class UrdfTree:
    """Links and joints of a URDF.

    Attributes:
        root: the link without a parent.
        segments: links that stand for parts of the body: drawn ones, so neither cameras nor the links inside a
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
            document = UrdfDocument.parse(text)
        except BodyError as error:
            raise RecordingError(f"{source}: not a URDF that can be read: {error}") from error
        body = tuple(link for link in document.links if not link.endswith(CAMERA_SUFFIX))
        drawn = tuple(link for link in body if link in document.drawn)
        cameras = tuple(link.removesuffix(CAMERA_SUFFIX) for link in document.links if link.endswith(CAMERA_SUFFIX))
        return cls(document.root, drawn or body, cameras, document.joints)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that have an angle."""
        return tuple(joint.name for joint in self.joints if joint.axis is not None)

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
                along = angles[joint.name][:, None] * joint.axis
                motion = rigid(np.eye(3), along) if joint.slides else rigid(exp_so3(along), np.zeros(3))
                parent_T_child = joint.parent_T_joint @ motion
            world_T_link[joint.child] = world_T_link[joint.parent] @ parent_T_child
        return world_T_link
