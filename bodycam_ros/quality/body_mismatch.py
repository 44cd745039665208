"""The body of somebody else, or of another day: most cameras are off from the solved body, each by a steady amount."""

from collections.abc import Sequence

import numpy as np

from bodycam_ros.geometry import inverse, robust_average_pose
from bodycam_ros.quality.camera_poses import CameraPoses
from bodycam_ros.quality.causes import lens_cause
from bodycam_ros.quality.contradiction import Contradiction, pose_distance
from bodycam_ros.results.verdict import Finding, Level

_OFFSET_M = 0.015  # of most cameras; with their own body 1 to 5 mm, with mounts moved by 30 mm 10 to 37
_LEAST_CAMERAS = 6  # of fewer, one with a wrong mount moves most
_LEAST_ROWS = 10  # states that an offset is averaged over
_PERSON_SCALES = (0.8, 1.25)  # of a map over the body that another person may explain as well


def body_finding(found: Contradiction, cameras: Sequence[str]) -> Finding | None:
    """The finding that the body is not that of the recording; None where most cameras fit, or a lens explains it.

    Args:
        found: the contradictions.
        cameras: that were registered.
    """
    scale = found.map_scale
    if len(cameras) < _LEAST_CAMERAS or (scale is not None and not _PERSON_SCALES[0] < scale < _PERSON_SCALES[1]):
        return None
    offsets = {camera: steady_offset(found.poses, camera) for camera in cameras}
    off = {camera: offset for camera, offset in offsets.items() if offset > _OFFSET_M}
    blamed = [camera for camera in off if lens_cause(found.poses.lens_errors.get(camera)) is not None]
    if len(off) <= len(cameras) / 2 or len(blamed) > len(off) / 2:
        return None
    low, high = (1e3 * bound(off.values()) for bound in (min, max))
    size = "" if scale is None else f", or a map that is {scale:.3g} times as large as it should be"
    return Finding(
        "",
        Level.WRONG,
        f"this is not the body of this recording: {len(off)} of {len(cameras)} cameras contradict it by {low:.0f} to "
        f"{high:.0f} mm all the time",
        f"the body is of another person or day, or the cameras were strapped on again{size}",
        "make a body from a range of motion of this person, with the cameras as they are",
        part="recording",
        check="body",
    )


def steady_offset(poses: CameraPoses, camera: str) -> float:
    """Distance of a camera's mean place from where the solved body has it [m]; 0 where it is hardly registered."""
    off = inverse(poses.solved[camera]) @ poses.registered[camera]
    off = off[np.isfinite(off).all(axis=(1, 2))]
    if len(off) < _LEAST_ROWS:
        return 0.0
    return float(pose_distance(np.eye(4)[None], robust_average_pose(off)[None])[0])
