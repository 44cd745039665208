"""Another solution of the same recording, to be compared with: lines, angles, and how far its joints are off."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.plots.stick_figure import Bone
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.body_motion import MotionJoiner, nearest
from bodycam_ros.results.topics import MOTION_TOPICS, ROBOT, published_robot
from bodycam_ros.results.urdf_tree import UrdfTree
from bodycam_ros.viewer.timeline import Motion, check_topics


@dataclass(frozen=True, eq=False)
class OtherMotion:
    """A body that moved through T instants, of any shape.

    Attributes:
        path: of the bag.
        stamps_ns: (T,) increasing [ns].
        lines: of the body and its equipment, over the T instants.
        angles: joint angle -> (T,) [rad].
        places: segment -> (T, 3) its origin, which is the joint to its parent [m].
    """

    path: Path
    stamps_ns: NDArray[np.int64]
    lines: tuple[Bone, ...]
    angles: Mapping[str, Array]
    places: Mapping[str, Array]

    def lines_at(self, at_ns: int, within_ns: int) -> list[Bone]:
        """The lines at a time; none where this one knows nothing so near to it."""
        row = nearest(self.stamps_ns, at_ns, within_ns)
        return [] if row is None else [line.at(row) for line in self.lines]

    def apart_m(self, places: Mapping[str, Array], at_ns: int, within_ns: int) -> Array:
        """How far (J,) joints that both have are apart at a time [m]; none where this one knows nothing near to it.

        Args:
            places: segment -> (3,) its origin in the body that is compared with this one [m].
            at_ns, within_ns: the time, and how near to it this one must know something.
        """
        row = nearest(self.stamps_ns, at_ns, within_ns)
        if row is None:
            return np.zeros(0)
        both = [name for name in places if name in self.places]
        return np.array([float(np.linalg.norm(self.places[name][row] - places[name])) for name in both])


def read_other_motion(path: Path, motion: Motion) -> OtherMotion:
    """Read a solved bag that is compared with another one.

    Args:
        path: ros2 bag folder or .mcap file.
        motion: what it is compared with.

    Raises:
        RecordingError: not a bag that 'bodycam replay' wrote.
        ViewError: it has no instant near one of the other, so it is of another recording.
    """
    with BagFile(path) as bag:
        check_topics(bag)
        urdf = UrdfTree.parse(published_robot(bag), f"{path}: {ROBOT}")
        joiner = MotionJoiner(path, urdf.moving, ROBOT)
        for topic, _, message in bag.messages(MOTION_TOPICS):
            joiner.add(topic, message)
    moved = joiner.joined()
    angles = dict(zip(moved.joint_names, moved.joint_angles.T, strict=True))
    world_T_link = urdf.forward_kinematics(moved.world_T_root, angles)
    if not any(nearest(moved.stamps_ns, int(at), motion.frame_ns) is not None for at in motion.stamps_ns):
        raise ViewError(
            f"--compare {path}: solved at other times than OUT, so from another recording; expected another solution "
            "of the same one"
        )
    places = {segment: world_T_link[segment][:, :3, 3] for segment in urdf.body_segments}
    return OtherMotion(path, moved.stamps_ns, tuple(urdf.bones(world_T_link)), angles, places)
