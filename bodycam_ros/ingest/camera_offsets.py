"""Start and drift of each camera's clock: by sound, else by motion, or by the file's time of creation.

Sources after the sound are used in turn, for the cameras that those before do not place.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import takewhile
from threading import Event
from types import MappingProxyType

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_remarks import CameraRemark, Causes
from bodycam_ros.ingest.clock_fit import CameraTime, relative_to
from bodycam_ros.ingest.frame_stream import for_each_camera
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.ingest.motion_sync import motion_times
from bodycam_ros.ingest.sound_envelope import CameraSound, scan_sound
from bodycam_ros.ingest.sound_sync import sound_times
from bodycam_ros.progress import Progress
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.image_folder import ImageFolder
from bodycam_ros.recording.sound import SoundBlock, SoundSource
from bodycam_ros.tracking.angular_speed import AngularSpeed, angular_speed

_SIGMAS = 4.0  # from which on two sources contradict each other
_ROUGH_S = 0.05  # the calibration of the body finds the rest of a clock that is off by no more
_DOUBTFUL = 0.3  # confidence
_MOST_NAMED = 4

_WAYS = {"sound": "its sound", "motion": "its motion", "given": "the creation time of its file"}
"""Source of clocks -> what it goes by."""

_OLDEST = datetime(2005, 1, 1, tzinfo=UTC)  # an earlier clock was never set: cameras begin at 1904, 1970 or 2000
_CREATION_SIGMA_S = 1.0
_FILE_DRIFT_SIGMA = 5e-5


FoundTimes = tuple[Mapping[str, CameraTime], Causes]
"""Camera -> its clock, in the time of those known before or in one of its own; and camera without one -> why."""

TimeSource = Callable[[Mapping[str, CameraTime]], FoundTimes]
"""Finds clocks; those already known are given."""


@dataclass(frozen=True, eq=False)
class SoundClocks:
    """What the sounds alone give.

    Attributes:
        times: camera -> its clock.
        causes: camera that its sound does not place -> why.
        faults: camera whose sound breaks off -> where.
    """

    times: dict[str, CameraTime]
    causes: dict[str, str]
    faults: dict[str, str]


@dataclass(frozen=True, eq=False)
class Offsets:
    """The clocks of all cameras.

    Attributes:
        reference: camera whose media time is the recording's.
        times: camera -> its clock, in the order in which they were given.
        unplaced: camera without a clock, which is not in ``times`` -> why.
        remarks: for the user.
    """

    reference: str
    times: Mapping[str, CameraTime]
    unplaced: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[CameraRemark, ...] = ()


def find_offsets(cameras: Sequence[IngestCamera], rig: Rig | None, progress: Progress) -> Offsets:
    """Find the clocks of all cameras from their files; see ``camera_times``."""
    videos = [camera.video for camera in cameras]
    sounds = {video.camera: video.sound for video in videos}
    sources = {"motion": partial(_motion, cameras, rig, progress), "given": partial(creation_times, videos)}
    return camera_times(sounds, None if rig is None else rig.cameras, sources, progress, image_intervals(cameras))


def image_intervals(cameras: Sequence[IngestCamera]) -> dict[str, float]:
    """Camera -> time between two of its images [s], where its file has a rate."""
    rates_hz = {camera.name: camera.video.facts.rate_hz for camera in cameras}
    return {camera: 1.0 / rate_hz for camera, rate_hz in rates_hz.items() if rate_hz > 0.0}


def camera_times(
    sounds: Mapping[str, SoundSource],
    segments: Mapping[str, str] | None,
    sources: Mapping[str, TimeSource],
    progress: Progress,
    intervals_s: Mapping[str, float] = MappingProxyType({}),
) -> Offsets:
    """Find the clocks of all cameras.

    Args:
        sounds: camera -> its sound, opened once; no block at all is a camera without sound.
        segments: camera -> segment that it is strapped to, if that is known.
        sources: name -> source; used after the sound, in this order.
        progress: of scanning and comparing.
        intervals_s: camera -> time between two of its images [s], where it is known.

    Raises:
        RecordingError: no two cameras can be placed; the message gives the reason for each, and what to do.
    """
    if len(sounds) == 1:
        only = next(iter(sounds))
        return Offsets(only, {only: CameraTime()})
    by_sound = sound_clocks(sounds, segments, progress, intervals_s)
    times, causes, faults = by_sound.times, by_sound.causes, by_sound.faults
    remarks: list[CameraRemark] = []
    failed: dict[str, list[str]] = {name: [causes[name]] for name in causes}
    for name, fault in faults.items():
        if name in causes:
            failed[name].append(fault)
        else:
            remarks.append((name, fault))
    for by, source in sources.items():
        found, why_not = source(times)
        found = aligned(found, times)
        remarks += contradictions(by, found, times)
        for name, time in found.items():
            if name not in times and name in causes:
                times[name] = time
                remarks.append((name, _found_by(by, time, failed[name])))
        for name, why in why_not.items():
            if name not in times and name in causes:
                failed[name].append(why)
    placed = {name: times[name] for name in sounds if name in times}
    reasons = {name: _reason(failed[name], sources) for name in causes if name not in times}
    if len(placed) < 2:
        raise RecordingError(_unknown_clocks(reasons))
    unplaced = {name: f"{why}; {_GIVE_OFFSETS}" for name, why in reasons.items()}
    remarks += [
        (name, f"its start is doubtful: another one fits nearly as well (confidence {time.confidence:.2f})")
        for name, time in placed.items()
        if time.confidence < _DOUBTFUL and time.start_sigma_s <= _ROUGH_S
    ]
    reference = next((name for name, time in placed.items() if time.start_sigma_s == 0.0), next(iter(placed)))
    return Offsets(reference, relative_to(reference, placed), unplaced, tuple(remarks))


def sound_clocks(
    sounds: Mapping[str, SoundSource],
    segments: Mapping[str, str] | None,
    progress: Progress,
    intervals_s: Mapping[str, float] = MappingProxyType({}),
) -> SoundClocks:
    """Clocks by the sounds alone, and why the others have none; the arguments are those of ``camera_times``."""
    scanned, faults = _scan(sounds, progress)
    without = {name: fault for name, sound in scanned.items() if (fault := _silence(sound))}
    # A camera in the middle of the body: claps reach it with the mean delay.
    middle = next((n for n in scanned if segments and segments.get(n) == "pelvis" and n not in without), "")
    times = _of_images(sound_times(scanned, middle, progress), intervals_s)
    unlike = "its sound does not match the sound of the other cameras, or matches it at several times"
    causes = {name: without.get(name, unlike) for name in sounds if name not in times}
    return SoundClocks(times, causes, faults)


def _of_images(times: Mapping[str, CameraTime], intervals_s: Mapping[str, float]) -> dict[str, CameraTime]:
    """Clocks of sounds as those of the images beside them.

    A file begins with its first sound, and the first image is exposed within one interval after that; the container
    has both at time 0. Known is that the images are late by anything from no interval to a whole one.
    """
    late = {name: intervals_s.get(name, 0.0) / np.sqrt(12.0) for name in times}  # of a uniform distribution
    reference = next((late[name] for name, time in times.items() if time.start_sigma_s == 0.0), 0.0)
    return {
        name: time
        if time.start_sigma_s == 0.0
        else replace(time, start_sigma_s=float(np.linalg.norm([time.start_sigma_s, late[name], reference])))
        for name, time in times.items()
    }


def _scan(sounds: Mapping[str, SoundSource], progress: Progress) -> tuple[dict[str, CameraSound], dict[str, str]]:
    """Scan all sounds, as many at once as there are cores; of a sound that breaks off, what was read counts."""
    faults: dict[str, str] = {}

    def blocks(name: str, ended: Event) -> Iterator[SoundBlock]:
        try:
            yield from takewhile(lambda _: not ended.is_set(), sounds[name]())
        except RecordingError as error:
            faults[name] = error.cause

    scanned = for_each_camera(sounds, lambda name, ended: scan_sound(blocks(name, ended)), "scanning sound", progress)
    return scanned, {name: faults[name] for name in sounds if name in faults}


def _silence(sound: CameraSound) -> str:
    """Why a camera's sound is of no use; empty if it may be."""
    if sound.duration_s <= 0.0:
        return "it has no sound"
    return "its sound is silence" if sound.loudest <= 0.0 else ""


def aligned(found: Mapping[str, CameraTime], times: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """The clocks that another source has, in the time of those known; none where both have no camera in common.

    The shift between both is that of the most certain camera with which most cameras agree, as single clocks may be
    minutes off, also the clock of the camera whose time is the recording's.

    Args:
        found: camera -> its clock by the source, in any time.
        times: camera -> its clock by the sources before.
    """
    if not times:
        return dict(found)
    common = [name for name in found if name in times]
    if not common:
        return {}
    sigmas_s = np.array([np.hypot(times[name].start_sigma_s, found[name].start_sigma_s) for name in common])
    common = [common[row] for row in np.argsort(sigmas_s, kind="stable")]
    sigmas_s = np.sort(sigmas_s)
    shifts_s = np.array([times[name].start_s - found[name].start_s for name in common])
    agree = np.abs(shifts_s[:, None] - shifts_s) <= _SIGMAS * np.hypot(sigmas_s[:, None], sigmas_s)
    chosen = int(np.argmax(agree.sum(axis=1)))
    shifted = {}
    for name, time in found.items():
        sigma_s = time.start_sigma_s if name == common[chosen] else np.hypot(time.start_sigma_s, sigmas_s[chosen])
        shifted[name] = replace(time, start_s=time.start_s + float(shifts_s[chosen]), start_sigma_s=float(sigma_s))
    return shifted


def contradictions(by: str, found: Mapping[str, CameraTime], times: Mapping[str, CameraTime]) -> Iterator[CameraRemark]:
    """Name the cameras whose clock another source has otherwise.

    Args:
        by: name of the source, a key of ``_WAYS``.
        found: camera -> its clock by the source, as ``aligned`` returns it.
        times: camera -> its clock by the sources before.
    """
    for name in (name for name in found if name in times):
        gap_s = found[name].start_s - times[name].start_s
        sigma_s = float(np.hypot(found[name].start_sigma_s, times[name].start_sigma_s))
        if abs(gap_s) > _SIGMAS * sigma_s:
            used = _WAYS[times[name].source]
            side = "later" if gap_s > 0.0 else "earlier"
            yield (
                name,
                (
                    f"by {_WAYS[by]} it started {_span(abs(gap_s))} {side} than by {used}, {abs(gap_s) / sigma_s:.0f} "
                    f"sigmas; {used} is used"
                ),
            )


def _found_by(by: str, time: CameraTime, failed: Sequence[str]) -> str:
    within = f", to {time.start_sigma_s:.1g} s only: record a clap" if time.start_sigma_s > _ROUGH_S else ""
    return f"{'; '.join(failed)}; its start was found by {_WAYS[by]}{within}"


def _span(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"


_GIVE_OFFSETS = "record a clap, or give the starts of all cameras with --offsets (timing.yaml has those of the others)"


def _reason(failed: Sequence[str], tried: Collection[str]) -> str:
    """Why a camera has no clock: why its sound does not give it, and why other sources do not, or which were tried."""
    cause, *others = failed
    if others or not tried:
        return "; ".join(failed)
    return f"{cause}, and its start cannot be found by {' or by '.join(_WAYS[each] for each in tried)}"


def _unknown_clocks(reasons: Mapping[str, str]) -> str:
    named = "; ".join(f"{name}: {why}" for name, why in list(reasons.items())[:_MOST_NAMED])
    more = f"; and {len(reasons) - _MOST_NAMED} more" if len(reasons) > _MOST_NAMED else ""
    return (
        f"the times at which these cameras started are unknown. {named}{more}. Clap loudly once all cameras run and "
        "again before the first is stopped; or give the times with --offsets, or --synchronous for genlocked cameras"
    )


def creation_times(videos: Sequence[CameraVideo | ImageFolder], known: Mapping[str, CameraTime]) -> FoundTimes:
    """By the time of creation that the camera's own clock gave its file, if that was ever set."""
    created = {video.camera: plausible_time(video.facts.created) for video in videos}
    starts_s = {name: time.timestamp() for name, time in created.items() if time is not None}
    first = next(iter(starts_s), "")
    times = {
        name: CameraTime(start_s - starts_s[first], 0.0, _CREATION_SIGMA_S, _FILE_DRIFT_SIGMA, confidence=0.0)
        for name, start_s in starts_s.items()
    }
    if first and not known:
        times[first] = CameraTime(confidence=0.0)
    return times, {}


def plausible_time(created: datetime | None) -> datetime | None:
    """A time of creation, unless the camera's clock was never set or is ahead of ours."""
    if created is None or not _OLDEST < created < datetime.now(UTC) + timedelta(days=1):
        return None
    return created


def _motion(
    cameras: Sequence[IngestCamera], rig: Rig | None, progress: Progress, known: Mapping[str, CameraTime]
) -> FoundTimes:
    """Times by the cameras' rotations; only where one is not placed yet, as all images have to be decoded."""
    by_name = {camera.name: camera for camera in cameras}

    def speed(name: str, ended: Event) -> AngularSpeed | None:
        try:
            return angular_speed(by_name[name].lens, by_name[name].grey_images(ended))
        except RecordingError:
            return None  # a video that cannot be decoded is named when it is written

    if all(name in known for name in by_name):
        return {}, {}
    speeds = for_each_camera(by_name, speed, "measuring rotation", progress)
    return motion_times({name: each for name, each in speeds.items() if each is not None}, rig)
