"""What a static camera says of a known motion, as messages for its solved bag."""

from collections.abc import Sequence

import numpy as np
from known_walk import Stamped, Walk

from bodycam_ros.messages.segment_poses import SEGMENT_POSES, segment_poses_message
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.solving.camera_evidence import SegmentPose

CONFIDENCE = {"thigh_left": 0.6, "shin_left": 0.9, "foot_left": 0.0}


def said(walk: Walk, station: str, unseen: Sequence[int] = ()) -> list[Stamped]:
    """That it sees the thigh and the shin, and looks for the foot in vain; at some frames it looks for nothing."""
    make, messages = recorded_messages(), []
    for frame, (stamp_ns, poses) in enumerate(zip(walk.stamps_ns.tolist(), walk.world_T_segment, strict=True)):
        seen = ["thigh_left", "shin_left"] if frame not in unseen else []
        evidence = [SegmentPose(name, poses[walk.body.segment_index[name]], np.eye(6)) for name in seen]
        message = segment_poses_message(make, stamp_ns, station, evidence, CONFIDENCE if seen else {})
        messages.append((f"/{station}{SEGMENT_POSES}", stamp_ns, message))
    return messages
