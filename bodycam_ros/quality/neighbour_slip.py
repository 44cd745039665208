"""A strap that slipped, where the camera next to it is the one that contradicts the body.

A camera alone on its segment takes the segment with it. The body follows it where its turn is within the gate
(``estimation/camera_gate.py``), and the camera on the next segment is then farther from the body than itself. Joints
tell the two apart, without the solved body: those of the slipped camera have changed on both sides.
"""

from dataclasses import replace

import numpy as np

from bodycam_ros.geometry import Array, inverse
from bodycam_ros.quality.causes import Cause, find_slip, slip_cause
from bodycam_ros.quality.contradiction import DOUBTFUL_GAP_M, Contradiction, lasting

_UNEXPLAINED = ("strap", "images", "mount")
"""Causes that say only that poses do not fit; the others have evidence of their own camera."""


def attribute_slips(found: Contradiction, causes: dict[str, Cause]) -> tuple[Contradiction, dict[str, Cause]]:
    """The contradiction and its causes with slipped cameras in place of their neighbours.

    Args:
        found: cameras that contradict the body.
        causes: likely cause of each.
    """
    for camera, cause in list(causes.items()):
        if cause.kind not in _UNEXPLAINED:
            continue
        for other in found.core:
            if _offsets(found, camera, other) is None or not _fits_all_but(found, camera, other):
                continue
            if (slipped := _slip_beyond(found, other, camera)) is not None:
                causes = {**{name: each for name, each in causes.items() if name != camera}, other: slipped}
                gaps = {name: gap for name, gap in found.gaps.items() if name != camera}
                gaps[other] = max(found.gaps[camera], gaps.get(other, 0.0))
                core = tuple(name for name in found.core if name != other)
                found = replace(found, core=core, gaps=gaps, shown_by={**found.shown_by, other: camera})
                break
    return found, causes


def _slip_beyond(found: Contradiction, camera: str, accused: str) -> Cause | None:
    """The slip of a camera by its joint with a third one that fits the body; None if there is none."""
    for third in found.core:
        if third in (camera, accused) or (of_third := _offsets(found, camera, third)) is None:
            continue
        known = np.isfinite(of_third).all(axis=1)
        if (slip := find_slip(found.poses.seconds[known], of_third[known])) is not None:
            return slip_cause(slip)
    return None


def _fits_all_but(found: Contradiction, camera: str, other: str) -> bool:
    """Whether a camera's joints with all other neighbours are where these have them."""
    for third in found.core:
        if third == other or (offsets := _offsets(found, camera, third)) is None:
            continue
        if lasting(np.linalg.norm(offsets, axis=1), found.poses.seconds) > DOUBTFUL_GAP_M:
            return False
    return True


def _offsets(found: Contradiction, camera: str, other: str) -> Array | None:
    """(T, 3) from where a camera's mount has a joint to where the other one has it [m], in the camera's frame.

    NaN where one is not registered; None if the segments of the two have no joint, or one is not alone on its own.
    """
    poses, mounts = found.poses, found.poses.body.mounts
    own, next_to = mounts[camera].segment, mounts[other].segment
    if any(mounts[name].segment == own for name in found.core if name != camera):
        return None
    for joint in poses.body.tree_joints:
        of = {joint.parent: joint.parent_T_joint, joint.child: joint.child_T_joint}
        if joint.type != "free" and own != next_to and own in of and next_to in of:
            camera_T_other = inverse(poses.registered[camera]) @ poses.registered[other]
            by_other = camera_T_other @ inverse(mounts[other].segment_T_camera) @ of[next_to]
            expected = inverse(mounts[camera].segment_T_camera) @ of[own]
            offsets: Array = by_other[:, :3, 3] - expected[:3, 3]
            return offsets
    return None
