"""Where segments end that carry no other: nobody measures crown and toes, so as people of its size."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel, bone_ends, sole_points
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras import girths

_SHORT_M = 0.1  # of a segment that nothing is known of


def bone_tip(body: BodyModel, segment: str) -> Array:
    """(3,) where the bone of a segment without children ends, in the segment's frame [m]."""
    kind, stature = SegmentName(segment).kind, girths.stature_of(body)
    if kind == "head":
        return np.array([0.0, 0.0, girths.NECK_TO_VERTEX * stature])
    if kind == "foot":
        ball: Array = sole_points(girths.BONES["shin"] * stature)[1]
        return ball
    length = girths.HAND_LENGTH if kind == "hand" else girths.BONES.get(kind)
    if length is not None:
        return np.array([0.0, 0.0, -length * stature])
    ends = bone_ends(body, segment)
    return ends[0] if ends else np.array([0.0, 0.0, _SHORT_M])
