"""A slipped strap: a camera whose place on its segment changes during the recording and stays changed.

Two cameras on one segment should never move against each other. Where they do, of three or more the one that moved
against all others slipped; of two, the joints decide (``joint_search``). A camera alone on its segment takes the
segment with it; it shows by all joints of the segment changing their place in its view.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, inverse, log_se3, rigid, robust_average_pose

_MIN_SHIFT_M = 0.025  # registrations err by half of this for a second or two
_MIN_TURN_RAD = 0.03  # soft tissue gives by a degree and comes back; a strap does not
_MIN_STAY_S = 1.0  # a change lasts this long on either side; blur passes sooner
_MIN_POSES = 10  # on either side of a change; fewer may be a few wrong registrations
_OF_USUAL = 3.0  # times a joint's usual scatter in a lone camera's view, by which it changes its place there
_WEIGHT_AFTER = 0.1  # of a slipped camera beside the others of its segment


@dataclass(frozen=True)
class Slip:
    """A lasting change: at which row, by how much."""

    row: int
    moved_m: float
    turned_rad: float


def slip_warning(camera: str, slip: Slip, seconds: float, alone: bool) -> str:
    """Warning of a slip that came some seconds after the start, of a camera that is alone on its segment or not."""
    warning = f"camera {camera} slipped after {seconds:.1f} s, by {1e3 * slip.moved_m:.0f} mm"
    if alone:
        return (
            f"{warning}: tighten its strap and repeat the recording; it is alone on its segment, and the body has it "
            "where it was before"
        )
    turned_deg = np.degrees(slip.turned_rad)
    return f"{warning} and {turned_deg:.1f} deg: tighten its strap; its images before are left out"


@dataclass(frozen=True, eq=False)
class JointInView:
    """A joint of a camera's segment over time, by the segment next to it.

    Attributes:
        name: of the joint.
        rows: (N) of the motion's stamps.
        seconds: (N) [s].
        places: (N, 3) in the camera's frame [m].
        residual_m: their usual scatter [m].
    """

    name: str
    rows: NDArray[np.intp]
    seconds: Array
    places: Array
    residual_m: float


def lasting_change(poses: Array, seconds: Array) -> Slip | None:
    """The greatest lasting change of poses that should stay the same; None if there is none.

    Args:
        poses: (N, 4, 4) of one camera in another of the same segment.
        seconds: (N) [s].
    """
    if len(poses) < 2 * _MIN_POSES or seconds[-1] - seconds[0] < 2 * _MIN_STAY_S:
        return None
    # In units of the thresholds, so that turns and shifts can be added.
    unit = np.repeat([_MIN_TURN_RAD, _MIN_SHIFT_M], 3)
    offsets = log_se3(inverse(robust_average_pose(poses)) @ poses) / unit
    times = np.arange(seconds[0] + _MIN_STAY_S, seconds[-1] - _MIN_STAY_S, _MIN_STAY_S / 8)
    rows = np.unique(np.searchsorted(seconds, times))
    rows = rows[(rows >= _MIN_POSES) & (rows <= len(poses) - _MIN_POSES)]
    if len(rows) == 0:
        return None
    # The change is where two places instead of one leave the least residual, in absolute values: blur is no place.
    row = int(min(rows, key=lambda row: _scatter(offsets[:row]) + _scatter(offsets[row:])))
    change = np.median(offsets[row:], axis=0) - np.median(offsets[:row], axis=0)
    turned, moved = float(np.linalg.norm(change[:3])), float(np.linalg.norm(change[3:]))
    return Slip(row, moved * _MIN_SHIFT_M, turned * _MIN_TURN_RAD) if max(turned, moved) >= 1.0 else None


def _scatter(offsets: Array) -> float:
    """Sum of distances from the median."""
    return float(np.linalg.norm(offsets - np.median(offsets, axis=0), axis=1).sum())


def slips_on_segment(
    names: Sequence[str], world_T_camera: Array, known: NDArray[np.bool_], seconds: Array
) -> dict[str, Slip]:
    """Cameras of a segment that moved against the others; of two that differ, both.

    Args:
        names: (K) of the cameras.
        world_T_camera: (T, K, 4, 4).
        known: (T, K).
        seconds: (T) [s].

    Returns:
        Camera -> its slip; rows count the T stamps.
    """
    changes: dict[str, list[Slip]] = {name: [] for name in names}
    for a, b in combinations(range(len(names)), 2):
        rows = np.flatnonzero(known[:, a] & known[:, b])
        slip = lasting_change(inverse(world_T_camera[rows, a]) @ world_T_camera[rows, b], seconds[rows])
        if slip is not None:
            for camera in (a, b):
                changes[names[camera]].append(Slip(int(rows[slip.row]), slip.moved_m, slip.turned_rad))
    most = max(len(found) for found in changes.values())
    return {
        name: max(found, key=lambda slip: slip.moved_m)
        for name, found in changes.items()
        if most and len(found) == most
    }


def slips_of_lone_cameras(joints_in_view: Mapping[str, Sequence[JointInView]]) -> dict[str, Slip]:
    """Cameras that are alone on their segment and moved on it, of camera -> the joints of its segment."""
    changes = {
        camera: {
            joint.name: change
            for joint in joints
            if (change := lasting_change(rigid(np.eye(3), joint.places), joint.seconds))
            and change.moved_m > _OF_USUAL * joint.residual_m
        }
        for camera, joints in joints_in_view.items()
    }
    slips: dict[str, Slip] = {}
    # A joint that changed its place is in view from both sides; the camera that has most of them moved.
    for camera in sorted(changes, key=lambda name: -len(changes[name])):
        own = changes[camera]
        explained = {joint.name for other in slips for joint in joints_in_view[other]}
        if own and len(own) == len(joints_in_view[camera]) and not explained & set(own):
            worst = max(own.values(), key=lambda slip: slip.moved_m)
            first = min(own, key=lambda name: own[name].row)
            joint = next(joint for joint in joints_in_view[camera] if joint.name == first)
            slips[camera] = Slip(int(joint.rows[own[first].row]), worst.moved_m, worst.turned_rad)
    return slips


def slip_weights(known: NDArray[np.bool_], slip: Slip, alone: bool) -> Array:
    """Weights (T) of a slipped camera.

    Its place after the slip is that of the next recording. Of a camera alone on its segment the images before the slip
    are used: after it, the segment's place in the N-pose is unknown.
    """
    is_before = np.arange(len(known)) < slip.row
    return np.where(is_before, 1.0, 0.0) * known if alone else np.where(is_before, 0.0, _WEIGHT_AFTER) * known
