"""What a replay or a live run published, as arrays."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.geometry import Array
from bodycam_ros.solved.body_motion import BodyMotion
from bodycam_ros.solved.trajectory import between_neighbours
from bodycam_ros.solved.urdf_tree import UrdfTree

GAP_FRAMES = 1.5
"""Instants further apart than this are a gap [frames]; between others the body is known."""


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """One camera over K images.

    Attributes:
        camera: name.
        stamps_ns: (K,) of its images, increasing [ns].
        tracks: (K,) feature tracks; -1 where the bag does not say.
        landmarks: (K,) tracks that are named, which means that they carry a landmark of the map.
        world_T_camera: (K, 4, 4) registered pose of the optical frame [m]; NaN while the camera is lost.
    """

    camera: str
    stamps_ns: NDArray[np.int64]
    tracks: NDArray[np.int64]
    landmarks: NDArray[np.int64]
    world_T_camera: Array

    @property
    def registered(self) -> NDArray[np.bool_]:
        """(K,) whether the camera knew its pose."""
        known: NDArray[np.bool_] = np.isfinite(self.world_T_camera[:, 0, 0])
        return known


@dataclass(frozen=True, eq=False)
class SolvedRecording:
    """The body over T instants, and the cameras that it was solved from.

    Attributes:
        path: of the bag.
        urdf: the robot that ``/robot_description`` describes.
        motion: of the body.
        cameras: in the order of the URDF.
    """

    path: Path
    urdf: UrdfTree
    motion: BodyMotion
    cameras: tuple[CameraRecord, ...]

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """(T,) solved instants, increasing [ns]."""
        return self.motion.stamps_ns

    @cached_property
    def world_T_link(self) -> dict[str, Array]:
        """Link -> poses (T, 4, 4) in the world [m], by the URDF's forward kinematics."""
        angles = dict(zip(self.motion.joint_names, self.motion.joint_angles.T, strict=True))
        return self.urdf.forward_kinematics(self.motion.world_T_root, angles)

    @cached_property
    def start_ns(self) -> int:
        """The first image or instant [ns]."""
        return int(min([self.stamps_ns[0], *(record.stamps_ns[0] for record in self.cameras)]))

    @cached_property
    def end_ns(self) -> int:
        """The last image or instant [ns]."""
        return int(max([self.stamps_ns[-1], *(record.stamps_ns[-1] for record in self.cameras)]))

    @cached_property
    def frame_ns(self) -> int:
        """Time between two images of a camera, the median over all [ns]; of instants if there are too few images."""
        steps = [np.diff(record.stamps_ns) for record in self.cameras]
        steps = steps if any(len(step) for step in steps) else [np.diff(self.stamps_ns)]
        together = np.concatenate(steps)
        return int(np.median(together)) if len(together) else 1

    def seconds(self, stamps_ns: NDArray[np.int64]) -> Array:
        """Stamps [ns] as times since the start of the recording [s]."""
        return np.asarray((stamps_ns - self.start_ns) * 1e-9, dtype=np.float64)

    def is_solved_at(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) whether stamps (N,) [ns] lie between instants, without a gap."""
        return between_neighbours(self.stamps_ns, stamps_ns, GAP_FRAMES * self.frame_ns)

    def solved_cameras(self) -> Iterator[tuple[CameraRecord, Array]]:
        """Each camera that the URDF mounts, with its solved poses world_T_camera (T, 4, 4) [m]."""
        for record in self.cameras:
            link = optical_frame(record.camera)
            if link in self.world_T_link:
                yield record, self.world_T_link[link]
