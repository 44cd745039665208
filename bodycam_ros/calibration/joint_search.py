"""Virtual cameras and joint centres of a whole body, with slipped straps left out (A 4.2, eq. 6-7, 12-14).

The joint stays put on both segments: ``parent_R_child(t) c + parent_t_child(t) = p`` for all t (A eq. 13), with the
joint c in the child and p in the parent. Differences over time leave ``[dR(t) | dt(t)] (c, 1) = 0`` (A eq. 14), whose
singular values say which directions the joint ever turned across: whether it was moved enough to be found, and whether
as a hinge.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.anthropometry import BoneLength, SegmentName
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.strap_slip import (
    JointInView,
    Slip,
    StrapSlipSettings,
    VirtualCamera,
    VirtualCameraSettings,
    fuse_cameras,
    slips_of_lone_cameras,
    slips_on_segment,
    trust_after_slip,
    trust_before_slip,
)
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_BALL, _HINGE = 3, 2  # directions that they turn across

_ITERATIONS = 50
_CONVERGED_M = 1e-12
_TO_SIGMA = 1.4826  # the median of absolute errors of a Gaussian, times this, is its sigma


@dataclass(frozen=True)
class JointCentreSettings:
    """How a joint is read off the motion."""

    free_rotation: float = setting(
        0.05,
        limits=(0.001, 0.5),
        reason="a singular value below this, about radians rms, is no motion but noise: across that direction the "
        "joint does not turn. Registrations give 0.002; people's knees 0.02; an exercised ankle 0.1",
    )
    min_instants: int = setting(
        30, limits=(4, 10000), reason="instants in which both segments of a joint must be known; one second of video"
    )
    residual_floor: float = setting(
        0.0005,
        unit="m",
        limits=(0.0, 0.1),
        reason="residuals below this are all good; keeps the robust weights from choosing among rounding errors",
    )
    outlier_sigmas: float = setting(
        3.0,
        limits=(1.0, 100.0),
        reason="a residual this many sigmas large counts a quarter, and larger ones soon nothing (Geman-McClure)",
    )


@dataclass(frozen=True, eq=False)
class JointCentre:
    """A joint on its two segments.

    Attributes:
        in_parent, in_child: (3,) its centre in the segments' frames [m]. Along directions that the joint never turned
            across, any point is as good; this one is nearest to the child's origin.
        singular_values: (3,) of A eq. 14, largest first, per root of the instants: the root mean square by which a
            direction of the child turned in the parent, from 0 for the axis of a hinge to 1.
        child_directions: (3, 3) rows: the directions in the child that belong to them.
        parent_directions: (3, 3) rows: the same in the parent; that of a hinge's axis is the axis there.
        residuals_m: (N) distances between the joint on the parent and on the child [m], one per equation.
        weights: (N) of the equations, 0 to 1.
    """

    in_parent: Array
    in_child: Array
    singular_values: Array
    child_directions: Array
    parent_directions: Array
    residuals_m: Array
    weights: Array

    def freedoms(self, settings: JointCentreSettings) -> int:
        """How many directions the joint turned across: 3 for a ball, 2 for a hinge, fewer if it was held still."""
        return int((self.singular_values > settings.free_rotation).sum())


def find_joint_centre(parent_T_child: Array, weights: Array, settings: JointCentreSettings) -> JointCentre:
    """Find the joint between two segments, whatever a minority of wrong poses says.

    Args:
        parent_T_child: (N, 4, 4) poses of the child in the parent over time; of every pair of cameras on the two.
        weights: (N) how much each counts before it is looked at.
        settings: thresholds.
    """
    robust = np.ones(len(parent_T_child))
    in_child = np.full(3, np.inf)
    for _ in range(_ITERATIONS):
        before = in_child
        centre = _weighted_centre(parent_T_child, weights * robust, settings)
        in_child = centre.in_child
        sigma = max(_TO_SIGMA * _weighted_median(centre.residuals_m, weights), settings.residual_floor)
        # Geman-McClure.
        robust = 1.0 / (1.0 + (centre.residuals_m / (settings.outlier_sigmas * sigma)) ** 2) ** 2
        if np.linalg.norm(in_child - before) < _CONVERGED_M:
            break
    return JointCentre(
        centre.in_parent,
        centre.in_child,
        centre.singular_values,
        centre.child_directions,
        centre.parent_directions,
        centre.residuals_m,
        robust * (weights > 0),
    )


def check_exercised(rig: Rig, centres: Mapping[str, JointCentre], settings: JointCentreSettings) -> dict[str, Array]:
    """Hinges among the joints: child segment -> (3,) axis in the frame of the child's virtual camera.

    Args:
        rig: names.
        centres: child segment -> its joint.
        settings: thresholds.

    Raises:
        RangeOfMotionError: joints that were held still, or turned about one axis only where nothing else tells where
            on it they sit; each is named, with what to repeat.
    """
    hinges = {}
    complaints = []
    for child, centre in centres.items():
        named = SegmentName(child)
        freedoms = centre.freedoms(settings)
        values = ", ".join(f"{value:.3f}" for value in centre.singular_values)
        if freedoms < _HINGE:
            complaints.append(
                f"joint {named.joint} was held still (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}): {named.exercise}"
            )
        elif freedoms < _BALL and not named.straight_in_rest:
            complaints.append(
                f"joint {named.joint} was turned about one axis only (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}), so its place along that axis is open: {named.exercise}"
            )
        elif freedoms < _BALL:
            hinges[child] = centre.child_directions[2]
    if complaints:
        raise RangeOfMotionError(
            "the range of motion does not tell where every joint is. Repeat it, and\n  " + "\n  ".join(complaints)
        )
    return hinges


def _weighted_centre(parent_T_child: Array, weights: Array, settings: JointCentreSettings) -> JointCentre:
    """Solve A eq. 14 by SVD, with the mean over time as the instant that all others are compared to."""
    share = weights / weights.sum()
    R, t = parent_T_child[:, :3, :3], parent_T_child[:, :3, 3]
    R_mean, t_mean = np.einsum("n,nij->ij", share, R), share @ t
    root = np.sqrt(share)
    dR = (root[:, None, None] * (R - R_mean)).reshape(-1, 3)
    dt = (root[:, None] * (t - t_mean)).reshape(-1)
    U, singular_values, directions = np.linalg.svd(dR, full_matrices=False)
    # The null vector (c, 1) of [dR | dt]; null vectors (axis, 0) of a hinge are left out, which leaves the shortest c.
    turning = singular_values > min(settings.free_rotation, 0.5 * singular_values[0])
    in_child = -directions[turning].T @ ((U.T @ dt)[turning] / singular_values[turning])
    in_parent = R_mean @ in_child + t_mean
    residuals_m = np.linalg.norm(R @ in_child + t - in_parent, axis=1)
    parent_directions = directions @ R_mean.T
    lengths = np.linalg.norm(parent_directions, axis=1, keepdims=True)
    parent_directions = parent_directions / np.maximum(lengths, np.finfo(float).tiny)
    return JointCentre(in_parent, in_child, singular_values, directions, parent_directions, residuals_m, weights)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, 0.5 * reached[-1])])


@dataclass(frozen=True, eq=False)
class FoundJoints:
    """What the motion of the cameras says, before the N-pose gives the segments their axes.

    Attributes:
        trust: (T, C) weight of each camera at each instant, 0 to 1.
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
        """Camera -> (4, 4) its place at its segment's virtual camera."""
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


class JointSearch:
    """Finds the joints of a rig.

    Args:
        rig: which camera is on which segment.
        strap_slip, virtual_camera, joint_centre: settings of the steps.
    """

    def __init__(
        self,
        rig: Rig,
        strap_slip: StrapSlipSettings,
        virtual_camera: VirtualCameraSettings,
        joint_centre: JointCentreSettings,
    ) -> None:
        self._rig = rig
        self._strap_slip = strap_slip
        self._virtual_camera = virtual_camera
        self._joint_centre = joint_centre

    def find(self, motion: CameraMotion) -> FoundJoints:
        """Find virtual cameras, joints and slips.

        Raises:
            RangeOfMotionError: cameras that should be seen together never are, or there is no joint to find.
        """
        if len(self._rig.segments) < 2:
            raise RangeOfMotionError(
                f"the rig has cameras on {self._rig.root} only; a body needs cameras on two segments that hang together"
            )
        trust, slips = self._trust(motion)
        virtual = self._virtual_cameras(motion, trust)  # A eq. 6-7
        centres = self._joint_centres(motion, trust, virtual)  # A eq. 12-14
        lone_slips = slips_of_lone_cameras(self._joints_in_view(motion, virtual, centres), self._strap_slip)
        if lone_slips:
            for camera, slip in lone_slips.items():
                column = motion.cameras.index(camera)
                trust[:, column] = trust_before_slip(motion.known[:, column], slip.row)
            virtual = self._virtual_cameras(motion, trust)
            centres = self._joint_centres(motion, trust, virtual)
        return FoundJoints(trust, {**slips, **lone_slips}, virtual, centres)

    def _trust(self, motion: CameraMotion) -> tuple[Array, dict[str, Slip]]:
        """Weights (T, C) of the cameras, less where one slipped, and the slips."""
        trust = motion.known.astype(np.float64)
        slips: dict[str, Slip] = {}
        for segment in self._rig.segments:
            columns = motion.columns(self._rig.cameras_on(segment))
            accused = slips_on_segment(
                self._rig.cameras_on(segment),
                motion.world_T_camera[:, columns],
                motion.known[:, columns],
                motion.seconds,
                self._strap_slip,
            )
            if len(accused) > 1:
                # They moved against each other; the one that slipped also moved against the joints.
                worst = max(accused, key=lambda camera: self._disagreement(motion, camera))
                accused = {worst: accused[worst]}
            slips |= accused
        for camera, slip in slips.items():
            column = motion.cameras.index(camera)
            trust[:, column] = trust_after_slip(motion.known[:, column], slip.row, self._strap_slip)
        return trust, slips

    def _disagreement(self, motion: CameraMotion, camera: str) -> float:
        """How far joints stray on a camera's segment if it alone tells the segment [m]; mean over its joints."""
        segment = self._rig.cameras[camera]
        neighbours = [other for other, parent in self._rig.parents.items() if parent == segment]
        neighbours += [parent for parent in [self._rig.parents[segment]] if parent is not None]
        gaps = []
        for neighbour in neighbours:
            for other in self._rig.cameras_on(neighbour):
                both = motion.known[:, motion.columns((camera, other))].all(axis=1)
                if both.any():
                    camera_T_other = (inverse(motion.poses(camera)) @ motion.poses(other))[both]
                    centre = find_joint_centre(camera_T_other, np.ones(both.sum()), self._joint_centre)
                    gaps.append(float(np.mean(np.minimum(centre.residuals_m, self._strap_slip.wrong_gap))))
        return float(np.mean(gaps)) if gaps else 0.0

    def _joints_in_view(
        self, motion: CameraMotion, virtual: Mapping[str, VirtualCamera], centres: Mapping[str, JointCentre]
    ) -> dict[str, list[JointInView]]:
        """Cameras alone on their segment -> the joints of the segment, where the neighbours say that they are."""
        in_view: dict[str, list[JointInView]] = {}
        for child, centre in centres.items():
            parent = str(self._rig.parents[child])
            rows = np.flatnonzero(virtual[child].known & virtual[parent].known)
            sides = ((child, parent, centre.in_parent), (parent, child, centre.in_child))
            for segment, neighbour, on_neighbour in sides:
                cameras = self._rig.cameras_on(segment)
                if len(cameras) == 1:
                    segment_T_neighbour = inverse(virtual[segment].world_T_virtual) @ virtual[neighbour].world_T_virtual
                    places = transform_points(segment_T_neighbour[rows], on_neighbour[None])[:, 0]
                    name, usual_m = SegmentName(child).joint, float(np.median(centre.residuals_m))
                    in_view.setdefault(cameras[0], []).append(
                        JointInView(name, rows, motion.seconds[rows], places, usual_m)
                    )
        return in_view

    def _virtual_cameras(self, motion: CameraMotion, trust: Array) -> dict[str, VirtualCamera]:
        """Segment -> its cameras as one (A eq. 6-7)."""
        virtual = {}
        for segment in self._rig.segments:
            names = self._rig.cameras_on(segment)
            columns = motion.columns(names)
            virtual[segment] = fuse_cameras(
                names, motion.world_T_camera[:, columns], trust[:, columns], self._virtual_camera
            )
        return virtual

    def _joint_centres(
        self, motion: CameraMotion, trust: Array, virtual: Mapping[str, VirtualCamera]
    ) -> dict[str, JointCentre]:
        """Child segment -> its joint, from every pair of cameras on the two segments (A eq. 12-14)."""
        centres = {}
        for child in self._rig.segments:
            parent = self._rig.parents[child]
            if parent is None:
                continue
            parent_T_child, weights = [], []
            for a in self._rig.cameras_on(parent):
                world_T_parent = motion.poses(a) @ inverse(virtual[parent].virtual_T_camera[a])
                for b in self._rig.cameras_on(child):
                    world_T_child = motion.poses(b) @ inverse(virtual[child].virtual_T_camera[b])
                    both = trust[:, motion.columns((a, b))].prod(axis=1)
                    parent_T_child.append((inverse(world_T_parent) @ world_T_child)[both > 0])
                    weights.append(both[both > 0])
            poses = np.concatenate(parent_T_child)
            together = max(map(len, parent_T_child))
            if together < self._joint_centre.min_instants:
                raise RangeOfMotionError(
                    f"joint {SegmentName(child).joint}: cameras on {parent} and on {child} were registered together "
                    f"at {together} instants only, of {len(motion.stamps_ns)}; "
                    f"{self._joint_centre.min_instants} are needed. Repeat it where both see the mapped place"
                )
            centres[child] = find_joint_centre(poses, np.concatenate(weights), self._joint_centre)
        return centres
