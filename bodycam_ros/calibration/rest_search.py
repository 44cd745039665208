"""The N-pose in a recording: the longest stretch in which every segment stands still and the limbs are straight."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.joint_search import FoundJoints
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.virtual_camera import VirtualCamera
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse, log_so3, robust_average_pose

MAX_TURN_RAD = 0.06
"""People sway by a degree or two; a limb that sets out turns more."""

MAX_SHIFT_M = 0.04
"""People sway by a centimetre or two; registrations err by half of one."""

_MIN_DURATION_S = 0.5  # shorter stillness may be the turning point of a motion
_START_STEP_S = 0.1  # between two tried starts of a stretch
_LEAST_GIVEN_ROWS = 3  # of an N-pose that the user names
_MAX_TILT_DEG = 30.0  # of a limb that hangs or stands, from the vertical: feet stand apart, arms lie against the body
_MAX_BEND_DEG = 30.0  # of knee and elbow from the end of their range; people stretch them fully in a range of motion
_HANGING = ("thigh", "shin", "upper_arm", "forearm")
_DOWN = np.array([0.0, 0.0, -1.0])


def find_rest_pose(
    seconds: Array, found: FoundJoints, rig: Rig, given_s: tuple[float, float] | None = None
) -> NDArray[np.intp]:
    """Find the rows (K) in which the N-pose is held.

    Args:
        seconds: (T) of the rows in the recording's time [s].
        found: joints and virtual cameras at these times.
        rig: which segment hangs on which.
        given_s: (from, to) [s] when it is known; None to search.

    Raises:
        RangeOfMotionError: nobody stands still for long enough, or with bent limbs alone, or nothing moves, or a
            segment is unobserved in that time.
    """
    if given_s is not None:
        rows = np.flatnonzero((seconds >= given_s[0]) & (seconds <= given_s[1]))
        when = f"from {given_s[0]:g} to {given_s[1]:g} s"
        if len(rows) < _LEAST_GIVEN_ROWS:
            raise RangeOfMotionError(
                f"--rest-pose: the recording has only {len(rows)} images of a camera {when}; give a part of "
                f"{seconds[0]:.1f} to {seconds[-1]:.1f} s"
            )
    else:
        start, end = _longest_straight(seconds, found, rig)
        rows, when = np.arange(start, end), f"from {seconds[start]:.1f} to {seconds[end - 1]:.1f} s"
    for segment, one in found.virtual.items():
        if not one.known[rows].any():
            raise RangeOfMotionError(
                f"segment {segment}: none of its cameras is registered while the body stands still in the N-pose "
                f"({when}), so its angles have no zero; stand in the N-pose where the cameras see the mapped place"
            )
    return rows


def _longest_straight(seconds: Array, found: FoundJoints, rig: Rig) -> tuple[int, int]:
    """First row of the longest still stretch with straight limbs, and the row after its last."""
    stretches = sorted(
        _still_stretches(seconds, found.virtual), key=lambda rows: seconds[rows[0]] - seconds[rows[1] - 1]
    )
    if not stretches:
        raise RangeOfMotionError(
            "the recording does not show the N-pose: at no time do all cameras stand still for "
            f"{_MIN_DURATION_S:g} s; stand still once, arms down, for 1.5 s, before or after the range of motion"
        )
    if stretches[0] == (0, len(seconds)):
        raise RangeOfMotionError("nothing moves in this recording; a range of motion of every joint is needed")
    bent = ""
    unobserved: tuple[int, int] | None = None
    for start, end in stretches:
        if not all(one.known[start:end].any() for one in found.virtual.values()):
            unobserved = unobserved or (start, end)
            continue
        if not (fault := _bent_limb(found, rig, slice(start, end))):
            return start, end
        bent = bent or f"stands still from {seconds[start]:.1f} to {seconds[end - 1]:.1f} s, but {fault}"
    if unobserved is not None:
        return unobserved
    raise RangeOfMotionError(
        f"the recording does not show the N-pose: the body {bent}; stand still once, upright, arms down, for 1.5 s. "
        "If this was the N-pose, name it by its times, as --rest-pose 0:1.5"
    )


def _still_stretches(seconds: Array, virtual: Mapping[str, VirtualCamera]) -> Iterator[tuple[int, int]]:
    """First row and row after the last of stretches in which every segment is still; they overlap."""
    latest_s = -np.inf
    for start in range(len(seconds)):
        if seconds[start] - latest_s < _START_STEP_S:
            continue
        latest_s = seconds[start]
        end = len(seconds)
        for one in virtual.values():
            end = min(
                end, start + _still_rows(seconds[start:end], one.world_T_virtual[start:end], one.known[start:end])
            )
            if seconds[max(start, end - 1)] - seconds[start] < _MIN_DURATION_S:
                break
        else:
            yield start, end
            if end == len(seconds):
                return  # later starts are parts of this stretch


def _still_rows(seconds: Array, poses: Array, known: NDArray[np.bool_]) -> int:
    """Number of rows from the first in which a segment is still; all of them if it never moves."""
    opening = np.flatnonzero(known & (seconds <= seconds[0] + _MIN_DURATION_S))
    if len(opening) == 0:
        return len(seconds)
    start = robust_average_pose(poses[opening])
    first, span = 0, 2 * (int(opening[-1]) + 3)
    while True:
        # In growing windows: most starts are in the midst of a motion, which ends them at once.
        rows = slice(first, first + span)
        moved = inverse(start) @ poses[rows]
        turns = np.linalg.norm(log_so3(moved[:, :3, :3]), axis=1)
        shifts = np.linalg.norm(poses[rows, :3, 3] - start[:3, 3], axis=1)
        away = known[rows] & ((turns > MAX_TURN_RAD) | (shifts > MAX_SHIFT_M))
        # A single row is a wrong registration; motion lasts.
        unknown = ~known[rows]
        lasting = np.flatnonzero(away[:-2] & (away[1:-1] | unknown[1:-1]) & (away[2:] | unknown[2:]))
        if len(lasting):
            return first + int(lasting[0])
        if first + span >= len(seconds):
            return len(seconds)
        first, span = first + span - 2, 2 * span


def _bent_limb(found: FoundJoints, rig: Rig, rows: slice) -> str:
    """The limb that is not straight down in some rows, and how far from it; empty if all are."""
    for segment in found.centres:
        named = SegmentName(segment)
        if named.kind not in _HANGING:
            continue
        if (tilt_deg := _tilt_deg(found, rig, segment, rows)) is not None and tilt_deg > _MAX_TILT_DEG:
            return f"the {named.words} is {tilt_deg:.0f} deg from the vertical"
        if named.straight_in_rest and (bend_deg := _bend_deg(found, rig, segment, rows)) > _MAX_BEND_DEG:
            return f"the {named.joint.replace('_', ' ')} is bent by {bend_deg:.0f} deg"
    return ""


def _tilt_deg(found: FoundJoints, rig: Rig, segment: str, rows: slice) -> float | None:
    """Angle of a limb from straight down [deg]; None where the recording has no joint below it."""
    below = next((child for child in found.centres if rig.parents[child] == segment), None)
    if below is None:
        return None
    one = found.virtual[segment]
    above = found.centres[segment]
    beneath = found.centres[below]
    bone = beneath.in_parent - above.in_child
    # Along the axis of a hinge any point is as good: that part of the bone says nothing.
    for axis, centre in ((above.axis_in_child, above), (beneath.axis_in_parent, beneath)):
        if centre.is_hinge:
            bone = bone - axis * (axis @ bone)
    pose = robust_average_pose(one.world_T_virtual[rows][one.known[rows]])
    cosine = float(pose[:3, :3] @ bone @ _DOWN) / max(float(np.linalg.norm(bone)), 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _bend_deg(found: FoundJoints, rig: Rig, segment: str, rows: slice) -> float:
    """Angle of a joint in some rows from the nearer end of its range [deg]; 0 where it is no hinge or unknown."""
    above, below = found.virtual[str(rig.parents[segment])], found.virtual[segment]
    centre, both = found.centres[segment], above.known & below.known
    if not centre.is_hinge or not both[rows].any():
        return 0.0
    turned = np.swapaxes(above.world_T_virtual[:, :3, :3], 1, 2) @ below.world_T_virtual[:, :3, :3]
    middle = robust_average_pose((inverse(above.world_T_virtual) @ below.world_T_virtual)[both])[:3, :3]
    angles_deg = np.degrees(log_so3(middle.T @ turned) @ centre.axis_in_child)
    low, high = np.percentile(angles_deg[both], [1.0, 99.0])
    held = float(np.median(angles_deg[rows][both[rows]]))
    return max(0.0, min(held - float(low), float(high) - held))
