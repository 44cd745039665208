"""Segment poses from static cameras (bodycam_msgs/SegmentPoses)."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, header_message, numbers, stamp_ns
from bodycam_ros.messages.poses import pose_message

SEGMENT_POSES, SEGMENT_POSES_TYPE = "/segment_poses", "bodycam_msgs/msg/SegmentPoses"
"""Topic below the name of a static camera, and type."""


def segment_poses_message(
    make: MessageFactory,
    stamp_ns: int,
    station: str,
    evidence: Sequence[SegmentPose],
    segments: Sequence[str],
    confidence: Array,
) -> Message:
    """bodycam_msgs/SegmentPoses of the measurements of a static camera, in the map's frame.

    Args:
        stamp_ns: of its image [ns].
        station: its name.
        evidence: poses of the segments that it observes.
        segments: S names, of all that were searched for.
        confidence: (S,) share of each one's contour that is measured.
    """
    return make(
        SEGMENT_POSES_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        station=station,
        segments=[pose.segment for pose in evidence],
        poses=[pose_message(make, pose.world_T_segment) for pose in evidence],
        covariances=make.array(np.array([pose.covariance for pose in evidence]), np.float64),
        looked_for=list(segments),
        confidence=make.array(confidence, np.float64),
    )


def observed_segments(message: Message) -> tuple[str, int, int, float]:
    """Static camera, stamp [ns], number of segments that it measured, and its mean confidence, 0 without any.

    Raises:
        ValueError: the station is missing, or a confidence is not from 0 to 1.
    """
    if not message.station:
        raise ValueError("the name of the station is empty")
    confidence = numbers(message.confidence, np.float64, len(message.looked_for))
    for segment, share in zip(message.looked_for, confidence.tolist(), strict=True):
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"the confidence of {segment} is {share:g}; expected 0 to 1")
    mean = float(confidence.mean()) if len(confidence) else 0.0
    return message.station, stamp_ns(message.header.stamp), len(message.segments), mean
