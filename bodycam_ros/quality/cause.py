"""Why a camera contradicts the body: each likely cause leaves its own trace.

A map of another scale than the body: all cameras contradict alike, and one scale explains it. Names that were
exchanged: each camera fits the place of another. A clock that is some milliseconds off: the camera is right about
places and wrong about when.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.quality.agreement import Agreement
from bodycam_ros.quality.camera_evidence import joint_view, joint_views
from bodycam_ros.quality.contradiction import Contradiction, blame, camera_links, lasting_gaps
from bodycam_ros.quality.lens_evidence import LensDeviation
from bodycam_ros.quality.thresholds import CLOCK_ERROR_S, DOUBTFUL_GAP_M, LENS_CENTRE, LENS_SCALE

_LONGEST_SEGMENT_M = 0.6
"""No strap holds a camera farther from where it was."""

_WELL = 0.6
"""Share of its images that a camera with the right lens is registered on, unless it is covered."""

_SCALE = 0.03
"""A map that is larger or smaller by less than this share is no cause."""

_SCALE_EXPLAINS = 0.9
"""Share of the cameras' distances that one scale must explain."""

_CLOCK_EXPLAINS = 0.35
"""Share of the gaps that a clock must explain; on good recordings none of 5 ms explains more than 0.25."""

_LEAST_CLOCK_ROWS = 20
"""Fewest times that a clock is estimated by: of fewer, chance explains as much."""

_LEFT_BY_CLOCK = 0.85
"""Share of the gap that may be left once the clock is put right; a fast limb is no straight line."""


@dataclass(frozen=True)
class Cause:
    """Why a camera contradicts the body: the likely reason, and what to do."""

    why: str
    remedy: str


def causes(agreement: Agreement, body: BodyModel, found: Contradiction) -> dict[str, Cause]:
    """The likely cause for each camera that contradicts."""
    if len(found.gaps) > len(found.core):
        scale = map_scale(agreement, body, [*found.core, *found.gaps])
        if scale is not None and abs(scale - 1.0) > _SCALE:
            return dict.fromkeys(found.gaps, _scale_cause(scale))
    places = exchanged_places(agreement, body, found)
    return {camera: _cause(agreement, body, found, camera, places) for camera in found.gaps}


def _cause(
    agreement: Agreement,
    body: BodyModel,
    found: Contradiction,
    camera: str,
    places: Mapping[str, str],
) -> Cause:
    place = places.get(camera)
    if place and places.get(place) == camera:
        return Cause(f"its name is exchanged with {place}", "exchange the two names, in the topics or in the body file")
    lens = agreement.lens_errors.get(camera)
    if lens is not None and is_wrong(lens):
        return lens_cause(lens)
    if place:
        return Cause(f"its pictures come from where {place} sits", "check which camera records under which name")
    clock = clock_error(agreement, body, found.core, camera, CLOCK_ERROR_S)
    if clock is not None:
        return clock_cause(clock)
    views = joint_views(agreement, body, found.core, camera)
    slips = [slip for view in views if (slip := view.slip(0.5 * DOUBTFUL_GAP_M))]
    if len(slips) > len(views) / 2:
        seconds, moved_m = (float(value) for value in np.median(slips, axis=0))
        return Cause(
            f"its strap slipped at {seconds:.1f} s, by {1e3 * moved_m:.0f} mm",
            "use the recording up to then, or record again",
        )
    well_registered = agreement.counts[camera].share > _WELL
    far_m = max((float(np.linalg.norm(view.offset)) for view in views), default=np.inf)
    if well_registered and far_m < _LONGEST_SEGMENT_M and all(view.is_steady for view in views):
        return Cause(
            f"it sits {1e3 * far_m:.0f} mm from where the body has it, all the time: strapped anew, or the body of "
            "another day or person",
            "record a range of motion with the cameras as they are now",
        )
    return Cause(
        "its lens is not what camera_info says, or its pictures show something else than the map",
        "check its camera_info, and what it saw with 'bodycam view'",
    )


def _scale_cause(scale: float) -> Cause:
    remedy = "check the tag size of the board on the map's photographs"
    return Cause(f"the map is {scale:.3g} times as large as the body says", remedy)


def is_wrong(lens: LensDeviation) -> bool:
    """Whether a lens is too far from its model."""
    return lens.excess(LENS_SCALE, LENS_CENTRE) > 1.0


def lens_cause(lens: LensDeviation) -> Cause:
    """A lens that is not what its model says."""
    return Cause(f"its lens is not what camera_info says: {lens.text}", "check its camera_info, or calibrate it anew")


def clock_cause(error_s: float) -> Cause:
    """A clock that is off."""
    way = "ahead" if error_s > 0.0 else "behind"
    return Cause(f"its clock is {1e3 * abs(error_s):.0f} ms {way}", "check how its images are stamped")


def map_scale(agreement: Agreement, body: BodyModel, cameras: Sequence[str]) -> float | None:
    """How many times as large as the body the map is; None if no scale explains where the cameras are.

    From one camera to another over the joint between them is as far as the body says: in the map's units that is the
    distance of their registered positions.
    """
    by_body, by_map = [], []
    for link in camera_links(body, body.mounts, cameras):
        first, second = agreement.registered(link.first), agreement.registered(link.second)
        if link.is_exact:
            first_arm = link.place(link.first, first) - first[:, :3, 3]
            second_arm = link.place(link.second, second) - second[:, :3, 3]
            by_body.append(first_arm - second_arm)
            by_map.append(second[:, :3, 3] - first[:, :3, 3])
    if not by_body:
        return None
    arms, distances = np.concatenate(by_body), np.concatenate(by_map)
    known = np.isfinite(arms).all(axis=1) & np.isfinite(distances).all(axis=1)
    arms, distances = arms[known], distances[known]
    lengths, total = float((arms**2).sum()), float((distances**2).sum())
    if lengths == 0.0 or total == 0.0:
        return None
    scale = float((arms * distances).sum()) / lengths
    rest = float(((distances - scale * arms) ** 2).sum())
    return scale if scale > 0.0 and rest < (1.0 - _SCALE_EXPLAINS) * total else None


def exchanged_places(agreement: Agreement, body: BodyModel, found: Contradiction) -> dict[str, str]:
    """Camera that contradicts -> the camera whose place on the body its poses fit.

    Only places are tried whose own camera contradicts, too, or is not there: the others are taken. A place whose camera
    is not there must be next to one that agrees: over more than one joint much fits by chance.
    """
    core, wanted = list(found.core), sorted(found.gaps)
    free = [place for place in body.mounts if place not in core]
    fits: dict[str, str] = {}
    while core and wanted:
        # One whose neighbours have found their places can be tried next: the best fit of all first.
        moved = {**body.mounts, **{camera: body.mounts[place] for camera, place in fits.items()}}
        tried = {}
        for camera, place in product(wanted, free):
            if place != camera:
                mounts = {**moved, camera: body.mounts[place]}
                gap_m = _gap_in_place(agreement, body, mounts, core, camera, place not in found.gaps)
                if gap_m is not None:
                    tried[camera, place] = gap_m
        if not tried:
            break
        camera, place = min(tried, key=lambda pair: tried[pair])
        fits[camera] = place
        free.remove(place)
        wanted.remove(camera)
        core.append(camera)
    return fits


def _gap_in_place(
    agreement: Agreement,
    body: BodyModel,
    mounts: Mapping[str, CameraMount],
    core: Sequence[str],
    camera: str,
    must_be_next: bool,
) -> float | None:
    """By how much a camera contradicts the core if all sit at these mounts [m]; None if it cannot."""
    links = [link for link in camera_links(body, mounts, [*core, camera]) if camera in (link.first, link.second)]
    gaps = lasting_gaps(agreement, links)
    exact = any(link.is_exact and (link.first, link.second) in gaps for link in links)
    if not gaps or (must_be_next and not exact) or max(gaps.values()) > DOUBTFUL_GAP_M:
        return None
    return max(gaps.values())


def clock_errors(agreement: Agreement, body: BodyModel, cameras: Sequence[str], limit_s: float) -> dict[str, float]:
    """Camera -> by how much its clock is ahead of the others' [s], of those that are off by more than a limit."""
    disagreements = {}
    for link in camera_links(body, body.mounts, cameras):
        if link.is_exact:
            view = joint_view(agreement, link, link.second)
            error_s, explained = view.clock_error() if len(view.places) >= _LEAST_CLOCK_ROWS else (0.0, 0.0)
            disagreements[link.first, link.second] = abs(error_s) if explained > _CLOCK_EXPLAINS else 0.0
    off, _ = blame(disagreements, limit_s, lambda camera: agreement.counts[camera].share)
    right = [camera for camera in cameras if camera not in off]
    errors = {camera: clock_error(agreement, body, right, camera, limit_s) for camera in off}
    return {camera: error_s for camera, error_s in errors.items() if error_s is not None}


def clock_error(
    agreement: Agreement, body: BodyModel, core: Sequence[str], camera: str, limit_s: float
) -> float | None:
    """By how much a camera's clock is ahead of the core's [s], beyond a limit; None if no clock explains its gaps."""
    views = [view for view in joint_views(agreement, body, core, camera) if len(view.places) >= _LEAST_CLOCK_ROWS]
    errors = [view.clock_error() for view in views]
    if not errors or np.median([explained for _, explained in errors]) < _CLOCK_EXPLAINS:
        return None
    error_s = float(np.median([error_s for error_s, _ in errors]))
    better = all(view.gap_with_clock(error_s) < _LEFT_BY_CLOCK * view.gap_with_clock(0.0) for view in views)
    return error_s if abs(error_s) > limit_s and better else None
