"""The body: segments, the joints between them, and the cameras strapped to them.

Segments form a tree from the root; a joint whose child already hangs on another joint closes a loop (a foot on a
pedal). ``body_file`` reads and writes it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than
from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.kinematics.joint import check_within_reach
from bodycam_ros.kinematics.tree import KinematicTree

THINNEST, THICKEST = 0.2, 5.0
"""Times as thick as people of a body's size are: beyond, a number was taken for something else."""


@dataclass(frozen=True, eq=False)
class CameraMount:
    """Where a camera is strapped to.

    Attributes:
        segment: the segment that carries it.
        segment_T_camera: (4, 4) pose of the camera's optical frame (x right, y down, z forward) [m].
        readout: read-out time of its rows by the range of motion, if known.
        imu: calibration of its inertial sensor; None without one.
    """

    segment: str
    segment_T_camera: Array
    readout: Readout | None = None
    imu: ImuCalibration | None = None


@dataclass(frozen=True, eq=False)
class BodyModel(KinematicTree):
    """Segments and joints (``KinematicTree``), and camera mounts.

    Attributes:
        mounts: camera -> where it is strapped to.
        report: figures of whoever made the body; kept, never used.
        standing: segments, of a machine, that do not move in the world; for other programs, the solver has it from the
            equipment.
        surface: folder with the meshes of its segments, relative to the body file, for static cameras.
        girths: segment -> how many times as thick its capsules are as those of people of the body's size; 1 where
            none is given.

    Raises:
        BodyError: the parts do not make one body.
    """

    mounts: Mapping[str, CameraMount]
    report: Mapping[str, Any] = field(default_factory=dict)
    standing: tuple[str, ...] = ()
    surface: str | None = None
    girths: Mapping[str, float] = field(default_factory=dict)

    @property
    def readout_starts(self) -> dict[str, Readout]:
        """Camera -> where the estimate of its read-out time starts, of cameras of which something is known."""
        return {camera: mount.readout.as_start for camera, mount in self.mounts.items() if mount.readout is not None}

    def __post_init__(self) -> None:
        super().__post_init__()
        for segment in self.standing:
            if segment not in self.segments:
                raise BodyError(
                    f"{segment}, which stands in the world, is not among the segments; "
                    f"{other_than(segment, self.segments)}"
                )
        for segment, girth in self.girths.items():
            if segment not in self.segments:
                raise BodyError(f"girths: {segment} is not among the segments; {other_than(segment, self.segments)}")
            if not THINNEST <= girth <= THICKEST:
                raise BodyError(
                    f"girths: {segment} is {girth:g} times as thick as people's; expected {THINNEST:g} to {THICKEST:g}"
                )
        for camera, mount in self.mounts.items():
            if mount.segment not in self.segments:
                others = other_than(mount.segment, self.segments)
                raise BodyError(f"segment {mount.segment} is not among the segments; {others}", camera)
            if not np.isfinite(mount.segment_T_camera).all():
                raise BodyError(f"its place on segment {mount.segment} is not finite", camera)
            check_within_reach(f"camera {camera}", mount.segment_T_camera)

    def cameras_on(self, segment: str) -> tuple[str, ...]:
        """Names of the cameras on a segment."""
        return tuple(camera for camera, mount in self.mounts.items() if mount.segment == segment)

    def segments_without(self, cameras: Collection[str]) -> list[str]:
        """Segments that carry none of some cameras."""
        carrying = {mount.segment for camera, mount in self.mounts.items() if camera in cameras}
        return [segment for segment in self.segments if segment not in carrying]


@dataclass(frozen=True, eq=False)
class Mass:
    """Mass of a segment, in its frame.

    Attributes:
        kilograms: its mass.
        centre: (3,) [m].
        inertia: (3, 3) about the centre [kg m^2].
    """

    kilograms: float
    centre: Array
    inertia: Array


def combined(parts: Sequence[Mass]) -> Mass:
    """The mass of rigidly joined parts in one frame, by the parallel axis theorem."""
    kilograms = sum(part.kilograms for part in parts)
    centre = sum((part.kilograms * part.centre for part in parts), np.zeros(3)) / kilograms
    inertia = np.zeros((3, 3))
    for part in parts:
        lever = part.centre - centre
        inertia += part.inertia + part.kilograms * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return Mass(kilograms, centre, inertia)


JOINT_RADIUS_M = 0.04
BONE_RADIUS_M = 0.025


def bone_ends(body: BodyModel, segment: str) -> list[Array]:
    """Where the bones from a segment's origin end (3,) [m]: at each joint that hangs on it, or else at its tip.

    Equipment reaches to where it is held, too. What stands beside the segment is no part of it.
    """
    held = body.joints if segment in body.equipment_segments else body.tree_joints
    ends = [joint.parent_T_joint[:3, 3] for joint in held if joint.parent == segment and joint.type != "free"]
    return [end for end in ends or [_tip(body, segment)] if np.linalg.norm(end) > BONE_RADIUS_M]


def _tip(body: BodyModel, segment: str) -> Array:
    """(3,) where a segment without further joints is drawn to: along its long axis, as far as its cameras reach."""
    joint = body.joint_to_parent(segment)
    cameras = [body.mounts[camera].segment_T_camera[:3, 3] for camera in body.cameras_on(segment)]
    if joint is None or not cameras:
        return np.zeros(3)
    long_axis = np.eye(3)["xyz".index(joint.angle_axes[1])]
    reach = max((float(position @ long_axis) for position in cameras), key=abs)
    tip: Array = reach * long_axis
    return tip


_DEPTH, _HEEL, _BALL = 0.19, -0.12, 0.29
"""Below, behind and ahead of the ankle, in lengths of a shin: 8, 5 and 12.5 cm of a person of 1.75 m in flat shoes."""


def sole_points(shin_length: float) -> Array:
    """Heel and ball (2, 3) [m] in the frame of a foot: origin at the ankle, x forward and z up in the N-pose."""
    return shin_length * np.array([[_HEEL, 0.0, -_DEPTH], [_BALL, 0.0, -_DEPTH]])
