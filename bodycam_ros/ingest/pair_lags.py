"""What two cameras say of each other's clocks: one segment's in stretches, two segments' by their curve's summit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.angular_speed import AngularSpeed
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clock_adjustment import PairLag
from bodycam_ros.ingest.motion_correlation import SEARCH_RATE, even_motion, offset_curve
from bodycam_ros.ingest.motion_sync_settings import MotionSyncSettings
from bodycam_ros.ingest.offset_agreement import Pair
from bodycam_ros.ingest.rigid_lag import rigid_lag

Array = NDArray[np.float64]

_SUMMIT_S = 0.25  # around the agreed offset in which a pair's own summit is looked for
_LINKED_FLOOR_S = 0.02  # a limb leads or trails its neighbour by hundredths of a second
_LAG_FLOOR_S = 0.0005
_MOST_CHUNKS = 24
_ENOUGH_TO_REFUSE = 3  # stretches in which a pair did not turn as one body
_MOST_STRETCHES = 8
_BESIDE_S = 5.0  # of lags beside those in question, which tell what chance gives


def rigid_lags(
    speeds: Mapping[str, AngularSpeed],
    believed: Mapping[str, CameraTime],
    pair: Pair,
    window_s: float,
    sure_at_s: float,
    least_explained: float,
    settings: MotionSyncSettings,
) -> list[PairLag]:
    """A pair compared in stretches all over what both recorded; nothing where it does not turn as one body.

    Args:
        speeds: camera -> how it turned.
        believed: camera -> its clock.
        pair: the cameras.
        window_s: how far the clocks may be apart [s].
        sure_at_s: time of the recording for which that is so; away from it drift adds to it [s].
        least_explained: share of the motion that a rigid pair must have in common.
        settings: lengths.
    """
    first, second = (speeds[camera] for camera in pair)
    first_s, second_s = (believed[c].recording_s(speeds[c].media_s) for c in pair)
    middles, length = _stretches(first_s, second_s, settings.chunk, _MOST_CHUNKS, settings)
    lags: list[PairLag] = []
    for tried, middle in enumerate(sorted(middles, key=lambda middle: abs(middle - sure_at_s))):
        if tried == _ENOUGH_TO_REFUSE and not lags:
            break
        window = window_s + _drifted(believed, pair, middle - sure_at_s)
        ours = np.abs(first_s - middle) <= 0.5 * length
        theirs = np.abs(second_s - middle) <= 0.5 * length + window
        found = rigid_lag(first.part(ours), first_s[ours], second.part(theirs), second_s[theirs], window)
        if found is None or found.explained < least_explained:
            continue
        sigma = float(np.hypot(found.sigma_s, _LAG_FLOOR_S))
        lags.append(_pair_lag(believed, pair, middle, found.lag_s, sigma))
    return lags


def linked_lags(
    speeds: Mapping[str, AngularSpeed],
    believed: Mapping[str, CameraTime],
    pair: Pair,
    sure_at_s: float,
    settings: MotionSyncSettings,
) -> list[PairLag]:
    """Two segments' cameras compared in long stretches, where their motions go together best.

    Args:
        speeds: camera -> how it turned.
        believed: camera -> its clock, without drift.
        pair: the cameras.
        sure_at_s: time of the recording for which the clocks are right [s]; away from it drift adds up.
        settings: lengths.
    """
    clocks = [believed[camera] for camera in pair]
    first_s, second_s = (clock.recording_s(speeds[clock.camera].media_s) for clock in clocks)
    middles, length = _stretches(first_s, second_s, settings.searched, _MOST_STRETCHES, settings)
    lags = []
    for middle in middles:
        reach_s = _SUMMIT_S + _drifted(believed, pair, middle - sure_at_s)
        around = (middle - 0.5 * length, middle + 0.5 * length)
        motions = [even_motion(speeds[c.camera], around[0] - c.start_s, around[1] - c.start_s) for c in clocks]
        if motions[0] is None or motions[1] is None:
            continue
        # Moved to one clock, so that lags are looked at and not starts.
        first, second = (
            replace(motion, first=motion.first + round(clock.start_s * SEARCH_RATE))
            for motion, clock in zip(motions, clocks, strict=True)
            if motion is not None
        )
        curve = offset_curve(first, second, settings.min_overlap, reach_s + _BESIDE_S)
        if curve is None:
            continue
        lag, sigma = curve.summit(0, round(reach_s * SEARCH_RATE))
        lags.append(_pair_lag(believed, pair, middle, lag / SEARCH_RATE, max(sigma / SEARCH_RATE, _LINKED_FLOOR_S)))
    return lags


def _stretches(
    first_s: Array, second_s: Array, length_s: float, most: int, settings: MotionSyncSettings
) -> tuple[list[float], float]:
    """Middles [s] of stretches of what two cameras both recorded, evenly spread, and their length [s]."""
    begin, end = max(first_s[0], second_s[0]), min(first_s[-1], second_s[-1])
    if end - begin < settings.min_overlap:
        return [], 0.0
    count = int(np.clip(round((end - begin) / length_s), 1, most))
    middles = begin + (np.arange(count) + 0.5) * (end - begin) / count
    return middles.tolist(), float(min(length_s, (end - begin) / count) if count > 1 else end - begin)


def _drifted(believed: Mapping[str, CameraTime], pair: Pair, seconds: float) -> float:
    """By how much two clocks may have drifted apart over a time [s]."""
    return 3.0 * float(np.hypot(believed[pair[0]].drift_sigma, believed[pair[1]].drift_sigma)) * abs(seconds)


def _pair_lag(
    believed: Mapping[str, CameraTime], pair: Pair, recording_s: float, lag_s: float, sigma_s: float
) -> PairLag:
    first_s, second_s = ((recording_s - believed[camera].start_s) / (1.0 + believed[camera].drift) for camera in pair)
    return PairLag(pair[0], pair[1], first_s, second_s, lag_s, sigma_s)
