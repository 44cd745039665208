"""What a static camera says of a body's segments, as a message and back."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyNow, SaidSegments, SegmentPose
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, flat, header_message, numbers, stamp_ns
from bodycam_ros.messages.tracks import pose_message, transform_from_pose
from bodycam_ros.shown import shown

SEGMENT_POSES, SEGMENT_POSES_TYPE = "/segment_poses", "bodycam_msgs/msg/SegmentPoses"
"""Topic beneath the station's name, and type."""

_ROUNDING = 1e-6  # of a covariance's asymmetry, relative to its variances


def segment_poses_message(
    make: MessageFactory, stamp_ns: int, station: str, evidence: Sequence[SegmentPose], confidence: Mapping[str, float]
) -> Message:
    """bodycam_msgs/SegmentPoses of what a station says, in the map's frame."""
    covariances = np.array([said.covariance for said in evidence])
    return make(
        SEGMENT_POSES_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        station=station,
        segments=[said.segment for said in evidence],
        poses=[pose_message(make, said.world_T_segment) for said in evidence],
        covariances=make.sequence(flat(covariances, np.float64)),
        looked_for=list(confidence),
        confidence=make.sequence(flat(np.array(list(confidence.values())), np.float64)),
    )


def segment_poses(message: Message) -> SaidSegments:
    """What a bodycam_msgs/SegmentPoses says.

    Raises:
        ValueError: it names no station, arrays do not have one value for each segment, a segment comes twice, a pose is
            not finite, a covariance is none, or a confidence is not from 0 to 1.
    """
    if not message.station:
        raise ValueError("it does not say which station it is from")
    segments, looked_for = _once(message.segments), _once(message.looked_for)
    for field, values, count in (
        ("poses", message.poses, len(segments)),
        ("covariances", message.covariances, 36 * len(segments)),
        ("confidence", message.confidence, len(looked_for)),
    ):
        if len(values) != count:
            raise ValueError(f"{field} has {len(values)} values; expected {count}")
    confidence = dict(zip(looked_for, numbers(message.confidence, np.float64, len(looked_for)).tolist(), strict=True))
    for segment, share in confidence.items():
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"the confidence of {shown(segment)} is {share:g}; expected 0 to 1")
    covariances = np.array(numbers(message.covariances, np.float64, len(segments), 6, 6))
    for row in np.flatnonzero(~_invertible(covariances)):
        raise ValueError(f"the covariance of {shown(segments[row])} is not finite, symmetric and positive definite")
    evidence = tuple(
        SegmentPose(segment, _pose(pose, segment), covariance)
        for segment, pose, covariance in zip(segments, message.poses, covariances, strict=True)
    )
    return SaidSegments(message.station, stamp_ns(message.header.stamp), evidence, confidence)


def _once(names: Sequence[str]) -> tuple[str, ...]:
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{shown(twice[0])} is listed twice")
    return tuple(names)


def _pose(pose: Message, segment: str) -> NDArray[np.float64]:
    position, turn = pose.position, pose.orientation
    if not all(map(math.isfinite, (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w))):
        raise ValueError(f"the pose of {shown(segment)} is not finite")
    return transform_from_pose(pose)


def _invertible(covariances: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which (N,) of covariances (N, 6, 6) are any: the solver would stumble over the others."""
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    whole: NDArray[np.bool_] = np.all(np.isfinite(covariances), axis=(1, 2)) & np.all(variances > 0.0, axis=1)
    sigmas = np.sqrt(np.where(whole[:, None], variances, 1.0))
    correlations = np.where(whole[:, None, None], covariances, np.eye(6)) / (sigmas[:, :, None] * sigmas[:, None])
    asymmetry = np.abs(correlations - np.swapaxes(correlations, 1, 2)).max(axis=(1, 2), initial=0.0)
    invertible: NDArray[np.bool_] = whole & (asymmetry < _ROUNDING) & (np.linalg.eigvalsh(correlations)[:, 0] > 0.0)
    return invertible


SEGMENTS_NOW, SEGMENTS_NOW_TYPE = "segments_now", SEGMENT_POSES_TYPE
"""Topic, in the nodes' namespace, and type. It waits for no later instant, as joint states do; confidence is 1 of what
cameras see, else 0.

With each instant comes the one before it once more, as it is known by then: what lies between is the body's motion.
"""

_SOLVER = "solver"  # in place of a station


def segments_now_message(make: MessageFactory, now: BodyNow, body: BodyModel) -> Message:
    """bodycam_msgs/SegmentPoses of a whole body."""
    poses = [
        SegmentPose(segment, world_T_segment, covariance)
        for segment, world_T_segment, covariance in zip(
            body.segments, now.world_T_segment, now.covariances, strict=True
        )
    ]
    observed = dict(zip(body.segments, now.observed.astype(float).tolist(), strict=True))
    return segment_poses_message(make, now.stamp_ns, _SOLVER, poses, observed)


def segments_now(message: Message, body: BodyModel) -> BodyNow:
    """What such a message says of a body.

    Raises:
        ValueError: as of ``segment_poses``, or it is of another body.
    """
    said = segment_poses(message)
    if tuple(each.segment for each in said.evidence) != body.segments:
        raise ValueError(
            f"its segments are {', '.join(each.segment for each in said.evidence)}; expected {', '.join(body.segments)}"
        )
    observed = body.named(segment for segment, share in said.confidence.items() if share and segment in body.segments)
    poses = np.array([each.world_T_segment for each in said.evidence])
    covariances = np.array([each.covariance for each in said.evidence])
    return BodyNow(said.stamp_ns, poses, covariances, observed)
