"""Likely causes of a contradiction: each leaves its own trace.

A map of another scale than the body: all cameras contradict alike, and one scale explains it. Exchanged names: each
camera fits the mount of another. A clock that is some milliseconds off: the poses are right at another time.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.calibration.strap_slip import Slip, lasting_change
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid, transform_points
from bodycam_ros.quality.camera_poses import CameraPoses
from bodycam_ros.quality.contradiction import (
    DOUBTFUL_GAP_M,
    Contradiction,
    lasting,
    pose_distance,
    proportion,
)
from bodycam_ros.quality.lens_evidence import LensDeviation

_LENS_SCALE, _LENS_CENTRE = 0.007, 0.015
"""Shares of the radius and of half the width. A focal length 2 % off shows as 0.010 to 0.017, a principal point 40 px
off as 0.06; good lenses as 0.0027 and 0.005 at most."""

_CLOCK_ERROR_S = 0.008
"""A camera whose poses fit the body better this much earlier or later is off, as far as stamps are one time."""

WELL_REGISTERED = 0.6
"""Share of its images that a camera with the right lens is registered on, unless it is covered."""

_MAX_STRAP_M = 0.6  # no strap moves a camera farther
_CLOCK_EXPLAINS = 0.35  # share of the gaps; on good recordings no clock of 5 ms explains more than 0.25
_LEFT_BY_CLOCK = 0.85  # share of the gap that may be left once the clock is put right; a fast limb is no straight line
_MIN_CLOCK_ROWS = 20  # states that a clock is estimated by: of fewer, chance explains as much
_STEADY, _FIRM = 0.4, 0.25  # spread of a constant offset, as a share of it; on both sides of a slip


@dataclass(frozen=True)
class Cause:
    """Why a camera contradicts the body.

    Attributes:
        kind: for programs; ``place`` is a camera that records from another's mount, ``mount`` one that sits elsewhere
            than the body has it, ``turned`` one that is turned about its optical axis there, ``images`` a wrong lens or
            images of something else than the map.
        why: the likely reason.
        remedy: what to do.
        is_exchange: whether it is on another's mount.
    """

    kind: Literal["scale", "names", "place", "lens", "clock", "strap", "mount", "turned", "images"]
    why: str
    remedy: str
    is_exchange: bool = False


def find_causes(found: Contradiction) -> dict[str, Cause]:
    """The likely cause for each camera that contradicts."""
    if found.map_scale is not None:
        why = f"the map is {found.map_scale:.3g} times as large as the body"
        return dict.fromkeys(
            found.gaps, Cause("scale", why, "check the tag size of the board on the map's photographs")
        )
    places, known = _exchanged_places(found)
    return {camera: _find_cause(found.poses, camera, places, known) for camera in found.gaps}


def _find_cause(poses: CameraPoses, camera: str, places: dict[str, str], known: dict[str, Array]) -> Cause:
    place = places.get(camera)
    if place and places.get(place) == camera:
        remedy = "exchange the two names, in the topics or in the body file"
        return Cause("names", f"its name is exchanged with {place}", remedy, True)
    if (lens := lens_cause(poses.lens_errors.get(camera))) is not None:
        return lens
    if place:
        remedy = "check the names of the cameras in the topics and in the body file"
        return Cause("place", f"its images come from the place of camera {place}", remedy, True)
    if (turned := _turned_cause(poses, camera, known)) is not None:
        return turned
    if (clock := clock_cause(poses, camera)) is not None:
        return clock
    seconds, offsets, _ = _joint_offsets(poses, camera)
    if (slip := find_slip(seconds, offsets)) is not None:
        return slip_cause(slip)
    far = np.median(offsets, axis=0)
    far_m, spread_m = float(np.linalg.norm(far)), _median_size(offsets - far)
    if poses.counts[camera].share > WELL_REGISTERED and far_m < _MAX_STRAP_M and spread_m < _STEADY * far_m:
        return Cause(
            "mount",
            f"it is {1e3 * far_m:.0f} mm from its place in the body file all the time: it was strapped on again, or "
            "the body file is of another day or person",
            "record a range of motion with the cameras as they are now, and make a new body",
        )
    return Cause(
        "images",
        "its images do not fit its calibration (camera_info), or they show what is not in the map",
        "check its camera_info; look at its images with 'bodycam view'",
    )


def lens_cause(lens: LensDeviation | None) -> Cause | None:
    """A lens that deviates from its model; None where it does not, or is unknown."""
    if lens is None or (abs(lens.scale) <= _LENS_SCALE and lens.centre <= _LENS_CENTRE):
        return None
    why = f"its images do not fit its calibration (camera_info): {lens.text}"
    return Cause("lens", why, "check its camera_info, or measure its lens again (bodycam lens)")


def _turned_cause(poses: CameraPoses, camera: str, known: dict[str, Array]) -> Cause | None:
    """Images that are turned by quarters about the optical axis; ``known``: see ``_place_gap``."""
    mount = poses.body.mounts[camera]
    gaps = {}
    for degrees in (90, 180, 270):
        turn = rigid(exp_so3(np.array([0.0, 0.0, np.radians(degrees)])), np.zeros(3))
        turned = replace(mount, segment_T_camera=mount.segment_T_camera @ turn)
        gaps[degrees] = _place_gap(poses, camera, turned, known)
    degrees, gap_m = min(gaps.items(), key=lambda each: np.nan_to_num(each[1], nan=np.inf))
    if not gap_m <= DOUBTFUL_GAP_M:
        return None
    return Cause(
        "turned",
        f"its images are turned by {min(degrees, 360 - degrees)} deg since the body was made: it was strapped on "
        "turned, or its automatic rotation turned the video",
        "record a range of motion with the cameras as they are now, automatic rotation off, and make a new body",
    )


def clock_cause(poses: CameraPoses, camera: str) -> Cause | None:
    """A clock that is off from the others'; None if no clock explains the gaps.

    With a clock that is ahead, an image with stamp t was taken before t: the joint lies ahead by its velocity times the
    clock's error. A body that is a little wrong leaves a constant in the camera's frame, which is subtracted.
    """
    _, offsets, velocities = _joint_offsets(poses, camera)
    if len(offsets) < _MIN_CLOCK_ROWS:
        return None
    error_s, explained = proportion(*(each - each.mean(axis=0) for each in (velocities, offsets)))
    is_better = np.linalg.norm(offsets - error_s * velocities) < _LEFT_BY_CLOCK * np.linalg.norm(offsets)
    if explained < _CLOCK_EXPLAINS or abs(error_s) <= _CLOCK_ERROR_S or not is_better:
        return None
    return Cause("clock", f"its clock offset is {1e3 * error_s:+z.0f} ms", "check how its images are stamped")


def _joint_offsets(poses: CameraPoses, camera: str) -> tuple[Array, Array, Array]:
    """The joint above a camera's segment, in the camera's frame at the T states at which it is registered.

    Returns:
        (T,) times [s]; (T, 3) from where the mount has the joint to where the solved body has it [m]; and (T, 3) the
        joint's velocity by the body, for a camera whose poses are wrong would move with its own errors [m/s].
    """
    expected = inverse(poses.body.mounts[camera].segment_T_camera)[:3, 3]
    joint_world = transform_points(poses.solved[camera], expected[None])
    camera_T_world = inverse(poses.registered[camera])
    offsets = transform_points(camera_T_world, joint_world)[:, 0] - expected
    moving = np.gradient(joint_world, poses.seconds, axis=0) if len(joint_world) > 1 else np.zeros_like(joint_world)
    velocities = (camera_T_world[:, :3, :3] @ np.swapaxes(moving, 1, 2))[:, :, 0]
    known = np.isfinite(offsets).all(axis=1)
    return poses.seconds[known], offsets[known], velocities[known]


def slip_cause(slip: Slip) -> Cause:
    """The cause of a contradiction that began with a slip."""
    why = f"its strap slipped at {slip.seconds:.1f} s, by {1e3 * slip.moved_m:.0f} mm"
    return Cause("strap", why, "use the recording up to then, or record again")


def find_slip(seconds: Array, offsets: Array) -> Slip | None:
    """When the joint left its place for another firm one, by offsets (T, 3) [m], if it did."""
    slip = lasting_change(rigid(np.eye(3), offsets), seconds)
    if slip is None:
        return None
    before, after = offsets[seconds < slip.seconds], offsets[seconds >= slip.seconds]
    spread_m = max(_median_size(before), _median_size(after - np.median(after, axis=0)))
    return slip if spread_m <= _FIRM * slip.moved_m else None


def _median_size(vectors: Array) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def _exchanged_places(found: Contradiction) -> tuple[dict[str, str], dict[str, Array]]:
    """Camera that contradicts -> the camera whose mount on the body its poses fit; and known segments' poses.

    Only mounts are tried whose own camera contradicts, too, or is missing: the others are taken. They must be next to
    a segment whose pose is known, by the body or by a camera that has found its mount: more fits by chance.
    """
    poses, mounts = found.poses, found.poses.body.mounts
    known = {mounts[c].segment: poses.solved[c] @ inverse(mounts[c].segment_T_camera) for c in found.core}
    fits: dict[str, str] = {}
    while True:
        free = [place for place in mounts if place not in found.core and place not in fits.values()]
        gaps = {
            (camera, place): _place_gap(poses, camera, mounts[place], known)
            for camera, place in product(found.gaps, free)
            if camera not in fits and place != camera
        }
        close = {pair: gap for pair, gap in gaps.items() if gap <= DOUBTFUL_GAP_M}
        if not close:
            break
        camera, place = min(close, key=lambda pair: close[pair])
        fits[camera] = place
        mount = mounts[place]
        known[mount.segment] = poses.registered[camera] @ inverse(mount.segment_T_camera)
    return fits, known


def _place_gap(poses: CameraPoses, camera: str, mount: CameraMount, known: dict[str, Array]) -> float:
    """Lasting gap between a camera, if it were at a mount, and the known poses of its segment or of those next to it.

    Args:
        known: segment -> (T, 4, 4) its pose [m].
    """
    world_T_segment = poses.registered[camera] @ inverse(mount.segment_T_camera)
    if mount.segment in known:
        return lasting(pose_distance(known[mount.segment], world_T_segment), poses.seconds)
    gaps = []
    for joint in poses.body.tree_joints:
        of = {joint.parent: joint.parent_T_joint, joint.child: joint.child_T_joint}
        other = next((segment for segment in of if segment != mount.segment), "")
        if mount.segment in of and other in known and joint.type != "free":
            apart = (world_T_segment @ of[mount.segment] - known[other] @ of[other])[:, :3, 3]
            gaps.append(lasting(np.linalg.norm(apart, axis=1), poses.seconds))
    return max(gaps, default=np.nan)
