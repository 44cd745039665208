"""Segment poses from static cameras, and the current body for them (bodycam_msgs/SegmentPoses)."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import LatestState, SegmentMeasurements, SegmentPose
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, header_message, numbers, stamp_ns
from bodycam_ros.messages.poses import pose_message, transform_from_pose
from bodycam_ros.shown import shown

SEGMENT_POSES, SEGMENT_POSES_TYPE = "/segment_poses", "bodycam_msgs/msg/SegmentPoses"
"""Topic below the name of a static camera, and type."""

SEGMENTS_NOW = "segments_now"
"""Topic, of the same type, of the whole body at its latest state, which waits for no later one as joint states do.

Confidence is 1 for segments that cameras observe, else 0. The state before is sent once more with each new one, as it
is estimated by then: their difference is the motion of the body.
"""

_ROUNDING = 1e-6  # of a covariance's asymmetry, relative to its variances
_SOLVER = "solver"  # in place of a static camera


def segment_poses_message(
    make: MessageFactory, stamp_ns: int, station: str, evidence: Sequence[SegmentPose], confidence: Mapping[str, float]
) -> Message:
    """bodycam_msgs/SegmentPoses of the measurements of a static camera, in the map's frame."""
    return make(
        SEGMENT_POSES_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        station=station,
        segments=[pose.segment for pose in evidence],
        poses=[pose_message(make, pose.world_T_segment) for pose in evidence],
        covariances=make.array(np.array([pose.covariance for pose in evidence]), np.float64),
        looked_for=list(confidence),
        confidence=make.array(np.array(list(confidence.values())), np.float64),
    )


def segment_poses(message: Message, station: str = "") -> SegmentMeasurements:
    """Content of a bodycam_msgs/SegmentPoses.

    Args:
        station: that it must be from, if one is given.

    Raises:
        ValueError: the station is missing or another one, an array does not have one value for each segment, a segment
            is listed twice, a pose is not finite, a covariance is not one, or a confidence is not from 0 to 1.
    """
    if not message.station:
        raise ValueError("the name of the station is empty")
    if station and message.station != station:
        raise ValueError(f"it is from {message.station}")
    segments, candidates = _once(message.segments), _once(message.looked_for)
    for field, values, count in (
        ("poses", message.poses, len(segments)),
        ("covariances", message.covariances, 36 * len(segments)),
        ("confidence", message.confidence, len(candidates)),
    ):
        if len(values) != count:
            raise ValueError(f"{field} has {len(values)} values; expected {count}")
    confidence = dict(zip(candidates, numbers(message.confidence, np.float64, len(candidates)).tolist(), strict=True))
    for segment, share in confidence.items():
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"the confidence of {shown(segment)} is {share:g}; expected 0 to 1")
    covariances = np.array(numbers(message.covariances, np.float64, len(segments), 6, 6))
    for row in np.flatnonzero(~_valid_covariances(covariances)):
        raise ValueError(f"the covariance of {shown(segments[row])} is not finite, symmetric and positive definite")
    evidence = tuple(
        SegmentPose(segment, _pose(pose, segment), covariance)
        for segment, pose, covariance in zip(segments, message.poses, covariances, strict=True)
    )
    return SegmentMeasurements(message.station, stamp_ns(message.header.stamp), evidence, confidence)


def _once(names: Sequence[str]) -> tuple[str, ...]:
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{shown(twice[0])} is listed twice")
    return tuple(names)


def _pose(pose: Message, segment: str) -> Array:
    position, turn = pose.position, pose.orientation
    if not all(map(math.isfinite, (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w))):
        raise ValueError(f"the pose of {shown(segment)} is not finite")
    return transform_from_pose(pose)


def _valid_covariances(covariances: Array) -> NDArray[np.bool_]:
    """(N,) whether each of (N, 6, 6) is finite, symmetric and positive definite; the solver would fail on others."""
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    finite: NDArray[np.bool_] = np.all(np.isfinite(covariances), axis=(1, 2)) & np.all(variances > 0.0, axis=1)
    sigmas = np.sqrt(np.where(finite[:, None], variances, 1.0))
    correlations = np.where(finite[:, None, None], covariances, np.eye(6)) / (sigmas[:, :, None] * sigmas[:, None])
    asymmetry = np.abs(correlations - np.swapaxes(correlations, 1, 2)).max(axis=(1, 2), initial=0.0)
    valid: NDArray[np.bool_] = finite & (asymmetry < _ROUNDING) & (np.linalg.eigvalsh(correlations)[:, 0] > 0.0)
    return valid


def latest_state_message(make: MessageFactory, now: LatestState, body: BodyModel) -> Message:
    """bodycam_msgs/SegmentPoses of a whole body."""
    poses = [SegmentPose(*each) for each in zip(body.segments, now.world_T_segment, now.covariances, strict=True)]
    observed = dict(zip(body.segments, now.observed.astype(float).tolist(), strict=True))
    return segment_poses_message(make, now.stamp_ns, _SOLVER, poses, observed)


def latest_state(message: Message, body: BodyModel) -> LatestState:
    """State of a body in such a message.

    Raises:
        ValueError: as of ``segment_poses``, or the segments are not the body's.
    """
    measured = segment_poses(message)
    segments = tuple(each.segment for each in measured.evidence)
    if segments != body.segments:
        raise ValueError(
            f"its segments are {', '.join(segments)}; expected {', '.join(body.segments)}; is it of another body?"
        )
    observed = body.named(name for name, share in measured.confidence.items() if share and name in body.segments)
    poses = np.array([each.world_T_segment for each in measured.evidence])
    covariances = np.array([each.covariance for each in measured.evidence])
    return LatestState(measured.stamp_ns, poses, covariances, observed)
