"""Two opinions about one camera's clock: do they agree, and what do they say together."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bodycam_ros.ingest.camera_time import CameraTime

_SIGMAS = 4.0


def gap_s(one: CameraTime, other: CameraTime, at_media_s: float) -> tuple[float, float]:
    """(by how much the other says later, its standard deviation) at a media time, all in seconds."""
    gap = other.start_s - one.start_s + (other.drift - one.drift) * at_media_s
    variances = [t.start_sigma_s**2 + (t.drift_sigma * at_media_s) ** 2 for t in (one, other)]
    return gap, float(np.sqrt(sum(variances)))


def agree(one: CameraTime, other: CameraTime, at_media_s: float) -> bool:
    """Whether two clocks of one camera may both be true."""
    gap, sigma = gap_s(one, other, at_media_s)
    return abs(gap) <= _SIGMAS * sigma


def combined(one: CameraTime, other: CameraTime) -> CameraTime:
    """What both say together, each by its information; the source is that of the surer start."""
    start_s, start_sigma_s = _mean(one.start_s, one.start_sigma_s, other.start_s, other.start_sigma_s)
    drift, drift_sigma = _mean(one.drift, one.drift_sigma, other.drift, other.drift_sigma)
    surer = min(one, other, key=lambda time: time.start_sigma_s)
    return CameraTime(one.camera, start_s, drift, start_sigma_s, drift_sigma, surer.source)


def in_time_of(times: Mapping[str, CameraTime], known: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """Clocks of a source with a time of its own, shifted and stretched to the time of those already known.

    Without a camera in common they stay as they are. ``recording = shift + (1 + rate) * own`` is taken from the
    reference, of which nothing is uncertain, or else from the middle of the cameras in common.
    """
    common = [name for name in times if name in known]
    if not common:
        return dict(times)
    common = [name for name in common if known[name].start_sigma_s == 0.0] or common
    rate = float(np.median([known[name].drift - times[name].drift for name in common]))
    moved = {
        name: replace(time, start_s=(1.0 + rate) * time.start_s, drift=time.drift + rate)
        for name, time in times.items()
    }
    shift = float(np.median([known[name].start_s - moved[name].start_s for name in common]))
    return {name: replace(time, start_s=time.start_s + shift) for name, time in moved.items()}


def relative_to(reference: str, times: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """The same clocks in the time of another camera, which gets start 0, drift 0 and no uncertainty.

    That of the others grows by the reference's own; what both have in common is counted twice.
    """
    zero = times[reference]
    if zero.start_s == zero.drift == zero.start_sigma_s == zero.drift_sigma == 0.0:
        return dict(times)
    moved = {
        name: CameraTime(
            name,
            (time.start_s - zero.start_s) / (1.0 + zero.drift),
            (1.0 + time.drift) / (1.0 + zero.drift) - 1.0,
            float(np.hypot(time.start_sigma_s, zero.start_sigma_s)),
            float(np.hypot(time.drift_sigma, zero.drift_sigma)),
            time.source,
        )
        for name, time in times.items()
    }
    return moved | {reference: CameraTime(reference, 0.0, 0.0, 0.0, 0.0, zero.source)}


def _mean(one: float, one_sigma: float, other: float, other_sigma: float) -> tuple[float, float]:
    if min(one_sigma, other_sigma) <= 0.0:
        return (one, one_sigma) if one_sigma <= other_sigma else (other, other_sigma)
    weights = one_sigma**-2.0, other_sigma**-2.0
    return (weights[0] * one + weights[1] * other) / sum(weights), sum(weights) ** -0.5
