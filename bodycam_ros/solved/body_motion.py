"""How a body moved: joint states and odometry of a bag, joined by their stamps."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message, numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import pose_and_covariance
from bodycam_ros.solved.topics import JOINT_STATES, ODOMETRY, contradictions_named


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """The body's movement over T instants, apart from its shape.

    Attributes:
        stamps_ns: (T,) instants with joint states and odometry, increasing [ns].
        joint_names: (A) in the order of ``joint_angles``.
        joint_angles: (T, A) [rad], [m] of what slides.
        world_T_root: (T, 4, 4) pose of the root link [m].
        root_covariance: (T, 6, 6) of that pose, rotation [rad^2] first, then translation [m^2], in the root's axes.
    """

    stamps_ns: NDArray[np.int64]
    joint_names: tuple[str, ...]
    joint_angles: Array
    world_T_root: Array
    root_covariance: Array


class MotionJoiner:
    """Takes messages in any order; ``joined`` is the motion that they tell.

    Args:
        path: of the bag, for messages.
        joint_names: joints whose angles are wanted, in this order.
        of: what has these joints, for messages.

    Attributes:
        others: joints in the bag that were not asked for.
        roots: links that odometry was published of.
    """

    def __init__(self, path: Path, joint_names: Sequence[str], of: str) -> None:
        self._path = path
        self._names = tuple(joint_names)
        self._of = of
        self._angles: dict[int, Array] = {}
        self._root: dict[int, tuple[Array, Array]] = {}
        self.others: set[str] = set()
        self.roots: set[str] = set()

    def add(self, topic: str, message: Message) -> None:
        """Add a message of one of ``MOTION_TOPICS``.

        Raises:
            RecordingError: it is of another body, or contradicts itself.
        """
        with contradictions_named(self._path, topic):
            self._add(topic, message)

    def joined(self) -> BodyMotion:
        """The instants of which both were recorded, with finite values.

        Raises:
            RecordingError: there are none.
        """
        stamps = sorted(stamp for stamp in self._angles if stamp in self._root and self._is_finite(stamp))
        if not stamps:
            raise RecordingError(
                f"{self._path}: none of {len(self._angles)} {JOINT_STATES} has an {ODOMETRY} of the same stamp and "
                "finite values; were both recorded, and by one solver?"
            )
        return BodyMotion(
            stamps_ns=np.array(stamps, dtype=np.int64),
            joint_names=self._names,
            joint_angles=np.array([self._angles[stamp] for stamp in stamps]).reshape(len(stamps), len(self._names)),
            world_T_root=np.array([self._root[stamp][0] for stamp in stamps]),
            root_covariance=np.array([self._root[stamp][1] for stamp in stamps]),
        )

    def _add(self, topic: str, message: Message) -> None:
        stamp = stamp_ns(message.header.stamp)
        if topic == ODOMETRY:
            self.roots.add(message.child_frame_id)
            self._root[stamp] = pose_and_covariance(message.pose)
            return
        others = [name for name in message.name if name not in self._names]
        if missing := [name for name in self._names if name not in message.name]:
            raise RecordingError(
                f"{self._path}: {JOINT_STATES} lacks {', '.join(missing)}, which {self._of} has"
                f"{', but has ' if others else ''}{', '.join(others)}; are both of the same body?"
            )
        self.others.update(others)
        column = {name: column for column, name in enumerate(message.name)}
        angles = numbers(message.position, np.float64, len(message.name))
        self._angles[stamp] = angles[[column[name] for name in self._names]]

    def _is_finite(self, stamp: int) -> bool:
        return bool(np.isfinite(self._angles[stamp]).all() and np.isfinite(self._root[stamp][0]).all())
