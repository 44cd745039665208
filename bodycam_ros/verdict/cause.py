"""Why a camera contradicts the body: each likely cause leaves its own trace."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.verdict.agreement import Agreement
from bodycam_ros.verdict.clock import clock_error
from bodycam_ros.verdict.contradiction import Contradiction
from bodycam_ros.verdict.exchange import exchanged_places
from bodycam_ros.verdict.joint_view import joint_views
from bodycam_ros.verdict.lens_evidence import LensDeviation
from bodycam_ros.verdict.map_scale import map_scale
from bodycam_ros.verdict.verdict_settings import VerdictSettings

_WELL = 0.6
"""Share of its images that a camera with the right lens is registered on, unless it is covered."""

_SCALE = 0.03
"""A map that is larger or smaller by less than this share is no cause."""


@dataclass(frozen=True)
class Cause:
    """Why a camera contradicts the body: the likely reason, and what to do."""

    why: str
    remedy: str


def causes(agreement: Agreement, body: BodyModel, found: Contradiction, settings: VerdictSettings) -> dict[str, Cause]:
    """The likely cause for each camera that contradicts."""
    if len(found.gaps) > len(found.core):
        scale = map_scale(agreement, body, [*found.core, *found.gaps])
        if scale is not None and abs(scale - 1.0) > _SCALE:
            return dict.fromkeys(found.gaps, _scale_cause(scale))
    places = exchanged_places(agreement, body, found, settings)
    return {camera: _cause(agreement, body, found, camera, places, settings) for camera in found.gaps}


def _cause(
    agreement: Agreement,
    body: BodyModel,
    found: Contradiction,
    camera: str,
    places: Mapping[str, str],
    settings: VerdictSettings,
) -> Cause:
    place = places.get(camera)
    if place and places.get(place) == camera:
        return Cause(f"its name is exchanged with {place}", "exchange the two names, in the topics or in the body file")
    lens = agreement.lens_errors.get(camera)
    if lens is not None and is_wrong(lens, settings):
        return lens_cause(lens)
    if place:
        return Cause(f"its pictures come from where {place} sits", "check which camera records under which name")
    clock = clock_error(agreement, body, found.core, camera, settings.clock_error)
    if clock is not None:
        return clock_cause(clock)
    views = joint_views(agreement, body, found.core, camera)
    slips = [slip for view in views if (slip := view.slip(0.5 * settings.doubtful_gap))]
    if len(slips) > len(views) / 2:
        seconds, moved_m = (float(value) for value in np.median(slips, axis=0))
        return Cause(
            f"its strap slipped at {seconds:.1f} s, by {1e3 * moved_m:.0f} mm",
            "use the recording up to then, or record again",
        )
    well_registered = agreement.counts[camera].share > _WELL
    if well_registered and views and all(view.is_steady for view in views):
        far_m = max(float(np.linalg.norm(view.offset)) for view in views)
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


def is_wrong(lens: LensDeviation, settings: VerdictSettings) -> bool:
    """Whether a lens is too far from its model."""
    return lens.excess(settings.lens_scale, settings.lens_centre) > 1.0


def lens_cause(lens: LensDeviation) -> Cause:
    """A lens that is not what its model says."""
    return Cause(f"its lens is not what camera_info says: {lens.text}", "check its camera_info, or calibrate it anew")


def clock_cause(error_s: float) -> Cause:
    """A clock that is off."""
    way = "ahead" if error_s > 0.0 else "behind"
    return Cause(f"its clock is {1e3 * abs(error_s):.0f} ms {way}", "check how its images are stamped")
