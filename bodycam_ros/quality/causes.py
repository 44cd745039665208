"""Likely causes of a contradiction: each leaves its own trace.

A map of another scale than the body: all cameras contradict alike, and one scale explains it. Exchanged names: each
camera fits the mount of another. A clock that is some milliseconds off: the poses are right at another time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from bodycam_ros.geometry import Array, inverse
from bodycam_ros.quality.camera_poses import CameraPoses
from bodycam_ros.quality.contradiction import (
    DOUBTFUL_GAP_M,
    CameraLink,
    Contradiction,
    blame,
    camera_links,
    lasting_gaps,
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
_MIN_SCALE = 0.03  # a map that is larger or smaller by less is no cause
_SCALE_EXPLAINS = 0.9  # share of the cameras' distances
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


def find_causes(poses: CameraPoses, found: Contradiction) -> dict[str, Cause]:
    """The likely cause for each camera that contradicts."""
    if len(found.gaps) > len(found.core):
        scale = _map_scale(poses, [*found.core, *found.gaps])
        if scale is not None and abs(scale - 1.0) > _MIN_SCALE:
            why = f"the map is {scale:.3g} times as large as the body"
            return dict.fromkeys(found.gaps, Cause(why, "check the tag size of the board on the map's photographs"))
    places = _exchanged_places(poses, found)
    return {camera: _find_cause(poses, found, camera, places) for camera in found.gaps}


def _find_cause(poses: CameraPoses, found: Contradiction, camera: str, places: dict[str, str]) -> Cause:
    place = places.get(camera)
    if place and places.get(place) == camera:
        return Cause(f"its name is exchanged with {place}", "exchange the two names, in the topics or in the body file")
    if (lens := lens_cause(poses.lens_errors.get(camera))) is not None:
        return lens
    if place:
        return Cause(f"its pictures come from where {place} sits", "check which camera records under which name")
    if (clock := _clock_cause(poses, found.core, camera)) is not None:
        return clock
    views = _joint_views(poses, found.core, camera)
    slips = [slip for view in views if (slip := view.slip())]
    if len(slips) > len(views) / 2:
        seconds, moved_m = (float(value) for value in np.median(slips, axis=0))
        why = f"its strap slipped at {seconds:.1f} s, by {1e3 * moved_m:.0f} mm"
        return Cause(why, "use the recording up to then, or record again")
    far_m = max((float(np.linalg.norm(view.offset)) for view in views), default=np.inf)
    is_registered = poses.counts[camera].share > WELL_REGISTERED
    if is_registered and far_m < _MAX_STRAP_M and all(view.is_steady for view in views):
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


def clock_causes(poses: CameraPoses, cameras: Sequence[str]) -> dict[str, Cause]:
    """Cameras, among those that agree with each other, whose clock is off."""
    disagreements = {}
    for link in camera_links(poses.body, cameras):
        if link.is_exact:
            view = JointView(poses, link, link.pair[1])
            error_s, explained = view.clock_error() if len(view.places) >= _MIN_CLOCK_ROWS else (0.0, 0.0)
            disagreements[link.pair] = abs(error_s) if explained > _CLOCK_EXPLAINS else 0.0
    off, _ = blame(disagreements, _CLOCK_ERROR_S, lambda camera: poses.counts[camera].share)
    right = [camera for camera in cameras if camera not in off]
    found = {camera: _clock_cause(poses, right, camera) for camera in off}
    return {camera: cause for camera, cause in found.items() if cause is not None}


def _clock_cause(poses: CameraPoses, core: Sequence[str], camera: str) -> Cause | None:
    """A clock that is off from the core's; None if no clock explains the gaps."""
    views = [view for view in _joint_views(poses, core, camera) if len(view.places) >= _MIN_CLOCK_ROWS]
    errors = [view.clock_error() for view in views]
    if not errors or np.median([explained for _, explained in errors]) < _CLOCK_EXPLAINS:
        return None
    error_s = float(np.median([error_s for error_s, _ in errors]))
    better = all(view.gap_with_clock(error_s) < _LEFT_BY_CLOCK * view.gap_with_clock(0.0) for view in views)
    if abs(error_s) <= _CLOCK_ERROR_S or not better:
        return None
    side = "ahead" if error_s > 0.0 else "behind"
    return Cause(f"its clock is {1e3 * abs(error_s):.0f} ms {side}", "check how its images are stamped")


class JointView:
    """The end of an exact link in a camera's frame, at the T states at which the cameras on both sides are known.

    Args:
        poses: of all cameras.
        link: that is exact.
        camera: one of its two.

    Attributes:
        expected: (3,) by the body [m].
        places: (T, 3) by the other camera [m].
        velocities: (T, 3) of that point in the world, in the camera's axes [m/s].
        seconds: (T,) [s].
    """

    def __init__(self, poses: CameraPoses, link: CameraLink, camera: str) -> None:
        other = link.other(camera)
        camera_T_other = inverse(poses.registered[camera]) @ poses.registered[other]
        places = link.place(other, camera_T_other)
        # By the other camera: one whose poses are wrong would move with its own errors.
        twist = poses.twists[other]
        moving = np.cross(twist[:, :3], link.ends[other]) + twist[:, 3:]
        velocities = (camera_T_other[:, :3, :3] @ moving[:, :, None])[:, :, 0]
        known = np.isfinite(places).all(axis=1)
        self.expected: Array = link.ends[camera]
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
        """By how much the camera's clock is ahead of the other's [s], and which share of the gaps that explains.

        With a clock that is ahead, an image with stamp t was taken before t: the joint lies ahead by its velocity times
        the clock's error. A body that is a little wrong leaves a constant in the camera's frame, which is subtracted.
        """
        return _proportion(*(each - each.mean(axis=0) for each in (self.velocities, self.places)))

    def gap_with_clock(self, error_s: float) -> float:
        """Root mean square of the offset if the camera's clock is ahead by so much [m]."""
        gaps = self.places - error_s * self.velocities - self.expected
        return float(np.sqrt((gaps**2).sum(axis=1).mean()))


def _spread(places: Array, centre: Array) -> float:
    """Median distance from a place [m]."""
    return float(np.median(np.linalg.norm(places - centre, axis=1)))


def _joint_views(poses: CameraPoses, core: Sequence[str], camera: str) -> list[JointView]:
    """A camera's nearest joints, or its own segment, by the core."""
    links = camera_links(poses.body, core, of=camera)
    views = [JointView(poses, link, camera) for link in links if link.is_exact]
    return [view for view in views if len(view.places) >= _MIN_ROWS]


def _map_scale(poses: CameraPoses, cameras: Sequence[str]) -> float | None:
    """Scale of the map over the body; None if no scale explains the positions of the cameras.

    The vector from one camera to another over the joint between them has the length of the body; that of their
    registered positions has the map's.
    """
    vectors = [np.zeros((2, 0, 3))]
    for link in camera_links(poses.body, cameras):
        if link.is_exact:
            registered = [poses.registered[camera] for camera in link.pair]
            by_map = registered[1][:, :3, 3] - registered[0][:, :3, 3]
            vectors.append(np.stack([by_map + np.subtract(*map(link.place, link.pair, registered)), by_map]))
    by_body, by_map = np.concatenate(vectors, axis=1)
    known = np.isfinite(by_body).all(axis=1)
    scale, explained = _proportion(by_body[known], by_map[known])
    return scale if scale > 0.0 and explained > _SCALE_EXPLAINS else None


def _proportion(x: Array, y: Array) -> tuple[float, float]:
    """The factor of x (N, 3) that is closest to y (N, 3), and which share of y's squares it explains; 0 of nothing."""
    squared, total = float((x**2).sum()), float((y**2).sum())
    if squared == 0.0 or total == 0.0:
        return 0.0, 0.0
    factor = float((x * y).sum()) / squared
    return factor, 1.0 - float(((y - factor * x) ** 2).sum()) / total


def _exchanged_places(poses: CameraPoses, found: Contradiction) -> dict[str, str]:
    """Camera that contradicts -> the camera whose mount on the body its poses fit.

    Only mounts are tried whose own camera contradicts, too, or is missing: the others are taken. A mount whose camera
    is missing must be next to one that agrees: over more than one joint much fits by chance.
    """
    body, core, wanted = poses.body, list(found.core), sorted(found.gaps)
    free = [place for place in body.mounts if place not in core]
    fits: dict[str, str] = {}
    while core and wanted:
        # One whose neighbours have found their mounts can be tried next: the best fit of all first.
        moved = {**body.mounts, **{camera: body.mounts[place] for camera, place in fits.items()}}
        tried = {}
        for camera, place in product(wanted, free):
            if place == camera:
                continue
            links = camera_links(body, core, {**moved, camera: body.mounts[place]}, of=camera)
            gaps = lasting_gaps(poses, links)
            is_next = place in found.gaps or any(link.is_exact and link.pair in gaps for link in links)
            if gaps and is_next and max(gaps.values()) <= DOUBTFUL_GAP_M:
                tried[camera, place] = max(gaps.values())
        if not tried:
            break
        camera, place = min(tried, key=lambda pair: tried[pair])
        fits[camera] = place
        free.remove(place)
        wanted.remove(camera)
        core.append(camera)
    return fits
