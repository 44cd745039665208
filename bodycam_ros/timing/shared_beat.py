"""Which cameras take their images together, and the instants at which the body is solved."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.timing.camera_path import nearest_rows

_TOGETHER_NS = 500_000
"""Stamps of one trigger differ by less."""

_TOGETHER_SHARE = 0.015
"""Of the time between two images; clocks that are started by hand meet so closely once in thirty."""


@dataclass(frozen=True)
class SharedBeat:
    """What the stamps of the first second or more say.

    Attributes:
        together: cameras that share their stamps: most of them, or nobody.
        period_ns: time between two images of a camera; the median of all [ns].
        reference: the camera whose clock is the body's.
    """

    together: frozenset[str]
    period_ns: int
    reference: str


def shared_beat(
    stamps_ns: Mapping[str, NDArray[np.int64]], preferred: tuple[str, ...] = (), alone: bool = False
) -> SharedBeat:
    """Find the cameras that go together.

    Args:
        stamps_ns: camera -> its stamps, ascending; at least one of one camera [ns].
        preferred: cameras that should be the reference, the first that goes with the others.
        alone: whether there is only one camera at all, whose stamps are the instants.
    """
    heard = {camera: stamps for camera, stamps in stamps_ns.items() if len(stamps) > 1}
    if not heard:
        return SharedBeat(frozenset(stamps_ns) if alone else frozenset(), 0, next(iter(stamps_ns)))
    # Cameras that are triggered mostly have the very same stamps, and are compared with the others once.
    alike: dict[bytes, list[str]] = {}
    for camera in sorted(heard):
        alike.setdefault(heard[camera].tobytes(), []).append(camera)
    groups = [
        frozenset(
            camera for others in alike.values() if go_together(heard[others[0]], heard[own[0]]) for camera in others
        )
        for own in alike.values()
    ]
    largest = max(groups, key=len)
    together = largest if alone or 2 * len(largest) > max(2, len(heard)) else frozenset[str]()
    candidates = [camera for camera in (*preferred, *sorted(heard)) if camera in (together or heard)]
    periods = [float(np.median(np.diff(stamps))) for stamps in heard.values()]
    return SharedBeat(together, round(float(np.median(periods))), candidates[0])


def go_together(own_ns: NDArray[np.int64], other_ns: NDArray[np.int64]) -> bool:
    """Whether most stamps (N) of a camera are those (M) of another, where both were heard [ns]."""
    period_ns = float(np.median(np.diff(own_ns))) if len(own_ns) > 1 else np.inf
    near_ns = min(_TOGETHER_NS, _TOGETHER_SHARE * period_ns)
    inside = own_ns[(own_ns >= other_ns[0] - _TOGETHER_NS) & (own_ns <= other_ns[-1] + _TOGETHER_NS)]
    if not len(inside):
        return False
    return bool(np.median(np.abs(other_ns[nearest_rows(other_ns, inside)] - inside)) < near_ns)
