"""Static cameras beside body cameras: what each state takes from them, and what it leaves to body cameras (B 2)."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyUncertainty, SegmentPose
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.estimation.factors.joint_rotations import JointRotations
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3

Mask = NDArray[np.bool_]

_JOINT_RAD = 0.2  # sigma of joints that static cameras observe: no contour determines a limb's turn about its long axis
_KNOWN_S = 0.1  # how long segments stay known that were placed by hand, or measured by body cameras that fell silent
_PREDICTED = np.diag(np.repeat([0.03, 0.01], 3) ** 2)  # [rad^2], [m^2] of their prediction by then
_UNSUPPORTED = np.repeat([1.0, 0.3], 3)  # [rad], [m] sigmas of a segment that the images do not show there


@dataclass(frozen=True, eq=False)
class StaticMeasurement:
    """What all static cameras measured of one state.

    Attributes:
        evidence: camera -> poses of the segments that it observes.
        world_T_segment: (S, 4, 4) the body as a whole, joints closed.
        confidence: camera -> (S,) of each segment, 0 to 1.
        jumped: rows of segments that were searched, and may be somewhere else than before.
        unsupported: rows of segments that the images do not show where the body has them.
        misplaced: cameras whose images do not show the body where the others have it.
        surface_variances: (S, 6) of errors in the segments' axes that last for a recording, rotation [rad^2] then
            translation [m^2]; empty for none.
        keypoints: of joints in the images.
        found: rows of those that jumped far, so that states before have them elsewhere.
        not_yet_shown: rows of unsupported ones that no image has shown yet, and none contradicts.
    """

    evidence: Mapping[str, list[SegmentPose]]
    world_T_segment: Array
    confidence: Mapping[str, Array]
    jumped: frozenset[int] = frozenset()
    unsupported: frozenset[int] = frozenset()
    misplaced: frozenset[str] = frozenset()
    surface_variances: Array = field(default_factory=lambda: np.zeros(0))
    keypoints: JointKeypoints = field(default_factory=JointKeypoints.nothing)
    found: frozenset[int] = frozenset()
    not_yet_shown: frozenset[int] = frozenset()

    @property
    def observed(self) -> set[str]:
        """Segments that any camera observes."""
        return {each.segment for poses in self.evidence.values() for each in poses}


class StaticCameras(Protocol):
    """Static cameras around a body."""

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """Segments where the body is known beforehand, in the first image; empty if it is not."""

    def measure(
        self, frame: BodyFrame, predicted: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """The body in the images of a frame; None if they cannot determine it.

        Args:
            frame: with their images.
            predicted: (S, 4, 4) poses.
            dt_s: since the state before [s]; 0 at the first.
            known: poses of segments by body cameras.
        """


@dataclass(frozen=True, eq=False)
class StaticObservation:
    """What static cameras observe of one state beside body cameras.

    Attributes:
        body: that is observed.
        measured: by all static cameras, of all segments.
        on_body: (S,) segments that body cameras measured.
    """

    body: BodyModel
    measured: StaticMeasurement
    on_body: Mask

    @cached_property
    def segments(self) -> Mask:
        """(S,) segments that a static camera observes."""
        return self.body.named(self.measured.observed)

    @property
    def observed(self) -> Mask:
        """(S,) segments that any camera observes."""
        return (self.on_body | self.segments) & ~self._listed(self.measured.unsupported)

    @property
    def jumped(self) -> Mask:
        """(S,) segments that were searched, and found elsewhere than predicted."""
        return self._listed(self.measured.jumped)

    @property
    def evidence(self) -> list[SegmentPose]:
        """Poses of segments by all static cameras."""
        return [each for poses in self.measured.evidence.values() for each in poses]

    @property
    def camera_count(self) -> int:
        """How many of them measured something."""
        return sum(bool(poses) for poses in self.measured.evidence.values())

    def poses(self, predicted: Array) -> Array:
        """Poses (S, 4, 4): predicted ones of segments that body cameras measure, static cameras' of the others."""
        return np.where(self.on_body[:, None, None], predicted, self.measured.world_T_segment)

    def joints(self) -> JointRotations:
        """Joints that static cameras observe and body cameras do not."""
        if not self.segments.any():
            return JointRotations.nothing()
        ends = self.body.joint_ends
        both, on_body = (mask[ends].all(axis=1) for mask in (self.on_body | self.segments, self.on_body))
        rows = np.flatnonzero(both & ~on_body)
        rotations = self.body.joint_rotations(self.measured.world_T_segment)[rows]
        return JointRotations(rows, rotations, np.full((len(rows), 3), _JOINT_RAD))

    def widen(self, uncertainty: BodyUncertainty) -> BodyUncertainty:
        """Covariances with errors of static cameras that last for a recording: surfaces are wrong in all frames."""
        if not (self.segments.any() or self.measured.unsupported):
            return uncertainty
        added, by_static = np.zeros((len(self.segments), 6)), self.segments & ~self.on_body
        if len(self.measured.surface_variances):
            added[by_static] = self.measured.surface_variances[by_static]
        added[self._listed(self.measured.unsupported)] = _UNSUPPORTED**2
        segments = uncertainty.segments + added[:, :, None] * np.eye(6)
        parents, children = self.body.joint_ends.T
        world_R_segment = self.measured.world_T_segment[:, :3, :3]
        child_R_parent = np.swapaxes(world_R_segment[children], 1, 2) @ world_R_segment[parents]
        joints = uncertainty.joints + added[children, :3, None] * np.eye(3)
        joints += child_R_parent * added[parents, None, :3] @ np.swapaxes(child_R_parent, 1, 2)
        root = segments[self.body.segment_index[self.body.root]]
        return replace(uncertainty, root=root, joints=joints, segments=segments)

    def _listed(self, rows: Iterable[int]) -> Mask:
        """(S,) segments of some rows that no body camera measures."""
        listed = np.zeros(len(self.on_body), bool)
        listed[list(rows)] = True
        return np.asarray(listed & ~self.on_body, bool)


class StaticEvidence:
    """Measures one state after the other by static cameras.

    Args:
        body: that is observed.
        cameras: static cameras; None without any.
        count: of the segments that they know, the first ones.
    """

    def __init__(self, body: BodyModel, cameras: StaticCameras | None, count: int) -> None:
        self._body = body
        self._cameras = cameras
        self._count = count
        self._known: Collection[SegmentPose] = ()
        self._known_for_s = 0.0
        self._before = np.zeros((len(body.segments), 4, 4))

    def place(self, frame: BodyFrame, measured: Iterable[SegmentPose]) -> list[SegmentPose]:
        """Segments that were placed by hand in the first frame, but those that body cameras measured."""
        placed = self._cameras.place(frame) if self._cameras and frame.images else []
        known = {each.segment for each in measured}
        return [each for each in placed if each.segment not in known]

    def measure(
        self, frame: BodyFrame, predicted: Array, dt_s: float, known: Collection[SegmentPose], on_body: Mask
    ) -> StaticObservation:
        """Measure a frame, as ``StaticCameras.measure``; body cameras measured the segments ``on_body`` (S,)."""
        cameras = self._cameras if frame.images else None
        known = self._recently_known(predicted, dt_s, known)
        measured = cameras.measure(frame, predicted[: self._count], dt_s, known) if cameras else None
        if measured:
            measured = self._with_other_segments(measured, predicted)
        if measured and dt_s > 0.0:
            measured = self._at_stamp(measured, frame, log_se3(inverse(self._before) @ predicted) / dt_s)
        measured = measured or StaticMeasurement({}, predicted, {})
        self._before = measured.world_T_segment
        return StaticObservation(self._body, measured, on_body)

    def _with_other_segments(self, measured: StaticMeasurement, predicted: Array) -> StaticMeasurement:
        """The measurement of all segments; those that static cameras do not know are as predicted."""
        variances = measured.surface_variances
        if len(variances):
            variances = np.concatenate([variances, np.zeros((len(predicted) - len(variances), 6))])
        poses = np.concatenate([measured.world_T_segment, predicted[self._count :]])
        return replace(measured, world_T_segment=poses, surface_variances=variances)

    def _recently_known(self, predicted: Array, dt_s: float, known: Collection[SegmentPose]) -> Collection[SegmentPose]:
        """Segments by body cameras or placed by hand; without any, those of the latest states where predicted now."""
        if known:
            self._known, self._known_for_s = known, 0.0
            return known
        self._known_for_s += dt_s
        if self._known_for_s > _KNOWN_S:
            return ()
        rows = self._body.segment_index
        return [SegmentPose(e.segment, predicted[rows[e.segment]], e.covariance + _PREDICTED) for e in self._known]

    def _at_stamp(self, measured: StaticMeasurement, frame: BodyFrame, velocities: Array) -> StaticMeasurement:
        """Evidence moved from the time of each image to that of the frame, at the segments' velocities (S, 6)."""
        stamps_ns = {image.camera: image.stamp_ns for image in frame.images.values()}
        evidence = dict(measured.evidence)
        for name, poses in measured.evidence.items():
            if late_ns := stamps_ns.get(name, frame.stamp_ns) - frame.stamp_ns:
                rows = [self._body.segment_index[each.segment] for each in poses]
                steps = exp_se3(-1e-9 * late_ns * velocities[rows])
                evidence[name] = [
                    replace(each, world_T_segment=each.world_T_segment @ step)
                    for each, step in zip(poses, steps, strict=True)
                ]
        keypoints = measured.keypoints
        if len(keypoints):
            late_s = np.array(
                [1e-9 * (stamps_ns.get(each, frame.stamp_ns) - frame.stamp_ns) for each in keypoints.views]
            )
            keypoints = keypoints.late(measured.world_T_segment, velocities, late_s[keypoints.cameras])
        return replace(measured, evidence=evidence, keypoints=keypoints)
