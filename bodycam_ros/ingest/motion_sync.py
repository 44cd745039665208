"""Clocks of cameras on one body from how they turned, where there is no sound.

A segment turns as the other cameras on it do, and somewhat as the one that it hangs on, which gives the clock to
hundredths of a second; the calibration of the body and the solver estimate the rest, and the drift.
"""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.ingest.clock_fit import CameraTime
from bodycam_ros.ingest.offset_search import Pair, Signal, agreed_offsets, offset_curves
from bodycam_ros.tracking.angular_speed import AngularSpeed

_RATE_HZ = 60.0  # of the comparison; twice what most cameras take
_STRENGTH_S = 0.25  # over which the strength is evened out
_STILL = 0.1  # [rad/s] below it a motion is not amplified: it is the noise of the images
_WILD = 3.0  # [rad/s]
_MAX_OFFSET_S = 600.0  # cameras started by hand run within minutes of each other; more is more chance of a wrong match
_MIN_EVIDENCE = 8.0  # of a pair; limbs of two people reach 7 nine times in ten, those of one 14 and more
_MIN_CONFIDENCE = 0.25  # of both, another person's camera passes one time in thirty
_MIN_EVIDENCE_ON_RIG, _MIN_CONFIDENCE_ON_RIG = 5.0, 0.2  # a rig has cameras of one body: arms hardly follow a torso
_DRIFT_SIGMA = 7e-5  # of two cameras: each crystal is within 50 millionths
_LINKED_SIGMA_S = 0.03  # of an offset: a limb leads or trails its neighbour by hundredths of a second


def motion_times(
    speeds: Mapping[str, AngularSpeed], rig: Rig | None = None
) -> tuple[dict[str, CameraTime], dict[str, str]]:
    """Align the clocks of cameras by how they turned: camera -> its clock, and camera without one -> why.

    Args:
        speeds: camera -> how it turned.
        rig: which camera is on which segment; without it all pairs are compared.
    """
    lively = {camera: speed for camera, speed in speeds.items() if _is_lively(speed)}
    causes = {
        camera: "its images show too little of its rotation (too dark, covered or without texture)"
        for camera in speeds
        if camera not in lively
    }
    if not lively:
        return {}, causes
    on_root = [camera for camera in lively if rig is not None and rig.cameras.get(camera) == rig.root]
    reference = next(iter(on_root or lively))
    signals = {camera: _even_motion(speed) for camera, speed in lively.items()}
    curves = offset_curves(signals, _pairs(lively, rig), _RATE_HZ, _MAX_OFFSET_S)
    evidence, confidence = _MIN_EVIDENCE, _MIN_CONFIDENCE
    if rig is not None:
        evidence, confidence = _MIN_EVIDENCE_ON_RIG, _MIN_CONFIDENCE_ON_RIG
    agreed = agreed_offsets(reference, curves, _RATE_HZ, evidence)
    sure = {camera: offset for camera, offset in agreed.items() if offset.confidence >= confidence}
    for camera in lively:
        if rig is not None and camera not in rig.cameras:
            causes[camera] = (
                "it is not among the cameras of the rig, so its motion cannot be compared; add it to the rig"
            )
        elif camera not in sure:
            causes[camera] = (
                "its motion does not match the motion of the cameras next to it, or matches it at several times "
                "(turn the whole body left and right once)"
            )
    times = {
        camera: CameraTime(each.samples / _RATE_HZ, 0.0, _LINKED_SIGMA_S, _DRIFT_SIGMA, "motion", each.confidence)
        for camera, each in sure.items()
    }
    return times | {reference: CameraTime(source="motion")}, causes


def _is_lively(speed: AngularSpeed) -> bool:
    return bool(speed.known.sum() >= max(8, 0.25 * len(speed.media_s))) and len(speed.media_s) > 20


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


def _even_motion(speed: AngularSpeed) -> Signal:
    """A camera's motion, evenly sampled: three components and their norm, of the same strength at all times.

    Limbs swing with sizes that differ by magnitudes, but they start and stop together.
    """
    times, omega = speed.media_s[speed.known], speed.omega[speed.known]
    samples = np.arange(int(np.ceil(times[0] * _RATE_HZ)), int(np.floor(times[-1] * _RATE_HZ)) + 1)
    measured = np.column_stack([omega, np.linalg.norm(omega, axis=1)])
    values = CubicSpline(times, measured)(samples / _RATE_HZ)
    strength = np.maximum(gaussian_filter1d((values**2).sum(axis=1), _STRENGTH_S * _RATE_HZ), 0.0)
    even = values / np.sqrt(_STILL**2 + strength)[:, None]
    # What turns wildly is one limb, or a camera that is being put on.
    return Signal(int(samples[0]), even, np.clip(values[:, 3], 0.0, _WILD))
