"""The verdict on a result, afterwards or live, by registered and solved camera poses."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.quality.body_mismatch import body_finding
from bodycam_ros.quality.camera_poses import CameraPoseLog, CameraPoses
from bodycam_ros.quality.causes import Cause, clock_cause, find_causes, lens_cause
from bodycam_ros.quality.contradiction import DOUBTFUL_GAP_M, Contradiction, find_contradiction, lasting, pose_gap
from bodycam_ros.quality.neighbour_slip import attribute_slips
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.results.verdict import Finding, Level, Verdict

_WRONG_GAP_M = 0.12  # beyond it a limb points elsewhere; lenses and names that are wrong show 0.14 and more
_WRONG_SHARE = 0.05  # of the time that a camera contradicts; shorter spells do not make a result wrong as a whole
_MIN_REGISTERED = 0.05  # share of a camera's images; below it the camera counts as unregistered
_MIN_IMAGES = 5  # a camera with fewer is not called unregistered yet
_EARLY_END_S = 1.0  # a camera that is registered for the last time this long before the others ends early
_BLIND_S = 1.0  # a camera alone on its segment that is not registered for longer leaves it unobserved
_LIVE_SPAN_S = 30.0  # of the past in a live verdict: it ends this long after its cause
_LIVE_INTERVAL_S = 3.0  # between two live verdicts; one takes some hundredths of a second, in which nothing is solved


def judge(poses: CameraPoses, others: Iterable[Finding] = ()) -> Verdict:
    """The verdict on what was solved.

    Args:
        poses: registered and solved poses of body cameras.
        others: findings on equipment and static cameras.
    """
    unregistered = [camera for camera in poses.cameras if _is_unregistered(poses, camera)]
    alone = [c for c in poses.cameras if c not in unregistered and _shares_no_time(poses, c)]
    cameras = [camera for camera in poses.cameras if camera not in unregistered and camera not in alone]
    found = find_contradiction(poses, cameras)
    causes = find_causes(found)
    lost = [
        *(_unregistered_finding(poses, camera, is_everybody=not cameras and not alone) for camera in unregistered),
        *(_no_common_time_finding(poses, camera, cameras) for camera in alone),
    ]
    is_exchanged = any(cause.is_exchange for cause in causes.values())
    if not is_exchanged and (other_body := body_finding(found, cameras)) is not None:
        # Clocks, lenses and straps cannot be told from a body that does not fit.
        return Verdict.from_findings((*lost, other_body, *others))
    found, causes = attribute_slips(found, causes)
    accused = [_contradiction_finding(poses, found, camera, cause) for camera, cause in causes.items()]
    findings = [
        *lost,
        *accused,
        *_other_findings(found, cameras),
    ]
    if all(finding.level is not Level.WRONG for finding in accused):
        subjects = {finding.subject for finding in findings}
        findings += _solver_findings(poses, found, subjects)
    return Verdict.from_findings((*findings, *others))


def _solved_gap(poses: CameraPoses, camera: str) -> float:
    """Lasting gap from a camera's registered to its solved pose [m]."""
    return lasting(pose_gap(poses, camera), poses.seconds)


def _is_unregistered(poses: CameraPoses, camera: str) -> bool:
    count = poses.counts[camera]
    return not count.registered or (count.images >= _MIN_IMAGES and count.share < _MIN_REGISTERED)


def _unregistered_finding(poses: CameraPoses, camera: str, is_everybody: bool) -> Finding:
    count = poses.counts[camera]
    what = f"registered on {count.registered} of {count.images} images"
    if is_everybody:
        why, remedy = "this is the map of another place, or the place has changed", "build a map of this place"
        return Finding(camera, Level.WRONG, what, why, remedy, check="registered", cause="map")
    why = "it was covered, dark or blurred, or its images are mirrored or do not fit its calibration (camera_info)"
    remedy = "look at its images; its segment is solved from the other cameras"
    return Finding(camera, Level.DOUBTFUL, what, why, remedy, check="registered")


def _shares_no_time(poses: CameraPoses, camera: str) -> bool:
    """Whether no other camera recorded while this one did."""
    own = poses.counts[camera]
    others = [poses.counts[other] for other in poses.cameras if other != camera]
    return bool(others) and all(own.last_ns < other.first_ns or own.first_ns > other.last_ns for other in others)


def _no_common_time_finding(poses: CameraPoses, camera: str, others: Sequence[str]) -> Finding:
    starts = [poses.counts[other].first_ns for other in others]
    later_s = 1e-9 * (poses.counts[camera].first_ns - float(np.median(starts))) if starts else 0.0
    why = (
        f"its clock is wrong: its images begin {abs(later_s):.1f} s {'after' if later_s > 0.0 else 'before'} the others"
    )
    what = "shares no time with the other cameras"
    remedy = "set the clocks of all cameras to the same time"
    return Finding(camera, Level.WRONG, what, why, remedy, check="clock", cause="clock")


def _contradiction_finding(poses: CameraPoses, found: Contradiction, camera: str, cause: Cause) -> Finding:
    gap_m, over_time = found.gaps[camera], pose_gap(found.poses, found.shown_by.get(camera, camera))
    bad, known = over_time > DOUBTFUL_GAP_M, np.isfinite(over_time)
    share = float(bad[known].mean())
    what = f"contradicts the body by {1e3 * gap_m:.0f} mm"
    if share < 0.9:
        times = poses.seconds[bad]
        what += f" between {times[0]:.1f} and {times[-1]:.1f} s"
    is_wrong = gap_m > _WRONG_GAP_M and share > _WRONG_SHARE and not _is_outvoted(poses, found, camera)
    level = Level.WRONG if is_wrong else Level.DOUBTFUL
    return Finding(camera, level, what, cause.why, cause.remedy, check="contradiction", cause=cause.kind)


def _is_outvoted(poses: CameraPoses, found: Contradiction, camera: str) -> bool:
    """Whether the body was solved by the others: another camera is on its segment, and the body agrees with those.

    The weights of ``estimation/camera_gate.py`` are not in a bag, so they are inferred.
    """
    mounts = poses.body.mounts
    is_shared = any(mounts[other].segment == mounts[camera].segment for other in found.core)
    return is_shared and not any(_solved_gap(poses, other) > DOUBTFUL_GAP_M for other in found.core)


def _other_findings(found: Contradiction, cameras: Sequence[str]) -> Iterator[Finding]:
    """Cameras that end early, leave their segment unobserved, or agree with each other by a wrong lens or clock."""
    poses = found.poses
    core = found.core
    mounts = found.poses.body.mounts
    last_ns = max((poses.counts[camera].last_registered_ns for camera in cameras), default=0)
    from_ns = poses.start_ns + 1e9 * float(poses.seconds[0]) if len(poses.seconds) else np.inf
    for camera in cameras:
        count, segment = poses.counts[camera], mounts[camera].segment
        end_s, all_s, until_s = (
            1e-9 * (stamp_ns - poses.start_ns) for stamp_ns in (count.last_registered_ns, last_ns, count.blind_until_ns)
        )
        doubt = partial(Finding, camera, Level.DOUBTFUL)
        if camera in core and (cause := lens_cause(poses.lens_errors.get(camera))) is not None:
            yield doubt("its landmarks do not fit its lens", cause.why, cause.remedy, check="lens", cause=cause.kind)
        elif camera in core and (cause := clock_cause(poses, camera)) is not None:
            yield doubt(
                "its poses fit the body only at other times", cause.why, cause.remedy, check="clock", cause=cause.kind
            )
        if all_s - end_s > _EARLY_END_S:
            what = f"registered for the last time at {end_s:.1f} s of {all_s:.1f} s"
            remedy = "after that its segment is solved from the other cameras"
            yield doubt(what, "it stopped, or was covered", remedy, check="end")
        is_shared = any(other != camera and mounts[other].segment == segment for other in cameras)
        if not is_shared and count.blind_ns > 1e9 * _BLIND_S and count.blind_until_ns > from_ns:
            what = f"not registered from {until_s - 1e-9 * count.blind_ns:.1f} s to {until_s:.1f} s"
            why = "it was covered or dark, or saw what the map does not show"
            remedy = f"in that time the pose of {segment} is a guess, from its poses before and after"
            yield doubt(what, why, remedy, check="blind")


def _solver_findings(poses: CameraPoses, found: Contradiction, subjects: set[str]) -> Iterator[Finding]:
    """Cameras that agree with each other and not with what was solved, though no wrong camera explains it.

    A camera that has a finding already gets only one that is worse.
    """
    for camera in found.core:
        gap_m = _solved_gap(poses, camera)
        if gap_m > (_WRONG_GAP_M if camera in subjects else DOUBTFUL_GAP_M):
            level = Level.WRONG if gap_m > _WRONG_GAP_M else Level.DOUBTFUL
            what = f"the solved body is {1e3 * gap_m:.0f} mm from its registration"
            why, remedy = (
                "the joints of the body file are not those of this person",
                "check the joints of the body file",
            )
            yield Finding(camera, level, what, why, remedy, check="joints")


class LiveVerdict(CameraPoseLog):
    """The last seconds while a body is solved, with a verdict on them that is renewed at intervals.

    Args:
        body: that is solved.
        cameras: models by name.
        pose_fit: gate of landmarks that lenses are checked with.
    """

    def __init__(self, body: BodyModel, cameras: Mapping[str, CameraModel], pose_fit: PoseFitSettings) -> None:
        super().__init__(body, cameras, pose_fit.inlier_px, _LIVE_SPAN_S)

    def _reset(self) -> None:
        super()._reset()
        self._latest = Verdict.from_findings(())
        self._judged_ns: int | None = None

    def verdict(self) -> Verdict:
        """The latest; made anew after ``_LIVE_INTERVAL_S``, in time of the recording."""
        if self._rows:
            solved_ns = self._rows[-1][0]
            self._judged_ns = solved_ns if self._judged_ns is None else self._judged_ns  # the first needs some states
            if solved_ns - self._judged_ns >= 1e9 * _LIVE_INTERVAL_S:
                self._judged_ns, self._latest = solved_ns, judge(self.poses())
        return self._latest
