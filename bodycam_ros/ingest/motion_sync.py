"""Clocks of cameras on one body from how they turned: where there is no sound, or more exactly than the sound.

Cameras of one segment turn alike, so their clocks agree to a fraction of a frame (``pair_lags``). A segment turns
somewhat as the one that it hangs on: that tells which second, and hundredths of it (``motion_correlation``).
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.ingest.angular_speed import AngularSpeed
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.motion_correlation import SEARCH_RATE, OffsetCurve, chance_curve, even_motion, offset_curve
from bodycam_ros.ingest.offset_agreement import AgreedOffset, Pair, adjust_clocks, agreed_offsets
from bodycam_ros.ingest.pair_lags import linked_lags, rigid_lags
from bodycam_ros.ingest.sound_settings import MotionSyncSettings

_LEAST_SHARE = 0.1  # of the shorter recording that two must have in common
_SEARCH_WINDOW_S = 0.1  # the search is right to some hundredths of a second
_LEAST_WINDOW_S = 0.02
_RIGID = 0.7  # share of the motion explained from which on two cameras of an unknown rig are one body
_ON_ONE_SEGMENT = 0.5  # and where the rig says so


@dataclass(frozen=True, eq=False)
class MotionTimes:
    """What the motion says of the clocks.

    Attributes:
        times: camera -> its clock; cameras that could not be aligned are not in it.
        confidence: camera -> 0 to 1: how far the offset's evidence leads the next best's and chance; 1 where a start
            was given.
        remarks: for the user, one sentence each: cameras that are not aligned and why, and those that are in doubt.
    """

    times: Mapping[str, CameraTime]
    confidence: Mapping[str, float]
    remarks: tuple[str, ...]


def motion_times(
    speeds: Mapping[str, AngularSpeed],
    rig: Rig | None = None,
    start: Mapping[str, CameraTime] | None = None,
    settings: MotionSyncSettings | None = None,
) -> MotionTimes:
    """Align the clocks of cameras by how they turned.

    Args:
        speeds: camera -> how it turned.
        rig: which camera is on which segment; without it every pair is asked, and which ones are rigid is found out.
        start: clocks that the sound gave; they are refined by the cameras of the same segment alone, within their
            sigma and ``frame_slack``. Without them the clocks are searched for.
        settings: limits and beliefs.
    """
    settings = settings or MotionSyncSettings()
    lively = {camera: speed for camera, speed in speeds.items() if _lively(speed)}
    remarks = [
        f"camera {camera}: its images do not tell how it turned (too dark, covered or without texture), so its clock "
        f"{'cannot be aligned by motion' if start is None else 'stays as the sound has it'}"
        for camera in speeds
        if camera not in lively
    ]
    if start is not None:
        known = {camera: clock for camera, clock in start.items() if camera in speeds}
        return MotionTimes(_refined(lively, rig, known, settings), dict.fromkeys(known, 1.0), tuple(remarks))
    if not lively:
        return MotionTimes({}, {}, tuple(remarks))
    reference = _reference(lively, rig)
    begin = _liveliest(lively, settings.searched)
    curves, chance = _curves(lively, rig, begin, settings)
    agreed = agreed_offsets(reference, curves, chance, apart=round(0.25 * SEARCH_RATE))
    for camera in lively:
        if rig is not None and camera not in rig.cameras:
            remarks.append(
                f"camera {camera}: the rig does not say which segment carries it, so its clock cannot be aligned by "
                "motion; add it to the cameras of the rig"
            )
        elif camera not in agreed:
            remarks.append(
                f"camera {camera}: no camera on its own or a neighbouring segment that is aligned with {reference} has "
                f"{settings.min_overlap:g} s of motion in common with it; its clock cannot be aligned by motion"
            )
        elif agreed[camera].confidence < settings.min_confidence:
            remarks.append(
                f"camera {camera}: its motion fits that of its neighbours at several offsets nearly alike (lead of "
                f"the best {agreed[camera].confidence:.0%}); its clock cannot be trusted: record a clap that it hears, "
                "or turn the whole body to and fro once"
            )
    sure = {c: a for c, a in agreed.items() if a.confidence >= settings.min_confidence}
    times = _searched(lively, rig, reference, sure, curves, begin + 0.5 * settings.searched, settings)
    return MotionTimes(times, {camera: sure[camera].confidence for camera in times}, tuple(remarks))


def _lively(speed: AngularSpeed) -> bool:
    return bool(speed.known.sum() >= 0.25 * len(speed.media_s)) and len(speed.media_s) > 20


def _reference(speeds: Mapping[str, AngularSpeed], rig: Rig | None) -> str:
    on_root = [camera for camera in speeds if rig is not None and rig.cameras.get(camera) == rig.root]
    return next(iter(on_root or speeds))


def _pairs(cameras: Mapping[str, AngularSpeed], rig: Rig | None, same_segment: bool) -> list[Pair]:
    """Pairs that are asked: of one segment, or without a rig all."""
    pairs = list(combinations(cameras, 2))
    if rig is None:
        return pairs
    on, parents = rig.cameras, rig.parents
    return [
        (first, second)
        for first, second in pairs
        if first in on
        and second in on
        and (
            on[first] == on[second]
            or (not same_segment and on[second] == parents[on[first]])
            or (not same_segment and on[first] == parents[on[second]])
        )
    ]


def _curves(
    speeds: Mapping[str, AngularSpeed], rig: Rig | None, begin: float, settings: MotionSyncSettings
) -> tuple[dict[Pair, OffsetCurve], dict[Pair, OffsetCurve]]:
    """Evidence for the offsets of all pairs, of the stretch that begins at a media time [s], and what chance gives."""
    end = begin + settings.searched
    inner = {camera: even_motion(speed, begin, end) for camera, speed in speeds.items()}
    outer = {
        camera: even_motion(speed, begin - settings.max_offset, end + settings.max_offset)
        for camera, speed in speeds.items()
    }
    curves, chance = {}, {}
    for pair in _pairs(speeds, rig, same_segment=False):
        first, second = outer[pair[0]], inner[pair[1]]
        if first is None or second is None:
            continue
        shorter = min(len(first.values), len(second.values)) / SEARCH_RATE
        overlap = max(settings.min_overlap, _LEAST_SHARE * shorter)
        curve = offset_curve(first, second, overlap, settings.max_offset)
        by_chance = chance_curve(first, second, overlap, settings.max_offset)
        if curve is not None and by_chance is not None:
            curves[pair], chance[pair] = curve, by_chance
    return curves, chance


def _liveliest(speeds: Mapping[str, AngularSpeed], length_s: float) -> float:
    """Media time at which the stretch begins in which all cameras together turn most [s]."""
    last = max(float(speed.media_s[-1]) for speed in speeds.values())
    turned = np.zeros(int(last) + 2)
    for speed in speeds.values():
        seconds = np.clip(speed.media_s[speed.known], 0.0, None).astype(int)
        # What turns wildly is one limb, or a camera that is being put on.
        np.add.at(turned, seconds, np.minimum(speed.speed[speed.known], 3.0))
    running = np.concatenate([[0.0], np.cumsum(turned)])
    length = min(int(np.ceil(length_s)), len(turned))
    return float(np.argmax(running[length:] - running[:-length]))


def _searched(
    speeds: Mapping[str, AngularSpeed],
    rig: Rig | None,
    reference: str,
    agreed: Mapping[str, AgreedOffset],
    pairs: Collection[Pair],
    searched_s: float,
    settings: MotionSyncSettings,
) -> dict[str, CameraTime]:
    """Clocks of what the search found, refined by rigid pairs, and by the pairs' own best lags between segments."""
    believed = {
        camera: CameraTime(camera, offset.samples / SEARCH_RATE, 0.0, np.inf, settings.drift_sigma, "motion")
        for camera, offset in agreed.items()
    }
    lags = []
    rigid_pairs = set(_pairs(speeds, rig, same_segment=True))
    for pair in pairs:
        if pair[0] not in agreed or pair[1] not in agreed:
            continue
        rigid = (
            rigid_lags(speeds, believed, pair, _SEARCH_WINDOW_S, searched_s, _least_explained(rig), settings)
            if pair in rigid_pairs
            else []
        )
        lags += rigid or linked_lags(speeds, believed, pair, searched_s, settings)
    return _with_floor(adjust_clocks(reference, believed, lags, "motion"), reference, settings.rigid_floor)


def _refined(
    speeds: Mapping[str, AngularSpeed],
    rig: Rig | None,
    start: Mapping[str, CameraTime],
    settings: MotionSyncSettings,
) -> dict[str, CameraTime]:
    """Given clocks, refined by rigid pairs."""
    if not start:
        return {}
    believed = {}
    for camera, clock in start.items():
        interval = float(np.median(np.diff(speeds[camera].media_s))) if camera in speeds else 0.0
        sigma = float(np.hypot(clock.start_sigma_s, settings.frame_slack * interval))
        believed[camera] = replace(clock, start_sigma_s=sigma)
    lags = []
    for pair in _pairs({camera: speeds[camera] for camera in start if camera in speeds}, rig, same_segment=True):
        sigma = np.hypot(believed[pair[0]].start_sigma_s, believed[pair[1]].start_sigma_s)
        window = max(3.0 * float(sigma), _LEAST_WINDOW_S)
        begin = max(believed[camera].start_s for camera in pair)
        lags += rigid_lags(speeds, believed, pair, window, begin, _least_explained(rig), settings)
    reference = min(start, key=lambda camera: start[camera].start_sigma_s)
    moved = {lag.first for lag in lags} | {lag.second for lag in lags}
    adjusted = _with_floor(adjust_clocks(reference, believed, lags, "motion"), reference, settings.rigid_floor)
    return {c: clock if c in moved else replace(clock, source=start[c].source) for c, clock in adjusted.items()}


def _least_explained(rig: Rig | None) -> float:
    return _RIGID if rig is None else _ON_ONE_SEGMENT


def _with_floor(clocks: Mapping[str, CameraTime], reference: str, floor_s: float) -> dict[str, CameraTime]:
    """Clocks with what no pair can tell added to their sigmas; the reference is exact by definition."""
    return {
        camera: clock
        if camera == reference
        else replace(clock, start_sigma_s=float(np.hypot(clock.start_sigma_s, floor_s)))
        for camera, clock in clocks.items()
    }
