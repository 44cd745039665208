"""The articulated body over a sliding window (A 4.3): cameras, joints and smoothness in one factor graph.

One pose per segment and instant; only gtsam's native factors, so that it never calls back into Python
(DESIGN 4.2). A frame is answered when it is ``output_delay`` frames old, when its neighbours on both sides have spoken.
"""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.mapping.pose_fit import PoseFitSettings
from bodycam_ros.settings import setting
from bodycam_ros.solving.back_end import BackEnd, BatchBackEnd, IncrementalBackEnd
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.camera_evidence import (
    EvidenceSettings,
    SegmentPose,
    SegmentTurn,
    absolute_evidence,
    rotation_evidence,
    turned,
    weak_evidence,
)
from bodycam_ros.solving.motion import MotionSettings, motion_sigmas, orthonormal, predict

_REFUSED = 5.0
"""In units of ``outlier_sigmas``: where the Cauchy kernel has taken 96 % of a camera's weight."""

_ANCHOR_RAD, _ANCHOR_M = 0.5, 0.5
"""Sigmas of the first instant's anchor: next to a camera nothing, yet not too vague for a Cholesky factor."""


@dataclass(frozen=True)
class SmootherSettings:
    """Length of the window, and how it is solved."""

    window: float = setting(
        0.5, unit="s", limits=(0.05, 10.0), reason="beyond half a second the past no longer changes an estimate"
    )
    output_delay: int = setting(
        4,
        unit="frames",
        limits=(0, 60),
        reason="a frame is published when this many followed, so that a blink of a camera is bridged from both sides",
    )
    incremental: bool = setting(
        True, reason="iSAM2; false solves the whole window by Levenberg-Marquardt at every frame, slower, as a check"
    )
    max_pause: float = setting(
        0.3,
        unit="s",
        limits=(0.05, 10.0),
        reason="after a longer silence of all cameras the window begins anew: motion tells nothing across it",
    )
    blind_after: float = setting(
        0.25,
        unit="s",
        limits=(0.0, 10.0),
        reason="a segment unseen for this long starts where its camera says, not where it was predicted",
    )
    max_refusals: int = setting(
        3,
        unit="frames",
        limits=(1, 100),
        reason="a camera far from the body for this many frames in a row is believed: wrong registrations are rarer",
    )
    extra_updates: int = setting(
        0,
        limits=(0, 10),
        reason="Gauss-Newton steps after the one that adds the frame; the next frame brings one anyway",
    )
    covariance_interval: int = setting(
        5, unit="frames", limits=(1, 100), reason="the root's covariance is evaluated on every so many frames"
    )
    relinearize_threshold: float = setting(
        0.005, unit="rad, m", limits=(0.0, 1.0), reason="change of a pose beyond which its factors are linearised anew"
    )
    outlier_sigmas: float = setting(
        4.0,
        limits=(1.0, 100.0),
        reason="a registration farther than this from the body counts less and less (Cauchy): a "
        "wrong one must not bend the limb",
    )


@dataclass(frozen=True)
class _Instant:
    index: int
    stamp_ns: int
    cameras_used: int
    root_covariance: NDArray[np.float64]


class BodySmoother:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: models of the cameras, by name.
        settings, motion, evidence, pose_fit: settings of the smoother and of its steps.

    Raises:
        BodyError: no camera is mounted on the body.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        settings: SmootherSettings | None = None,
        motion: MotionSettings | None = None,
        evidence: EvidenceSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
    ) -> None:
        self.body = body
        self.settings = settings or SmootherSettings()
        self._cameras = {name: camera for name, camera in cameras.items() if name in body.mounts}
        if not self._cameras:
            raise BodyError(
                f"body {body.name}: none of the recording's cameras ({', '.join(cameras) or 'there are none'}) is on "
                f"it; it carries {', '.join(body.mounts)}"
            )
        self._motion = motion or MotionSettings()
        self._evidence = evidence or EvidenceSettings()
        self._pose_fit = pose_fit or PoseFitSettings()
        self._joint_noises = [gtsam.noiseModel.Gaussian.Information(joint.information) for joint in body.joints]
        self._begin_anew()

    def _begin_anew(self) -> None:
        """An empty window: at the start, and after a pause that nothing reaches across."""
        self._back_end: BackEnd = (
            IncrementalBackEnd(self.settings.window, self.settings.extra_updates, self.settings.relinearize_threshold)
            if self.settings.incremental
            else BatchBackEnd(self.settings.window)
        )
        self._window: deque[_Instant] = deque(maxlen=max(3, self.settings.output_delay + 1))
        self._published = -1
        self._seen_ns: dict[str, int] = {}
        self._refusals: Counter[str] = Counter()
        self._replaced: set[int] = set()

    def update(self, frame: BodyFrame) -> list[BodyState]:
        """Add one instant, later than the one before.

        Returns:
            The states that are now old enough to publish; empty until the first camera is registered.
        """
        evidence = {
            camera: seen
            for camera, matches in frame.matches.items()
            if camera in self._cameras
            and (seen := absolute_evidence(matches, self.body.mounts[camera], self._evidence))
        }
        states: list[BodyState] = []
        if self._window and frame.stamp_ns - self._window[-1].stamp_ns > 1e9 * self.settings.max_pause:
            states = self.flush()
            self._begin_anew()
        if not self._window and not evidence:
            return states
        predicted, turns = self._predict(frame, evidence)
        evidence |= self._weak_evidence(frame, set(evidence), predicted)

        index = self._window[-1].index + 1 if self._window else 0
        factors = gtsam.NonlinearFactorGraph()
        self._add_camera_factors(factors, index, evidence)
        self._add_turn_factors(factors, index, turns, predicted)
        self._add_joint_factors(factors, index, predicted)
        self._add_motion_factors(factors, index, frame.stamp_ns, predicted)
        poses = {self._key(index, row): predicted[row] for row in range(len(self.body.segments))}
        self._back_end.update(factors, poses, 1e-9 * frame.stamp_ns)
        root_covariance = self._root_covariance(index)
        self._window.append(_Instant(index, frame.stamp_ns, len(evidence), root_covariance))
        self._count_refusals(evidence)
        return states + self._publish(self.settings.output_delay)

    def flush(self) -> list[BodyState]:
        """The states that were still waiting for later frames; the recording is over."""
        if self._window:
            self._back_end.settle()
        return self._publish(0)

    def _predict(
        self, frame: BodyFrame, evidence: Mapping[str, SegmentPose]
    ) -> tuple[NDArray[np.float64], dict[str, SegmentTurn]]:
        """Start values (S, 4, 4) of the new instant, and the turns of the segments that no camera is registered on."""
        if not self._window:
            predicted, turns = self._first_poses(frame), {}
        else:
            predicted = self._predict_motion(frame.stamp_ns)
            turns = self._predict_turns(frame, {seen.segment for seen in evidence.values()}, predicted)
        self._replaced = set()
        for camera, seen in evidence.items():
            # A limb that was blind may have gone anywhere, and from there the robust kernel would refuse its camera for
            # ever; so it would from a state gone wrong.
            blind = frame.stamp_ns - self._seen_ns.get(seen.segment, 0) > 1e9 * self.settings.blind_after
            if blind or self._refusals[camera] >= self.settings.max_refusals:
                row = self.body.segment_index[seen.segment]
                predicted[row] = orthonormal(seen.world_T_segment[None])[0]
                self._replaced.add(row)
            self._seen_ns[seen.segment] = frame.stamp_ns
        return predicted, turns

    def _predict_motion(self, stamp_ns: int) -> NDArray[np.float64]:
        """Poses (S, 4, 4) at the velocity of the latest two instants."""
        latest = self._window[-1]
        if len(self._window) == 1:
            return self._poses(latest)
        before = self._window[-2]
        time_ratio = (stamp_ns - latest.stamp_ns) / (latest.stamp_ns - before.stamp_ns)
        predicted = predict(self._poses(before), self._poses(latest), time_ratio, self._motion)
        # Where a segment was put elsewhere, the step before is no velocity.
        for row in self._replaced:
            predicted[row] = self._poses(latest)[row]
        return predicted

    def _predict_turns(
        self, frame: BodyFrame, seen: set[str], predicted: NDArray[np.float64]
    ) -> dict[str, SegmentTurn]:
        """Turns by camera of the segments that are not seen; their prediction is turned accordingly, in place."""
        latest = self._window[-1]
        turns = {}
        for camera, matches in frame.matches.items():
            mount = self.body.mounts.get(camera)
            if mount is None or mount.segment in seen or matches.previous_stamp_ns != latest.stamp_ns:
                continue
            turn = rotation_evidence(matches, mount, self._evidence)
            if turn:
                row = self.body.segment_index[mount.segment]
                turns[camera] = turn
                predicted[row] = turned(self._poses(latest)[row], turn, predicted[row])
        return turns

    def _first_poses(self, frame: BodyFrame) -> NDArray[np.float64]:
        """Segments where their cameras are (A 4.2, from camera poses), the others as in the N-pose."""
        poses: dict[str, NDArray[np.float64]] = {}
        for camera, matches in frame.matches.items():
            if camera in self._cameras and matches.world_T_camera is not None:
                mount = self.body.mounts[camera]
                poses.setdefault(mount.segment, matches.world_T_camera @ inverse(mount.segment_T_camera))
        joints = self.body.tree_joints
        while len(poses) < len(self.body.segments):
            for joint in (*joints, *reversed(joints)):
                parent_T_child = joint.parent_T_joint @ joint.joint_T_child
                if joint.parent in poses and joint.child not in poses:
                    poses[joint.child] = poses[joint.parent] @ parent_T_child
                elif joint.child in poses and joint.parent not in poses:
                    poses[joint.parent] = poses[joint.child] @ inverse(parent_T_child)
        return orthonormal(np.stack([poses[segment] for segment in self.body.segments]))

    def _weak_evidence(
        self, frame: BodyFrame, registered: set[str], predicted: NDArray[np.float64]
    ) -> dict[str, SegmentPose]:
        weak = {}
        for camera, matches in frame.matches.items():
            if camera in self._cameras and camera not in registered:
                mount = self.body.mounts[camera]
                start = predicted[self.body.segment_index[mount.segment]]
                seen = weak_evidence(matches, self._cameras[camera], mount, start, self._pose_fit, self._evidence)
                if seen:
                    weak[camera] = seen
        return weak

    def _add_camera_factors(
        self, factors: gtsam.NonlinearFactorGraph, index: int, evidence: Mapping[str, SegmentPose]
    ) -> None:
        """E_r of A eq. 8: each camera's reprojection errors, condensed to its pose and information."""
        kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(self.settings.outlier_sigmas)
        for seen in evidence.values():
            noise = gtsam.noiseModel.Robust.Create(kernel, gtsam.noiseModel.Gaussian.Covariance(seen.covariance))
            key = self._key(index, self.body.segment_index[seen.segment])
            factors.add(gtsam.PriorFactorPose3(key, gtsam.Pose3(seen.world_T_segment), noise))

    def _add_turn_factors(
        self,
        factors: gtsam.NonlinearFactorGraph,
        index: int,
        turns: Mapping[str, SegmentTurn],
        predicted: NDArray[np.float64],
    ) -> None:
        """Second term of A eq. 8: the rotation between frames holds a segment whose cameras are not registered."""
        if not turns:
            return
        world_T_segment = self._poses(self._window[-1])
        for turn in turns.values():
            row = self.body.segment_index[turn.segment]
            previous_t_segment = (inverse(world_T_segment[row]) @ predicted[row])[:3, 3]
            measured = gtsam.Pose3(gtsam.Rot3(turn.previous_R_segment), previous_t_segment)
            noise = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([turn.sigma, 10.0], 3))
            factors.add(gtsam.BetweenFactorPose3(self._key(index - 1, row), self._key(index, row), measured, noise))

    def _add_joint_factors(
        self, factors: gtsam.NonlinearFactorGraph, index: int, predicted: NDArray[np.float64]
    ) -> None:
        """The skeleton (A eq. 3-5) as soft constraints: tight where a joint holds, loose where it turns."""
        for joint, noise in zip(self.body.joints, self._joint_noises, strict=True):
            parent, child = self.body.segment_index[joint.parent], self.body.segment_index[joint.child]
            measured = gtsam.Pose3(joint.measured_relative_pose(inverse(predicted[parent]) @ predicted[child]))
            factors.add(gtsam.BetweenFactorPose3(self._key(index, parent), self._key(index, child), measured, noise))

    def _add_motion_factors(
        self, factors: gtsam.NonlinearFactorGraph, index: int, stamp_ns: int, predicted: NDArray[np.float64]
    ) -> None:
        """E_O and E_A of A eq. 10-11, on velocities; the first instant gets a vague anchor instead."""
        if not self._window:
            vague = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([_ANCHOR_RAD, _ANCHOR_M], 3))
            for row, pose in enumerate(predicted):
                factors.add(gtsam.PriorFactorPose3(self._key(index, row), gtsam.Pose3(pose), vague))
            return
        latest = self._window[-1]
        noise = gtsam.noiseModel.Diagonal.Sigmas(motion_sigmas(1e-9 * (stamp_ns - latest.stamp_ns), self._motion))
        steps = inverse(self._poses(latest)) @ predicted
        for row, step in enumerate(steps):
            factors.add(
                gtsam.BetweenFactorPose3(self._key(index - 1, row), self._key(index, row), gtsam.Pose3(step), noise)
            )

    def _count_refusals(self, evidence: Mapping[str, SegmentPose]) -> None:
        """For how many frames in a row each camera has been far from the body that was solved."""
        if not evidence:
            return
        rows = [self.body.segment_index[seen.segment] for seen in evidence.values()]
        measured = np.stack([seen.world_T_segment for seen in evidence.values()])
        errors = log_se3(inverse(self._poses(self._window[-1])[rows]) @ measured)
        whitened = np.linalg.solve(np.stack([seen.covariance for seen in evidence.values()]), errors[:, :, None])
        sigmas = np.sqrt(np.einsum("ni,ni->n", errors, whitened[:, :, 0]))
        for camera, refused in zip(evidence, sigmas > _REFUSED * self.settings.outlier_sigmas, strict=True):
            self._refusals[camera] = self._refusals[camera] + 1 if refused else 0

    def _root_covariance(self, index: int) -> NDArray[np.float64]:
        """Covariance (6, 6) of the root at the newest instant.

        It costs as much as half an update, and changes slowly: between two evaluations the last one stands. For the
        delayed state it is cautious, as the frames that follow only sharpen it.
        """
        if self._window and index % self.settings.covariance_interval:
            return self._window[-1].root_covariance
        return self._back_end.covariance(self._key(index, self.body.segment_index[self.body.root]))

    def _publish(self, delay: int) -> list[BodyState]:
        states = []
        for instant in self._window:
            if self._published < instant.index <= self._window[-1].index - delay:
                states.append(
                    BodyState(
                        stamp_ns=instant.stamp_ns,
                        segments=self.body.segments,
                        world_T_segment=self._poses(instant),
                        root_covariance=instant.root_covariance,
                        cameras_used=instant.cameras_used,
                        predicted=instant.cameras_used == 0,
                    )
                )
                self._published = instant.index
        return states

    def _poses(self, instant: _Instant) -> NDArray[np.float64]:
        keys = [self._key(instant.index, row) for row in range(len(self.body.segments))]
        return orthonormal(self._back_end.poses(keys))

    def _key(self, index: int, row: int) -> int:
        return index * len(self.body.segments) + row
