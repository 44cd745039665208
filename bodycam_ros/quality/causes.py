"""Likely causes of a contradiction: each leaves its own trace.

A map of another scale than the body: all cameras contradict alike, and one scale explains it. Exchanged names: each
camera fits the mount of another. A clock that is some milliseconds off: the poses are right at another time.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.geometry import Array, inverse, transform_points
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
_MIN_ROWS = 5  # states on either side of a slip
_STEADY, _FIRM = 0.4, 0.25  # spread of a constant offset, as a share of it; on both sides of a slip


@dataclass(frozen=True)
class Cause:
    """Why a camera contradicts the body: the likely reason, and what to do."""

    why: str
    remedy: str


def find_causes(found: Contradiction) -> dict[str, Cause]:
    """The likely cause for each camera that contradicts."""
    if found.map_scale is not None:
        why = f"the map is {found.map_scale:.3g} times as large as the body"
        return dict.fromkeys(found.gaps, Cause(why, "check the tag size of the board on the map's photographs"))
    places = _exchanged_places(found)
    return {camera: _find_cause(found.poses, camera, places) for camera in found.gaps}


def _find_cause(poses: CameraPoses, camera: str, places: dict[str, str]) -> Cause:
    place = places.get(camera)
    if place and places.get(place) == camera:
        return Cause(f"its name is exchanged with {place}", "exchange the two names, in the topics or in the body file")
    if (lens := lens_cause(poses.lens_errors.get(camera))) is not None:
        return lens
    if place:
        return Cause(f"its pictures come from where {place} sits", "check which camera records under which name")
    if (clock := clock_cause(poses, camera)) is not None:
        return clock
    view = JointView(poses, camera)
    if (slip := view.slip()) is not None:
        seconds, moved_m = slip
        why = f"its strap slipped at {seconds:.1f} s, by {1e3 * moved_m:.0f} mm"
        return Cause(why, "use the recording up to then, or record again")
    far_m = float(np.linalg.norm(view.offset))
    if poses.counts[camera].share > WELL_REGISTERED and far_m < _MAX_STRAP_M and view.is_steady:
        return Cause(
            f"it sits {1e3 * far_m:.0f} mm from where the body has it, all the time: strapped anew, or the body of "
            "another day or person",
            "record a range of motion with the cameras as they are now",
        )
    return Cause(
        "its lens is not what camera_info says, or its pictures show something else than the map",
        "check its camera_info, and what it saw with 'bodycam view'",
    )


def lens_cause(lens: LensDeviation | None) -> Cause | None:
    """A lens that deviates from its model; None where it does not, or is unknown."""
    if lens is None or (abs(lens.scale) <= _LENS_SCALE and lens.centre <= _LENS_CENTRE):
        return None
    return Cause(f"its lens is not what camera_info says: {lens.text}", "check its camera_info, or calibrate it anew")


def clock_cause(poses: CameraPoses, camera: str) -> Cause | None:
    """A clock that is off from the others'; None if no clock explains the gaps."""
    view = JointView(poses, camera)
    if len(view.places) < _MIN_CLOCK_ROWS:
        return None
    error_s, explained = view.clock_error()
    is_better = view.gap_with_clock(error_s) < _LEFT_BY_CLOCK * view.gap_with_clock(0.0)
    if explained < _CLOCK_EXPLAINS or abs(error_s) <= _CLOCK_ERROR_S or not is_better:
        return None
    side = "ahead" if error_s > 0.0 else "behind"
    return Cause(f"its clock is {1e3 * abs(error_s):.0f} ms {side}", "check how its images are stamped")


class JointView:
    """The joint above a camera's segment, as the body has it, in the camera's frame where that is registered.

    Args:
        poses: of all cameras.
        camera: name.

    Attributes:
        expected: (3,) by the mount [m].
        places: (T, 3) by the solved body [m], at the T states at which the camera is registered.
        velocities: (T, 3) of that point in the world, in the camera's axes [m/s].
        seconds: (T,) [s].
    """

    def __init__(self, poses: CameraPoses, camera: str) -> None:
        self.expected: Array = inverse(poses.body.mounts[camera].segment_T_camera)[:3, 3]
        joint_world = transform_points(poses.solved[camera], self.expected[None])
        camera_T_world = inverse(poses.registered[camera])
        places = transform_points(camera_T_world, joint_world)[:, 0]
        # By the body: a camera whose poses are wrong would move with its own errors.
        moving = np.gradient(joint_world, poses.seconds, axis=0) if len(joint_world) > 1 else np.zeros_like(joint_world)
        velocities = (camera_T_world[:, :3, :3] @ np.swapaxes(moving, 1, 2))[:, :, 0]
        known = np.isfinite(places).all(axis=1)
        self.places, self.velocities, self.seconds = places[known], velocities[known], poses.seconds[known]

    @property
    def offset(self) -> Array:
        """(3,) median of its offset [m]."""
        offset: Array = np.median(self.places, axis=0) - self.expected
        return offset

    @property
    def is_steady(self) -> bool:
        """Whether the offset is constant."""
        return bool(_spread(self.places, np.median(self.places, axis=0)) < _STEADY * np.linalg.norm(self.offset))

    def slip(self) -> tuple[float, float] | None:
        """When it left the body's place for another firm one [s], and how far that is [m], if it did."""
        rows = range(_MIN_ROWS, len(self.places) - _MIN_ROWS + 1)
        if not rows:
            return None

        def unexplained(row: int) -> float:
            after = self.places[row:]
            before_m = np.linalg.norm(self.places[:row] - self.expected, axis=1).sum()
            return float(before_m + np.linalg.norm(after - np.median(after, axis=0), axis=1).sum())

        row = min(rows, key=unexplained)
        before, after = self.places[:row], self.places[row:]
        home = np.median(after, axis=0)
        moved_m = float(np.linalg.norm(home - self.expected))
        if moved_m < 0.5 * DOUBTFUL_GAP_M:
            return None
        is_firm = max(_spread(before, self.expected), _spread(after, home)) <= _FIRM * moved_m
        return (float(self.seconds[row]), moved_m) if is_firm else None

    def clock_error(self) -> tuple[float, float]:
        """By how much the camera's clock is ahead of the others' [s], and which share of the gaps that explains.

        With a clock that is ahead, an image with stamp t was taken before t: the joint lies ahead by its velocity times
        the clock's error. A body that is a little wrong leaves a constant in the camera's frame, which is subtracted.
        """
        return proportion(*(each - each.mean(axis=0) for each in (self.velocities, self.places)))

    def gap_with_clock(self, error_s: float) -> float:
        """Root mean square of the offset if the camera's clock is ahead by so much [m]."""
        gaps = self.places - error_s * self.velocities - self.expected
        return float(np.sqrt((gaps**2).sum(axis=1).mean()))


def _spread(places: Array, centre: Array) -> float:
    """Median distance from a place [m]."""
    return float(np.median(np.linalg.norm(places - centre, axis=1)))


def _exchanged_places(found: Contradiction) -> dict[str, str]:
    """Camera that contradicts -> the camera whose mount on the body its poses fit.

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
    return fits


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
