"""A slipped strap: a camera whose place on its segment changes during the recording and stays changed.

Two cameras on one segment should never move against each other. Where they do, of three or more the one that moved
against all others is to blame; of two, the caller must tell by other means. A camera alone on its segment takes the
segment with it; it shows by all joints of the segment changing their place in its view.

The virtual camera stands where the segment's reference camera does, so its frame is the segment's until the N-pose
gives a better one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse, log_se3, log_so3, nearest_rotation, rigid, robust_average_pose
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


_ENOUGH_FOR_A_MAJORITY = 3
_ROUNDING = 1e-9  # [m], [rad]


@dataclass(frozen=True)
class VirtualCameraSettings:
    """Which camera of a segment is left out of the virtual one."""

    far_off: float = setting(
        4.0,
        limits=(1.0, 1000.0),
        reason="times that cameras of a segment usually differ from their nearest; of three or more, one that differs "
        "more is left out at that instant",
    )


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """The cameras of one segment, fused.

    Attributes:
        virtual_T_camera: camera -> (4, 4) where it sits; the identity for the reference camera.
        world_T_virtual: (T, 4, 4) its pose; the identity where it is not known.
        known: (T) whether any of the cameras is.
    """

    virtual_T_camera: Mapping[str, Array]
    world_T_virtual: Array
    known: NDArray[np.bool_]

    def filled(self) -> Array:
        """Its poses (T, 4, 4), where it is not known those of the nearest instant at which it is."""
        rows = np.flatnonzero(self.known)
        nearest = np.abs(np.arange(len(self.known))[:, None] - rows).argmin(axis=1)
        poses: Array = self.world_T_virtual[rows[nearest]]
        return poses


def fuse_cameras(
    names: tuple[str, ...], world_T_camera: Array, weights: Array, settings: VirtualCameraSettings
) -> VirtualCamera:
    """Fuse the cameras of one segment.

    Args:
        names: (K) of the cameras, for messages.
        world_T_camera: (T, K, 4, 4) their poses.
        weights: (T, K) how much each counts, 1 for one that sits still, 0 where it is not known; the reference is the
            weightiest.
        settings: which camera is left out.

    Raises:
        RangeOfMotionError: a camera is never known together with the reference camera.
    """
    reference = int(np.argmax(weights.sum(axis=0)))
    virtual_T_camera = {name: np.eye(4) for name in names}
    for k, name in enumerate(names):
        if k != reference:
            pair = [reference, k]
            virtual_T_camera[name] = average_relative_pose(
                names[reference], name, world_T_camera[:, pair], weights[:, pair]
            )
    # A eq. 7: each camera says where the virtual one is.
    said = world_T_camera @ inverse(np.stack([virtual_T_camera[name] for name in names]))
    return VirtualCamera(virtual_T_camera, weighted_average_poses(said, weights, settings), weights.max(axis=1) > 0)


def average_relative_pose(reference: str, camera: str, world_T_pair: Array, weights: Array) -> Array:
    """Pose reference_T_camera (4, 4), the robust average over time of A eq. 6.

    Args:
        reference, camera: names, for messages.
        world_T_pair: (T, 2, 4, 4) poses of the two.
        weights: (T, 2) how much each counts at each instant; zero where it is not known.

    Raises:
        RangeOfMotionError: the two are never known together.
    """
    together = weights.min(axis=1)
    if not together.any():
        raise RangeOfMotionError(
            f"cameras {reference} and {camera} are on one segment but were never registered at the same time, so "
            "nothing tells how they sit to each other; repeat the recording where both see the mapped place"
        )
    # Where a strap slipped, only the time that counts in full says where the camera sits.
    best = together >= together.max()
    relative = inverse(world_T_pair[best, 0]) @ world_T_pair[best, 1]
    return robust_average_pose(relative)


def weighted_average_poses(poses: Array, weights: Array, settings: VirtualCameraSettings) -> Array:
    """Average (T, 4, 4) over the K of poses (T, K, 4, 4) with weights (T, K); the identity where all weights are zero.

    Of three or more, one far from all others is left out.
    """
    if poses.shape[1] >= _ENOUGH_FOR_A_MAJORITY:
        weights = weights * _near_another(poses, weights, settings.far_off)
    total = weights.sum(axis=1)
    share = weights / np.where(total > 0, total, 1.0)[:, None]
    R = np.einsum("tk,tkij->tij", share, poses[:, :, :3, :3])
    t = np.einsum("tk,tki->ti", share, poses[:, :, :3, 3])
    R[total == 0] = np.eye(3)
    return rigid(nearest_rotation(R), t)


def _near_another(poses: Array, weights: Array, far_off: float) -> NDArray[np.bool_]:
    """(T, K) whether a pose is about as near to another of its instant as poses are on the whole."""
    seen = weights > 0
    pairs = seen[:, :, None] & seen[:, None, :] & ~np.eye(poses.shape[1], dtype=bool)
    between = inverse(poses)[:, :, None] @ poses[:, None]
    near = np.ones(seen.shape, dtype=bool)
    for distances in (
        np.linalg.norm(between[..., :3, 3], axis=-1),
        np.linalg.norm(log_so3(between[..., :3, :3]), axis=-1),
    ):
        to_nearest = np.where(pairs, distances, np.inf).min(axis=2)
        told = np.isfinite(to_nearest)
        if told.any():
            near &= ~told | (to_nearest <= far_off * np.median(to_nearest[told]) + _ROUNDING)
    # Where none is near another nothing says which is wrong.
    near[~(near & seen).any(axis=1)] = True
    return near
