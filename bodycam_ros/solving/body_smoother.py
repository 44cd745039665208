"""The articulated body over a sliding window (A 4.3): cameras, joints and smoothness in one factor graph.

One pose per segment and instant; only gtsam's native factors, so that it never calls back into Python
(DESIGN 4.2). A frame is answered when it is ``output_delay`` frames old, when its neighbours on both sides have spoken.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.settings import setting
from bodycam_ros.solving.back_end import BackEnd, BatchBackEnd, IncrementalBackEnd
from bodycam_ros.solving.body_factors import BodyFactors, merged
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
from bodycam_ros.solving.camera_trust import CameraTrust, TrustSettings
from bodycam_ros.solving.motion import MotionSettings, orthonormal, predict


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
    """An instant of the window: its number, its stamp, each camera's own stamp, and what is known of it already."""

    index: int
    stamp_ns: int
    camera_stamps_ns: Mapping[str, int]
    cameras_used: int
    root_covariance: NDArray[np.float64]


class BodySmoother:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: models of the cameras, by name.
        settings, motion, evidence, trust, pose_fit: settings of the smoother and of its steps.

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
        trust: TrustSettings | None = None,
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
        self._trust_settings = trust or TrustSettings()
        self._pose_fit = pose_fit or PoseFitSettings()
        self._factors = BodyFactors(body, self.settings.outlier_sigmas, self._motion)
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
        self._trust = CameraTrust(self.body, self.settings.outlier_sigmas, self._trust_settings)
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
        states = self._publish_leaving(frame.stamp_ns)
        if not self._window and not evidence:
            return states
        predicted, turns = self._predict(frame, evidence)
        evidence |= self._weak_evidence(frame, set(evidence), predicted)

        index = self._window[-1].index + 1 if self._window else 0
        graphs = {
            "cameras": self._factors.cameras(index, evidence.values()),
            "turns": self._factors.turns(index, turns),
            "joints": self._factors.joints(index, predicted),
            "past": self._past(index, frame.stamp_ns, predicted),
        }
        poses = dict(zip(self._factors.keys(index), predicted, strict=True))
        self._back_end.update(merged(graphs), poses, 1e-9 * frame.stamp_ns)

        root_covariance = self._root_covariance(index, seen=bool(evidence))
        stamps_ns = {camera: matches.stamp_ns for camera, matches in frame.matches.items()}
        self._window.append(_Instant(index, frame.stamp_ns, stamps_ns, len(evidence), root_covariance))
        self._trust.compare(evidence, self._poses(self._window[-1]))
        return states + self._publish(self.settings.output_delay)

    def flush(self) -> list[BodyState]:
        """The states that were still waiting for later frames; the recording is over."""
        if self._window:
            self._back_end.settle()
        return self._publish(0)

    def _publish_leaving(self, stamp_ns: int) -> list[BodyState]:
        """States that cannot wait any longer: after a pause all, else those that the window is about to lose."""
        if not self._window:
            return []
        pause_s = 1e-9 * (stamp_ns - self._window[-1].stamp_ns)
        if pause_s > min(self.settings.max_pause, self.settings.window):
            states = self.flush()
            self._begin_anew()
            return states
        leaves_before_ns = stamp_ns - 1e9 * self.settings.window
        staying = sum(instant.stamp_ns > leaves_before_ns for instant in self._window)
        return self._publish(staying)

    def _predict(
        self, frame: BodyFrame, evidence: Mapping[str, SegmentPose]
    ) -> tuple[NDArray[np.float64], list[tuple[int, SegmentTurn]]]:
        """Start values (S, 4, 4) of the new instant, and the turns of the segments that no camera is registered on."""
        turns: list[tuple[int, SegmentTurn]] = []
        if not self._window:
            predicted = self._first_poses(frame)
        else:
            predicted = self._predict_motion(frame.stamp_ns)
            turns = self._predict_turns(frame, {seen.segment for seen in evidence.values()}, predicted)
        believed = self._trust.believed(evidence, frame.stamp_ns)
        for row, world_T_segment in believed.items():
            predicted[row] = orthonormal(world_T_segment[None])[0]
        self._replaced = set(believed)
        return predicted, turns

    def _predict_motion(self, stamp_ns: int) -> NDArray[np.float64]:
        """Poses (S, 4, 4) at the velocity of the latest two instants."""
        latest = self._window[-1]
        world_T_segment = self._poses(latest)
        if len(self._window) == 1:
            return world_T_segment
        before = self._window[-2]
        time_ratio = (stamp_ns - latest.stamp_ns) / (latest.stamp_ns - before.stamp_ns)
        predicted = predict(self._poses(before), world_T_segment, time_ratio, self._motion)
        # Where a segment was put elsewhere, the step before is no velocity.
        for row in self._replaced:
            predicted[row] = world_T_segment[row]
        return predicted

    def _predict_turns(
        self, frame: BodyFrame, seen: set[str], predicted: NDArray[np.float64]
    ) -> list[tuple[int, SegmentTurn]]:
        """Turns of the segments that are not seen, and since which instant; their prediction is turned, in place."""
        turns = []
        for camera, matches in frame.matches.items():
            mount = self.body.mounts.get(camera)
            if mount is None or mount.segment in seen:
                continue
            # By the camera's own stamps: those of other cameras may be off by some milliseconds.
            since = next((i for i in self._window if i.camera_stamps_ns.get(camera) == matches.previous_stamp_ns), None)
            turn = rotation_evidence(matches, mount, self._evidence)
            if since and turn and frame.stamp_ns - since.stamp_ns < 1e9 * self.settings.window:
                row = self.body.segment_index[mount.segment]
                turns.append((since.index, turn))
                predicted[row] = turned(self._poses(since)[row], turn, predicted[row])
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

    def _past(self, index: int, stamp_ns: int, predicted: NDArray[np.float64]) -> gtsam.NonlinearFactorGraph:
        """How the instant hangs on the one before, or what stands in for it at the start."""
        if not self._window:
            return self._factors.anchor(index, predicted)
        latest = self._window[-1]
        dt_s = 1e-9 * (stamp_ns - latest.stamp_ns)
        previous_dt_s = 1e-9 * (latest.stamp_ns - self._window[-2].stamp_ns) if len(self._window) > 1 else dt_s
        return self._factors.motion(index, inverse(self._poses(latest)) @ predicted, dt_s, previous_dt_s)

    def _root_covariance(self, index: int, seen: bool) -> NDArray[np.float64]:
        """Covariance (6, 6) of the root at the newest instant.

        It costs as much as half an update and changes slowly while cameras speak: then the last one stands for some
        frames. While the body is seen it is cautious for the delayed state, which later frames sharpen; while no camera
        speaks it grows too slowly, because velocity is not a variable of the graph.
        """
        if self._window and seen and index % self.settings.covariance_interval:
            return self._window[-1].root_covariance
        return self._back_end.covariance(self._factors.key(index, self.body.segment_index[self.body.root]))

    def _publish(self, delay: int) -> list[BodyState]:
        """States of the instants that at least ``delay`` others have followed."""
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
        return orthonormal(self._back_end.poses(self._factors.keys(instant.index)))
