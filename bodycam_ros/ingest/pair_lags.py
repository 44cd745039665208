"""What two cameras say of each other's clocks: one segment's in stretches, two segments' by their curve's summit."""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.ingest.angular_speed import AngularSpeed
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clock_adjustment import PairLag
from bodycam_ros.ingest.motion_correlation import SEARCH_RATE, OffsetCurve
from bodycam_ros.ingest.motion_sync_settings import MotionSyncSettings
from bodycam_ros.ingest.offset_agreement import Pair
from bodycam_ros.ingest.rigid_lag import rigid_lag

_SUMMIT_S = 0.25  # around the agreed offset in which a pair's own summit is looked for
_LINKED_FLOOR_S = 0.02  # a limb leads or trails its neighbour by hundredths of a second
_LAG_FLOOR_S = 0.0005
_MOST_CHUNKS = 24


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
    drift_sigma = float(np.hypot(believed[pair[0]].drift_sigma, believed[pair[1]].drift_sigma))
    first_s, second_s = (believed[c].recording_s(speeds[c].media_s) for c in pair)
    begin, end = max(first_s[0], second_s[0]), min(first_s[-1], second_s[-1])
    if end - begin < settings.min_overlap:
        return []
    count = int(np.clip(round((end - begin) / settings.chunk), 1, _MOST_CHUNKS))
    length = min(settings.chunk, (end - begin) / count) if count > 1 else end - begin
    lags = []
    for middle in begin + (np.arange(count) + 0.5) * (end - begin) / count:
        window = window_s + 3.0 * drift_sigma * abs(middle - sure_at_s)
        ours = np.abs(first_s - middle) <= 0.5 * length
        theirs = np.abs(second_s - middle) <= 0.5 * length + window
        found = rigid_lag(first.part(ours), first_s[ours], second.part(theirs), second_s[theirs], window)
        if found is None or found.explained < least_explained:
            continue
        sigma = float(np.hypot(found.sigma_s, _LAG_FLOOR_S))
        lags.append(_pair_lag(believed, pair, float(middle), found.lag_s, sigma))
    return lags


def summit_lag(
    speeds: Mapping[str, AngularSpeed], believed: Mapping[str, CameraTime], pair: Pair, curve: OffsetCurve
) -> PairLag:
    """What the curve of two segments says near the agreed offsets."""
    agreed = round((believed[pair[1]].start_s - believed[pair[0]].start_s) * SEARCH_RATE)
    offset, sigma = curve.summit(agreed, round(_SUMMIT_S * SEARCH_RATE))
    first_s, second_s = (speeds[camera].media_s for camera in pair)
    middle = 0.5 * (
        max(first_s[0] + believed[pair[0]].start_s, second_s[0] + believed[pair[1]].start_s)
        + min(first_s[-1] + believed[pair[0]].start_s, second_s[-1] + believed[pair[1]].start_s)
    )
    sigma_s = max(sigma / SEARCH_RATE, _LINKED_FLOOR_S)
    return _pair_lag(believed, pair, middle, (offset - agreed) / SEARCH_RATE, sigma_s)


def _pair_lag(
    believed: Mapping[str, CameraTime], pair: Pair, recording_s: float, lag_s: float, sigma_s: float
) -> PairLag:
    first_s, second_s = ((recording_s - believed[camera].start_s) / (1.0 + believed[camera].drift) for camera in pair)
    return PairLag(pair[0], pair[1], first_s, second_s, lag_s, sigma_s)
