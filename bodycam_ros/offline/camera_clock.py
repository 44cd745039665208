"""What stamps say about the cameras of a recording: one is silent, absent for a part, or of another time.

Clocks that are off by less than the recording are learned from the motion, see ``bodycam_ros.timing``.
"""

from collections.abc import Collection

import numpy as np

_EARLY_S = 1.0  # [s] by which a camera may begin after, or end before, the others


class CameraClocks:
    """First and last stamps by camera.

    Args:
        cameras: that are expected to speak.
    """

    def __init__(self, cameras: Collection[str]) -> None:
        self._spans_ns: dict[str, tuple[int, int] | None] = dict.fromkeys(cameras)

    def add(self, camera: str, stamp_ns: int) -> None:
        """Note an image."""
        first, last = self._spans_ns[camera] or (stamp_ns, stamp_ns)
        self._spans_ns[camera] = min(first, stamp_ns), max(last, stamp_ns)

    def remarks(self) -> tuple[str, ...]:
        """A line for every camera that is silent, absent for a part, or not there when the others are."""
        lines = []
        for camera, span in self._spans_ns.items():
            if span is None:
                lines.append(f"camera {camera}: no image of it could be used")
                continue
            others = [other for name, other in self._spans_ns.items() if other is not None and name != camera]
            if others:
                lines += [f"camera {camera}: {remark}" for remark in _against(span, others)]
        return tuple(lines)


def _against(own: tuple[int, int], others: list[tuple[int, int]]) -> list[str]:
    """What sets a camera's first and last stamp apart from those of the others [ns]."""
    first, last = np.median(others, axis=0).tolist()
    if own[0] > last or own[1] < first:
        off_s = 1e-9 * (own[0] - first)
        return [f"its stamps are {abs(off_s):.1f} s {'ahead of' if off_s > 0 else 'behind'} the others'; set its clock"]
    remarks = []
    if (late_s := 1e-9 * (own[0] - first)) > _EARLY_S:
        remarks.append(f"begins {late_s:.1f} s after the others")
    if (early_s := 1e-9 * (last - own[1])) > _EARLY_S:
        remarks.append(f"ends {early_s:.1f} s before the others")
    return remarks
