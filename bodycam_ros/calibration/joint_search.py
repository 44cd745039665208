"""Virtual cameras and joint centres of a whole body, with slipped straps left out (A 4.2, eq. 6-7, 12-14)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.calibration.anthropometry import BoneLength, SegmentName
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.joint_centre import JointCentre, find_joint_centre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.strap_slip import (
    JointInView,
    Slip,
    slip_weights,
    slips_of_lone_cameras,
    slips_on_segment,
)
from bodycam_ros.calibration.virtual_camera import VirtualCamera, fuse_cameras
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse, transform_points

_MIN_TOGETHER_S = 2.5  # that both segments of a joint are known
_WRONG_GAP_M = 0.1  # a joint gaping more shows a wrong registration, and no more of a slip by gaping wider


@dataclass(frozen=True, eq=False)
class FoundJoints:
    """The joints by the motion of the cameras, before the N-pose gives the segments their axes.

    Attributes:
        trust: (T, C) weight of each camera at each stamp, 0 to 1.
        slips: camera -> its slip.
        virtual: segment -> its cameras as one.
        centres: child segment -> the joint that it hangs on, in the frames of the virtual cameras.
    """

    trust: Array
    slips: Mapping[str, Slip]
    virtual: Mapping[str, VirtualCamera]
    centres: Mapping[str, JointCentre]

    @property
    def virtual_T_camera(self) -> dict[str, Array]:
        """Camera -> (4, 4) its mount on its segment's virtual camera."""
        return {camera: pose for one in self.virtual.values() for camera, pose in one.virtual_T_camera.items()}

    def bone_lengths(self, rig: Rig) -> list[BoneLength]:
        """Bones between joints found so far; along the axis of a hinge its joint may be anywhere near the camera."""
        bones = []
        for child, below in self.centres.items():
            segment = str(rig.parents[child])
            if (above := self.centres.get(segment)) is not None:
                length_m = float(np.linalg.norm(below.in_parent - above.in_child))
                start, end = SegmentName(segment).joint, SegmentName(child).joint
                bones.append(BoneLength(segment, start, end, length_m, sigma_m=0.0))
        return bones


def find_joints(rig: Rig, motion: CameraMotion) -> FoundJoints:
    """Find virtual cameras, joints and slips.

    Args:
        rig: which camera is on which segment.
        motion: of the cameras.

    Raises:
        RangeOfMotionError: cameras that should be registered together never are, or there is no joint to find.
    """
    if len(rig.segments) < 2:
        raise RangeOfMotionError(
            f"the rig has cameras on {rig.root} only; a body needs cameras on two segments that hang together"
        )
    trust = motion.known.astype(np.float64)
    slips = {camera: slip for segment in rig.segments for camera, slip in _slips(rig, motion, segment).items()}
    _lower_trust(trust, motion, slips, alone=False)
    virtual = _virtual_cameras(rig, motion, trust)  # A eq. 6-7
    centres = _joint_centres(rig, motion, trust, virtual)  # A eq. 12-14
    lone_slips = slips_of_lone_cameras(_joints_in_view(rig, motion, virtual, centres))
    if lone_slips:
        _lower_trust(trust, motion, lone_slips, alone=True)
        virtual = _virtual_cameras(rig, motion, trust)
        centres = _joint_centres(rig, motion, trust, virtual)
    return FoundJoints(trust, {**slips, **lone_slips}, virtual, centres)


def _lower_trust(trust: Array, motion: CameraMotion, slips: Mapping[str, Slip], alone: bool) -> None:
    for camera, slip in slips.items():
        column = motion.cameras.index(camera)
        trust[:, column] = slip_weights(motion.known[:, column], slip, alone)


def _slips(rig: Rig, motion: CameraMotion, segment: str) -> dict[str, Slip]:
    """Cameras of a segment that slipped."""
    names = rig.cameras_on(segment)
    columns = motion.columns(names)
    accused = slips_on_segment(names, motion.world_T_camera[:, columns], motion.known[:, columns], motion.seconds)
    if len(accused) > 1:
        # They moved against each other; the one that slipped also moved against the joints.
        worst = max(accused, key=lambda camera: _disagreement(rig, motion, camera))
        return {worst: accused[worst]}
    return accused


def _disagreement(rig: Rig, motion: CameraMotion, camera: str) -> float:
    """Mean gap [m] of the joints of a camera's segment if that camera alone gives the segment's pose."""
    segment = rig.cameras[camera]
    neighbours = [other for other, parent in rig.parents.items() if parent == segment]
    neighbours += [parent for parent in [rig.parents[segment]] if parent is not None]
    gaps = []
    for other in [other for neighbour in neighbours for other in rig.cameras_on(neighbour)]:
        both = motion.known[:, motion.columns((camera, other))].all(axis=1)
        if both.any():
            camera_T_other = (inverse(motion.poses(camera)) @ motion.poses(other))[both]
            centre = find_joint_centre(camera_T_other, np.ones(both.sum()))
            gaps.append(float(np.mean(np.minimum(centre.residuals_m, _WRONG_GAP_M))))
    return float(np.mean(gaps)) if gaps else 0.0


def _joints_in_view(
    rig: Rig, motion: CameraMotion, virtual: Mapping[str, VirtualCamera], centres: Mapping[str, JointCentre]
) -> dict[str, list[JointInView]]:
    """Cameras alone on their segment -> the joints of the segment, by the neighbours."""
    in_view: dict[str, list[JointInView]] = {}
    for child, centre in centres.items():
        parent = str(rig.parents[child])
        rows = np.flatnonzero(virtual[child].known & virtual[parent].known)
        for segment, neighbour, place in ((child, parent, centre.in_parent), (parent, child, centre.in_child)):
            cameras = rig.cameras_on(segment)
            if len(cameras) == 1:
                segment_T_neighbour = inverse(virtual[segment].world_T_virtual) @ virtual[neighbour].world_T_virtual
                places = transform_points(segment_T_neighbour[rows], place[None])[:, 0]
                name, usual_m = SegmentName(child).joint, float(np.median(centre.residuals_m))
                joint = JointInView(name, rows, motion.seconds[rows], places, usual_m)
                in_view.setdefault(cameras[0], []).append(joint)
    return in_view


def _virtual_cameras(rig: Rig, motion: CameraMotion, trust: Array) -> dict[str, VirtualCamera]:
    """Segment -> its cameras as one (A eq. 6-7)."""
    columns = {segment: motion.columns(rig.cameras_on(segment)) for segment in rig.segments}
    return {
        segment: fuse_cameras(rig.cameras_on(segment), motion.world_T_camera[:, own], trust[:, own])
        for segment, own in columns.items()
    }


def _joint_centres(
    rig: Rig, motion: CameraMotion, trust: Array, virtual: Mapping[str, VirtualCamera]
) -> dict[str, JointCentre]:
    """Child segment -> its joint, from every pair of cameras on the two segments (A eq. 12-14)."""
    centres = {}
    for child in rig.segments:
        parent = rig.parents[child]
        if parent is None:
            continue
        parent_T_child, weights = [], []
        for a in rig.cameras_on(parent):
            world_T_parent = motion.poses(a) @ inverse(virtual[parent].virtual_T_camera[a])
            for b in rig.cameras_on(child):
                world_T_child = motion.poses(b) @ inverse(virtual[child].virtual_T_camera[b])
                both = trust[:, motion.columns((a, b))].prod(axis=1)
                parent_T_child.append((inverse(world_T_parent) @ world_T_child)[both > 0])
                weights.append(both[both > 0])
        duration_s = float(motion.seconds[-1])
        together_s = duration_s * max(map(len, parent_T_child)) / len(motion.seconds)
        if together_s < _MIN_TOGETHER_S:
            raise RangeOfMotionError(
                f"joint {SegmentName(child).joint}: cameras on {parent} and on {child} were registered together for "
                f"{together_s:.1f} s only, of {duration_s:.1f} s; {_MIN_TOGETHER_S:g} s are needed. Repeat it where "
                "both see the mapped place"
            )
        centres[child] = find_joint_centre(np.concatenate(parent_T_child), np.concatenate(weights))
    return centres
