"""Cameras whose poses fit the place of another on the body: names that were exchanged."""

from collections.abc import Mapping, Sequence
from itertools import product

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.verdict.agreement import Agreement
from bodycam_ros.verdict.camera_link import camera_links
from bodycam_ros.verdict.contradiction import Contradiction, lasting_gaps
from bodycam_ros.verdict.verdict_settings import VerdictSettings


def exchanged_places(
    agreement: Agreement, body: BodyModel, found: Contradiction, settings: VerdictSettings
) -> dict[str, str]:
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
                gap_m = _gap(agreement, body, mounts, core, camera, place not in found.gaps, settings)
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


def _gap(
    agreement: Agreement,
    body: BodyModel,
    mounts: Mapping[str, CameraMount],
    core: Sequence[str],
    camera: str,
    must_be_next: bool,
    settings: VerdictSettings,
) -> float | None:
    """By how much a camera contradicts the core if all sit at these mounts [m]; None if it cannot."""
    links = [link for link in camera_links(body, mounts, [*core, camera]) if camera in (link.first, link.second)]
    gaps = lasting_gaps(agreement, links, settings)
    exact = any(link.is_exact and (link.first, link.second) in gaps for link in links)
    if not gaps or (must_be_next and not exact) or max(gaps.values()) > settings.doubtful_gap:
        return None
    return max(gaps.values())
