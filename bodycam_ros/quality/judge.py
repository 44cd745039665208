"""The verdict on a result, afterwards or live, by registered and solved camera poses."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.quality.agreement import Agreement, AgreementLog
from bodycam_ros.quality.cause import Cause, causes, clock_cause, clock_errors, is_wrong, lens_cause
from bodycam_ros.quality.contradiction import LEVER_M, Contradiction, contradiction, gaps_over_time, lasting
from bodycam_ros.quality.thresholds import (
    BLIND_S,
    CLOCK_ERROR_S,
    DOUBTFUL_GAP_M,
    EARLY_END_S,
    LEAST_REGISTERED,
    LEAST_STAY_S,
    LIVE_INTERVAL_S,
    LIVE_SPAN_S,
    WRONG_GAP_M,
    WRONG_SHARE,
)
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.verdict import Finding, Level, Verdict

_LEAST_IMAGES = 5
"""A camera with fewer images is not called unregistered yet."""


def judge(agreement: Agreement, body: BodyModel) -> Verdict:
    """The verdict on what was solved.

    Args:
        agreement: where cameras were registered and solved.
        body: that was solved.
    """
    unregistered = [camera for camera in agreement.cameras if _is_unregistered(agreement, camera)]
    alone = [
        camera for camera in agreement.cameras if camera not in unregistered and _shares_no_time(agreement, camera)
    ]
    cameras = [camera for camera in agreement.cameras if camera not in unregistered and camera not in alone]
    found = contradiction(agreement, body, cameras)
    accused = [
        _contradiction_finding(agreement, body, found, camera, cause)
        for camera, cause in causes(agreement, body, found).items()
    ]
    findings = [
        *_unregistered_findings(agreement, unregistered, everybody=bool(unregistered) and not cameras and not alone),
        *(_no_common_time_finding(agreement, camera, cameras) for camera in alone),
        *accused,
        *_lens_and_clock_findings(agreement, body, found),
        *_early_end_findings(agreement, cameras),
        *_unobserved_findings(agreement, body, cameras),
    ]
    if all(finding.level is not Level.WRONG for finding in accused):
        subjects = {finding.subject for finding in findings}
        findings += _solver_findings(agreement, found, subjects)
    return Verdict.from_findings(findings)


def solved_gaps(agreement: Agreement, camera: str) -> Array:
    """(T,) from a camera's registered to its solved pose [m], a turn counted at the next joint; NaN if unknown."""
    solved_T_registered = inverse(agreement.solved(camera)) @ agreement.registered(camera)
    gaps: Array = np.linalg.norm(solved_T_registered[:, :3, 3], axis=1)
    known = np.isfinite(gaps)
    turns = np.linalg.norm(log_so3(solved_T_registered[known, :3, :3]), axis=1)
    gaps[known] = np.maximum(gaps[known], LEVER_M * turns)
    return gaps


def _is_unregistered(agreement: Agreement, camera: str) -> bool:
    count = agreement.counts[camera]
    return not count.registered or (count.images >= _LEAST_IMAGES and count.share < LEAST_REGISTERED)


def _unregistered_findings(agreement: Agreement, unregistered: Sequence[str], everybody: bool) -> Iterator[Finding]:
    for camera in unregistered:
        count = agreement.counts[camera]
        what = f"registered on {count.registered} of {count.images} images"
        if everybody:
            why, remedy = "this is the map of another place, or the place has changed", "build a map of this place"
            yield Finding(camera, Level.WRONG, what, why, remedy)
        else:
            why = "it was covered, dark or blurred, or its lens is not what camera_info says"
            yield Finding(
                camera, Level.DOUBTFUL, what, why, "look at its pictures; its segment follows from the others"
            )


def _shares_no_time(agreement: Agreement, camera: str) -> bool:
    """Whether no other camera recorded while this one did."""
    own = agreement.counts[camera]
    others = [agreement.counts[other] for other in agreement.cameras if other != camera]
    return bool(others) and all(own.last_ns < other.first_ns or own.first_ns > other.last_ns for other in others)


def _no_common_time_finding(agreement: Agreement, camera: str, others: Sequence[str]) -> Finding:
    starts = [agreement.counts[other].first_ns for other in others]
    later_s = 1e-9 * (agreement.counts[camera].first_ns - float(np.median(starts))) if starts else 0.0
    return Finding(
        camera,
        Level.WRONG,
        "shares no time with the other cameras",
        f"its clock is far off: it begins {abs(later_s):.1f} s {'after' if later_s > 0.0 else 'before'} them",
        "set the cameras' clocks to one time",
    )


def _contradiction_finding(
    agreement: Agreement, body: BodyModel, found: Contradiction, camera: str, cause: Cause
) -> Finding:
    # Over segments without a camera, links tell the least that it may be off by; the solved body tells more.
    solved_gap_m = lasting(solved_gaps(agreement, camera), agreement.seconds, LEAST_STAY_S)
    gap_m = float(np.fmax(found.gaps[camera], solved_gap_m))
    over_time = gaps_over_time(agreement, body, found.core, camera)
    bad = over_time > DOUBTFUL_GAP_M
    known = np.isfinite(over_time)
    share = float(bad[known].mean()) if known.any() else 1.0
    what = f"contradicts the body by {1e3 * gap_m:.0f} mm"
    if bad.any() and share < 0.9:
        times = agreement.seconds[bad]
        what += f" between {times[0]:.1f} and {times[-1]:.1f} s"
    if camera in found.rivals:
        what += f" (or {found.rivals[camera]} does)"
    level = Level.DOUBTFUL
    if gap_m > WRONG_GAP_M and share > WRONG_SHARE and not _is_left_out(agreement, body, found, camera):
        level = Level.WRONG
    return Finding(camera, level, what, cause.why, cause.remedy)


def _is_left_out(agreement: Agreement, body: BodyModel, found: Contradiction, camera: str) -> bool:
    """Whether the solver rejected it: another camera is on the segment, and the body agrees with all others."""
    segment = body.mounts[camera].segment
    held = any(body.mounts[other].segment == segment for other in found.core)
    return held and all(
        not lasting(solved_gaps(agreement, other), agreement.seconds, LEAST_STAY_S) > DOUBTFUL_GAP_M
        for other in found.core
    )


def _lens_and_clock_findings(agreement: Agreement, body: BodyModel, found: Contradiction) -> Iterator[Finding]:
    """Cameras that agree with each other, but whose lens or clock does not fit."""
    clocks = clock_errors(agreement, body, found.core, CLOCK_ERROR_S)
    for camera in found.core:
        lens = agreement.lens_errors.get(camera)
        if lens is not None and is_wrong(lens):
            cause = lens_cause(lens)
            yield Finding(camera, Level.DOUBTFUL, "its landmarks do not fit its lens", cause.why, cause.remedy)
        elif camera in clocks:
            cause = clock_cause(clocks[camera])
            yield Finding(camera, Level.DOUBTFUL, "its places come at other times", cause.why, cause.remedy)


def _solver_findings(agreement: Agreement, found: Contradiction, subjects: Collection[str]) -> Iterator[Finding]:
    """Cameras that agree with each other and not with what was solved, though none that is wrong explains it.

    Of those with a finding already only what is worse than that.
    """
    for camera in found.core:
        gap_m = lasting(solved_gaps(agreement, camera), agreement.seconds, LEAST_STAY_S)
        if gap_m > (WRONG_GAP_M if camera in subjects else DOUBTFUL_GAP_M):
            level = Level.WRONG if gap_m > WRONG_GAP_M else Level.DOUBTFUL
            what = f"the solved body is {1e3 * gap_m:.0f} mm from where it saw itself"
            yield Finding(camera, level, what, "the body does not bend as this one did", "check the body's joints")


def _unobserved_findings(agreement: Agreement, body: BodyModel, cameras: Sequence[str]) -> Iterator[Finding]:
    """Cameras that were not registered for long, without another one on their segment."""
    looked_from_ns = agreement.start_ns + 1e9 * float(agreement.seconds[0]) if len(agreement.seconds) else np.inf
    for camera in cameras:
        count = agreement.counts[camera]
        segment = body.mounts[camera].segment
        shared = any(other != camera and body.mounts[other].segment == segment for other in cameras)
        if not shared and count.blind_ns > 1e9 * BLIND_S and count.blind_until_ns > looked_from_ns:
            until_s = 1e-9 * (count.blind_until_ns - agreement.start_ns)
            blind_s = 1e-9 * count.blind_ns
            yield Finding(
                camera,
                Level.DOUBTFUL,
                f"not registered from {until_s - blind_s:.1f} s to {until_s:.1f} s",
                "it was covered or dark, or saw what the map does not show",
                f"{segment} is a guess in that time, by the poses that it was seen in",
            )


def _early_end_findings(agreement: Agreement, cameras: Sequence[str]) -> Iterator[Finding]:
    last_ns = max((agreement.counts[camera].last_registered_ns for camera in cameras), default=0)
    for camera in cameras:
        ended_ns = agreement.counts[camera].last_registered_ns
        if last_ns - ended_ns > 1e9 * EARLY_END_S:
            end_s, all_s = (1e-9 * (stamp_ns - agreement.start_ns) for stamp_ns in (ended_ns, last_ns))
            yield Finding(
                camera,
                Level.DOUBTFUL,
                f"registered for the last time at {end_s:.1f} s of {all_s:.1f} s",
                "it stopped, or was covered",
                "its segment follows from the others after that",
            )


class LiveVerdict:
    """A verdict that is computed at intervals while the body is solved.

    It judges the last seconds, so a verdict ends some time after its cause.

    Args:
        body: that is solved.
        cameras: models by name.
        pose_fit: gate of landmarks that lenses are checked with.
    """

    def __init__(self, body: BodyModel, cameras: Mapping[str, CameraModel], pose_fit: PoseFitSettings) -> None:
        self._body = body
        self._log = AgreementLog(body, cameras, pose_fit.inlier_px, LIVE_SPAN_S)
        self._latest = Verdict.from_findings(())
        self._judged_ns: int | None = None
        self._solved_ns = 0

    def add_registration(self, matches: LandmarkMatches) -> None:
        """Add the registration of one image."""
        self._log.add_registration(matches)

    def add_state(self, stamp_ns: int, world_T_segment: NDArray[np.float64]) -> None:
        """Add a solved instant: poses (S, 4, 4) of all segments of the body."""
        self._log.add_state(stamp_ns, world_T_segment)
        self._solved_ns = stamp_ns
        if self._judged_ns is None or stamp_ns < self._judged_ns:
            # The first verdict needs some states.
            self._judged_ns, self._latest = stamp_ns, Verdict.from_findings(())

    def verdict(self) -> Verdict:
        """The latest; made anew when ``LIVE_INTERVAL_S`` have passed since, in time of the recording."""
        if self._judged_ns is not None and self._solved_ns - self._judged_ns >= 1e9 * LIVE_INTERVAL_S:
            self._latest = judge(self._log.agreement(), self._body)
            self._judged_ns = self._solved_ns
        return self._latest
