"""Where the solver has all segments at an instant, as a message and back: for those who look for them next."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyNow, SegmentPose
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.segment_poses import SEGMENT_POSES_TYPE, segment_poses, segment_poses_message

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
