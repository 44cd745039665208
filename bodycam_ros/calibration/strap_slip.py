"""A slipped strap: a camera whose place on its segment changes during the recording and stays changed.

Two cameras on one segment should never move against each other. Where they do, of three or more the one that moved
against all others is to blame; of two, the caller must tell by other means. A camera alone on its segment takes the
segment with it; it shows by all joints of the segment changing their place in its view.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import inverse, log_se3, rigid, robust_average_pose
from bodycam_ros.settings import setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StrapSlipSettings:
    """What counts as a slip."""

    min_shift: float = setting(
        0.025, unit="m", limits=(0.001, 0.5), reason="registrations err by half of this for a second or two"
    )
    min_turn: float = setting(
        0.03, unit="rad", limits=(0.001, 1.0), reason="soft tissue gives by a degree and comes back; a strap does not"
    )
    min_stay: float = setting(
        1.0, unit="s", limits=(0.1, 60.0), reason="a change must last this long on either side; blur passes sooner"
    )
    min_poses: int = setting(
        10, limits=(1, 10000), reason="on either side of a change; fewer may be a few wrong registrations"
    )
    of_usual: float = setting(
        3.0,
        limits=(0.0, 100.0),
        reason="times that a joint usually strays in a lone camera's view, by which it must change its place there",
    )
    wrong_gap: float = setting(
        0.1,
        unit="m",
        limits=(0.001, 10.0),
        reason="a joint gaping more than this tells of a wrong registration, and no more of a slip by gaping wider",
    )
    weight: float = setting(
        0.1,
        limits=(0.0, 1.0),
        reason="of a slipped camera after its slip, beside the ones that hold; before it, it counts nothing",
    )


@dataclass(frozen=True)
class Slip:
    """A lasting change: at which instant's row, by how much."""

    row: int
    moved_m: float
    turned_rad: float


def slip_warning(camera: str, slip: Slip, seconds: float, alone: bool) -> str:
    """What a person should know of a slip that came some seconds after the start.

    Args:
        alone: on its segment.
    """
    warning = f"camera {camera} slipped after {seconds:.1f} s, by {1e3 * slip.moved_m:.0f} mm"
    if alone:
        return (
            f"{warning}: tighten its strap and repeat the recording; it is alone on its segment, and the body has it "
            "where it was before"
        )
    turned_deg = np.degrees(slip.turned_rad)
    return f"{warning} and {turned_deg:.1f} deg: tighten its strap; what it saw before is left out"


@dataclass(frozen=True, eq=False)
class JointInView:
    """A joint of a camera's segment over time, where the segment next to it says that it is.

    Attributes:
        name: of the joint.
        rows: (N) instants.
        seconds: (N) when [s].
        places: (N, 3) in the camera's frame [m].
        residual_m: by how much they usually stray [m].
    """

    name: str
    rows: NDArray[np.intp]
    seconds: Array
    places: Array
    residual_m: float


def lasting_change(poses: Array, seconds: Array, settings: StrapSlipSettings) -> Slip | None:
    """The greatest lasting change of poses that should stay the same; None if there is none worth the name.

    Args:
        poses: (N, 4, 4) of one camera seen from another on the same segment.
        seconds: (N) when [s].
        settings: thresholds.
    """
    if len(poses) < 2 * settings.min_poses or seconds[-1] - seconds[0] < 2 * settings.min_stay:
        return None
    # In units of what is worth the name, so that turns and shifts can be added.
    unit = np.repeat([settings.min_turn, settings.min_shift], 3)
    offsets = log_se3(inverse(robust_average_pose(poses)) @ poses) / unit
    times = np.arange(seconds[0] + settings.min_stay, seconds[-1] - settings.min_stay, settings.min_stay / 8)
    rows = np.unique(np.searchsorted(seconds, times))
    rows = rows[(rows >= settings.min_poses) & (rows <= len(poses) - settings.min_poses)]
    if len(rows) == 0:
        return None
    # The change is where two places instead of one leave the least to explain; absolute values, since blur is no place.
    unexplained = [_spread(offsets[:row]) + _spread(offsets[row:]) for row in rows]
    row = int(rows[np.argmin(unexplained)])
    change = np.median(offsets[row:], axis=0) - np.median(offsets[:row], axis=0)
    turned, moved = float(np.linalg.norm(change[:3])), float(np.linalg.norm(change[3:]))
    if max(turned, moved) < 1.0:
        return None
    return Slip(row, moved * settings.min_shift, turned * settings.min_turn)


def _spread(offsets: Array) -> float:
    """Sum of distances from the median."""
    return float(np.linalg.norm(offsets - np.median(offsets, axis=0), axis=1).sum())


def slips_on_segment(
    names: tuple[str, ...],
    world_T_camera: Array,
    known: NDArray[np.bool_],
    seconds: Array,
    settings: StrapSlipSettings,
) -> Mapping[str, Slip]:
    """Cameras of a segment that moved against others, as far as the segment alone tells: of two that differ, both.

    Args:
        names: (K) of the cameras.
        world_T_camera: (T, K, 4, 4).
        known: (T, K).
        seconds: (T) [s].
        settings: thresholds.

    Returns:
        Camera -> its slip; rows count the T instants.
    """
    changes: dict[tuple[int, int], Slip] = {}
    for a, b in combinations(range(len(names)), 2):
        rows = np.flatnonzero(known[:, a] & known[:, b])
        if slip := lasting_change(inverse(world_T_camera[rows, a]) @ world_T_camera[rows, b], seconds[rows], settings):
            changes[a, b] = Slip(int(rows[slip.row]), slip.moved_m, slip.turned_rad)
    accused = {k: [change for pair, change in changes.items() if k in pair] for k in range(len(names))}
    most = max((len(found) for found in accused.values()), default=0)
    return {
        names[k]: max(found, key=lambda slip: slip.moved_m)
        for k, found in accused.items()
        if most and len(found) == most
    }


def slips_of_lone_cameras(
    joints_in_view: Mapping[str, Sequence[JointInView]], settings: StrapSlipSettings
) -> dict[str, Slip]:
    """Cameras that are alone on their segment and moved on it.

    Args:
        joints_in_view: camera -> the joints of its segment, where its neighbours say that they are.
        settings: thresholds.
    """
    changes = {
        camera: {
            joint.name: change
            for joint in joints
            if (change := lasting_change(rigid(np.eye(3), joint.places), joint.seconds, settings))
            and change.moved_m > settings.of_usual * joint.residual_m
        }
        for camera, joints in joints_in_view.items()
    }
    slips: dict[str, Slip] = {}
    # A joint that changed its place is seen from both sides; the camera that has most of them moved.
    for camera in sorted(changes, key=lambda name: -len(changes[name])):
        own = changes[camera]
        explained = {joint.name for other in slips for joint in joints_in_view[other]}
        if own and len(own) == len(joints_in_view[camera]) and not explained & set(own):
            worst = max(own.values(), key=lambda slip: slip.moved_m)
            first = min(own.items(), key=lambda item: item[1].row)[0]
            joint = next(joint for joint in joints_in_view[camera] if joint.name == first)
            slips[camera] = Slip(int(joint.rows[own[first].row]), worst.moved_m, worst.turned_rad)
    return slips


def trust_before_slip(known: NDArray[np.bool_], slip_row: int) -> Array:
    """Weights (T) of a slipped camera that is alone: after the slip nobody knows where its segment is in the N-pose."""
    return np.where(np.arange(len(known)) < slip_row, 1.0, 0.0) * known


def trust_after_slip(known: NDArray[np.bool_], slip_row: int, settings: StrapSlipSettings) -> Array:
    """Weights (T) of a slipped camera: its place after the slip is where it will be in the next recording."""
    return np.where(np.arange(len(known)) < slip_row, 0.0, settings.weight) * known
