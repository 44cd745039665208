"""Clocks of cameras on one body from how they turned, where there is no sound.

A segment turns as the other cameras on it do, and somewhat as the one that it hangs on, which gives the clock to
hundredths of a second; the calibration of the body and the solver estimate the rest, and the drift.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.ingest.clock_fit import CameraTime, FoundTimes
from bodycam_ros.ingest.motion_correlation import SEARCH_RATE, chance_curve, even_motion, offset_curve
from bodycam_ros.ingest.offset_search import OffsetCurve, Pair, agreed_offsets
from bodycam_ros.tracking.angular_speed import AngularSpeed

_MAX_OFFSET_S = 600.0  # cameras started by hand run within minutes of each other; more is more chance of a wrong match
_SEARCHED_S = 300.0  # the liveliest stretch of this length decides which second; drift is 30 ms within it at most
_LEAST_SHARE = 0.1  # of the shorter recording that two must have in common
_MIN_CONFIDENCE = 0.25  # limbs that have nothing to do with each other lead by less 19 times in 20, linked ones by 0.8
_APART_S = 0.25
_MIN_OVERLAP_S = 2.0  # shorter stretches of motion resemble each other by chance
_DRIFT_SIGMA = 7e-5  # of two cameras: each crystal is within 50 millionths
_LINKED_SIGMA_S = 0.03  # of an offset: a limb leads or trails its neighbour by hundredths of a second


def motion_times(speeds: Mapping[str, AngularSpeed], rig: Rig | None = None) -> FoundTimes:
    """Align the clocks of cameras by how they turned.

    Args:
        speeds: camera -> how it turned.
        rig: which camera is on which segment; without it all pairs are compared.
    """
    lively = {camera: speed for camera, speed in speeds.items() if _is_lively(speed)}
    remarks = [
        f"camera {camera}: its images show too little of its rotation (too dark, covered or without texture); its "
        "clock cannot be aligned by motion"
        for camera in speeds
        if camera not in lively
    ]
    if not lively:
        return FoundTimes("motion", {}, remarks)
    on_root = [camera for camera in lively if rig is not None and rig.cameras.get(camera) == rig.root]
    reference = next(iter(on_root or lively))
    begin_s = _liveliest(lively)
    curves, chance = _curves(lively, rig, begin_s)
    agreed = agreed_offsets(reference, curves, round(_APART_S * SEARCH_RATE), chance)
    sure = {camera: offset for camera, offset in agreed.items() if offset.confidence >= _MIN_CONFIDENCE}
    for camera in lively:
        if rig is not None and camera not in rig.cameras:
            remarks.append(
                f"camera {camera}: is not among the cameras of the rig, so its clock cannot be aligned by motion; add "
                "it to the rig"
            )
        elif camera not in agreed:
            remarks.append(
                f"camera {camera}: no camera on its own or a neighbouring segment that is aligned with {reference} has "
                f"{_MIN_OVERLAP_S:g} s of motion in common with it; its clock cannot be aligned by motion"
            )
        elif camera not in sure:
            remarks.append(
                f"camera {camera}: its motion fits that of its neighbours at several offsets nearly alike (lead of "
                f"the best {agreed[camera].confidence:.0%}), so its clock is unknown: record a clap near it, or "
                "turn the whole body to and fro once"
            )
    times = {
        camera: CameraTime(
            camera, each.samples / SEARCH_RATE, 0.0, _LINKED_SIGMA_S, _DRIFT_SIGMA, "motion", each.confidence
        )
        for camera, each in sure.items()
    }
    return FoundTimes(
        "motion",
        times | {reference: CameraTime(reference, source="motion", confidence=agreed[reference].confidence)},
        remarks,
    )


def _is_lively(speed: AngularSpeed) -> bool:
    return bool(speed.known.sum() >= 0.25 * len(speed.media_s)) and len(speed.media_s) > 20


def _pairs(cameras: Mapping[str, AngularSpeed], rig: Rig | None) -> list[Pair]:
    """Pairs to compare: of one segment and of neighbours; without a rig all."""
    pairs = list(combinations(cameras, 2))
    if rig is None:
        return pairs
    chosen = []
    for first, second in pairs:
        one, other = rig.cameras.get(first), rig.cameras.get(second)
        if one is not None and other is not None and (one in (other, rig.parents[other]) or other == rig.parents[one]):
            chosen.append((first, second))
    return chosen


def _curves(
    speeds: Mapping[str, AngularSpeed], rig: Rig | None, begin_s: float
) -> tuple[dict[Pair, OffsetCurve], dict[Pair, OffsetCurve]]:
    """Evidence for the offsets of all pairs, of the stretch that begins at a media time [s], and what chance gives."""
    end_s = begin_s + _SEARCHED_S
    inner = {camera: even_motion(speed, begin_s, end_s) for camera, speed in speeds.items()}
    outer = {
        camera: even_motion(speed, begin_s - _MAX_OFFSET_S, end_s + _MAX_OFFSET_S) for camera, speed in speeds.items()
    }
    curves, chance = {}, {}
    for pair in _pairs(speeds, rig):
        first, second = outer[pair[0]], inner[pair[1]]
        if first is None or second is None:
            continue
        shorter = min(len(first.values), len(second.values)) / SEARCH_RATE
        overlap = max(_MIN_OVERLAP_S, _LEAST_SHARE * shorter)
        curve = offset_curve(first, second, overlap, _MAX_OFFSET_S)
        by_chance = chance_curve(first, second, overlap, _MAX_OFFSET_S)
        if curve is not None and by_chance is not None:
            curves[pair], chance[pair] = curve, by_chance
    return curves, chance


def _liveliest(speeds: Mapping[str, AngularSpeed]) -> float:
    """Media time at which the stretch begins in which all cameras together turn most [s]."""
    last = max(float(speed.media_s[-1]) for speed in speeds.values())
    turned = np.zeros(int(last) + 2)
    for speed in speeds.values():
        seconds = np.clip(speed.media_s[speed.known], 0.0, None).astype(int)
        # What turns wildly is one limb, or a camera that is being put on.
        np.add.at(turned, seconds, np.minimum(speed.speed[speed.known], 3.0))
    running = np.concatenate([[0.0], np.cumsum(turned)])
    length = min(int(np.ceil(_SEARCHED_S)), len(turned))
    return float(np.argmax(running[length:] - running[:-length]))
