"""What stamps say about the cameras of a recording: one ends early, or has not the time of the others."""

from array import array
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

_EARLY_S = 1.0  # [s] by which a camera may begin after, or end before, the others
_OFF_NS = 3_000_000  # a limb at 3 m/s is 1 cm further by then
_STEADY_NS = 1_000_000  # spread of the offset of a camera that the others' trigger reaches late
_LOOKED_AT = 500  # stamps of a camera, evenly over the recording


class CameraClocks:
    """Stamps by camera, as they come.

    Args:
        cameras: that are expected to speak.
    """

    def __init__(self, cameras: Collection[str]) -> None:
        self._stamps: dict[str, array[int]] = {camera: array("q") for camera in cameras}

    def add(self, camera: str, stamp_ns: int) -> None:
        """Note an image."""
        self._stamps[camera].append(stamp_ns)

    def remarks(self) -> tuple[str, ...]:
        """A line for every camera that is silent, absent for a part, or off the others' time."""
        stamps = {camera: np.sort(np.array(s, dtype=np.int64)) for camera, s in self._stamps.items() if len(s)}
        lines = []
        for camera in self._stamps:
            if camera not in stamps:
                lines.append(f"camera {camera}: no image of it could be used")
                continue
            others = [s for name, s in stamps.items() if name != camera]
            if others:
                lines += [f"camera {camera}: {remark}" for remark in _against(stamps[camera], others)]
        return tuple(lines)


def _against(own: NDArray[np.int64], others: list[NDArray[np.int64]]) -> list[str]:
    """What sets a camera's stamps (N) apart from those of the others, all ascending [ns]."""
    first = float(np.median([s[0] for s in others]))
    last = float(np.median([s[-1] for s in others]))
    if own[0] > last or own[-1] < first:
        off_s = 1e-9 * (own[0] - first)
        return [f"its stamps are {abs(off_s):.1f} s {'ahead of' if off_s > 0 else 'behind'} the others'; set its clock"]
    remarks = []
    if (late_s := 1e-9 * (own[0] - first)) > _EARLY_S:
        remarks.append(f"begins {late_s:.1f} s after the others")
    if (early_s := 1e-9 * (last - own[-1])) > _EARLY_S:
        remarks.append(f"ends {early_s:.1f} s before the others")
    offsets = [_offset(own, s) for s in others]
    middle = float(np.median([offset for offset, _ in offsets]))
    spread = float(np.median([spread for _, spread in offsets]))
    if spread > _STEADY_NS and max(abs(middle), spread) > _OFF_NS:
        remarks.append(f"is not triggered with the others: its images are {1e-6 * spread:.0f} ms apart from theirs")
    elif abs(middle) > _OFF_NS:
        remarks.append(f"its stamps are {1e-6 * abs(middle):.0f} ms {'after' if middle > 0 else 'before'} the others'")
    return remarks


def _offset(own: NDArray[np.int64], other: NDArray[np.int64]) -> tuple[float, float]:
    """Median, and median deviation from it, of the time from the nearest image of another camera to ours [ns]."""
    if len(own) > len(other):  # not every image of ours has one of the other's beside it
        middle, spread = _offset(other, own)
        return -middle, spread
    looked_at = own[:: max(1, len(own) // _LOOKED_AT)]
    inside = looked_at[(looked_at >= other[0]) & (looked_at <= other[-1])]
    looked_at = inside if len(inside) else looked_at
    after = np.clip(np.searchsorted(other, looked_at), 1, max(1, len(other) - 1))
    before, after_ns = other[after - 1], other[np.minimum(after, len(other) - 1)]
    nearest = np.where(looked_at - before <= after_ns - looked_at, before, after_ns)
    differences = (looked_at - nearest).astype(np.float64)
    middle = float(np.median(differences))
    return middle, float(np.median(np.abs(differences - middle)))
