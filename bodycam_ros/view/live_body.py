"""What the running graph says of the body, as a motion of one instant."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.view.motion import Motion


@dataclass(frozen=True, eq=False)
class LiveInstant:
    """Where a body is.

    Attributes:
        stamp_ns: of the instant [ns].
        names: (A) of the joint angles.
        angles: (A) [rad], [m] of places.
        world_T_root: (4, 4) [m].
        poses: camera -> stamps [ns] and poses world_T_camera (4, 4) [m] that it found for itself lately, in order.
    """

    stamp_ns: int
    names: tuple[str, ...]
    angles: Array
    world_T_root: Array
    poses: Mapping[str, tuple[tuple[int, NDArray[np.float64]], ...]]

    def motion(self, body: BodyModel) -> Motion | None:
        """The instant as a motion of a body; None if it is of another one, or not finite."""
        column = {name: column for column, name in enumerate(self.names)}
        wanted = JointAngles(body).names
        if any(name not in column for name in wanted):
            return None
        angles = self.angles[[column[name] for name in wanted]]
        if not (np.isfinite(angles).all() and np.isfinite(self.world_T_root).all()):
            return None
        registered = {
            camera: (
                np.array([stamp for stamp, _ in heard], dtype=np.int64),
                np.array([pose for _, pose in heard], dtype=np.float64).reshape(-1, 4, 4),
            )
            for camera, heard in self.poses.items()
            if camera in body.mounts
        }
        stamps_ns = np.array([self.stamp_ns], dtype=np.int64)
        return Motion(stamps_ns, self.world_T_root[None], wanted, angles[None], registered)


class Listener(Protocol):
    """Hears the graph."""

    def watch(self, cameras: "tuple[str, ...]") -> None:
        """Hear from now on where these cameras find themselves."""

    def stop(self) -> None:
        """Hear no more."""
